"""The best worst case after one locked joint, bounded by a semidefinite program (cvxpy).

The program, its dual and what a certificate proves are stated in `certificate`. Where only the
trace of JJᵀ is known, the optimum is eq. (6); with more linear facts the same program gives
bounds that have no closed form.
"""

from __future__ import annotations

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
    scaled_facts,
)
from formulations.bounds.worst_case.problem import LinearFact, WorstCase
from nlp.arrays import finite_or_none
from nlp.conic import run


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

    @property
    def primal_eigenvalue(self) -> float | None:
        """The t that the solver reports, unchecked, in the squared units of J."""
        return self._unscaled(self.primal_value)

    @property
    def dual_eigenvalue(self) -> float | None:
        """The t of the solver's multipliers, unchecked, in the squared units of J."""
        return self._unscaled(None if self.certificate is None else self.certificate.dual_value)

    def _unscaled(self, value: float | None) -> float | None:
        scaled = finite_or_none(value)
        return self.problem.unit / scaled if scaled is not None and scaled > 0 else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON; None stands for a bound that is infinite."""
        closed_form = self.problem.closed_form
        certificate, multipliers = self.certificate, self.multipliers
        return {
            "kind": "numerical",
            "joints": self.problem.joints,
            "task_dimension": self.problem.task_dimension,
            "trace": self.problem.trace,
            "facts": [fact.name for fact in self.problem.facts],
            "eigenvalue_bound": finite_or_none(self.eigenvalue_bound),
            "singular_value_bound": finite_or_none(self.singular_value_bound),
            "closed_form_eigenvalue_bound": closed_form,
            "closed_form_singular_value_bound": (
                None if closed_form is None else math.sqrt(closed_form)
            ),
            "primal_eigenvalue": self.primal_eigenvalue,
            "dual_eigenvalue": self.dual_eigenvalue,
            "certificate": None if certificate is None else certificate.to_dict(),
            "multipliers": None if multipliers is None else multipliers.to_dict(),
            "solver": self.solver,
            "status": self.status,
            "seconds": self.seconds,
        }


@dataclass(frozen=True, eq=False)
class _Program:
    """The program in cvxpy, with the constraints whose multipliers are read afterwards."""

    program: cp.Problem
    semidefinite: cp.Constraint
    redundancy: cp.Constraint
    facts: tuple[cp.Constraint, ...]


def _program(problem: WorstCase) -> _Program:
    """State the bound in cvxpy, without solving it."""
    n, m = problem.joints, problem.task_dimension
    inverse_t = cp.Variable(name="scaled 1/t")
    matrix = cp.Variable((m, m), symmetric=True, name="M/t")
    y = cp.Variable((m, m), symmetric=True, name="Y")
    identity = np.eye(m)
    semidefinite = cp.bmat([[y, identity], [identity, matrix - identity]]) >> 0
    redundancy = cp.trace(y) <= n - m
    facts = tuple(_stated(fact, matrix, inverse_t) for fact in scaled_facts(problem))
    program = cp.Problem(cp.Minimize(inverse_t), [semidefinite, redundancy, *facts])
    return _Program(program, semidefinite, redundancy, facts)


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
    stated = _program(problem)
    status = run(stated.program, solver, options)
    multipliers = _multipliers(stated)
    certificate = None if multipliers is None else check_multipliers(problem, multipliers)
    proved = -math.inf if certificate is None else certificate.proved_value
    return SdpBound(
        problem=problem,
        eigenvalue_bound=problem.unit / proved if proved > 0 else math.inf,
        primal_value=finite_or_none(stated.program.value),
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


def _multipliers(stated: _Program) -> WorstCaseMultipliers | None:
    values = [c.dual_value for c in (stated.semidefinite, stated.redundancy, *stated.facts)]
    if any(value is None for value in values):
        return None
    matrix, redundancy, *facts = values
    return WorstCaseMultipliers(
        np.array(matrix), float(redundancy), tuple(float(value) for value in facts)
    )
