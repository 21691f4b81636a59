"""Section 4, 8R and more: eqs. (47)–(49), how readily optima are found, and their families."""

from collections import Counter
from collections.abc import Iterator
from functools import partial

import numpy as np

from formulations import measures, residual
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.measures.canonical import group_equivalent
from formulations.reproduction import reference, row
from formulations.reproduction.printed import (
    aligned,
    nearest_unit_revolute,
    product_slack,
    singular_value_slack,
)
from formulations.reproduction.searches import search
from formulations.reproduction.solution_family import (
    fills_tangent_space,
    least_slope,
    local_dimension,
    solve_near,
    trace_family,
)
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.problem import Solution

ARM = Arm.of(UnitRevolute(), 8)
_TOLERANCE = 1e-9
# A minimum of the sum of squares that is this close has converged to a solution.
_CONVERGED = 1e-6
_DISTINCT = 1e-3
_FAMILIES = "entire families"


def rows(seed: int = 0, starts: int = 50) -> Iterator[row.ReproductionRow]:
    """Rows of eqs. (47)–(49), of 'it immediately converges', and of the families."""
    printed, own = reference.OPTIMAL_8R, solutions(8, seed, starts)
    angles = [_polished(solution) for solution in own]
    try:
        start = solve_near(ARM, ARM.variables(nearest_unit_revolute(printed)))
    except InputError as reason:
        quantity = "an exactly isotropic matrix next to the printed one"
        yield row.claim("(47)", quantity, "exists", "none", False, str(reason))
        return
    yield from _printed_rows(printed, start)
    matrices = [ARM.jacobian(point) for point in angles]
    note = f"own solutions, polished; the value farthest from the paper's, to {_TOLERANCE:.0e}"
    for equation, quantity, root, measured in (
        ("(48)", "singular values", 8, measures.singular_values),
        ("(49)", "fσ_6 for f = 1, …, 8", 2, measures.locked_singular_values),
    ):
        expected = reference.SIGMA_8R if root == 8 else reference.WORST_CASE_8R
        paper, values = f"√({root}/3) = {row.shown(expected)}", list(map(measured, matrices))
        show = row.farthest(expected)
        yield row.compared(equation, quantity, paper, expected, values, note, _TOLERANCE, show)
    yield _convergence_row(8, own, "after (46)", "immediately converges")
    for n in (9, 10, 12):
        others = solutions(n, seed, min(starts, 20))
        yield _convergence_row(n, others, "Sec. 5", "7R is the only exception")
    yield from family_rows(start, angles)


def solutions(joints: int, seed: int, starts: int) -> list[Solution]:
    """Residual minimisation from random starts."""
    arm = Arm.of(UnitRevolute(), joints)
    build = partial(residual.build, arm, hessian="exact")
    return search(build, arm.sample, starts, seed, {"tol": 1e-12})


def _polished(solution: Solution) -> FloatArray:
    """Angles of an 8R solution after Gauss–Newton steps on the equations themselves.

    A sum of squares is flat at its zeros, most of all where families meet: minimising it
    leaves the singular values with half the digits. What is no solution stays as it is.
    """
    try:
        return solve_near(ARM, solution.variables)
    except InputError:
        return solution.variables


def _printed_rows(printed: FloatArray, angles: FloatArray) -> Iterator[row.ReproductionRow]:
    """Rows of (47) itself, and of its distance to the solution at these angles."""
    deviation = float(np.max(np.abs(printed @ printed.T - 8 / 3 * np.eye(6))))
    rounding = product_slack(printed)
    quantity = "singular values of the printed matrix"
    paper = f"√(8/3) = {row.shown(reference.SIGMA_8R)}"
    ours = row.shown_range(measures.singular_values(printed))
    note = (
        f"largest entry of JJᵀ − (8/3)I {deviation:.1e}; rounded entries allow {rounding:.1e}"
    )
    yield row.claim("(47)", quantity, paper, ours, deviation <= rounding, note)
    sigmas, expected = measures.locked_singular_values(printed), reference.WORST_CASE_8R
    slack = singular_value_slack(printed)
    quantity, paper = "fσ_6 of the printed matrix", f"√(2/3) = {row.shown(expected)}"
    note = f"rounded entries allow {slack:.1e}"
    yield row.compared("(47)", quantity, paper, expected, sigmas, note, slack, row.shown_range)
    exact = ARM.jacobian(angles)
    moved = float(np.max(np.abs(aligned(exact, printed) - printed)))
    tolerant = measures.is_optimally_failure_tolerant(exact, _TOLERANCE)
    slope = least_slope(ARM, angles)
    yield row.claim(
        "(47)",
        "distance of the printed matrix to an exactly isotropic one, any entry",
        "isotropic as designed",
        f"at most {moved:.1e}",
        tolerant and moved <= rounding / slope,
        f"the equations are flat here (slope {slope:.2f} at least), so that what rounding "
        f"leaves in JJᵀ allows {rounding / slope:.1e}",
    )


def _convergence_row(
    joints: int, answers: list[Solution], equation: str, paper: str
) -> row.ReproductionRow:
    matrices = [solution.outputs["jacobian"] for solution in answers]
    tolerant = sum(measures.is_optimally_failure_tolerant(j, _CONVERGED) for j in matrices)
    median = int(np.median([solution.status.iterations for solution in answers]))
    quantity = f"{joints}R: random starts that end at an optimally failure-tolerant J"
    note = f"to {_CONVERGED:.0e}, agrees if most do; {median} iterations in the median"
    ours, most = f"{tolerant} of {len(answers)}", 2 * tolerant > len(answers)
    return row.claim(equation, quantity, paper, ours, most, note)


def family_rows(
    start: FloatArray, optima: list[FloatArray], steps: int = 20
) -> Iterator[row.ReproductionRow]:
    """Rows of the family that the solution next to (47) belongs to, and of other optima's.

    Parameters
    ----------
    start
        Angles of that solution, in radians, shape (24,).
    optima
        Angles of other 8R optima.
    steps
        How many further optima are found along the curve.
    """
    size = local_dimension(ARM, start)
    filled = fills_tangent_space(ARM, start)
    yield row.claim(
        "after (46)",
        "dimension of the family of 8R optima around (47)",
        _FAMILIES,
        f"{size.family} = {size.angles} angles − {size.symmetries} symmetries − "
        f"{size.equations} equations",
        size.family >= 1 and filled,
        "ranks at the exact solution next to (47); solutions of the same rank were found in "
        f"{'every' if filled else 'not every'} tangent direction. Of 18 equations only "
        f"{size.equations} are independent here",
    )
    matrices = [ARM.jacobian(point) for point in trace_family(ARM, start, steps)]
    classes = len(group_equivalent(matrices, tolerance=_DISTINCT))
    tolerant = all(measures.is_optimally_failure_tolerant(j, _TOLERANCE) for j in matrices)
    sigmas = [measures.worst_case_sigma(matrix) for matrix in matrices]
    yield row.claim(
        "after (46)",
        f"distinct Jacobians among {len(matrices)} along a curve of 8R optima from (47)",
        _FAMILIES,
        classes,
        tolerant and classes == len(matrices),
        f"each optimally failure tolerant to {_TOLERANCE:.0e}; fσ_6 farthest from √(2/3): "
        f"{row.farthest(reference.WORST_CASE_8R)(sigmas)}; inner products of any two differ by "
        f"more than {_DISTINCT:.0e}",
    )
    sizes = Counter(local_dimension(ARM, point).family for point in optima)
    quantity = f"dimensions of the families around {len(optima)} own 8R optima"
    ours = ", ".join(f"{dimension} for {count}" for dimension, count in sorted(sizes.items()))
    note = (
        "by rank; 18 independent equations leave two dimensions, a third where their "
        "derivatives are dependent"
    )
    yield row.claim("after (46)", quantity, _FAMILIES, ours, min(sizes) >= 1, note)
