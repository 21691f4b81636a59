"""Solve a moment program with a general conic solver, through cvxpy."""

from collections.abc import Mapping
from typing import Any

import cvxpy as cp
import numpy as np

from formulations.bounds.so3_moments.programs.moment_program import ConicOutcome, MomentProgram
from nlp.conic import run


def solve_with_cvxpy(
    program: MomentProgram, solver: str, options: Mapping[str, Any] | None = None
) -> ConicOutcome:
    """Return the pseudo-moments and multipliers that a conic solver finds.

    Parameters
    ----------
    program
        The program.
    solver, options
        Conic solver known to cvxpy, and its own options.

    Raises
    ------
    InputError
        If there is no such solver.
    SolverOptionError
        If the solver has no such option.
    """
    unknowns = cp.Variable(program.moments - 1)
    conditions = []
    for block in program.blocks:
        size = block.shape[1]
        slopes = block[1:].reshape(program.moments - 1, -1).T
        value = cp.reshape(slopes @ unknowns + block[0].ravel(), (size, size), order="C")
        conditions.append(value >> 0)
    objective = cp.Minimize(program.objective[1:] @ unknowns + program.objective[0])
    question = cp.Problem(objective, conditions)
    status = run(question, solver, options)
    if unknowns.value is None or any(entry.dual_value is None for entry in conditions):
        return ConicOutcome(None, None, status)
    multipliers = tuple(np.asarray(entry.dual_value) for entry in conditions)
    symmetric = tuple(0.5 * (entry + entry.T) for entry in multipliers)
    stats = question.solver_stats
    iterations = None if stats is None else stats.num_iters
    return ConicOutcome(np.asarray(unknowns.value), symmetric, status, iterations)
