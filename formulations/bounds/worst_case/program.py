"""The best worst case after one locked joint, bounded by a semidefinite program (cvxpy).

The program, its dual and what a certificate proves are stated in `certificate`. Where only the
trace of JJᵀ is known, the optimum is eq. (6); with more linear facts the same program gives
bounds that have no closed form.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from formulations.bounds.worst_case.certificate import (
    WorstCaseCertificate,
    WorstCaseMultipliers,
    check_multipliers,
)
from formulations.bounds.worst_case.problem import WorstCase
from nlp.arrays import finite_or_none
from nlp.conic import check_solver, run


@dataclass(frozen=True, eq=False)
class SdpBound:
    """A numerical bound on the worst case after one locked joint.

    `eigenvalue_bound` rests on `certificate` alone: it is what the multipliers prove in
    floating point, whatever `status` the solver reports. It is infinite if they prove nothing.

    Parameters
    ----------
    problem
        The class of Jacobians that was bounded.
    eigenvalue_bound
        Upper bound on t, in the squared units of J.
    primal_value
        Optimum s that the solver reports, or None. It is scaled: t = (trace/m)/s.
    multipliers, certificate
        The dual variables and their independent check, or None if the solver gave none.
    solver, status
        Name of the solver and what it reported.
    seconds
        Wall time of building and solving.
    """

    problem: WorstCase
    eigenvalue_bound: float
    primal_value: float | None
    multipliers: WorstCaseMultipliers | None
    certificate: WorstCaseCertificate | None
    solver: str
    status: str
    seconds: float

    @property
    def singular_value_bound(self) -> float:
        """Upper bound on the measure (5), in the units of J."""
        return math.sqrt(self.eigenvalue_bound)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON; None stands for a bound that is infinite."""
        problem, certificate, multipliers = self.problem, self.certificate, self.multipliers
        closed_form = problem.closed_form
        return {
            "kind": "numerical",
            "joints": problem.joints,
            "task_dimension": problem.task_dimension,
            "trace": problem.trace,
            "facts": [fact.name for fact in problem.facts],
            "eigenvalue_bound": finite_or_none(self.eigenvalue_bound),
            "singular_value_bound": finite_or_none(self.singular_value_bound),
            "closed_form_eigenvalue_bound": closed_form,
            "closed_form_singular_value_bound": closed_form and math.sqrt(closed_form),
            # What the solver reports, unchecked, of the primal and of the dual program.
            "primal_eigenvalue": self._eigenvalue(self.primal_value),
            "dual_eigenvalue": None
            if certificate is None
            else self._eigenvalue(certificate.dual_value),
            "certificate": certificate and certificate.to_dict(),
            "multipliers": multipliers and multipliers.to_dict(),
            "solver": self.solver,
            "status": self.status,
            "seconds": self.seconds,
        }

    def _eigenvalue(self, scaled: float | None) -> float | None:
        value = finite_or_none(scaled)
        return self.problem.unit / value if value is not None and value > 0 else None


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
    check_solver(solver)
    began = time.perf_counter()
    program = _program(problem)
    status = run(program, solver, options)
    values = [constraint.dual_value for constraint in program.constraints]
    multipliers, certificate, proved = None, None, -math.inf
    if all(value is not None for value in values):
        matrix, redundancy, *facts = values
        multipliers = WorstCaseMultipliers(
            np.array(matrix), float(redundancy), tuple(map(float, facts))
        )
        certificate = check_multipliers(problem, multipliers)
        proved = certificate.proved_value
    return SdpBound(
        problem=problem,
        eigenvalue_bound=problem.unit / proved if proved > 0 else math.inf,
        primal_value=finite_or_none(program.value),
        multipliers=multipliers,
        certificate=certificate,
        solver=solver,
        status=status,
        seconds=time.perf_counter() - began,
    )


def _program(problem: WorstCase) -> cp.Problem:
    """State the program; its constraints are in the order of the multipliers."""
    n, m, identity = problem.joints, problem.task_dimension, np.eye(problem.task_dimension)
    inverse_t = cp.Variable(name="scaled 1/t")
    matrix = cp.Variable((m, m), symmetric=True, name="M/t")
    y = cp.Variable((m, m), symmetric=True, name="Y")
    constraints = [cp.bmat([[y, identity], [identity, matrix - identity]]) >> 0]
    constraints.append(cp.trace(y) <= n - m)
    for fact in problem.scaled_facts():
        left, right = cp.sum(cp.multiply(fact.matrix, matrix)), inverse_t * fact.value
        constraints.append(left == right if fact.relation == "equal" else left <= right)
    return cp.Problem(cp.Minimize(inverse_t), constraints)
