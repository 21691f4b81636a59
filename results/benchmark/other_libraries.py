"""Other libraries on both statements, with analytic derivatives written by hand in NumPy.

The residual is the sum of squares of the isotropy equations with diagonal entries weighted by
√½: least squares (trf); JAX with Levenberg–Marquardt, all starts of a batch at once; Pymanopt
with trust regions on SO(3)ⁿ.

Max-min, as one would state it for SLSQP::

    maximise   t                     over the angles and t
    subject to λ_k(JJᵀ − j_f j_fᵀ) ≥ t      for every joint f and k = 1 … K

with K = 6, all eigenvalues, so that SLSQP sees those next to the smallest, or K = 1, which
costs less. Derivatives come from the eigenvectors; they jump where eigenvalues meet, and at the
best Jacobians some do.

J, shape (6, n), is the Jacobian of n unit revolute joints: its columns are j_f = (v_f; w_f),
two unit vectors at right angles. Each has three angles (α, β, γ) in radians, so vectors of all
angles have shape (3n,); eq. (21) of the paper says how they make a column. The isotropy
equations are JJᵀ − (n/3) I = 0, 21 of them as the matrix is symmetric. All arrays are
float64.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import least_squares, minimize

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.nlp.arrays import FloatArray

#: Largest number of iterations of SLSQP, and its tolerance `ftol`. With a larger tolerance it
#: ends sooner, at a worst case with fewer digits.
MOST = 500
TOLERANCE = 1e-10
#: Largest number of steps of the loop in JAX, and the largest component of the gradient at
#: which it ends. A batch takes as long as its slowest start.
JAX_STEPS = 300
JAX_GRADIENT = 1e-7
# The damping of the loop in JAX at first, and its least; it is divided by the first factor
# after a step that helps, and multiplied by the second after another. They change
# how fast the loop ends, not where optima are.
_DAMPING = 1e-2
_LEAST_DAMPING = 1e-10
_DAMPING_DOWN = 5
_DAMPING_UP = 4
# Rows and columns of the entries of a symmetric matrix that are compared.
_UPPER = np.triu_indices(6)
_ROWS = _UPPER[0]
_COLUMNS = _UPPER[1]
# Squares of entries off the diagonal stand for two entries each: so half of ‖JJᵀ − (n/3) I‖²
# is the sum of squares of these entries, those on the diagonal times √½.
_WEIGHTS = np.where(_ROWS == _COLUMNS, np.sqrt(0.5), 1.0)
# A function from a start, shape (3n,), to its Jacobian, shape (6, n); or, of a batched peer,
# from B starts, shape (B, 3n), to Jacobians, shape (B, 6, n).
Solve: TypeAlias = Callable[[FloatArray], FloatArray]
# An array of NumPy; or of JAX where the library is jax.numpy.
_Array: TypeAlias = Any


class NotRunError(Exception):
    """A peer that cannot be run here; its message says why in a few words."""


def _columns(angles: _Array, library: Any = np) -> tuple[_Array, _Array]:
    """Return J by eq. (21), and its derivatives in each joint's own angles, shape (6, n, 3).

    v = cos γ · first + sin γ · second, where first, second and w are orthonormal.
    """
    array, vstack = library.array, library.vstack
    turns = angles.reshape(-1, 3).T
    (sa, sb, sc), (ca, cb, cc) = library.sin(turns), library.cos(turns)
    zero = library.zeros_like(sa)
    first, second = array([ca * sb, sa * sb, -cb]), array([sa, -ca, zero])
    v, w = cc * first + sc * second, array([ca * cb, sa * cb, sb])
    by_alpha = vstack([-v[1], v[0], zero, -w[1], w[0], zero])  # a rotation about z
    by_beta = vstack([cc * w, -first])
    by_gamma = vstack([cc * second - sc * first, array([zero, zero, zero])])
    return vstack([v, w]), library.stack([by_alpha, by_beta, by_gamma], axis=2)


def jacobian(angles: _Array, library: Any = np) -> _Array:
    """Return J, shape (6, n), for angles (α_1, β_1, γ_1, α_2, …)."""
    return _columns(angles, library)[0]


def residuals(angles: _Array, library: Any = np) -> _Array:
    """Return the 21 weighted entries of JJᵀ − (n/3) I on and above the diagonal."""
    matrix = jacobian(angles, library)
    gap = matrix @ matrix.T - matrix.shape[1] / 3 * np.eye(6)
    return _WEIGHTS * gap[_ROWS, _COLUMNS]


def derivatives(angles: FloatArray) -> FloatArray:
    """Return the derivatives of `residuals`, shape (21, 3n)."""
    # An entry of JJᵀ is Σ_i J_ai J_bi: its derivative in an angle of joint i is that of one
    # product, ∂J_ai J_bi + J_ai ∂J_bi.
    matrix, moved = _columns(angles)
    matrix = matrix[:, :, None]
    both = moved[_ROWS] * matrix[_COLUMNS] + matrix[_ROWS] * moved[_COLUMNS]
    return np.asarray((_WEIGHTS[:, None, None] * both).reshape(21, -1))


def locked_eigenvalues(
    angles: FloatArray, most: int = 6
) -> tuple[FloatArray, Callable[[], FloatArray]]:
    """Return the smallest eigenvalues of JJᵀ − j_f j_fᵀ for each joint, and their derivatives.

    Shapes (Kn,), K = `most` of one failure after the other, each in ascending order, and
    (Kn, 3n), which are computed when they are asked for.
    Where eigenvalues meet the derivatives are those of one choice of eigenvectors.
    """
    matrix, moved = _columns(angles)
    n = matrix.shape[1]
    values, vectors = np.linalg.eigh(
        matrix @ matrix.T - np.einsum("an,bn->nab", matrix, matrix)
    )

    def slopes() -> FloatArray:
        # ∂λ = uᵀ ∂(JJᵀ) u = 2 Σ_i (uᵀ j_i)(uᵀ ∂j_i) over joints that are not locked, where u is
        # the unit eigenvector of λ. Shapes: kept (n, K, 6), along (n, K, n), turned
        # (n, K, n, 3).
        kept = vectors[:, :, :most].swapaxes(1, 2)
        along = kept @ matrix
        along[np.arange(n), :, np.arange(n)] = 0.0  # a locked joint moves nothing
        turned = np.tensordot(kept, moved, 1)
        return np.asarray((2 * along[..., None] * turned).reshape(most * n, 3 * n))

    return values[:, :most].ravel(), slopes


def least_squares_residual(_: Arm) -> Solve:
    """Return what solves a start by `scipy.optimize.least_squares`, ``trf``."""

    def solve(start: FloatArray) -> FloatArray:
        return np.asarray(jacobian(least_squares(residuals, start, derivatives).x))

    return solve


def slsqp_max_min(arm: Arm, most: int) -> Solve:
    """Return what solves a start by SLSQP, `most` eigenvalues of a failure as constraints.

    A point has the angles, and t at last: shape (3n + 1,). t is at first the least eigenvalue
    at the start, so the start is feasible.
    """
    downwards = np.append(np.zeros(arm.size), -1.0)

    # SLSQP asks for the constraints, and then for their derivatives at the same point.
    @lru_cache(maxsize=1)
    def evaluated(point: bytes) -> tuple[FloatArray, Callable[[], FloatArray]]:
        return locked_eigenvalues(np.frombuffer(point)[:-1], most)

    def gaps(point: FloatArray) -> FloatArray:
        return np.asarray(evaluated(point.tobytes())[0] - point[-1])

    def slopes(point: FloatArray) -> FloatArray:
        rows = evaluated(point.tobytes())[1]()
        return np.asarray(np.column_stack([rows, -np.ones(len(rows))]))

    def solve(start: FloatArray) -> FloatArray:
        level = locked_eigenvalues(start)[0].min()
        answer = minimize(
            lambda point: -point[-1],
            np.append(start, level),
            jac=lambda _: downwards,
            constraints={"type": "ineq", "fun": gaps, "jac": slopes},
            method="SLSQP",
            options={"ftol": TOLERANCE, "maxiter": MOST},
        )
        return np.asarray(jacobian(answer.x[:-1]))

    return solve


def jax_residual(arm: Arm, batch: int) -> Solve:
    """Return what solves batches of so many starts by Levenberg–Marquardt, compiled here.

    The state of a loop is a tuple: angles x, shape (3n,); damping; number of steps made;
    largest component of the gradient before the last step.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    from jax import numpy as jnp

    def equations(angles: Any) -> Any:
        return residuals(angles, jnp)

    def step(state: Any) -> Any:
        x, damping, count, _ = state
        r, d = equations(x), jax.jacfwd(equations)(x)
        slope = d.T @ r
        lhs = d.T @ d + damping * jnp.eye(x.size)
        trial = x - jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(lhs), slope)
        better = jnp.sum(equations(trial) ** 2) < jnp.sum(r**2)
        lower = jnp.maximum(damping / _DAMPING_DOWN, _LEAST_DAMPING)
        damping = jnp.where(better, lower, damping * _DAMPING_UP)
        return jnp.where(better, trial, x), damping, count + 1, jnp.max(jnp.abs(slope))

    def goes_on(state: Any) -> Any:
        return (state[2] < JAX_STEPS) & (state[3] > JAX_GRADIENT)

    def solve(start: Any) -> Any:
        ended = jax.lax.while_loop(goes_on, step, (start, _DAMPING, 0, jnp.inf))
        return jacobian(ended[0], jnp)

    solve_all = jax.jit(jax.vmap(solve))
    rng = np.random.default_rng(0)  # any starts do: they are solved only to compile
    solve_all(np.array([arm.sample(rng) for _ in range(batch)])).block_until_ready()

    return lambda starts: np.asarray(solve_all(starts), dtype=np.float64)


def pymanopt_residual(arm: Arm) -> Solve:
    """Return what solves a start by trust regions on SO(3)ⁿ.

    A point has shape (n, 3, 3): a rotation matrix for each joint, with columns v, w and v × w.
    The cost is ½·‖JJᵀ − (n/3) I‖², whose gradient in J is 2 (JJᵀ − (n/3) I) J.
    """
    import pymanopt
    from pymanopt.manifolds import SpecialOrthogonalGroup
    from pymanopt.optimizers import TrustRegions

    n = arm.shape[1]
    manifold = SpecialOrthogonalGroup(3, k=n)

    def columns(points: FloatArray) -> FloatArray:
        """Return J, shape (6, n), of a point; linear, so also its change along a vector."""
        return np.vstack([points[:, :, 0].T, points[:, :, 1].T])

    def lifted(slope: FloatArray) -> FloatArray:
        """Return a gradient in J, shape (6, n), as one in the entries of a point."""
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
        matrix = jacobian(start)
        v, w = matrix[:3].T, matrix[3:].T
        point = np.stack([v, w, np.cross(v, w)], axis=2)
        return columns(optimizer.run(problem, initial_point=point).point)

    return solve
