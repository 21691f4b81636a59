"""A point of max-min improved by an active-set method, without factors or a level.

J(x) is the Jacobian, shape (m, n), at the variables x of an arm, shape (size,); F is a set of
joints that lock, σ_F the smallest singular value without their columns, and u_F, v_F its
singular vectors. Sequential quadratic programming (SciPy's SLSQP) needs few points, but each
one takes a singular value decomposition for every F.
"""

import warnings
from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Evaluation

# Number of times that `polish` begins, again where it did not converge, with a new Hessian.
# More take longer, and seldom help.
_ATTEMPTS = 3
# Options of SLSQP: the change of s below which it ends, and its largest number of iterations.
_OPTIONS = {"ftol": 1e-12, "maxiter": 200}


def polish(
    arm: ArmModel,
    point: FloatArray,
    failures: int = 1,
    scaled: bool = False,
    sets: Sequence[tuple[int, ...]] | None = None,
    relative: bool = False,
) -> tuple[FloatArray, bool]:
    """Return a better point than one of full rank after failures, and whether it converged.

    ::

        maximise s   subject to  log σ_F(x) ≥ s   for every set F of k joints, bounds on x

    by SciPy's SLSQP, with ∂σ_F = u_Fᵀ ∂J v_F. In logarithms it does not matter how small σ_F
    is: where a failure leaves 1e-4 of σ, its square is below Ipopt's tolerances.

    Parameters
    ----------
    arm
        An arm whose joints have bounds only, no equations; or, scaled, free columns.
    point
        The variables to begin with, shape (size,).
    failures
        How many joints lock at once, k.
    scaled
        Whether σ_F/‖J‖_F is maximised in place of σ_F: where only the norm of J is limited, the
        answer is to be scaled afterwards.
    sets
        Other sets F than those of k joints, all of one size.
    relative
        Whether σ_F over the largest singular value that F leaves is maximised.
    """
    from scipy.optimize import Bounds, minimize  # takes long to load

    m, n = arm.shape
    chosen = sets or measures.locked_sets(np.zeros((m, n)), failures)
    # The columns that are left, shape (sets, n − k).
    remaining = np.array([np.delete(np.arange(n), joints) for joints in chosen])

    # SLSQP asks for values and slopes one after the other: the last point is kept.
    @lru_cache(maxsize=1)
    def left(raw: bytes) -> tuple[FloatArray, FloatArray]:
        """Return log σ_F of variables as bytes, shape (sets,), and its slopes, (sets, size)."""
        matrix, slopes = _with_slopes(arm)(np.frombuffer(raw))
        u, values, v = np.linalg.svd(matrix[:, remaining].transpose(1, 0, 2))
        sigma = np.maximum(values[:, -1], np.finfo(float).tiny)
        moved = slopes.reshape(n, m, arm.size)[remaining]  # column, row, variable
        change = np.einsum("fi,fc,fcip->fp", u[:, :, -1], v[:, m - 1, :], moved)
        if relative:
            largest = values[:, 0]
            grown = np.einsum("fi,fc,fcip->fp", u[:, :, 0], v[:, 0, :], moved)
            slopes = change / sigma[:, None] - grown / largest[:, None]
            return np.log(sigma) - np.log(largest), slopes
        if not scaled:
            return np.log(sigma), change / sigma[:, None]
        size = np.sum(matrix**2)
        shrinking = matrix.ravel(order="F") @ slopes / size
        return np.log(sigma) - 0.5 * np.log(size), change / sigma[:, None] - shrinking

    lower, upper = arm.bounds
    ones, slope = np.ones((len(chosen), 1)), np.append(np.zeros(len(point)), -1.0)
    constraint = {
        "type": "ineq",
        "fun": lambda z: left(z[:-1].tobytes())[0] - z[-1],
        "jac": lambda z: np.hstack([left(z[:-1].tobytes())[1], -ones]),
    }
    best, converged = point, False
    for _ in range(_ATTEMPTS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # that it clips to the bounds
            answer = minimize(
                lambda z: -z[-1],
                np.append(best, float(np.min(left(best.tobytes())[0]))),
                jac=lambda _: slope,
                method="SLSQP",
                bounds=Bounds(np.append(lower, -np.inf), np.append(upper, np.inf)),
                constraints=[constraint],
                options=_OPTIONS,
            )
        if not np.isfinite(answer.x).all():
            break
        best, converged = np.clip(answer.x[:-1], lower, upper), bool(answer.success)
        if converged:
            break
    return best, converged


@lru_cache(maxsize=4)
def _with_slopes(arm: ArmModel) -> Evaluation:
    """Return what evaluates J, shape (m, n), and ∂vec(J)/∂x, shape (mn, size)."""
    variables = arm.symbols()
    matrix = arm.matrix(variables)
    return Evaluation(variables, [matrix, ca.jacobian(ca.vec(matrix), variables)])
