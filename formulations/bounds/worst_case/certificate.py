"""Check, in plain NumPy, that multipliers prove a bound on the worst case.

Lengths are scaled so that the trace limit is m; b_k below is the scaled right-hand side. The
bound is the semidefinite program (primal, with s the scaled 1/t and M' = M/t)

    minimise s   subject to   tr Y ≤ n − m,  B = [[Y, I], [I, M' − I]] ⪰ 0,
                              ⟨A_k, M'⟩ = s b_k  or  ⟨A_k, M'⟩ ≤ s b_k,

the first fact being tr M' ≤ s m. For μ ≥ 0, Z = [[Z₁₁, Z₁₂], [Z₂₁, Z₂₂]] ⪰ 0 and ν_k (≥ 0 for
inequalities) with Z₁₁ = μI, Z₂₂ = Σ ν_k A_k and Σ ν_k b_k = 1, every feasible s is at least

    d = −μ(n − m) − 2 tr Z₁₂ + tr Z₂₂.

A solver's multipliers satisfy this only approximately. Here the equations are enforced, and a
negative λ = λ_min(Z) that results is accounted for: ⟨Z, B⟩ ≥ λ tr B, and
tr B ≤ n − 2m + s m, so s ≥ (d + λ(n − 2m))/(1 − λ m).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from formulations.bounds.worst_case.problem import LinearFact, WorstCase
from nlp.arrays import FloatArray, finite_or_none


@dataclass(frozen=True, eq=False)
class WorstCaseMultipliers:
    """Dual variables of the bound, as a solver returned them.

    Parameters
    ----------
    matrix
        Z, 2m×2m, of the matrix inequality B ⪰ 0.
    redundancy
        μ, of tr Y ≤ n − m.
    facts
        ν_k, of the trace limit first and of the facts in their order.
    """

    matrix: FloatArray
    redundancy: float
    facts: tuple[float, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**vars(self), "matrix": self.matrix.tolist(), "facts": list(self.facts)}


@dataclass(frozen=True)
class WorstCaseCertificate:
    """What the multipliers prove once their violations are accounted for.

    Parameters
    ----------
    dual_value
        d of the multipliers as the solver returned them.
    residual
        Largest violation of the dual equations by those multipliers.
    smallest_eigenvalue
        λ_min(Z) after the equations were enforced.
    proved_value
        The lower limit of s that remains; minus infinity if nothing is proved.
    """

    dual_value: float
    residual: float
    smallest_eigenvalue: float
    proved_value: float

    def to_dict(self) -> dict[str, float | None]:
        """Return plain values; None stands for an infinite one."""
        return {name: finite_or_none(value) for name, value in vars(self).items()}


def check_multipliers(
    problem: WorstCase, multipliers: WorstCaseMultipliers
) -> WorstCaseCertificate:
    """Return what the multipliers prove, by weak duality, wherever they come from.

    Parameters
    ----------
    problem
        The class of Jacobians.
    multipliers
        Any numbers of the right shapes; they need not be optimal or even feasible.
    """
    m, facts, mu = problem.task_dimension, problem.scaled_facts(), multipliers.redundancy
    z = 0.5 * (multipliers.matrix + multipliers.matrix.T)
    nu, matrices = np.array(multipliers.facts), np.stack([fact.matrix for fact in facts])
    at_most = np.array([fact.relation == "at most" for fact in facts])
    violations = [
        np.abs(z[:m, :m] - mu * np.eye(m)).max(),
        np.abs(z[m:, m:] - np.tensordot(nu, matrices, axes=1)).max(),
        abs(_total(nu, facts) - 1.0),
        max(0.0, -mu, *-nu[at_most]),
    ]
    residual, dual_value = float(max(violations)), _dual_value(problem, z, mu)

    nu = np.where(at_most, np.maximum(nu, 0.0), nu)
    total = _total(nu, facts)
    if not (math.isfinite(total) and total > 0 and np.isfinite(z).all()):
        return WorstCaseCertificate(dual_value, residual, -math.inf, -math.inf)
    nu, z = nu / total, z / total
    mu = max(float(np.trace(z[:m, :m])) / m, 0.0)
    z[:m, :m] = mu * np.eye(m)
    z[m:, m:] = np.tensordot(nu, matrices, axes=1)
    smallest = float(np.linalg.eigvalsh(z)[0])
    # Rounding in eigvalsh is of the order of the machine precision times the norm.
    shortfall = min(smallest - 2 * m * np.finfo(float).eps * float(np.linalg.norm(z)), 0.0)
    value = _dual_value(problem, z, mu) + shortfall * (problem.joints - 2 * m)
    proved = float(value / (1 - shortfall * m))
    return WorstCaseCertificate(dual_value, residual, smallest, proved)


def _total(nu: Iterable[float], facts: Iterable[LinearFact]) -> float:
    return float(sum(v * fact.value for v, fact in zip(nu, facts, strict=True)))


def _dual_value(problem: WorstCase, z: FloatArray, mu: float) -> float:
    m = problem.task_dimension
    linear = np.trace(z[m:, m:]) - 2.0 * np.trace(z[:m, m:])
    return float(linear - mu * (problem.joints - m))
