"""Section 4, 8R and more: eqs. (47)–(49), how readily optima are found, and their families.

Each function of rows yields rows of the report of ``reproduce``: what the paper prints, what is
computed here, and whether the two agree (`row.ReproductionRow`).

J is the Jacobian of n revolute joints, shape (6, n), with columns (v; ω) of |v| = |ω| = 1. A
point is a vector of its 3n angles α_1, β_1, γ_1, α_2, … in radians, eq. (21). "The equations"
are f_1 … f_21 of the Appendix, the entries of JJᵀ − (n/3)I; a solution is a point where all
are zero. fσ_6 is the smallest singular value after joint f has locked.

Near a solution of JJᵀ = (n/3)I the others form a manifold in the space of the 3n angles. The
symmetries (rotations of the frame, common phase) move along it without changing the
manipulator; what is left are truly different Jacobians, followed here by a
predictor–corrector method.

Of the 21 equations 18 are independent as functions, which leaves 24 − 4 − 18 = 2 dimensions
for 8R. That is a lower bound: on most of the solutions that random starts find, (47) among
them, the derivatives of the 18 are dependent and the family has three dimensions.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from functools import lru_cache, partial

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures, residual
from lockedjoint.formulations.isotropy_equations import appendix_residuals
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.reproduction import reference, row
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Solution

ARM = Arm.of(UnitRevolute(), 8)
# Tolerance with which polished solutions must agree with eqs. (48) and (49), and be isotropic.
_TOLERANCE = 1e-9
# A minimum of the sum of squares that is this close has converged to a solution.
_CONVERGED = 1e-6
# Inner products of columns of two distinct Jacobians differ by more than this.
_DISTINCT = 1e-3
_FAMILIES = "entire families"
# Numbers of joints for which "7R is the only exception" is tried, beside 8.
_MORE_JOINTS = (9, 10, 12)
# The largest number of random starts for each of them. More take longer.
_MOST_STARTS = 20
# Options of Ipopt: a smaller tolerance gives more digits of an angle.
_OPTIONS = {"tol": 1e-12}
# Singular values of the equations' derivative below this count as zero.
_RANK_TOLERANCE = 1e-6
# Shares of the largest singular value of the equations' derivative below which a direction is
# left out of a correction, tried in this order. The first leaves out directions that the
# equations hardly see: where the rank is about to drop, a full step goes far along them for
# nothing.
_CUTOFFS = (3e-3, 1e-6, 1e-8)
# Largest absolute value of an equation at a solution. Rounding leaves about 1e-15.
_RESIDUAL_TOLERANCE = 1e-13
# Number of corrections after which a cutoff is given up.
_CORRECTIONS = 50
# A solution in a tangent direction may be this many squared steps from the predicted point.
_LARGEST_CORRECTION = 10


def rows(seed: int = 0, starts: int = 50) -> Iterator[row.ReproductionRow]:
    """Yield the rows of eqs. (47)–(49), of 'it immediately converges', and of the families."""
    printed, own = reference.OPTIMAL_8R, solutions(8, seed, starts)
    angles = [_polished(solution) for solution in own]
    try:
        start = solve_near(ARM, ARM.variables(reference.nearest_unit_revolute(printed)))
    except InputError as reason:
        quantity = "an exactly isotropic matrix next to the printed one"
        yield row.claim("(47)", quantity, "exists", "none", False, str(reason))
        return
    yield from _printed_rows(printed, start)
    matrices = [ARM.jacobian(point) for point in angles]
    note = f"own solutions, polished; the value farthest from the paper's, to {_TOLERANCE:.0e}"
    sigma, worst = reference.SIGMA_8R, reference.WORST_CASE_8R
    values = list(map(measures.singular_values, matrices))
    paper, show = f"√(8/3) = {row.shown(sigma)}", row.farthest(sigma)
    yield row.compared("(48)", "singular values", paper, sigma, values, note, _TOLERANCE, show)
    values = list(map(measures.locked_singular_values, matrices))
    paper, show = f"√(2/3) = {row.shown(worst)}", row.farthest(worst)
    quantity = "fσ_6 for f = 1, …, 8"
    yield row.compared("(49)", quantity, paper, worst, values, note, _TOLERANCE, show)
    yield _convergence_row(8, own, "after (46)", "immediately converges")
    for n in _MORE_JOINTS:
        others = solutions(n, seed, min(starts, _MOST_STARTS))
        yield _convergence_row(n, others, "Sec. 5", "7R is the only exception")
    yield from _family_rows(start, angles)


def solutions(joints: int, seed: int, starts: int) -> list[Solution]:
    """Return what residual minimisation ends at, one solution per random start."""
    arm = Arm.of(UnitRevolute(), joints)
    build = partial(residual.build, arm, hessian="exact")
    return row.search(build, arm.sample, starts, seed, _OPTIONS)


def _polished(solution: Solution) -> FloatArray:
    """Return the 24 angles of an 8R solution after Gauss–Newton steps on the equations.

    A sum of squares is flat at its zeros, most of all where families meet: minimising it
    leaves the singular values with half the digits. What is no solution stays as it is.
    """
    try:
        return solve_near(ARM, solution.variables)
    except InputError:
        return solution.variables


def _printed_rows(printed: FloatArray, angles: FloatArray) -> Iterator[row.ReproductionRow]:
    """Yield the rows of (47) itself, and of its distance to the solution at these angles.

    `printed` is the matrix of the paper, shape (6, 8), `angles` have shape (24,).
    """
    deviation = float(np.max(np.abs(printed @ printed.T - 8 / 3 * np.eye(6))))
    rounding, slack = reference.product_slack(printed), reference.singular_value_slack(printed)
    quantity, true = "singular values of the printed matrix", deviation <= rounding
    paper = f"√(8/3) = {row.shown(reference.SIGMA_8R)}"
    ours = row.shown_range(measures.singular_values(printed))
    note = (
        f"largest entry of JJᵀ − (8/3)I {deviation:.1e}; rounded entries allow {rounding:.1e}"
    )
    yield row.claim("(47)", quantity, paper, ours, true, note)
    sigmas, expected = measures.locked_singular_values(printed), reference.WORST_CASE_8R
    quantity, paper = "fσ_6 of the printed matrix", f"√(2/3) = {row.shown(expected)}"
    note = f"rounded entries allow {slack:.1e}"
    yield row.compared("(47)", quantity, paper, expected, sigmas, note, slack, row.shown_range)
    exact, slope = ARM.jacobian(angles), least_slope(ARM, angles)
    moved = float(np.max(np.abs(reference.aligned(exact, printed) - printed)))
    tolerant = measures.is_optimally_failure_tolerant(exact, _TOLERANCE)
    quantity = "distance of the printed matrix to an exactly isotropic one, any entry"
    ours, true = f"at most {moved:.1e}", tolerant and moved <= rounding / slope
    note = (
        f"the equations are flat here (slope {slope:.2f} at least), so that what rounding "
        f"leaves in JJᵀ allows {rounding / slope:.1e}"
    )
    yield row.claim("(47)", quantity, "isotropic as designed", ours, true, note)


def _convergence_row(
    joints: int, answers: list[Solution], equation: str, paper: str
) -> row.ReproductionRow:
    """Return the row of how many random starts ended at an optimally failure-tolerant J."""
    matrices = [solution.outputs["jacobian"] for solution in answers]
    tolerant = sum(measures.is_optimally_failure_tolerant(j, _CONVERGED) for j in matrices)
    median = int(np.median([solution.status.iterations for solution in answers]))
    quantity = f"{joints}R: random starts that end at an optimally failure-tolerant J"
    note = f"to {_CONVERGED:.0e}, agrees if most do; {median} iterations in the median"
    ours, most = f"{tolerant} of {len(answers)}", 2 * tolerant > len(answers)
    return row.claim(equation, quantity, paper, ours, most, note)


def _family_rows(
    start: FloatArray, others: list[FloatArray], steps: int = 20
) -> Iterator[row.ReproductionRow]:
    """Yield the rows of the family of a solution, followed for `steps` steps, and of others.

    `start` and each of `others` are angles of 8R solutions, shape (24,).
    """
    where, (equations, symmetries) = "after (46)", local_ranks(ARM, start)
    family = ARM.size - equations - symmetries
    filled = fills_tangent_space(ARM, start)
    quantity = "dimension of the family of 8R optima around (47)"
    ours = f"{family} = {ARM.size} angles − {symmetries} symmetries − {equations} equations"
    note = (
        "ranks at the exact solution next to (47); solutions of the same rank were found in "
        f"{'every' if filled else 'not every'} tangent direction. Of 18 equations only "
        f"{equations} are independent here"
    )
    yield row.claim(where, quantity, _FAMILIES, ours, family >= 1 and filled, note)
    matrices = [ARM.jacobian(point) for point in trace_family(ARM, start, steps)]
    classes = len(group_equivalent(matrices, tolerance=_DISTINCT))
    tolerant = all(measures.is_optimally_failure_tolerant(j, _TOLERANCE) for j in matrices)
    sigmas = [measures.worst_case_sigma(matrix) for matrix in matrices]
    quantity = f"distinct Jacobians among {len(matrices)} along a curve of 8R optima from (47)"
    note = (
        f"each optimally failure tolerant to {_TOLERANCE:.0e}; fσ_6 farthest from √(2/3): "
        f"{row.farthest(reference.WORST_CASE_8R)(sigmas)}; inner products of any two differ by "
        f"more than {_DISTINCT:.0e}"
    )
    true = tolerant and classes == len(matrices)
    yield row.claim(where, quantity, _FAMILIES, classes, true, note)
    sizes = Counter(ARM.size - sum(local_ranks(ARM, point)) for point in others)
    quantity = f"dimensions of the families around {len(others)} own 8R optima"
    ours = ", ".join(f"{dimension} for {count}" for dimension, count in sorted(sizes.items()))
    note = (
        "by rank; 18 independent equations leave two dimensions, a third where their "
        "derivatives are dependent"
    )
    yield row.claim(where, quantity, _FAMILIES, ours, min(sizes) >= 1, note)


def local_ranks(arm: Arm, angles: FloatArray) -> tuple[int, int]:
    """Return two ranks around a solution; angles in radians, shape (3n,).

    Those of the derivative of the 21 equations, and of the directions in which only frame and
    phase change. What they leave of the angles is the family of different Jacobians.
    """
    matrices = (_equations(arm, angles)[1], symmetry_directions(arm, angles))
    first, second = (np.linalg.matrix_rank(matrix, tol=_RANK_TOLERANCE) for matrix in matrices)
    return int(first), int(second)


def least_slope(arm: Arm, angles: FloatArray) -> float:
    """Return the smallest nonzero singular value of the equations' derivative at a point.

    Angles whose equations are off by r can be r/slope from a solution, to first order.
    """
    values = np.linalg.svd(_equations(arm, angles)[1], compute_uv=False)
    return float(np.min(values[values > _RANK_TOLERANCE]))


def fills_tangent_space(arm: Arm, angles: FloatArray, step: float = 1e-3) -> bool:
    """Whether solutions lie in every direction that `local_ranks` leave.

    A rank alone bounds the dimension of the family from above. Here a step of length
    `step`, in radians, goes both ways along each tangent direction; if solutions fill the
    tangent space, a correction of the order of its square reaches one, of the same rank.
    """
    expected = local_ranks(arm, angles)
    for direction in _family_directions(arm, angles):
        for sign in (1.0, -1.0):
            predicted = angles + sign * step * direction
            try:
                solution = solve_near(arm, predicted)
            except InputError:
                return False
            far = np.linalg.norm(solution - predicted) > _LARGEST_CORRECTION * step**2
            if far or local_ranks(arm, solution) != expected:
                return False
    return True


def symmetry_directions(arm: Arm, angles: FloatArray) -> FloatArray:
    """Return the angle velocities of the three rotations of the frame and of the phase.

    Shape (4, 3n), the phase last. A rotation about e turns all v and ω as e×v and e×ω; the
    phase turns (v, ω) as (−ω, v). The angles that do so solve linear equations.
    """
    # J, shape (6, n), and the derivative of its entries by the angles, shape (6n, 3n).
    jacobian, derivative = map(np.array, _with_derivative(arm, Arm.matrix)(angles))
    velocity, axis = jacobian[:3], jacobian[3:]
    motions = [
        np.vstack([np.cross(unit, part, axisb=0).T for part in (velocity, axis)])
        for unit in np.eye(3)
    ]
    motions.append(np.vstack([-axis, velocity]))
    # CasADi stacks matrices column by column.
    targets = np.column_stack([motion.ravel(order="F") for motion in motions])
    return np.asarray(np.linalg.lstsq(derivative, targets, rcond=None)[0].T)


def solve_near(arm: Arm, angles: FloatArray) -> FloatArray:
    """Return the isotropic solution nearby that Gauss–Newton steps of least norm lead to.

    Angles in radians, shape (3n,), as the given ones. Raises InputError if they lead to none.
    """
    for cutoff in _CUTOFFS:
        point = angles
        for _ in range(_CORRECTIONS):
            values, derivative = _equations(arm, point)
            if np.max(np.abs(values)) <= _RESIDUAL_TOLERANCE:
                return point
            point = point - np.linalg.lstsq(derivative, values, rcond=cutoff)[0]
    raise InputError("angles", "far from any solution", "angles near an isotropic Jacobian")


def trace_family(
    arm: Arm, angles: FloatArray, steps: int = 20, length: float = 0.05
) -> list[FloatArray]:
    """Follow a curve of different solutions from near `angles`, radians, shape (3n,).

    Returns ``steps + 1`` solutions, predicted `length` radians apart. Raises InputError if the
    solution is isolated, or the curve is lost because `length` is too large.
    """
    points = [solve_near(arm, angles)]
    if sum(local_ranks(arm, points[0])) >= arm.size:
        raise InputError("angles", "an isolated solution", "a member of a family")
    direction = np.ones(arm.size)  # any first direction that is not normal to the family
    for _ in range(steps):
        # The last direction, projected onto the tangent space: the curve does not turn back.
        free = _family_directions(arm, points[-1])
        tangent = free.T @ (free @ direction)
        direction = tangent / np.linalg.norm(tangent)
        points.append(solve_near(arm, points[-1] + length * direction))
    return points


def _family_directions(arm: Arm, point: FloatArray) -> FloatArray:
    """Return orthonormal rows: directions normal to frame and phase that keep the equations.

    Shape (dimension of the family, 3n).
    """
    _, derivative = _equations(arm, point)
    fixed = np.vstack([derivative, symmetry_directions(arm, point)])
    _, values, vectors = np.linalg.svd(fixed)
    return np.asarray(vectors[int(np.sum(values > _RANK_TOLERANCE)) :])


def _equations(arm: Arm, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return f_1 … f_21 at a point, shape (21,), and their derivative, shape (21, 3n)."""
    values, derivative = _with_derivative(arm, appendix_residuals)(angles)
    return np.array(values).ravel(), np.array(derivative)


@lru_cache(maxsize=16)
def _with_derivative(arm: Arm, state: Callable[[Arm, ca.SX], ca.SX]) -> ca.Function:
    """Return a numeric function of the angles: an expression, and its derivative.

    A matrix of expressions is differentiated column by column.
    """
    angles = arm.symbols()
    expression = state(arm, angles)
    derivative = ca.jacobian(ca.vec(expression), angles)
    return ca.Function("with_derivative", [angles], [expression, derivative])
