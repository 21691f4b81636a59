"""Section 4, start: rotational joints (21), the equations (22)–(43), and their closed forms.

The Appendix prints f_1 … f_21; they are compared to eqs. (23)–(43), computed from J.
"""

from collections.abc import Callable, Iterator
from functools import partial

import casadi as ca
import numpy as np

from formulations import appendix, measures
from formulations.isotropy_equations import independent_rows, pairs, residuals, sampled
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.reproduction import reference, row
from formulations.reproduction.printed import column_error
from formulations.reproduction.solution_family import symmetry_directions
from nlp.arrays import FloatArray

Forms = Callable[[ca.SX], ca.SX]
_ROW_NAMES = ("v_x", "v_y", "v_z", "ω_x", "ω_y", "ω_z")
_CONFIGURATIONS = 50
_AS_PRINTED: Forms = partial(appendix.closed_forms, as_printed=True)


def rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (21), (22), of the counts of independent equations, and of the Appendix."""
    rng = np.random.default_rng(seed)
    arm = Arm.of(UnitRevolute(), 7)
    point = arm.sample(rng)
    error = column_error(np.hstack([arm.jacobian(arm.sample(rng)) for _ in range(20)]))
    quantity, paper = "v·ω = 0 and |v| = |ω|", "by construction, both of norm 1"
    note = "140 random columns; '−1/ω' in the scan is the dashed line of the partition"
    yield row.within("(21)", quantity, paper, error, note)
    yield _missing_zero_row(rng)
    yield _row_names_row(arm.jacobian(point))
    joints = (7, 8, 12)
    norms = [np.sqrt(Arm.of(UnitRevolute(), n).largest_trace / 6) for n in joints]
    expected = [np.sqrt(n / 3) for n in joints]
    quantity, paper = (
        "row norm of an isotropic J, n = 7, 8, 12",
        f"√(n/3) = {row.shown(expected)}",
    )
    note = "from tr JJᵀ = 2n shared by six rows"
    yield row.compared("(23)–(28)", quantity, paper, expected, norms, note)
    yield from _count_rows(arm)
    yield _dependent_angles_row(arm, point)
    yield from appendix_rows(seed)


def second_vector_errors(rng: np.random.Generator) -> FloatArray:
    """Error |e·ω| + |e·e₁| of (sinα, −cosα) with a 0 put first, second, third; shape (3,).

    The vector e that eq. (21) multiplies by sinγ must be orthogonal to ω and to the vector
    e₁ that it multiplies by cosγ.
    """
    alpha, beta = rng.uniform(-np.pi, np.pi, (2, 50))
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    first = np.array([cos_a * sin_b, sin_a * sin_b, -cos_b])
    axis = np.array([cos_a * cos_b, sin_a * cos_b, sin_b])
    seconds = [np.insert(np.array([sin_a, -cos_a]), k, 0.0, axis=0) for k in range(3)]
    products = [[np.sum(second * one, axis=0) for one in (first, axis)] for second in seconds]
    return np.asarray(np.max(np.sum(np.abs(products), axis=1), axis=1))


def _missing_zero_row(rng: np.random.Generator) -> row.ReproductionRow:
    *elsewhere, last = second_vector_errors(rng)
    return row.ReproductionRow(
        "(21)",
        "second vector of v, multiplied by sinγ",
        "(sinα, −cosα), two entries",
        "(sinα, −cosα, 0)",
        row.misprint(min(elsewhere), last),
        "two entries cannot be added to three; only with the 0 last is v·ω = 0 and |v| = 1 "
        "(lost in the scan, if not in print)",
    )


def _row_names_row(jacobian: FloatArray) -> row.ReproductionRow:
    as_printed = jacobian[[0, 1, 2, 3, 4, 4]]
    n = jacobian.shape[1]
    # By eq. (21) all |ω_i| = 1: the squares of the last three rows add up to n.
    wrong, right = (abs(float(np.sum(j[3:] ** 2)) - n) for j in (as_printed, jacobian))
    rank = int(np.sum(measures.singular_values(as_printed) > 1e-9))
    paper, verdict = "ω_yᵀ, as the row above it", row.misprint(wrong, right)
    note = f"with ω_yᵀ twice Σ|ω_i|² = n fails, and J of rank {rank} is never isotropic"
    return row.ReproductionRow("(22)", "last row of J", paper, "ω_zᵀ", verdict, note)


def _count_rows(arm: Arm) -> Iterator[row.ReproductionRow]:
    variables = arm.symbols()
    values = sampled(arm, variables, residuals(arm, variables))
    norms, products = (_function_rank(part) for part in (values[:, :6], values[:, 6:]))
    expected, others = (
        reference.INDEPENDENT_NORM_EQUATIONS,
        reference.INDEPENDENT_ORTHOGONALITY_EQUATIONS,
    )
    quantity = "independent of the 6 norm equations"
    note = "rank of the equations as functions of the angles"
    yield row.claim("(23)–(28)", quantity, str(expected), norms, norms == expected, note)
    quantity, note = "independent of the 15 others", "f_9 + f_14 + f_18 = Σ v·ω = 0 always"
    yield row.claim("(29)–(43)", quantity, str(others), products, products == others, note)
    together, true = len(independent_rows(arm)), expected + others == _function_rank(values)
    note = "4 + 14; modulo the frame and phase 17 angles are left to meet them"
    true = true and together == expected + others
    quantity = "independent equations in all"
    yield row.claim("(23)–(43)", quantity, str(expected + others), together, true, note)


def _function_rank(values: FloatArray) -> int:
    """Rank of functions sampled at more points than there are functions, constants aside."""
    scale = np.linalg.norm(values, axis=0)
    columns = np.column_stack([np.ones(values.shape[0]), values / scale])
    return int(np.linalg.matrix_rank(columns, tol=1e-9)) - 1


def _dependent_angles_row(arm: Arm, point: FloatArray) -> row.ReproductionRow:
    directions = symmetry_directions(arm, point)
    gauge = int(np.linalg.matrix_rank(directions, tol=1e-9))
    step = 1e-5  # to first order the singular values must not move, so by less than step²
    before = measures.singular_values(arm.jacobian(point))
    moved = [
        measures.singular_values(arm.jacobian(point + step * direction)) - before
        for direction in directions
    ]
    true = gauge > 0 and float(np.max(np.abs(moved))) <= 1e3 * step**2
    quantity = "directions of the 21 angles that change no singular value"
    ours = f"{gauge}, so 21 − {gauge} = {21 - gauge} angles matter"
    note = "rotations of the frame and the common phase"
    return row.claim("after (43)", quantity, "angles not independent", ours, true, note)


def appendix_rows(
    seed: int = 0, printed: Forms = _AS_PRINTED, corrected: Forms = appendix.closed_forms
) -> Iterator[row.ReproductionRow]:
    """One row per closed form, compared at random configurations of a 7R."""
    arm = Arm.of(UnitRevolute(), 7)
    rng = np.random.default_rng(seed)
    points = [arm.sample(rng) for _ in range(_CONFIGURATIONS)]
    derived = np.array(appendix.SIGNS) * [_equations(arm.jacobian(point)) for point in points]
    print_errors, corrected_errors = (
        np.max(np.abs(_values(arm, forms, points) - derived), axis=0).tolist()
        for forms in (printed, corrected)
    )
    for k, errors in enumerate(zip(print_errors, corrected_errors, strict=True)):
        yield _closed_form_row(k, *errors)


def _closed_form_row(k: int, print_error: float, corrected_error: float) -> row.ReproductionRow:
    i, j = pairs(6)[k]
    entry = f"{_ROW_NAMES[i]}ᵀ{_ROW_NAMES[j]}" + (" − n/3" if i == j else "")
    verdict = row.misprint(print_error, corrected_error)
    note = "printed with the opposite sign; 7/3 stands for n/3" if i == j else ""
    equation, quantity = f"({23 + k})", f"f_{k + 1} = {entry}, closed form"
    paper, ours = "as printed in the Appendix", f"equal {row.shown_error(print_error)}"
    if k + 1 == appendix.MISPRINTED and verdict is not row.Verdict.AGREES:
        paper, ours = "Σ −sinβ cosβ cosγ", "Σ −sinα cos²β cosγ"
        note = (
            f"the print repeats f_18 and is off by up to {print_error:.2g}; ours equals J's "
            f"entry {row.shown_error(corrected_error)}"
        )
    return row.ReproductionRow(equation, quantity, paper, ours, verdict, note)


def _equations(jacobian: FloatArray) -> FloatArray:
    """Left-hand sides of eqs. (23)–(43) from J alone, shape (21,)."""
    deviation = jacobian @ jacobian.T - jacobian.shape[1] / 3 * np.eye(6)
    return np.asarray(deviation[tuple(np.transpose(pairs(6)))])


def _values(arm: Arm, forms: Forms, points: list[FloatArray]) -> FloatArray:
    variables = arm.symbols()
    function = ca.Function("forms", [variables], [forms(variables)])
    return np.array([np.array(function(point)).ravel() for point in points])
