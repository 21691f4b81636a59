"""JAX on the residual: Levenberg–Marquardt and damped Newton, all starts of a batch at once."""

from typing import Any

import numpy as np

from formulations.joints.arm import Arm
from results.benchmark import unit_revolute as hand
from results.benchmark.measurement import Solve

STEPS, GRADIENT = 300, 1e-7


def prepare(arm: Arm, batch: int, exact: bool) -> Solve:
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
        return (state[2] < STEPS) & (state[3] > GRADIENT)

    def solve(start: Any) -> Any:
        return hand.jacobian(
            jax.lax.while_loop(goes_on, step, (start, 1e-2, 0, jnp.inf))[0], jnp
        )

    solve_all = jax.jit(jax.vmap(solve))
    rng = np.random.default_rng(0)
    solve_all(np.array([arm.sample(rng) for _ in range(batch)])).block_until_ready()

    return lambda starts: np.asarray(solve_all(starts), dtype=np.float64)
