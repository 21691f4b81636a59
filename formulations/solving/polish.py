"""A point of max-min improved by an active-set method, without factors or a level."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from formulations import measures
from formulations.joints.joint import ColumnModel
from nlp.arrays import FloatArray
from nlp.problem import Evaluation

# How often `Polish` begins again where it did not converge.
_POLISHES = 3


@dataclass(frozen=True)
class Polish:
    """Improves a point of `build` without factors or a level, by an active-set method.

    ::

        maximise s   subject to  log σ_F(x) ≥ s   for every set F of k joints, bounds on x

    from singular value decompositions, with ∂σ_F = u_Fᵀ ∂J v_F, by SciPy's SLSQP. In logarithms
    it does not matter how small σ_F is: where a failure leaves 1e-4 of σ, t is below Ipopt's
    tolerances. For joints that have bounds only; or, scaled, columns of any length: where only
    the norm of J is limited, log σ_F/‖J‖_F is maximised, to be scaled afterwards. Other sets F
    than those of k joints may be given.
    """

    arm: ColumnModel
    locked: int = 1
    scaled: bool = False
    sets: Sequence[tuple[int, ...]] | None = None

    def __call__(self, point: FloatArray) -> tuple[FloatArray, bool]:
        """Return a better point than one of full rank after failures, and if it converged."""
        from scipy.optimize import Bounds, minimize  # takes long to load

        lower, upper = self.arm.bounds
        last = _Remaining(self)
        constraint = {
            "type": "ineq",
            "fun": lambda z: last(z[:-1])[0] - z[-1],
            "jac": lambda z: np.column_stack([last(z[:-1])[1], -np.ones(len(last.sets))]),
        }
        slope = np.append(np.zeros(len(point)), -1.0)
        best, converged = point, False
        for _ in range(_POLISHES):  # again where a line search failed, with a new Hessian
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # that it clips to the bounds
                answer = minimize(
                    lambda z: -z[-1],
                    np.append(best, float(np.min(last(best)[0]))),
                    jac=lambda _: slope,
                    method="SLSQP",
                    bounds=Bounds(np.append(lower, -np.inf), np.append(upper, np.inf)),
                    constraints=[constraint],
                    options={"ftol": 1e-12, "maxiter": 200},
                )
            if not np.isfinite(answer.x).all():
                break
            best, converged = np.clip(answer.x[:-1], lower, upper), bool(answer.success)
            if converged:
                break
        return best, converged


class _Remaining:
    """Logarithms of what the failures leave, and their derivatives; keeps the last point."""

    def __init__(self, polish: Polish) -> None:
        m, n = polish.arm.shape
        self.sets = polish.sets or measures.locked_sets(np.zeros((m, n)), polish.locked)
        self._remaining = np.array([np.delete(np.arange(n), joints) for joints in self.sets])
        self._evaluation, self._shape = _with_slopes(polish.arm), (n, m, polish.arm.size)
        self._scaled = polish.scaled
        self._point, self._value = b"", (np.zeros(0), np.zeros((0, 0)))

    def __call__(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log σ_F, shape (sets,), and derivatives, shape (sets, size)."""
        if point.tobytes() != self._point:
            matrix, slopes = self._evaluation(point)
            u, values, v = np.linalg.svd(matrix[:, self._remaining].transpose(1, 0, 2))
            m = values.shape[1]
            sigma = np.maximum(values[:, -1], np.finfo(float).tiny)
            moved = slopes.reshape(self._shape)[self._remaining]  # column, row, variable
            change = np.einsum("fi,fc,fcip->fp", u[:, :, -1], v[:, m - 1, :], moved)
            self._point = point.tobytes()
            self._value = np.log(sigma), change / sigma[:, None]
            if self._scaled:
                size = np.sum(matrix**2)
                slope = matrix.ravel(order="F") @ slopes / size
                self._value = self._value[0] - 0.5 * np.log(size), self._value[1] - slope
        return self._value


@lru_cache(maxsize=4)
def _with_slopes(arm: ColumnModel) -> Evaluation:
    variables = arm.symbols()
    matrix = arm.matrix(variables)
    return Evaluation(variables, [matrix, ca.jacobian(ca.vec(matrix), variables)])
