"""Other libraries on both statements, with analytic derivatives.

The residual: least squares (trf, lm) and SLSQP. Max-min, as one would state it for SLSQP::

    maximise   t                     over the angles and t
    subject to λ_k(JJᵀ − j_f j_fᵀ) ≥ t      for every joint f and k = 1 … 6

with all eigenvalues, not only the smallest, so that SLSQP sees those next to it. Derivatives
come from the eigenvectors; they jump where eigenvalues meet, and at the best Jacobians some do.

Max-min by smoothing: L-BFGS minimises log (Σ_f tr M_f⁻ᵖ)^{1/p}, M_f = JJᵀ − j_f j_fᵀ, for
growing p, each from the previous answer: Schatten norms of the inverses replace smallest
eigenvalues. For p → ∞ it is −log of the smallest eigenvalue of all.

JAX and Pymanopt on the residual: Levenberg–Marquardt and damped Newton, all starts of a batch
at once; trust regions on SO(3)ⁿ.
"""

from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import least_squares, minimize

from formulations.joints.arm import Arm
from nlp.arrays import FloatArray
from results.benchmark import unit_revolute as hand
from results.benchmark.measurement import NotRunError, Solve

POWERS = (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0)
MOST, TOLERANCE = 500, 1e-10
JAX_STEPS, JAX_GRADIENT = 300, 1e-7


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


def jax_residual(arm: Arm, batch: int, exact: bool) -> Solve:
    """Return what solves a batch of starts, with the exact or the Gauss–Newton Hessian."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from jax import numpy as jnp

    def equations(angles: Any) -> Any:
        return hand.residuals(angles, jnp)

    def half(angles: Any) -> Any:
        return jnp.sum(equations(angles) ** 2) / 2

    def step(state: Any) -> Any:
        x, damping, count, _ = state
        r, d = equations(x), jax.jacfwd(equations)(x)
        slope = d.T @ r
        curvature = jax.hessian(half)(x) if exact else d.T @ d
        lhs = curvature + damping * jnp.eye(x.size)
        # Where it is not positive definite, the step is NaN: not accepted, damped more.
        trial = x - jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(lhs), slope)
        better = half(trial) < jnp.sum(r**2) / 2
        damping = jnp.where(better, jnp.maximum(damping / 5, 1e-10), damping * 4)
        return jnp.where(better, trial, x), damping, count + 1, jnp.max(jnp.abs(slope))

    def goes_on(state: Any) -> Any:
        return (state[2] < JAX_STEPS) & (state[3] > JAX_GRADIENT)

    def solve(start: Any) -> Any:
        return hand.jacobian(
            jax.lax.while_loop(goes_on, step, (start, 1e-2, 0, jnp.inf))[0], jnp
        )

    solve_all = jax.jit(jax.vmap(solve))
    rng = np.random.default_rng(0)
    solve_all(np.array([arm.sample(rng) for _ in range(batch)])).block_until_ready()

    return lambda starts: np.asarray(solve_all(starts), dtype=np.float64)


def pymanopt_residual(arm: Arm) -> Solve:
    """Return what solves a start by trust regions on SO(3)ⁿ."""
    import pymanopt
    from pymanopt.manifolds import SpecialOrthogonalGroup
    from pymanopt.optimizers import TrustRegions

    n = arm.shape[1]
    manifold = SpecialOrthogonalGroup(3, k=n)

    def columns(points: FloatArray) -> FloatArray:
        return np.vstack([points[:, :, 0].T, points[:, :, 1].T])

    def lifted(slope: FloatArray) -> FloatArray:
        return np.stack([slope[:3].T, slope[3:].T, np.zeros((n, 3))], axis=2)

    def gap(matrix: FloatArray) -> FloatArray:
        return np.asarray(matrix @ matrix.T - n / 3 * np.eye(6))

    def cost(points: FloatArray) -> float:
        return float(0.5 * np.sum(gap(columns(points)) ** 2))

    def gradient(points: FloatArray) -> FloatArray:
        matrix = columns(points)
        return lifted(2 * gap(matrix) @ matrix)

    def hessian(points: FloatArray, vector: FloatArray) -> FloatArray:
        matrix, moved = columns(points), columns(vector)
        change = moved @ matrix.T
        return lifted(2 * (gap(matrix) @ moved + (change + change.T) @ matrix))

    on = pymanopt.function.numpy(manifold)
    derivatives = {"euclidean_gradient": on(gradient), "euclidean_hessian": on(hessian)}
    problem = pymanopt.Problem(manifold, on(cost), **derivatives)
    optimizer = TrustRegions(verbosity=0)

    def solve(start: FloatArray) -> FloatArray:
        matrix = hand.jacobian(start)
        v, w = matrix[:3].T, matrix[3:].T
        point = np.stack([v, w, np.cross(v, w)], axis=2)
        return columns(optimizer.run(problem, initial_point=point).point)

    return solve
