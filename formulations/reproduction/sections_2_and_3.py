"""Sections 2 and 3, eqs. (6)–(20): the bound, shares of joints, and canonical Jacobians.

Each function yields rows of the report of ``reproduce``: what the paper prints, what is
computed here, and whether the two agree (`row.ReproductionRow`). Three functions of `row` make
most of them: `compared` for numbers, `within` for an error that is to be rounding, and `claim`
for a statement. The paper's matrices are in `reference`, whose header has V; fσ_m is the least
singular value of J without column f.

J is a Jacobian of shape (m, n), one column j_i per joint; without units. JJᵀ = σ²I where it is
isotropic, T = tr JJᵀ. Eq. (6) bounds the smallest singular value after the worst failure, the
*worst case*: √(T(n − m)/(mn)), for isotropic J σ√((n − m)/n). R_i and N_i = 1 − R_i are the
shares of joint i in the range of Jᵀ and in the null space of J. α, in radians, is the parameter
of the planar 4R family (16).

The Jacobians are planar 3R and 4R, eqs. (12)–(17) and Figs. 1 and 2, positional 4R (18)–(19),
and (20). No orthogonal U was found that turns the canonical Jacobian (20) into one of revolute
joints::

    minimise   Σ_i (v_i·ω_i)² + ¼(|v_i|² − |ω_i|²)²      over U, 6×6
    subject to UUᵀ = I

with (v_i; ω_i) the columns of √(7/3) U J, J from (20), whose norms² are 2. The sum is zero
exactly where every column is that of a revolute joint with |v| = |ω| = 1, eq. (21). Other
lever arms would not help: |ω_i| = 1 for every revolute joint, so JJᵀ = σ²I has 3σ² = n, and
columns of equal norm have norm² 6σ²/n = 2, which leaves |v_i| = 1.
"""

from collections.abc import Callable, Iterator
from functools import partial

import casadi as ca
import numpy as np
from scipy.optimize import minimize_scalar

from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import FreeColumn
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.reproduction import reference, row
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Constraint, Problem

# Shapes (m, n) of the random Jacobians on which Section 2 is tried. If you change them, change
# the range of m and n in the notes of `bound_rows`.
_SHAPES = ((2, 3), (2, 4), (3, 4), (3, 7), (6, 7), (6, 8), (6, 12))
# Number of random Jacobians of each shape. More of them try eq. (6) harder and take longer.
_PER_SHAPE = 100
# One arm of the worst kind: isotropic, but joint 1 moves nothing (it sits at the end effector).
_IDLE_JOINT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
# Tolerance on angles between columns, in degrees: rounding of the arctangent.
_ANGLE_TOLERANCE_DEG = 1e-9
# Step of the central differences of Fig. 1, in radians. Their error is of the order of its
# square, 1e-10, and of rounding over the step, 1e-11.
_DIFFERENCE_STEP_RAD = 1e-5
# Tolerance on an entry of J from these differences.
_DIFFERENCE_TOLERANCE = 1e-8
# Values of α of the planar 4R family, in radians: 360 in [0, 2π), one degree apart. The offset
# keeps multiples of π/4, where the optima are, off the grid.
_GRID = 0.01 + 2 * np.pi * np.arange(360) / 360
# Number of the first values of the grid that lie in one eighth of a turn. Beyond it the
# Jacobians of the family repeat, modulo frame, order and signs.
_EIGHTH = len(_GRID) // 8
# Inner products of the columns of two distinct Jacobians differ by more than this.
_DISTINCT = 1e-3
# Tolerance of the search for an optimal α, in radians.
_SEARCH_TOLERANCE_RAD = 1e-10
# Maxima of the worst case this near to the largest one count as equal to it.
_MAXIMUM_TOLERANCE = 1e-6
# Tolerance on an optimal α, in radians. The worst case has a peak there, so α is found sharply.
_OPTIMUM_TOLERANCE_RAD = 1e-6
# The paper's words for the optimal α.
_ODD = "odd multiples of π/4"
# Number of random orthogonal U under which fσ_6 must not change.
_RANDOM_ROTATIONS = 100
# The search for U: a sum of squares below this would be a revolute Jacobian.
_REVOLUTE = 1e-12
# The search for U: an entry of UUᵀ − I may be off by this; starts that end farther are left
# out.
_ORTHOGONAL = 1e-7
# The search for U: sums of squares this near to the least one count as equal to it.
_SAME_SUM = 1e-6


def bound_rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Yield the rows of Section 2, on random Jacobians of several shapes.

    The isotropic ones have the same row spaces as the others, and σ = 1.
    """
    rng = np.random.default_rng(seed)
    general = [rng.standard_normal(shape) for shape in _SHAPES for _ in range(_PER_SHAPE)]
    isotropic = [np.asarray(np.linalg.qr(matrix.T)[0].T) for matrix in general]
    yield from _worst_case_rows(general, isotropic)
    yield _equality_row(isotropic)
    yield from _contribution_rows(general)


def _worst_case_rows(
    general: list[FloatArray], isotropic: list[FloatArray]
) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eq. (6): no J is above the bound, and harmonic frames attain it."""
    count = f"{len(general)} random Jacobians, m from 2 to 6, n from 3 to 12"
    for which, matrices, note in (
        ("isotropic J", isotropic, count),
        ("any J, with σ² = tr JJᵀ/m", general, f"{count}; beyond the paper"),
    ):
        largest = max(map(_share_of_bound, matrices))
        quantity = f"largest worst case over its bound, {which}"
        true = largest <= 1 + row.ROUNDING
        yield row.claim("(6)", quantity, "at most 1", row.shown(largest), true, note)
    shares = [_share_of_bound(reference.harmonic_jacobian(m, n)) for m, n in _SHAPES]
    quantity = "worst case over its bound, optimally failure-tolerant J"
    note = "harmonic frames: isotropic with columns of equal norm, one of each shape"
    yield row.compared("(6)", quantity, "1", 1, shares, note, show=row.farthest(1))


def _equality_row(isotropic: list[FloatArray]) -> row.ReproductionRow:
    """Return the row of equality in (6), which follows from fσ_m² = σ² − ‖j_f‖² for σ = 1."""
    squares = np.concatenate([measures.locked_singular_values(j) ** 2 for j in isotropic])
    rest = np.concatenate([np.maximum(1 - np.sum(j**2, axis=0), 0) for j in isotropic])
    error = float(np.max(np.abs(squares - rest)))
    quantity = "equality in (6) for all f is the same as columns of equal norm"
    ours = f"fσ_m² = σ² − ‖j_f‖² {row.shown_error(error)}"
    note = "random isotropic J with σ = 1; the squares ‖j_f‖² add up to mσ²"
    return row.claim("Sec. 2", quantity, "equivalent", ours, error <= row.ROUNDING, note)


def _contribution_rows(general: list[FloatArray]) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (7)–(11): R_i and N_i as sums of squares of columns of Vᵀ."""
    # R_i and N_i from the first m rows of Vᵀ and the others, without functions of `measures`.
    parts = [np.split(np.linalg.svd(j)[2] ** 2, [len(j)]) for j in general]
    tops = np.concatenate([np.sum(top, axis=0) for top, _ in parts])
    bottoms = np.concatenate([np.sum(bottom, axis=0) for _, bottom in parts])
    known = np.concatenate([measures.range_contributions(j) for j in general])
    quantity, paper = "R_i from the upper m rows of Vᵀ", "‖j_i‖² of the orthonormal rows"
    note = "Vᵀ partitioned after row m, against the measure computed from J"
    yield row.within("(7)–(9)", quantity, paper, float(np.max(np.abs(tops - known))), note)
    sums, show = tops + bottoms, row.farthest(1)
    note = "R_i from the upper, N_i from the lower rows of Vᵀ, the one farthest from 1"
    yield row.compared("(10)–(11)", "R_i + N_i", "1", 1, sums, note, show=show)


def _share_of_bound(matrix: FloatArray) -> float:
    """Return the worst case of J, shape (m, n), over the bound of eq. (6): at most 1."""
    m, n = matrix.shape
    bound = measures.sigma_bound(m, n, measures.trace(matrix))
    return measures.worst_case_sigma(matrix) / bound


def three_joint_rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (12)–(15) and of Figs. 1 and 2.

    The search of Fig. 2 makes so many random starts from a seed.
    """
    yield from _planar_3r_rows()
    yield from _index_rows(seed, starts)


def _planar_3r_rows() -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (12)–(15) and of Fig. 1, of one Jacobian, shape (2, 3)."""
    jacobian, null_space = reference.PLANAR_3R, reference.PLANAR_3R_NULL_SPACE
    values = measures.singular_values(jacobian)
    yield row.compared("(12)", "singular values of planar 3R", "σ = 1, isotropic", 1, values)
    yield configuration_row(jacobian)
    last = np.linalg.svd(jacobian)[2][-1]
    ours, paper = last * np.sign(last @ null_space), row.shown(null_space)
    note = "last right singular vector of (12); its sign is arbitrary"
    yield row.compared("(13)", "null space of (12)", paper, null_space, ours, note)
    directions = np.degrees(np.arctan2(jacobian[1], jacobian[0]))
    # The last gap leads from the last direction to the first one, a whole turn on.
    gaps = np.diff(np.sort(directions), append=np.min(directions) + 360)
    quantity, expected = "angles between the columns, degrees", reference.PLANAR_3R_ANGLE
    yield row.compared(
        "after (13)", quantity, "120", expected, gaps, tolerance=_ANGLE_TOLERANCE_DEG
    )
    sigma = reference.PLANAR_3R_SIGMA
    paper = f"√(1/3) = {row.shown(sigma)}"
    sigmas = measures.locked_singular_values(jacobian)
    yield row.compared("(14)", "fσ_2 for f = 1, 2, 3", paper, sigma, sigmas)
    units = jacobian / np.linalg.norm(jacobian, axis=0)
    weakest = [measures.weakest_direction(np.delete(jacobian, f, axis=1)) for f in range(3)]
    cosines = np.abs(np.sum(np.transpose(weakest) * units, axis=0))
    quantity = "|cosine| between the direction that suffers most and j_f"
    yield row.compared("(15)", quantity, "1", 1, cosines)


def _index_rows(seed: int, starts: int) -> Iterator[row.ReproductionRow]:
    """Yield the rows of Fig. 2: the best and the worst index, or worst case, of a planar 3R."""
    sigma = reference.PLANAR_3R_SIGMA
    paper = f"√(1/3) = {row.shown(sigma)}"
    best = max(map(measures.worst_case_sigma, _best(3, 1, seed, starts)))
    note = f"max-min over all planar 3R with tr JJᵀ = 2, {starts} random starts"
    quantity = "best index of a planar 3R"
    yield row.compared("Fig. 2", quantity, paper, sigma, best, note, row.SOLVER)
    first, *others = measures.locked_singular_values(_IDLE_JOINT)
    isotropic = np.ptp(measures.singular_values(_IDLE_JOINT)) <= row.ROUNDING
    idle = max(abs(s - reference.PLANAR_3R_WORST) for s in others) <= row.ROUNDING
    quantity, true = "worst index: 2σ_2 and 3σ_2", bool(isotropic and idle)
    note = f"exhibit J = [0 1 0; 0 0 1], isotropic, joint 1 idle; 1σ_2 = {row.shown(first)}"
    yield row.claim("Fig. 2", quantity, "0", row.shown(others), true, note)


def configuration_row(jacobian: FloatArray) -> row.ReproductionRow:
    """Return the row of Fig. 1: an arm with the Jacobian (12) exists; `jacobian` is to be (12).

    Joints are placed in the complex plane as the columns of `jacobian`, shape (2, 3), say, with
    the end effector at the origin. The end of the chain is differentiated by the joint angles,
    and what results is compared with (12).
    """
    # Turning about a joint at p moves the origin by −ip = j, so that p = ij. Links lead from
    # one joint to the next, the last one to the origin.
    links = np.diff(1j * (jacobian[0] + 1j * jacobian[1]), append=0)

    def end(turns: FloatArray) -> complex:
        """Return where the chain ends, seen from joint 1; turns of the joints in radians."""
        return complex(np.sum(links * np.exp(1j * np.cumsum(turns))))

    step = _DIFFERENCE_STEP_RAD
    slopes = [(end(step * unit) - end(-step * unit)) / (2 * step) for unit in np.eye(3)]
    differentiated = [np.real(slopes), np.imag(slopes)]
    verdict = row.equal(reference.PLANAR_3R, differentiated, _DIFFERENCE_TOLERANCE)
    quantity, ours = "link lengths of a planar 3R", row.shown(np.abs(links))
    note = "the chain's end differentiated by its joint angles gives (12)"
    return row.ReproductionRow("Fig. 1", quantity, "exists", ours, verdict, note)


def _best(joints: int, failures: int, seed: int, starts: int) -> list[FloatArray]:
    """Return the Jacobians, shape (2, joints), that max-min from random starts ends at.

    Over all planar arms with tr JJᵀ = 2, so that σ = 1 where they are isotropic.
    """
    arm = Arm.of(FreeColumn(2, norm=float(np.sqrt(2 / joints)), budget="mean"), joints)
    build = partial(max_min.build, arm, failures)
    return row.optima(row.search(build, arm.sample, starts, seed))


def four_joint_rows(seed: int = 0, starts: int = 20) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (16) and (17), and of the claim on double failures after them."""
    wholes = [reference.planar_4r(alpha) for alpha in _GRID]
    members = [whole[:2] for whole in wholes]
    error = float(max(np.max(np.abs(v.T @ v - np.eye(4))) for v in wholes))
    note = f"{len(_GRID)} values of α"
    yield row.within("(16)", "VᵀV = I for every α", "orthogonal", error, note)
    classes = len(group_equivalent(members[:_EIGHTH], tolerance=_DISTINCT))
    quantity = f"distinct Jacobians among {_EIGHTH} values of α"
    note = (
        "modulo frame, order and signs; α over one eighth of a turn, beyond which they repeat"
    )
    yield row.claim("(16)", quantity, "a family", classes, classes == _EIGHTH, note)
    sigma = reference.PLANAR_4R_SIGMA
    sigmas = np.concatenate([measures.locked_singular_values(matrix) for matrix in members])
    quantity, paper = "fσ_2 for all f and α", f"√(1/2) = {row.shown(sigma)}"
    note = "the value farthest from the paper's"
    yield row.compared("(17)", quantity, paper, sigma, sigmas, note, show=row.farthest(sigma))
    yield from _double_failure_rows(seed, starts)


def _double_failure_rows(seed: int, starts: int) -> Iterator[row.ReproductionRow]:
    """Yield the rows of the claim that α = kπ/4, k odd, is optimal for double failures."""

    def worst(alpha: float) -> float:
        """Return the worst case of two failures of the family (16) at α, in radians."""
        return measures.worst_case_sigma(reference.planar_4r(alpha)[:2], failures=2)

    where, expected = "after (17)", reference.PLANAR_4R_DOUBLE_FAILURE
    angles = _maximisers(worst)
    alike = len(angles) == len(expected)
    verdict = row.Verdict.MISMATCH
    if alike:
        verdict = row.equal(expected, angles, _OPTIMUM_TOLERANCE_RAD)
    quantity, ours = "α optimal for double failures", row.shown(angles / (np.pi / 4))
    note = "search over α in [0, 2π) for the best worst case of two failures, in units of π/4"
    yield row.ReproductionRow(where, quantity, _ODD, f"{ours}, times π/4", verdict, note)
    at_best, at_zero = worst(float(expected[0])), worst(0.0)
    answers = _best(4, 2, seed, starts)
    sigmas = [measures.worst_case_sigma(matrix, 2) for matrix in answers]
    attained = max(sigmas)
    quantity = "worst case of two failures at α = kπ/4, k odd"
    note = (
        "sin(π/8) at α = π/4; the best of max-min with two locked joints over all planar 4R "
        f"with tr JJᵀ = 2, {starts} starts, is {row.shown(attained)}"
    )
    yield row.compared(where, quantity, "optimal", attained, at_best, note, row.SOLVER)
    best = [a for a, s in zip(answers, sigmas, strict=True) if s >= attained - row.SOLVER]
    same = len(group_equivalent([reference.planar_4r(np.pi / 4)[:2], *best])) == 1
    quantity = "optimum for two failures, found over all planar 4R by max-min"
    ours = f"(16) at α = π/4 from {len(best)} of {starts} starts" if same else "another J"
    note = "canonical forms agree modulo frame, order and signs"
    yield row.claim(where, quantity, _ODD, ours, same, note)
    ours = row.shown(at_zero if at_zero > row.ROUNDING else 0.0)
    true = at_zero <= row.ROUNDING < at_best
    quantity = "worst case of two failures at α = 0"
    note = "single failures do not tell α = 0 from the optimum, double failures do"
    yield row.claim(where, quantity, "not optimal", ours, true, note)


def _maximisers(objective: Callable[[float], float]) -> FloatArray:
    """Return all α in [0, 2π), in radians, that maximise a function of period 2π, ascending.

    Peaks of the function on the grid are refined between their neighbours. The array is empty
    where the function has no peaks.
    """
    values = np.array([objective(alpha) for alpha in _GRID])
    peaks = (values >= np.roll(values, 1)) & (values > np.roll(values, -1))
    step = 2 * np.pi / len(_GRID)
    refine = partial(
        minimize_scalar, method="bounded", options={"xatol": _SEARCH_TOLERANCE_RAD}
    )
    refined = [
        refine(lambda alpha: -objective(alpha), bounds=(peak - step, peak + step)).x
        for peak in _GRID[peaks]
    ]
    best = max(map(objective, refined), default=np.nan)
    near = [alpha for alpha in refined if objective(alpha) >= best - _MAXIMUM_TOLERANCE]
    return np.sort(np.mod(near, 2 * np.pi))


def positional_rows() -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (18) and (19)."""
    matrix, expected = reference.POSITIONAL_4R, reference.POSITIONAL_4R_SIGMA
    error = float(np.max(np.abs(matrix @ matrix.T - np.eye(4))))
    yield row.within("(18)", "VᵀV = I", "orthogonal", error)
    unit = matrix[:3] / np.linalg.norm(matrix[:3], axis=0)
    cosines = (unit.T @ unit)[np.triu_indices(4, 1)]
    quantity, paper = "cosines between the columns", "span space symmetrically"
    note = "all −1/3: the corners of a regular tetrahedron"
    yield row.compared("(18)", quantity, paper, -1 / 3, cosines, note)
    sigmas, paper = measures.locked_singular_values(matrix[:3]), f"1/2 = {row.shown(expected)}"
    yield row.compared("(19)", "fσ_3 for f = 1, …, 4", paper, expected, sigmas)


def canonical_rows(seed: int = 0) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eq. (20) and of the claims around it, but for the search for a U."""
    yield from _canonical_6x7_rows()
    yield from _any_dimension_rows()
    yield _screw_row()
    yield _frame_row(seed)


def _canonical_6x7_rows() -> Iterator[row.ReproductionRow]:
    """Yield the rows of eq. (20) itself, of shape (6, 7)."""
    jacobian, show = reference.CANONICAL_6X7, row.shown_range
    values = measures.singular_values(jacobian)
    yield row.compared("(20)", "singular values", "σ = 1, isotropic", 1, values)
    shares = measures.null_space_contributions(jacobian)
    yield row.compared("(20)", "N_i, i = 1, …, 7", "equal, so 1/7", 1 / 7, shares, show=show)
    sigmas, expected = measures.locked_singular_values(jacobian), np.sqrt(1 / 7)
    quantity, paper = "fσ_6 for f = 1, …, 7", f"√(1/7) = {row.shown(expected)}"
    note = "eq. (6) with equality"
    yield row.compared("(20)", quantity, paper, expected, sigmas, note, show=show)


def _any_dimension_rows() -> Iterator[row.ReproductionRow]:
    """Yield the rows of Jacobians like (20) of other shapes (m, n), all optimal by eq. (6)."""
    jacobian = reference.CANONICAL_6X7
    error = float(np.max(np.abs(jacobian - reference.simplex_jacobian(6))))
    ratios = [_share_of_bound(reference.simplex_jacobian(m)) for m in range(1, 13)]
    quantity = "the same pattern for m = 1, …, 12, n = m + 1: worst case over √((n−m)/n)"
    paper, ours = "a task space of any dimension", row.farthest(1)(ratios)
    true = max(error, *(abs(share - 1) for share in ratios)) <= row.ROUNDING
    note = f"regular simplex; for m = 6, n = 7 the print {row.shown_error(error)}"
    yield row.claim("(20)", quantity, paper, ours, true, note)
    sizes = [(m, n) for m in range(1, 9) for n in range(m + 1, 17)]
    ratios = [_share_of_bound(reference.harmonic_jacobian(m, n)) for m, n in sizes]
    quantity = "m = 1, …, 8, n = m + 1, …, 16: worst case over √((n−m)/n)"
    paper = "a manipulator of any dimension"
    note = "the paper prints n = m + 1 only; our construction for n > m + 1: harmonic frames"
    yield row.compared("(20)", quantity, paper, 1, ratios, note, show=row.farthest(1))


def _screw_row() -> row.ReproductionRow:
    """Return the row of the claim that no column of (20) is revolute: v·ω = 0 and ω ≠ 0."""
    jacobian = reference.CANONICAL_6X7
    pitch = np.abs(np.sum(jacobian[:3] * jacobian[3:], axis=0))
    rotates = np.linalg.norm(jacobian[3:], axis=0) > row.ROUNDING
    screws, revolute = pitch > row.ROUNDING, rotates & (pitch <= row.ROUNDING)
    quantity = "columns of (20) that a revolute joint can contribute"
    paper, ours, true = "none: arbitrary screws", np.sum(revolute), not np.any(revolute)
    note = f"{np.sum(screws)} columns are screws with v·ω ≠ 0, {np.sum(~rotates)} have ω = 0"
    return row.claim("after (20)", quantity, paper, ours, true, note)


def _frame_row(seed: int) -> row.ReproductionRow:
    """Return the row of the claim that UJ has the same fσ_6 as J, on random orthogonal U."""
    jacobian = reference.CANONICAL_6X7
    sigmas = measures.locked_singular_values(jacobian)
    drawn = np.random.default_rng(seed).standard_normal((_RANDOM_ROTATIONS, 6, 6))
    factors = np.linalg.qr(drawn)[0]
    after = [measures.locked_singular_values(factor @ jacobian) for factor in factors]
    change = float(np.max(np.abs(np.array(after) - sigmas)))
    quantity = "change of fσ_6 under UJ, U orthogonal"
    return row.within("after (20)", quantity, "none", change, f"{_RANDOM_ROTATIONS} random U")


def rotation() -> Problem:
    """State the search for U as a nonlinear program, the columns of (20) scaled to norm² 2.

    The variables are the 36 entries of U, column by column. The output ``jacobian`` is UJ,
    shape (6, 7).
    """
    jacobian = reference.CANONICAL_6X7
    n = jacobian.shape[1]
    factor = ca.SX.sym("U", 6, 6)
    product = factor @ ca.DM(np.sqrt(n / 3) * jacobian)
    velocity, axis = product[:3, :], product[3:, :]
    products = ca.sum1(velocity * axis)
    excess = ca.sum1(velocity**2) - ca.sum1(axis**2)
    gram = factor @ factor.T - ca.SX.eye(6)
    orthogonality = ca.vertcat(*(gram[i, j] for i in range(6) for j in range(i + 1)))
    return Problem(
        name="rotation into revolute joints",
        variables=ca.vec(factor),
        objective=ca.sumsqr(products) + ca.sumsqr(excess) / 4,
        constraints=(Constraint("orthogonality", orthogonality, 0.0, 0.0),),
        outputs={"jacobian": product},
    )


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """Return the entries of a random orthogonal U, uniformly distributed, shape (36,).

    With positive diagonal of the triangle the factor Q of QR is uniform (Stewart, 1980).
    """
    factor, triangle = np.linalg.qr(rng.standard_normal((6, 6)))
    return np.asarray((factor * np.sign(np.diag(triangle))).ravel())


def violation(jacobian: FloatArray) -> float:
    """Return the sum that `rotation` minimises, from the matrix UJ alone, shape (6, n)."""
    velocity, axis = jacobian[:3], jacobian[3:]
    excess = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return float(np.sum(np.sum(velocity * axis, axis=0) ** 2) + np.sum(excess**2) / 4)


def rotation_rows(seed: int = 0, starts: int = 40) -> Iterator[row.ReproductionRow]:
    """Yield the row of the attempt to rotate (20) into a Jacobian of revolute joints."""
    solutions = row.search(rotation, random_rotation, starts, seed)
    feasible = [solution for solution in solutions if solution.violation <= _ORTHOGONAL]
    sums = np.array([violation(solution.outputs["jacobian"]) for solution in feasible])
    least = float(np.min(sums, initial=np.inf))
    same = int(np.sum(sums <= least + _SAME_SUM))
    searched = row.holds(bool(np.isfinite(least)))
    yield row.ReproductionRow(
        "after (20)",
        "least violation of v·ω = 0, |v| = |ω| = 1 over all UJ, sum of squares",
        "no U identified",
        row.shown(least),
        row.Verdict.IMPROVED if least <= _REVOLUTE else searched,
        f"columns scaled to norm² 2; {same} of {starts} random U end at this value, none "
        "lower; a numerical search, not a proof",
    )
