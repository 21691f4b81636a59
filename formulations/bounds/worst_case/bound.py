"""A numerical bound on the worst case, with everything needed to check it again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from formulations.bounds.worst_case.certificate import (
    WorstCaseCertificate,
    WorstCaseMultipliers,
)
from formulations.bounds.worst_case.problem import WorstCase


@dataclass(frozen=True, eq=False)
class SdpBound:
    """A numerical bound on the worst case after one locked joint.

    `status` is the solver's own word. `eigenvalue_bound` rests on `certificate` alone: it is
    what the multipliers prove in floating point, whatever the solver says. It is infinite if
    they prove nothing.

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
        if value is None or not (math.isfinite(value) and value > 0):
            return None
        return self.problem.trace / self.problem.task_dimension / value

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON; None stands for a bound that is infinite."""
        closed_form = self.problem.closed_form
        multipliers = self.multipliers
        bound = self.eigenvalue_bound if math.isfinite(self.eigenvalue_bound) else None
        return {
            "kind": "numerical",
            "joints": self.problem.joints,
            "task_dimension": self.problem.task_dimension,
            "trace": self.problem.trace,
            "facts": [fact.name for fact in self.problem.facts],
            "eigenvalue_bound": bound,
            "singular_value_bound": None if bound is None else math.sqrt(bound),
            "closed_form_eigenvalue_bound": closed_form,
            "closed_form_singular_value_bound": (
                None if closed_form is None else math.sqrt(closed_form)
            ),
            "primal_eigenvalue": self.primal_eigenvalue,
            "dual_eigenvalue": self.dual_eigenvalue,
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
            "multipliers": None
            if multipliers is None
            else {
                "matrix": multipliers.matrix.tolist(),
                "redundancy": multipliers.redundancy,
                "facts": list(multipliers.facts),
            },
            "solver": self.solver,
            "status": self.status,
            "seconds": self.seconds,
        }
