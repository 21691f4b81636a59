"""The best worst case after one locked joint, bounded by a semidefinite program (cvxpy).

The program, its dual and what a certificate proves are stated in `worst_case_certificate`.
Where nothing is known of JJᵀ but its trace, the optimum is eq. (6); with more linear facts the
same program gives bounds that have no closed form.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from formulations.bounds.worst_case.bound import SdpBound
from formulations.bounds.worst_case.certificate import (
    WorstCaseMultipliers,
    check_multipliers,
    scaled_facts,
)
from formulations.bounds.worst_case.problem import LinearFact, WorstCase, free_columns
from nlp.conic import run


@dataclass(frozen=True, eq=False)
class WorstCaseProgram:
    """The program in cvxpy, with the constraints whose multipliers are read afterwards."""

    program: cp.Problem
    semidefinite: cp.Constraint
    redundancy: cp.Constraint
    facts: tuple[cp.Constraint, ...]


def build_program(problem: WorstCase) -> WorstCaseProgram:
    """State the bound in cvxpy, without solving it.

    Parameters
    ----------
    problem
        The class of Jacobians.
    """
    n, m = problem.joints, problem.task_dimension
    inverse_t = cp.Variable(name="scaled 1/t")
    matrix = cp.Variable((m, m), symmetric=True, name="M/t")
    y = cp.Variable((m, m), symmetric=True, name="Y")
    identity = np.eye(m)
    semidefinite = cp.bmat([[y, identity], [identity, matrix - identity]]) >> 0
    redundancy = cp.trace(y) <= n - m
    facts = tuple(_stated(fact, matrix, inverse_t) for fact in scaled_facts(problem))
    program = cp.Problem(cp.Minimize(inverse_t), [semidefinite, redundancy, *facts])
    return WorstCaseProgram(program, semidefinite, redundancy, facts)


def solve_bound(
    joints: int,
    task_dimension: int,
    *,
    trace: float | None = None,
    solver: str = "CLARABEL",
    options: Mapping[str, Any] | None = None,
) -> SdpBound:
    """Bound the worst case of every m×n Jacobian with tr JJᵀ at most `trace`.

    Parameters
    ----------
    joints
        Number n of columns.
    task_dimension
        Number m of rows, less than n.
    trace
        Upper limit of tr JJᵀ; by default m, which is σ = 1 in eq. (6).
    solver, options
        Conic solver known to cvxpy, and its own options.

    Raises
    ------
    InputError
        Unless 1 ≤ m < n and the trace is positive and finite.

    Notes
    -----
    Maciejewski and Roberts (1995), eqs. (5) and (6).
    """
    problem = free_columns(joints, task_dimension, trace=trace)
    return solve_worst_case(problem, solver=solver, options=options)


def solve_worst_case(
    problem: WorstCase, *, solver: str = "CLARABEL", options: Mapping[str, Any] | None = None
) -> SdpBound:
    """Bound the worst case of a class of Jacobians.

    Parameters
    ----------
    problem
        The class, e.g. from `free_columns` or `revolute_arm`.
    solver, options
        Conic solver known to cvxpy, and its own options.

    Returns
    -------
    SdpBound
        Also when the solver fails: see its `status`.
    """
    began = time.perf_counter()
    stated = build_program(problem)
    status = run(stated.program, solver, options)
    multipliers = _multipliers(stated)
    certificate = None if multipliers is None else check_multipliers(problem, multipliers)
    proved = -math.inf if certificate is None else certificate.proved_value
    unit = problem.trace / problem.task_dimension
    value = stated.program.value
    return SdpBound(
        problem=problem,
        eigenvalue_bound=unit / proved if proved > 0 else math.inf,
        primal_value=None if value is None else float(value),
        multipliers=multipliers,
        certificate=certificate,
        solver=solver,
        status=status,
        seconds=time.perf_counter() - began,
    )


def _stated(fact: LinearFact, matrix: cp.Variable, inverse_t: cp.Variable) -> cp.Constraint:
    left = cp.sum(cp.multiply(fact.matrix, matrix))
    right = inverse_t * fact.value
    return left == right if fact.relation == "equal" else left <= right


def _multipliers(stated: WorstCaseProgram) -> WorstCaseMultipliers | None:
    values = [c.dual_value for c in (stated.semidefinite, stated.redundancy, *stated.facts)]
    if any(value is None for value in values):
        return None
    matrix, redundancy, *facts = values
    return WorstCaseMultipliers(
        np.array(matrix), float(redundancy), tuple(float(value) for value in facts)
    )
