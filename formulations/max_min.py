"""Second statement: the worst case after a failure, maximised directly (eq. 5).

::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − J_F J_Fᵀ) ≥ t      for every set F of k joints
               the joints' own bounds

At the optimum √t is the worst-case smallest singular value after any k joints lock. The
eigenvalue constraints are stated smoothly by one of `nlp.matrix_inequality`'s encodings: this
is `unequal_max_min` where all joints fail alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from formulations import measures, residual, unequal_max_min
from formulations.bounds.certified import Bound, largest_worst_case
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.measures.unequal_failures import FailureModel
from nlp.arrays import FloatArray
from nlp.options import OptionValue
from nlp.problem import Problem, Sense
from nlp.solver import Solver

NAME = "max-min"
SENSE: Sense = "maximise"
SETTINGS = frozenset({"encoding", "from_residual_minima", "locked", "failures", "goal"})
# Following the central path closely loses fewer starts to lesser optima; a start that has
# not converged in 500 iterations (the median is 30) does not. Steps need no second look.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        "barrier_tol_factor": 1.0,
        "mu_init": 1.0,
        "max_iter": 500,
        "fast_step_computation": "yes",
    }
)


def build(arm: ColumnModel, locked: int = 1, encoding: str = "shared-factor") -> Problem:
    """State the problem for an arm.

    Parameters
    ----------
    arm
        The joints.
    locked
        How many joints lock at once, k.
    encoding
        One of ``nlp.matrix_inequality.ENCODINGS``.

    Raises
    ------
    InputError
        If the encoding is unknown, k is out of range, or no configuration that was tried
        keeps full rank after k joints lock.
    """
    m, n = arm.shape
    unequal_max_min.check_locked(n - m, n, locked)
    alike = FailureModel.equally_likely(n, locked)
    return replace(unequal_max_min.build(arm, alike, "worst", encoding), name=NAME)


def merit(jacobian: FloatArray, locked: int = 1) -> float:
    """What the statement maximises, from J alone: the worst-case singular value √t."""
    return measures.worst_case_sigma(jacobian, locked)


def bound(arm: Arm, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return what no worst case of the arm is above; see `catalogue.Formulation`."""
    return largest_worst_case(arm, locked, certified)


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
