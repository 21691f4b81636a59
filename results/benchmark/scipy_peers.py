"""SciPy on both statements, with analytic derivatives.

The residual: least squares (trf, lm) and SLSQP. Max-min, as one would state it for SLSQP::

    maximise   t                     over the angles and t
    subject to λ_k(JJᵀ − j_f j_fᵀ) ≥ t      for every joint f and k = 1 … 6

with all eigenvalues, not only the smallest, so that SLSQP sees those next to it. Derivatives
come from the eigenvectors; they jump where eigenvalues meet, and at the best Jacobians some do.

Max-min by smoothing: L-BFGS minimises log (Σ_f tr M_f⁻ᵖ)^{1/p}, M_f = JJᵀ − j_f j_fᵀ, for
growing p, each from the previous answer: Schatten norms of the inverses replace smallest
eigenvalues. For p → ∞ it is −log of the smallest eigenvalue of all.
"""

from functools import partial

import numpy as np
from scipy.optimize import least_squares, minimize

from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from results.benchmark import unit_revolute as hand
from results.benchmark.measurement import NotRunError, Solve

POWERS = (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)
MOST, TOLERANCE = 500, 1e-10


def least_squares_residual(arm: Arm, method: str) -> Solve:
    """Return what solves a start by `scipy.optimize.least_squares`, ``trf`` or ``lm``."""
    if method == "lm" and arm.size > 21:
        raise NotRunError("lm needs at least as many residuals as unknowns")

    def solve(start: FloatArray) -> FloatArray:
        answer = least_squares(hand.residuals, start, hand.derivatives, method=method)
        return np.asarray(hand.jacobian(answer.x))

    return solve


def slsqp_residual(_: Arm) -> Solve:
    """Return what solves a start by SLSQP without constraints."""

    def both(angles: FloatArray) -> tuple[float, FloatArray]:
        rows = hand.residuals(angles)
        return float(rows @ rows), 2 * rows @ hand.derivatives(angles)

    def solve(start: FloatArray) -> FloatArray:
        options = {"ftol": TOLERANCE, "maxiter": 1000}
        answer = minimize(both, start, jac=True, method="SLSQP", options=options)
        return np.asarray(hand.jacobian(answer.x))

    return solve


def slsqp_max_min(arm: Arm) -> Solve:
    """Return what solves a start by SLSQP, eigenvalues as constraints."""
    downwards = np.append(np.zeros(arm.size), -1.0)

    def gaps(point: FloatArray) -> FloatArray:
        return np.asarray(hand.locked_eigenvalues(point[:-1])[0] - point[-1])

    def slopes(point: FloatArray) -> FloatArray:
        rows = hand.locked_eigenvalues(point[:-1])[1]
        return np.asarray(np.column_stack([rows, -np.ones(len(rows))]))

    def solve(start: FloatArray) -> FloatArray:
        level = hand.locked_eigenvalues(start)[0].min()
        answer = minimize(
            lambda point: -point[-1],
            np.append(start, level),
            jac=lambda _: downwards,
            constraints={"type": "ineq", "fun": gaps, "jac": slopes},
            method="SLSQP",
            options={"ftol": TOLERANCE, "maxiter": MOST},
        )
        return np.asarray(hand.jacobian(answer.x[:-1]))

    return solve


def schatten_max_min(_: Arm) -> Solve:
    """Return what solves a start by L-BFGS on Schatten norms of growing power."""
    options = {"maxiter": 2000, "maxfun": 4000}
    step = partial(minimize, _smoothed, jac=True, method="L-BFGS-B", tol=1e-12, options=options)

    def solve(start: FloatArray) -> FloatArray:
        x = start
        for power in POWERS:
            x = step(x, (power,)).x
        return np.asarray(hand.jacobian(x))

    return solve


def _smoothed(angles: FloatArray, power: float) -> tuple[float, FloatArray]:
    """Return the smoothed −log of the smallest eigenvalue, and its gradient."""
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
