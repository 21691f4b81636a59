"""Section 4, start: the columns of rotational joints (21) and the equations (22)–(43)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.isotropy_equations import independent_rows, residuals, sampled
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown, shown_error
from formulations.reproduction.solution_family import symmetry_directions
from formulations.reproduction.verdicts import equal, holds, misprint
from nlp.arrays import FloatArray

_ROUNDING = 1e-12


def rows(seed: int = 0) -> Iterator[Row]:
    """Rows of eqs. (21), (22) and of the counts of independent equations."""
    rng = np.random.default_rng(seed)
    arm = Arm.of(UnitRevolute(), 7)
    point = arm.sample(rng)
    yield _column_row(arm, rng)
    yield _missing_zero_row(rng)
    yield _row_names_row(arm.jacobian(point))
    yield _row_norm_row()
    yield from _count_rows(arm)
    yield _dependent_angles_row(arm, point)


def _column_row(arm: Arm, rng: np.random.Generator) -> Row:
    columns = np.hstack([arm.jacobian(arm.sample(rng)) for _ in range(20)])
    velocity, axis = columns[:3], columns[3:]
    errors = [
        np.abs(np.sum(velocity**2, axis=0) - 1),
        np.abs(np.sum(axis**2, axis=0) - 1),
        np.abs(np.sum(velocity * axis, axis=0)),
    ]
    error = float(np.max(errors))
    return Row(
        "(21)",
        "v·ω = 0 and |v| = |ω|",
        "by construction, both of norm 1",
        shown_error(error, _ROUNDING),
        holds(error <= _ROUNDING),
        "140 random columns; '−1/ω' in the scan is the dashed line of the partition",
    )


def second_vector_errors(rng: np.random.Generator) -> FloatArray:
    """Error |e·ω| + |e·e₁| of (sinα, −cosα) with a 0 put first, second, third; shape (3,).

    The vector e that eq. (21) multiplies by sinγ must be orthogonal to ω and to the vector
    e₁ that it multiplies by cosγ.
    """
    alpha, beta = rng.uniform(-np.pi, np.pi, (2, 50))
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    first = np.array([cos_a * sin_b, sin_a * sin_b, -cos_b])
    axis = np.array([cos_a * cos_b, sin_a * cos_b, sin_b])
    errors = []
    for place in range(3):
        second = np.insert(np.array([sin_a, -cos_a]), place, 0.0, axis=0)
        products = [np.sum(second * other, axis=0) for other in (first, axis)]
        errors.append(float(np.max(np.sum(np.abs(products), axis=0))))
    return np.array(errors)


def _missing_zero_row(rng: np.random.Generator) -> Row:
    *elsewhere, last = second_vector_errors(rng)
    return Row(
        "(21)",
        "second vector of v, multiplied by sinγ",
        "(sinα, −cosα), two entries",
        "(sinα, −cosα, 0)",
        misprint(min(elsewhere), last, _ROUNDING),
        "two entries cannot be added to three; only with the 0 last is v·ω = 0 and |v| = 1 "
        "(lost in the scan, if not in print)",
    )


def _row_names_row(jacobian: FloatArray) -> Row:
    as_printed = jacobian[[0, 1, 2, 3, 4, 4]]
    n = jacobian.shape[1]
    # By eq. (21) all |ω_i| = 1: the squares of the last three rows add up to n.
    wrong, right = (abs(float(np.sum(j[3:] ** 2)) - n) for j in (as_printed, jacobian))
    rank = int(np.sum(measures.singular_values(as_printed) > 1e-9))
    return Row(
        "(22)",
        "last row of J",
        "ω_yᵀ, as the row above it",
        "ω_zᵀ",
        misprint(wrong, right, _ROUNDING),
        f"with ω_yᵀ twice Σ|ω_i|² = n fails, and J of rank {rank} is never isotropic",
    )


def _row_norm_row() -> Row:
    arms = [Arm.of(UnitRevolute(), n) for n in (7, 8, 12)]
    norms = [np.sqrt((arm.fixed_trace or np.nan) / 6) for arm in arms]
    expected = [np.sqrt(arm.shape[1] / 3) for arm in arms]
    verdict = equal(expected, norms, _ROUNDING)
    paper, note = f"√(n/3) = {shown(expected)}", "from tr JJᵀ = 2n shared by six rows"
    quantity = "row norm of an isotropic J, n = 7, 8, 12"
    return Row("(23)–(28)", quantity, paper, shown(norms), verdict, note)


def _count_rows(arm: Arm) -> Iterator[Row]:
    variables = arm.symbols()
    values = sampled(arm, variables, residuals(arm, variables))
    norms, products = (_function_rank(part) for part in (values[:, :6], values[:, 6:]))
    expected = reference.INDEPENDENT_NORM_EQUATIONS
    note = "rank of the equations as functions of the angles"
    quantity, verdict = "independent of the 6 norm equations", holds(norms == expected)
    yield Row("(23)–(28)", quantity, str(expected), str(norms), verdict, note)
    expected = reference.INDEPENDENT_ORTHOGONALITY_EQUATIONS
    quantity, verdict = "independent of the 15 others", holds(products == expected)
    note = "f_9 + f_14 + f_18 = Σ v·ω = 0 always"
    yield Row("(29)–(43)", quantity, str(expected), str(products), verdict, note)
    expected += reference.INDEPENDENT_NORM_EQUATIONS
    together = len(independent_rows(arm))
    verdict = holds(together == expected == _function_rank(values))
    quantity = "independent equations in all"
    note = "4 + 14; modulo the frame and phase 17 angles are left to meet them"
    yield Row("(23)–(43)", quantity, str(expected), str(together), verdict, note)


def _function_rank(values: FloatArray) -> int:
    """Rank of functions sampled at more points than there are functions, constants aside."""
    scale = np.linalg.norm(values, axis=0)
    columns = np.column_stack([np.ones(values.shape[0]), values / scale])
    return int(np.linalg.matrix_rank(columns, tol=1e-9)) - 1


def _dependent_angles_row(arm: Arm, point: FloatArray) -> Row:
    directions = symmetry_directions(arm, point)
    gauge = int(np.linalg.matrix_rank(directions, tol=1e-9))
    step = 1e-5  # to first order the singular values must not move, so by less than step²
    before = measures.singular_values(arm.jacobian(point))
    moved = [
        measures.singular_values(arm.jacobian(point + step * direction)) - before
        for direction in directions
    ]
    still = float(np.max(np.abs(moved))) <= 1e3 * step**2
    return Row(
        "after (43)",
        "directions of the 21 angles that change no singular value",
        "angles not independent",
        f"{gauge}, so 21 − {gauge} = {21 - gauge} angles matter",
        holds(gauge > 0 and still),
        "rotations of the frame and the common phase",
    )
