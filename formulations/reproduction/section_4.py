"""Section 4, start: rotational joints (21), the equations (22)–(43), and their closed forms.

Each function yields rows of the report of ``reproduce``: what the paper prints, what is
computed here, and whether the two agree (`row.ReproductionRow`).

J is the Jacobian of n joints, shape (6, n). Its column j_i = (v_i; ω_i) has a linear part v_i
above and an angular part ω_i below. In eq. (21) three angles α, β, γ in radians say what column
a rotational joint has: v = cosγ e₁ + sinγ e, where the unit vectors e₁, e and ω are normal to
one another. The arm here has n = 7 such joints, and so 21 angles.

Eqs. (23)–(43) say that JJᵀ = (n/3)I, entry by entry: six for the diagonal ("norm equations"),
then 15 for the entries above it. The Appendix prints their left sides f_1 … f_21 as functions
of the angles. These are compared with the entries of JJᵀ − (n/3)I, computed from J.
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
# Number of random arms whose columns are checked against eq. (21). More arms cost more time and
# change the number of columns in the note.
_ARMS_OF_EQUATION_21 = 20
# Number of random pairs (α, β) at which the second vector of eq. (21) is tried.
_ANGLE_PAIRS = 50
# Number of random arms at which a closed form of the Appendix is compared with J. More of them
# can show a larger error of a misprint, and nothing else.
_CONFIGURATIONS = 50
# Singular values below this count as zero where a rank is counted. The true ones are of the
# order of 1, rounding leaves about 1e-15.
_RANK_TOLERANCE = 1e-9
# Length of the step, in radians, with which a direction of the angles is tried.
_STEP_RAD = 1e-5
# Largest change of a singular value per squared step, in 1/rad², where the first derivative is
# zero: second derivatives of singular values are below it.
_LARGEST_BEND = 1e3


def rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (21), (22), and of the counts of independent equations."""
    rng = np.random.default_rng(seed)
    point = _ARM.sample(rng)
    arms = [_ARM.jacobian(_ARM.sample(rng)) for _ in range(_ARMS_OF_EQUATION_21)]
    columns = np.hstack(arms)
    yield row.within(
        "(21)",
        quantity="v·ω = 0 and |v| = |ω|",
        paper="by construction, both of norm 1",
        error=reference.column_error(columns),
        note=f"{columns.shape[1]} random columns; '−1/ω' in the scan is the dashed line of the "
        "partition",
    )
    # The print has two entries. Where the missing 0 belongs is found by trying all three
    # places.
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
    yield _last_row_row(_ARM.jacobian(point))
    joints = (7, 8, 12)
    # JJᵀ of an isotropic J has six equal eigenvalues, which add up to its trace 2n.
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


def _last_row_row(jacobian: FloatArray) -> row.ReproductionRow:
    """Return the row on the last row of J in eq. (22), which the paper prints as ω_yᵀ again."""
    as_printed = jacobian[[0, 1, 2, 3, 4, 4]]
    # All |ω_i| = 1 by eq. (21): the squares of the last three rows add up to n.
    wrong, right = (abs(float(np.sum(j[3:] ** 2)) - 7) for j in (as_printed, jacobian))
    rank = int(np.sum(measures.singular_values(as_printed) > _RANK_TOLERANCE))
    return row.ReproductionRow(
        "(22)",
        quantity="last row of J",
        paper="ω_yᵀ, as the row above it",
        ours="ω_zᵀ",
        verdict=row.misprint(wrong, right),
        note=f"with ω_yᵀ twice Σ|ω_i|² = n fails, and J of rank {rank} is never isotropic",
    )


def second_vector_errors(rng: np.random.Generator) -> FloatArray:
    """Return the largest |e·ω| + |e·e₁| of (sinα, −cosα) with a 0 put in each of three places.

    Shape (3,): the 0 first, second, third. The vector e that eq. (21) multiplies by
    sinγ must be orthogonal to ω and to the vector e₁ that it multiplies by cosγ.
    """
    alpha, beta = rng.uniform(-np.pi, np.pi, (2, _ANGLE_PAIRS))
    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    first = np.array([cos_a * sin_b, sin_a * sin_b, -cos_b])
    axis = np.array([cos_a * cos_b, sin_a * cos_b, sin_b])
    # Three vectors e at each pair of angles: shape (3 places of the 0, 3 entries, pairs).
    seconds = np.array([np.insert([sin_a, -cos_a], k, 0.0, axis=0) for k in range(3)])
    errors = sum(np.abs(np.sum(seconds * other, axis=1)) for other in (first, axis))
    return np.asarray(np.max(errors, axis=1))


def _count_rows() -> Iterator[row.ReproductionRow]:
    """Yield the rows on how many of eqs. (23)–(43) are independent functions of the angles."""
    variables = _ARM.symbols()
    # Shape (configurations, 21): the 6 norm equations come first, then the 15 others.
    values = equations.sampled(_ARM, variables, equations.residuals(_ARM, variables))
    norms, products, together = map(_function_rank, (values[:, :6], values[:, 6:], values))
    norms_in_paper = reference.INDEPENDENT_NORM_EQUATIONS
    products_in_paper = reference.INDEPENDENT_ORTHOGONALITY_EQUATIONS
    yield row.claim(
        "(23)–(28)",
        quantity="independent of the 6 norm equations",
        paper=str(norms_in_paper),
        ours=norms,
        true=norms == norms_in_paper,
        note="rank of the equations as functions of the angles",
    )
    yield row.claim(
        "(29)–(43)",
        quantity="independent of the 15 others",
        paper=str(products_in_paper),
        ours=products,
        true=products == products_in_paper,
        note="f_9 + f_14 + f_18 = Σ v·ω = 0 always",
    )
    ours, total = len(equations.independent_rows(_ARM)), norms_in_paper + products_in_paper
    yield row.claim(
        "(23)–(43)",
        quantity="independent equations in all",
        paper=str(total),
        ours=ours,
        true=ours == total == together,
        note="4 + 14; modulo the frame and phase 17 angles are left to meet them",
    )


def _function_rank(values: FloatArray) -> int:
    """Return how many functions are linearly independent of one another and of constants.

    `values` has shape (points, functions), more points than functions. A column of ones is put
    beside the functions and taken off the rank again: what differs by a constant is one
    equation.
    """
    scale = np.linalg.norm(values, axis=0)
    columns = np.column_stack([np.ones(values.shape[0]), values / scale])
    return int(np.linalg.matrix_rank(columns, tol=_RANK_TOLERANCE)) - 1


def _dependent_angles_row(point: FloatArray) -> row.ReproductionRow:
    """Return the row on directions of the angles in which only frame and phase change.

    `point` has the 21 angles, in radians, shape (21,).
    """
    directions = symmetry_directions(_ARM, point)  # shape (4, 21)
    gauge = int(np.linalg.matrix_rank(directions, tol=_RANK_TOLERANCE))
    before, *after = (
        measures.singular_values(_ARM.jacobian(point + _STEP_RAD * direction))
        for direction in (np.zeros_like(point), *directions)
    )
    # The singular values must not move to first order. What is left is of second order.
    change = float(np.max(np.abs(after - before)))
    true = gauge > 0 and change <= _LARGEST_BEND * _STEP_RAD**2
    return row.claim(
        "after (43)",
        quantity="directions of the 21 angles that change no singular value",
        paper="angles not independent",
        ours=f"{gauge}, so 21 − {gauge} = {21 - gauge} angles matter",
        true=true,
        note="rotations of the frame and the common phase",
    )


def appendix_rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Yield one row per closed form f_1 … f_21, compared at random configurations of a 7R."""
    rng, variables = np.random.default_rng(seed), _ARM.symbols()
    points = [_ARM.sample(rng) for _ in range(_CONFIGURATIONS)]
    printed = _form_errors(
        points, variables, equations.closed_forms(variables, as_printed=True)
    )
    corrected = _form_errors(points, variables, equations.closed_forms(variables))
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


def _form_errors(points: list[FloatArray], variables: ca.SX, forms: ca.SX) -> list[float]:
    """Return the largest error over the points of each of 21 closed forms, f_1 first.

    A point has 21 angles in radians. What is right are the entries of JJᵀ − (7/3)I, computed
    from J alone, with the signs of the Appendix.
    """
    grams = [jacobian @ jacobian.T for jacobian in map(_ARM.jacobian, points)]
    entries = tuple(np.transpose(equations.pairs(6)))
    derived = np.array(
        [equations.SIGNS * (gram - 7 / 3 * np.eye(6))[entries] for gram in grams]
    )
    function = ca.Function("forms", [variables], [forms])
    values = [np.array(function(point)).ravel() for point in points]
    return list(np.max(np.abs(values - derived), axis=0))
