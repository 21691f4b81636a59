"""Section 4, start: rotational joints (21), the equations (22)–(43), and their closed forms.

The Appendix prints f_1 … f_21; they are compared to eqs. (23)–(43), computed from J.
"""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from lockedjoint.formulations import isotropy_equations as equations
from lockedjoint.formulations import measures
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.reproduction import reference, row
from lockedjoint.formulations.reproduction.eight_joints import symmetry_directions
from lockedjoint.nlp.arrays import FloatArray

_ARM = Arm.of(UnitRevolute(), 7)
_ROW_NAMES = ("v_x", "v_y", "v_z", "ω_x", "ω_y", "ω_z")
_CONFIGURATIONS = 50


def rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (21), (22), and of the counts of independent equations."""
    rng = np.random.default_rng(seed)
    point = _ARM.sample(rng)
    columns = np.hstack([_ARM.jacobian(_ARM.sample(rng)) for _ in range(20)])
    yield row.within(
        "(21)",
        quantity="v·ω = 0 and |v| = |ω|",
        paper="by construction, both of norm 1",
        error=reference.column_error(columns),
        note="140 random columns; '−1/ω' in the scan is the dashed line of the partition",
    )
    *elsewhere, last = second_vector_errors(rng)
    yield row.ReproductionRow(
        "(21)",
        quantity="second vector of v, multiplied by sinγ",
        paper="(sinα, −cosα), two entries",
        ours="(sinα, −cosα, 0)",
        verdict=row.misprint(min(elsewhere), last),
        note="two entries cannot be added to three; only with the 0 last is v·ω = 0 and "
        "|v| = 1 (lost in the scan, if not in print)",
    )
    jacobian = _ARM.jacobian(point)
    as_printed = jacobian[[0, 1, 2, 3, 4, 4]]
    # All |ω_i| = 1 by eq. (21): the squares of the last three rows add up to n.
    wrong, right = (abs(float(np.sum(j[3:] ** 2)) - 7) for j in (as_printed, jacobian))
    rank = int(np.sum(measures.singular_values(as_printed) > 1e-9))
    yield row.ReproductionRow(
        "(22)",
        quantity="last row of J",
        paper="ω_yᵀ, as the row above it",
        ours="ω_zᵀ",
        verdict=row.misprint(wrong, right),
        note=f"with ω_yᵀ twice Σ|ω_i|² = n fails, and J of rank {rank} is never isotropic",
    )
    joints = (7, 8, 12)
    norms = [np.sqrt(Arm.of(UnitRevolute(), n).largest_trace / 6) for n in joints]
    expected = [np.sqrt(n / 3) for n in joints]
    yield row.compared(
        "(23)–(28)",
        quantity="row norm of an isotropic J, n = 7, 8, 12",
        paper=f"√(n/3) = {row.shown(expected)}",
        expected=expected,
        values=norms,
        note="from tr JJᵀ = 2n shared by six rows",
    )
    yield from _count_rows()
    yield _dependent_angles_row(point)


def second_vector_errors(rng: np.random.Generator) -> FloatArray:
    """Error |e·ω| + |e·e₁| of (sinα, −cosα) with a 0 put first, second, third; shape (3,).

    The vector e that eq. (21) multiplies by sinγ must be orthogonal to ω and to the vector
    e₁ that it multiplies by cosγ.
    """
    alpha, beta = rng.uniform(-np.pi, np.pi, (2, 50))
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    first = np.array([cos_a * sin_b, sin_a * sin_b, -cos_b])
    axis = np.array([cos_a * cos_b, sin_a * cos_b, sin_b])
    seconds = np.array([np.insert([sin_a, -cos_a], k, 0.0, axis=0) for k in range(3)])
    errors = sum(np.abs(np.sum(seconds * other, axis=1)) for other in (first, axis))
    return np.asarray(np.max(errors, axis=1))


def _count_rows() -> Iterator[row.ReproductionRow]:
    variables = _ARM.symbols()
    # The columns are the 6 norm equations first, then the 15 others.
    values = equations.sampled(_ARM, variables, equations.residuals(_ARM, variables))
    norms, products, together = map(_function_rank, (values[:, :6], values[:, 6:], values))
    expected = reference.INDEPENDENT_NORM_EQUATIONS
    others = reference.INDEPENDENT_ORTHOGONALITY_EQUATIONS
    yield row.claim(
        "(23)–(28)",
        quantity="independent of the 6 norm equations",
        paper=str(expected),
        ours=norms,
        true=norms == expected,
        note="rank of the equations as functions of the angles",
    )
    yield row.claim(
        "(29)–(43)",
        quantity="independent of the 15 others",
        paper=str(others),
        ours=products,
        true=products == others,
        note="f_9 + f_14 + f_18 = Σ v·ω = 0 always",
    )
    ours, total = len(equations.independent_rows(_ARM)), expected + others
    yield row.claim(
        "(23)–(43)",
        quantity="independent equations in all",
        paper=str(total),
        ours=ours,
        true=ours == total == together,
        note="4 + 14; modulo the frame and phase 17 angles are left to meet them",
    )


def _function_rank(values: FloatArray) -> int:
    """Rank of functions sampled at more points than there are functions, constants aside."""
    scale = np.linalg.norm(values, axis=0)
    columns = np.column_stack([np.ones(values.shape[0]), values / scale])
    return int(np.linalg.matrix_rank(columns, tol=1e-9)) - 1


def _dependent_angles_row(point: FloatArray) -> row.ReproductionRow:
    """Return the row of the angles that do not matter at a point, shape (21,), in radians."""
    directions = symmetry_directions(_ARM, point)
    gauge = int(np.linalg.matrix_rank(directions, tol=1e-9))
    # To first order the singular values must not move. What is left is of second order: at most
    # 1000 step² is allowed.
    step = 1e-5
    before, *after = (
        measures.singular_values(_ARM.jacobian(point + step * direction))
        for direction in (np.zeros_like(point), *directions)
    )
    true = gauge > 0 and float(np.max(np.abs(after - before))) <= 1e3 * step**2
    return row.claim(
        "after (43)",
        quantity="directions of the 21 angles that change no singular value",
        paper="angles not independent",
        ours=f"{gauge}, so 21 − {gauge} = {21 - gauge} angles matter",
        true=true,
        note="rotations of the frame and the common phase",
    )


def appendix_rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """One row per closed form, compared at random configurations of a 7R."""
    rng, variables = np.random.default_rng(seed), _ARM.symbols()
    points = [_ARM.sample(rng) for _ in range(_CONFIGURATIONS)]
    # Left-hand sides of eqs. (23)–(43) from J alone.
    grams = [jacobian @ jacobian.T for jacobian in map(_ARM.jacobian, points)]
    entries = tuple(np.transpose(equations.pairs(6)))
    derived = np.array(
        [equations.SIGNS * (gram - 7 / 3 * np.eye(6))[entries] for gram in grams]
    )

    def errors(forms: ca.SX) -> list[float]:
        function = ca.Function("forms", [variables], [forms])
        values = [np.array(function(point)).ravel() for point in points]
        return list(np.max(np.abs(values - derived), axis=0))

    printed = errors(equations.closed_forms(variables, as_printed=True))
    corrected = errors(equations.closed_forms(variables))
    for k, (i, j) in enumerate(equations.pairs(6)):
        entry = f"{_ROW_NAMES[i]}ᵀ{_ROW_NAMES[j]}" + (" − n/3" if i == j else "")
        verdict = row.misprint(printed[k], corrected[k])
        note = "printed with the opposite sign; 7/3 stands for n/3" if i == j else ""
        paper, ours = "as printed in the Appendix", f"equal {row.shown_error(printed[k])}"
        if k + 1 == equations.MISPRINTED and verdict is not row.Verdict.AGREES:
            paper, ours = "Σ −sinβ cosβ cosγ", "Σ −sinα cos²β cosγ"
            note = (
                f"the print repeats f_18 and is off by up to {printed[k]:.2g}; ours equals J's "
                f"entry {row.shown_error(corrected[k])}"
            )
        yield row.ReproductionRow(
            f"({23 + k})",
            quantity=f"f_{k + 1} = {entry}, closed form",
            paper=paper,
            ours=ours,
            verdict=verdict,
            note=note,
        )
