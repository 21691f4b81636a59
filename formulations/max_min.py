"""Second statement: the worst case after a failure, maximised directly (eq. 5).

::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − J_F J_Fᵀ) ≥ t      for every set F of k joints
               the joints' own bounds

At the optimum √t is the worst-case smallest singular value after any k joints lock. The
eigenvalue constraints are stated smoothly in one of several encodings:

two-stage
    the default for k = 1: a few Gauss–Newton steps on the residual, then ``reduced``;
reduced
    no auxiliary variables, derivatives written out: see `formulations.reduced`;
shared-factor, principal-minors, factor-per-deletion, positive-factor-per-deletion
    auxiliary factors, for any k: see `nlp.matrix_inequality`. These are `unequal_max_min` where
    all joints fail alike.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import casadi as ca
import numpy as np

from formulations import measures, reduced, residual, unequal_max_min
from formulations.bounds.certified import Bound, largest_worst_case
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.measures.unequal_failures import FailureModel
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.matrix_inequality import ENCODINGS
from nlp.options import OptionValue
from nlp.problem import Evaluation, Problem, Sense
from nlp.solver import Solver

NAME = "max-min"
SENSE: Sense = "maximise"
SETTINGS = frozenset({"encoding", "from_residual_minima", "locked", "failures", "goal"})
REDUCED = ("two-stage", "reduced")
# A start that has not converged in 500 iterations (the median is below 30) does not. Steps need
# no second look.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"max_iter": 500, "fast_step_computation": "yes"}
)
# Options of single encodings, over these. A problem built here brings them along.
ENCODING_OPTIONS: Mapping[str, Mapping[str, OptionValue]] = MappingProxyType(
    dict.fromkeys(ENCODINGS, unequal_max_min.OPTIONS)
)
# How often `Polish` begins again where it did not converge.
_POLISHES = 3


def build(arm: ColumnModel, locked: int = 1, encoding: str | None = None) -> Problem:
    """State the problem for an arm.

    Parameters
    ----------
    arm
        The joints.
    locked
        How many joints lock at once, k.
    encoding
        ``"two-stage"``, ``"reduced"`` or one of ``nlp.matrix_inequality.ENCODINGS``; by default
        `default_encoding`.

    Raises
    ------
    InputError
        If the encoding is unknown or does not state the problem, k is out of range, or no
        configuration that was tried keeps full rank after k joints lock.
    """
    m, n = arm.shape
    unequal_max_min.check_locked(n - m, n, locked)
    alike = FailureModel.equally_likely(n, locked)
    encoding = encoding or default_encoding(locked)
    if encoding in REDUCED:
        check_encoding(encoding, locked)
        unequal_max_min.attained_merit(arm, alike, enough=0.01)
        return reduced.build(arm, two_stages=encoding == "two-stage")
    return replace(unequal_max_min.build(arm, alike, "worst", encoding), name=NAME)


def default_encoding(locked: int = 1) -> str:
    """Return the encoding that takes the least time for k locked joints, all alike."""
    return "two-stage" if locked == 1 else "shared-factor"


def check_encoding(encoding: str, locked: int = 1, alike: bool = True) -> None:
    """Refuse an encoding that is unknown or does not state the problem.

    Parameters
    ----------
    encoding
        Its name.
    locked
        How many joints lock at once.
    alike
        Whether all joints are equally likely to fail.

    Raises
    ------
    InputError
        If so.
    """
    if encoding not in (*REDUCED, *ENCODINGS):
        allowed = "one of " + ", ".join((*REDUCED, *ENCODINGS))
    elif encoding in REDUCED and (locked != 1 or not alike):
        allowed = f"one of {', '.join(ENCODINGS)} for several locked joints or unequal failures"
    else:
        return
    raise InputError("encoding", encoding, allowed)


def merit(jacobian: FloatArray, locked: int = 1) -> float:
    """What the statement maximises, from J alone: the worst-case singular value √t."""
    return measures.worst_case_sigma(jacobian, locked)


def bound(arm: Arm, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return what no worst case of the arm is above; see `catalogue.Formulation`."""
    return largest_worst_case(arm, locked, certified)


@dataclass(frozen=True)
class Polish:
    """Improves a point of `build` without factors or a level, by an active-set method.

    ::

        maximise s   subject to  log σ_F(x) ≥ s   for every set F of k joints, bounds on x

    from singular value decompositions, with ∂σ_F = u_Fᵀ ∂J v_F, by SciPy's SLSQP. In logarithms
    it does not matter how small σ_F is: where a failure leaves 1e-4 of σ, t is below Ipopt's
    tolerances. For joints that have bounds only, or, scaled, columns of any length.

    Attributes
    ----------
    arm
        The joints.
    locked
        How many joints lock at once, k.
    scaled
        Whether log σ_F/‖J‖_F is maximised instead, where only the norm of J is limited: scale
        what is found.
    sets
        The sets F that count; None for every set of k joints.
    """

    arm: ColumnModel
    locked: int = 1
    scaled: bool = False
    sets: Sequence[tuple[int, ...]] | None = None

    def __call__(self, point: FloatArray) -> tuple[FloatArray, bool]:
        """Return a point within the bounds, and whether the method converged to it.

        Parameters
        ----------
        point
            Where to begin, shape (size,), with full rank after each failure.
        """
        from scipy.optimize import Bounds, minimize  # takes long to load

        lower, upper = self.arm.bounds
        last = _Remaining(self)
        constraint = {
            "type": "ineq",
            "fun": lambda z: last(z[:-1])[0] - z[-1],
            "jac": lambda z: np.column_stack([last(z[:-1])[1], -np.ones(len(last.sets))]),
        }
        slope = np.append(np.zeros(len(point)), -1.0)
        found, converged = point, False
        for _ in range(_POLISHES):  # again where a line search failed, with a new Hessian
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # that it clips to the bounds
                answer = minimize(
                    lambda z: -z[-1],
                    np.append(found, float(np.min(last(found)[0]))),
                    jac=lambda _: slope,
                    method="SLSQP",
                    bounds=Bounds(np.append(lower, -np.inf), np.append(upper, np.inf)),
                    constraints=[constraint],
                    options={"ftol": 1e-12, "maxiter": 200},
                )
            if not np.isfinite(answer.x).all():
                break
            found, converged = np.clip(answer.x[:-1], lower, upper), bool(answer.success)
            if converged:
                break
        return found, converged


class _Remaining:
    """Logarithms of what the failures leave, and their derivatives; keeps the last point."""

    def __init__(self, polish: Polish) -> None:
        m, n = polish.arm.shape
        self.sets = polish.sets or measures.locked_sets(np.zeros((m, n)), polish.locked)
        self._left = np.array([np.delete(np.arange(n), one) for one in self.sets])
        self._evaluation, self._shape = _with_slopes(polish.arm), (n, m, polish.arm.size)
        self._scaled = polish.scaled
        self._point, self._value = b"", (np.zeros(0), np.zeros((0, 0)))

    def __call__(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log σ_F, shape (sets,), and derivatives, shape (sets, size)."""
        if point.tobytes() != self._point:
            matrix, slopes = self._evaluation(point)
            u, values, v = np.linalg.svd(matrix[:, self._left].transpose(1, 0, 2))
            m = values.shape[1]
            sigma = np.maximum(values[:, -1], np.finfo(float).tiny)
            moved = slopes.reshape(self._shape)[self._left]  # column, row, variable
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


@dataclass(frozen=True)
class ResidualMinimum:
    """Draws starts for `build` that are residual minima reached from random starts.

    Attributes
    ----------
    arm
        The joints.
    """

    arm: ColumnModel

    def __call__(self, rng: np.random.Generator) -> FloatArray:
        """Draw variables of the arm at random and minimise the residual from there."""
        return _residual_solver(self.arm).solve(self.arm.sample(rng)).variables


@lru_cache(maxsize=4)
def _residual_solver(arm: ColumnModel) -> Solver:
    return Solver(residual.build(arm), residual.OPTIONS)
