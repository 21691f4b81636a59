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

from formulations import max_min, residual
from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from results.benchmark import unit_revolute as hand
from results.benchmark.measurement import NotRunError, Peer, Run

_POWERS = (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)
_MOST, _TOLERANCE = 500, 1e-10
_FTOL = f"ftol {_TOLERANCE:g}"


def _least_squares(arm: Arm, method: str) -> Run:
    if method == "lm" and arm.size > 21:
        raise NotRunError("lm needs at least as many residuals as unknowns")

    def one(start: FloatArray) -> FloatArray:
        found = least_squares(hand.residuals, start, hand.derivatives, method=method)
        return np.asarray(hand.jacobian(found.x))

    return one


def _residual_slsqp(_: Arm) -> Run:
    def both(angles: FloatArray) -> tuple[float, FloatArray]:
        rows = hand.residuals(angles)
        return float(rows @ rows), 2 * rows @ hand.derivatives(angles)

    def one(start: FloatArray) -> FloatArray:
        options = {"ftol": _TOLERANCE, "maxiter": 1000}
        found = minimize(both, start, jac=True, method="SLSQP", options=options)
        return np.asarray(hand.jacobian(found.x))

    return one


def _max_min_slsqp(arm: Arm) -> Run:
    downwards = np.append(np.zeros(arm.size), -1.0)

    def gaps(point: FloatArray) -> FloatArray:
        return np.asarray(hand.locked_eigenvalues(point[:-1])[0] - point[-1])

    def slopes(point: FloatArray) -> FloatArray:
        found = hand.locked_eigenvalues(point[:-1])[1]
        return np.asarray(np.column_stack([found, -np.ones(len(found))]))

    def one(start: FloatArray) -> FloatArray:
        level = hand.locked_eigenvalues(start)[0].min()
        found = minimize(
            lambda point: -point[-1],
            np.append(start, level),
            jac=lambda _: downwards,
            constraints={"type": "ineq", "fun": gaps, "jac": slopes},
            method="SLSQP",
            options={"ftol": _TOLERANCE, "maxiter": _MOST},
        )
        return np.asarray(hand.jacobian(found.x[:-1]))

    return one


def _schatten(_: Arm) -> Run:
    options = {"maxiter": 2000, "maxfun": 4000}
    solve = partial(
        minimize, _smoothed, jac=True, method="L-BFGS-B", tol=1e-12, options=options
    )

    def one(start: FloatArray) -> FloatArray:
        x = start
        for power in _POWERS:
            x = solve(x, (power,)).x
        return np.asarray(hand.jacobian(x))

    return one


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


RESIDUAL = (
    *(
        Peer(
            f"scipy least_squares {method}",
            residual.NAME,
            partial(_least_squares, method=method),
            "analytic Jacobian, default tolerances",
        )
        for method in ("trf", "lm")
    ),
    Peer("scipy SLSQP", residual.NAME, _residual_slsqp, f"analytic gradient, {_FTOL}"),
)
MAX_MIN = (
    Peer(
        "scipy SLSQP, eigenvalues as constraints",
        max_min.NAME,
        _max_min_slsqp,
        f"analytic derivatives, {_FTOL}, at most {_MOST} steps",
    ),
    Peer(
        "Schatten smoothing, scipy L-BFGS",
        max_min.NAME,
        _schatten,
        f"p from {_POWERS[0]:g} to {_POWERS[-1]:g}",
    ),
)
