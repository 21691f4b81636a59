"""Eq. (6) as a semidefinite program: the best worst case that traces of blocks of JJᵀ allow.

With M' = JJᵀ/t and s = T/(mt), tr JJᵀ ≤ T, the largest t is at the least s with

    tr Y ≤ n − m,   B = [[Y, I], [I, M' − I]] ⪰ 0,   ⟨A_k, M'⟩ ≤ s b_k for all k,

where A_k projects on a block of rows. docs/bounds.md, section 1, derives it, and what the
multipliers Z of B, μ and ν of the others prove of s.
"""

import math
import time
from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np

from formulations.bounds.closed_form import block_trace_bound
from formulations.conic import SOLVER, run
from nlp.arrays import FloatArray, finite_or_none, whole_number
from nlp.errors import InputError


def worst_case_bound(
    joints: int,
    rows: Sequence[int],
    traces: Sequence[float],
) -> dict[str, Any]:
    """Return an upper bound on t and on the measure (5), its root, as plain values for JSON.

    `rows` are the numbers of rows of blocks of J, which add up to m < n, and `traces` limits of
    the trace of JJᵀ on each: (m,) and (T,) if only ‖J‖_F² ≤ T, (3, 3) and (nℓ², n) for revolute
    joints, |v| ≤ ℓ. It is what the multipliers prove, or None where that is nothing.
    """
    m = whole_number("task dimension", sum(rows), 1, 40)  # more take over a minute
    closed_form = block_trace_bound(joints, rows, traces)
    if not all(1e-200 <= trace / joints <= 1e200 for trace in traces):
        raise InputError("traces", list(traces), "1e-200 to 1e200 for each joint")
    began, total, eye = time.perf_counter(), float(sum(traces)), np.eye(m)
    limits = np.array(traces) * m / total
    s, gram, y = cp.Variable(), *(cp.Variable((m, m), symmetric=True) for _ in range(2))
    conditions = [cp.bmat([[y, eye], [eye, gram - eye]]) >> 0, cp.trace(y) <= joints - m]
    blocks = zip(np.split(np.arange(m), np.cumsum(rows)[:-1]), limits, strict=True)
    conditions += [cp.sum(cp.diag(gram)[block]) <= s * b for block, b in blocks]
    status = run(cp.Problem(cp.Minimize(s), conditions))
    z, mu, *nu = (np.full(c.shape, c.dual_value, float).tolist() for c in conditions)  # or NaN
    certificate = check_multipliers(joints, rows, limits, np.array(z), mu, np.array(nu))
    t = total / m / certificate["proved_value"] if certificate["proved_value"] > 0 else None
    return {
        "kind": "numerical",
        "joints": joints,
        "task_dimension": m,
        "trace": total,
        "facts": [f"block trace ≤ {trace:g}" for trace in traces if trace < total],
        "eigenvalue_bound": t,
        "singular_value_bound": t and math.sqrt(t),
        "closed_form_eigenvalue_bound": closed_form,
        "closed_form_singular_value_bound": math.sqrt(closed_form),
        "primal_eigenvalue": finite_or_none(s.value) and total / m / float(s.value),
        "certificate": {name: finite_or_none(value) for name, value in certificate.items()},
        "multipliers": t and {"matrix": z, "redundancy": mu, "facts": nu},
        "solver": SOLVER,
        "status": status,
        "seconds": time.perf_counter() - began,
    }


def check_multipliers(
    joints: int, rows: Sequence[int], b: FloatArray, z: FloatArray, mu: float, nu: FloatArray
) -> dict[str, float]:
    """Return what Z, μ and ν prove of s, given b_k of the blocks, and what they violate."""
    m, z, positive = sum(rows), 0.5 * (z + z.T), np.maximum(nu, 0)

    def enforced(mu: float, nu: FloatArray) -> FloatArray:
        return np.block(
            [[mu * np.eye(m), z[:m, m:]], [z[m:, :m], np.diag(np.repeat(nu, rows))]]
        )

    def dual_value(z: FloatArray) -> float:
        return float(np.trace(z[m:, m:] - 2 * z[:m, m:] - (joints - m) / m * z[:m, :m]))

    violated = [np.abs(z - enforced(mu, nu)).max(), abs(b @ nu - 1), -mu, *-nu]
    result = {"dual_value": dual_value(z), "residual": float(max(violated))}
    smallest = proved = -math.inf
    if (total := b @ positive) > 0 and np.isfinite(z).all():
        y = enforced(max(np.trace(z[:m, :m]) / m, 0), positive) / total
        smallest = float(np.linalg.eigvalsh(y)[0])
        # Rounding in eigvalsh is of the order of the machine precision times the norm.
        excess = min(smallest - 2 * m * np.finfo(float).eps * float(np.linalg.norm(y)), 0.0)
        proved = (dual_value(y) + excess * (joints - 2 * m)) / (1 - excess * m)
    return result | {"smallest_eigenvalue": smallest, "proved_value": proved}
