"""Section 4, 8R and more: eqs. (47)–(49), and how readily optima are found."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import measures, residual
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.reproduction import reference
from formulations.reproduction.nearest import aligned, nearest_unit_revolute
from formulations.reproduction.rounding import product_slack, singular_value_slack
from formulations.reproduction.row import Row, Verdict, shown
from formulations.reproduction.searches import jacobians, search
from formulations.reproduction.solution_family import least_slope, solve_near
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.solution import Solution

ARM = Arm.of(UnitRevolute(), 8)
_TOLERANCE = 1e-9
# A minimum of the sum of squares that is this close has converged to a solution.
_CONVERGED = 1e-6
_DECIMALS = reference.MATRIX_DECIMALS


def rows(
    seed: int = 0, starts: int = 50, printed: FloatArray = reference.OPTIMAL_8R
) -> Iterator[Row]:
    """Rows of eqs. (47)–(49) and of 'it immediately converges'."""
    yield _isotropic_row(printed)
    yield _locked_row(printed)
    yield _exact_row(printed)
    found = solutions(8, seed, starts)
    matrices = [ARM.jacobian(polished(solution)) for solution in found]
    values = np.concatenate([measures.singular_values(matrix) for matrix in matrices])
    yield _value_row("(48)", "singular values", "√(8/3)", reference.SIGMA_8R, values)
    values = np.concatenate([measures.locked_singular_values(matrix) for matrix in matrices])
    quantity = "fσ_6 for f = 1, …, 8"
    yield _value_row("(49)", quantity, "√(2/3)", reference.WORST_CASE_8R, values)
    yield _convergence_row(8, found, "after (46)", "immediately converges")
    for n in (9, 10, 12):
        others = solutions(n, seed, min(starts, 20))
        yield _convergence_row(n, others, "Sec. 5", "7R is the only exception")


def solutions(joints: int, seed: int, starts: int) -> list[Solution]:
    """Residual minimisation from random starts."""
    arm = Arm.of(UnitRevolute(), joints)
    return search(
        lambda: residual.build(arm),
        arm.sample,
        starts=starts,
        seed=seed,
        options={"tol": 1e-12},
    )


def polished(solution: Solution) -> FloatArray:
    """Angles of an 8R solution after Gauss–Newton steps on the equations themselves.

    A sum of squares is flat at its zeros, most of all where families meet: minimising it
    leaves the singular values with half the digits. What is no solution stays as it is.
    """
    try:
        return solve_near(ARM, solution.variables)
    except InputError:
        return solution.variables


def _isotropic_row(printed: FloatArray) -> Row:
    deviation = float(np.max(np.abs(printed @ printed.T - 8 / 3 * np.eye(6))))
    slack = product_slack(printed, _DECIMALS)
    values = measures.singular_values(printed)
    ours = f"{shown(values[-1])} to {shown(values[0])}"
    note = f"largest entry of JJᵀ − (8/3)I {deviation:.1e}; rounded entries allow {slack:.1e}"
    paper = f"√(8/3) = {shown(reference.SIGMA_8R)}"
    verdict = holds(deviation <= slack)
    return Row("(47)", "singular values of the printed matrix", paper, ours, verdict, note)


def _locked_row(printed: FloatArray) -> Row:
    sigmas = measures.locked_singular_values(printed)
    slack = singular_value_slack(printed, _DECIMALS)
    verdict = equal(reference.WORST_CASE_8R, sigmas, slack)
    ours = f"{shown(sigmas.min())} to {shown(sigmas.max())}"
    paper = f"√(2/3) = {shown(reference.WORST_CASE_8R)}"
    note = f"rounded entries allow {slack:.1e}"
    return Row("(47)", "fσ_6 of the printed matrix", paper, ours, verdict, note)


def _exact_row(printed: FloatArray) -> Row:
    quantity = "distance of the printed matrix to an exactly isotropic one, any entry"
    paper = "isotropic as designed"
    try:
        angles = solve_near(ARM, ARM.variables(nearest_unit_revolute(printed)))
    except InputError as reason:
        return Row("(47)", quantity, paper, "none", Verdict.MISMATCH, str(reason))
    exact = ARM.jacobian(angles)
    moved = float(np.max(np.abs(aligned(exact, printed) - printed)))
    tolerant = measures.is_optimally_failure_tolerant(exact, _TOLERANCE)
    slope = least_slope(ARM, angles)
    slack = product_slack(printed, _DECIMALS) / slope
    note = (
        f"the equations are flat here (slope {slope:.2f} at least), so that what rounding "
        f"leaves in JJᵀ allows {slack:.1e}"
    )
    ours = f"at most {moved:.1e}"
    return Row("(47)", quantity, paper, ours, holds(tolerant and moved <= slack), note)


def _value_row(
    equation: str, quantity: str, form: str, expected: float, values: FloatArray
) -> Row:
    farthest = values[np.argmax(np.abs(values - expected))]
    paper = f"{form} = {shown(expected)}"
    verdict = equal(expected, values, _TOLERANCE)
    note = f"own solutions, polished; the value farthest from the paper's, to {_TOLERANCE:.0e}"
    return Row(equation, quantity, paper, shown(farthest), verdict, note)


def _convergence_row(joints: int, found: list[Solution], equation: str, paper: str) -> Row:
    tolerant = [
        measures.is_optimally_failure_tolerant(matrix, _CONVERGED)
        for matrix in jacobians(found)
    ]
    iterations = [solution.status.iterations for solution in found]
    return Row(
        equation,
        f"{joints}R: random starts that end at an optimally failure-tolerant J",
        paper,
        f"{sum(tolerant)} of {len(found)}",
        holds(2 * sum(tolerant) > len(found)),
        f"to {_CONVERGED:.0e}, agrees if most do; {int(np.median(iterations))} iterations in "
        "the median",
    )
