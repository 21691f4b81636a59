"""Smallest singular values of many Jacobians at once, whole and after any one joint locks.

The same quantities as `formulations.measures.jacobian` has for one matrix, for stacks of them.
"""

from __future__ import annotations

import numpy as np

from nlp.arrays import FloatArray

CHUNK = 1 << 16


def smallest(jacobians: FloatArray) -> FloatArray:
    """σ_m of each Jacobian, shape (…) for (…, m, n): before a failure."""
    return np.asarray(np.linalg.svd(jacobians, compute_uv=False)[..., -1])


def worst_cases(jacobians: FloatArray) -> FloatArray:
    """Smallest σ_m over the one joint that locks, shape (…) for (…, m, n), n > m (eq. 5)."""
    *lead, m, n = jacobians.shape
    flat = jacobians.reshape(-1, m, n)
    kept = np.array([[k for k in range(n) if k != locked] for locked in range(n)])
    chunk = max(1, CHUNK // n)
    parts = [
        smallest(np.moveaxis(flat[at : at + chunk][:, :, kept], 1, 2)).min(axis=-1)
        for at in range(0, len(flat), chunk)
    ]
    return np.concatenate(parts).reshape(lead)
