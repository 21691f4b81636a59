"""Max-min by smoothing: Schatten norms of the inverses stand for smallest eigenvalues.

Minimises log (Σ_f tr M_f⁻ᵖ)^{1/p}, M_f = JJᵀ − j_f j_fᵀ, for growing p by SciPy's L-BFGS, each
from the last one's answer. For p → ∞ it is −log of the smallest eigenvalue of all.
"""

from __future__ import annotations

import numpy as np

from formulations import max_min
from formulations.joints.arm import Arm
from formulations.studies.benchmark import unit_revolute as hand
from formulations.studies.benchmark.peer import Peer, Run, each
from nlp.arrays import FloatArray

_POWERS = (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)


def _smoothed(angles: FloatArray, power: float) -> tuple[float, FloatArray]:
    matrix = hand.jacobian(angles)
    gram = matrix @ matrix.T
    grams = gram - np.einsum("an,bn->nab", matrix, matrix)
    values, vectors = np.linalg.eigh(grams)
    logs = -np.log(np.maximum(values, 1e-12))
    top = logs.max()
    shares = np.exp(power * (logs - top))
    total = shares.sum()
    weights = shares / total / np.maximum(values, 1e-12)
    slopes = -np.einsum("nak,nk,nbk->nab", vectors, weights, vectors)
    slope = 2 * (slopes.sum(axis=0) @ matrix - np.einsum("nab,bn->an", slopes, matrix))
    return float(top + np.log(total) / power), hand.chain(angles, slope)


def _prepare(arm: Arm, batch: int) -> Run:  # noqa: ARG001
    from scipy.optimize import minimize

    def one(start: FloatArray) -> FloatArray:
        x = start
        for power in _POWERS:
            options = {"maxiter": 2000, "maxfun": 4000}
            x = minimize(
                _smoothed, x, (power,), jac=True, method="L-BFGS-B", tol=1e-12, options=options
            ).x
        return hand.jacobian(x)

    return each(one, arm.shape)


PEERS = (
    Peer(
        "Schatten smoothing, scipy L-BFGS",
        max_min.NAME,
        _prepare,
        f"p from {_POWERS[0]:g} to {_POWERS[-1]:g}",
    ),
)
