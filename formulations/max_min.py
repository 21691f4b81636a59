"""Second statement: the worst case after a failure, maximised directly (eq. 5).

::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − J_F J_Fᵀ) ≥ t      for every set F of k joints
               the joints' own bounds

At the optimum √t is the worst-case smallest singular value after any k joints lock. The
eigenvalue constraints are stated smoothly by one of `nlp.matrix_inequality`'s encodings.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import combinations
from types import MappingProxyType

import casadi as ca
import numpy as np

from formulations import measures, residual
from formulations.bounds.certified import Bound, largest_worst_case
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError
from nlp.matrix_inequality import ENCODINGS
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
# The level starts at most at this share of what keeps the start's own factor regular.
_LEVEL_SHARE = 0.5


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
    if encoding not in ENCODINGS:
        raise InputError("encoding", encoding, "one of " + ", ".join(ENCODINGS))
    m, n = arm.shape
    floor = attained_level(arm, locked)
    variables, level = arm.symbols(), ca.SX.sym("t")
    jacobian = arm.matrix(variables)
    # Every feasible t ≥ floor has λ_min(JJᵀ − tI) ≥ t/(n − m): see measures.sigma_bound.
    pivot = float(np.sqrt(floor / (n - m)))
    deleted = list(combinations(range(n), locked))
    encoded = ENCODINGS[encoding](jacobian, level, deleted, pivot)

    def lift(point: FloatArray) -> FloatArray:
        numeric = arm.jacobian(point)
        reach = _LEVEL_SHARE * measures.singular_values(numeric)[-1] ** 2
        t = min(max(measures.worst_case_sigma(numeric, locked) ** 2, floor), reach)
        return np.concatenate([point, [t], encoded.lift(numeric, t)])

    least, largest = arm.bounds
    return Problem(
        name=NAME,
        variables=ca.vertcat(variables, level, encoded.variables),
        objective=ca.log(level),
        sense=SENSE,
        constraints=(*arm.constraints(variables), *encoded.constraints),
        lower=np.concatenate([least, [floor], encoded.lower]),
        upper=np.concatenate([largest, np.full(1 + encoded.lower.size, np.inf)]),
        outputs={"jacobian": jacobian},
        lift=lift,
    )


def attained_level(arm: ColumnModel, locked: int = 1, samples: int = 100) -> float:
    """Return a level t that some configuration of the arm attains: half of the best sampled.

    Raises
    ------
    InputError
        If no sampled configuration keeps full rank after `locked` joints lock.
    """
    m, n = arm.shape
    if whole_number("locked joints", locked, 1) > n - m:
        raise InputError("locked joints", locked, f"at most the degree of redundancy, {n - m}")
    rng = np.random.default_rng(1995)
    configurations = (arm.jacobian(arm.sample(rng)) for _ in range(samples))
    best = max(measures.worst_case_sigma(matrix, locked) for matrix in configurations)
    if best < 1e-6:
        allowed = f"joints that can keep full rank after any {locked} lock"
        raise InputError("arm", f"of {arm.description}", allowed)
    return 0.5 * best**2


def merit(jacobian: FloatArray, locked: int = 1) -> float:
    """What the statement maximises, from J alone: the worst-case singular value √t."""
    return measures.worst_case_sigma(jacobian, locked)


def bound(arm: Arm, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return what no worst case of the arm is above; see `catalogue.Formulation`."""
    return largest_worst_case(arm, locked, certified)


class ResidualMinimum:
    """Draws starts for `build` that are residual minima reached from random starts.

    Parameters
    ----------
    arm
        The joints.
    """

    def __init__(self, arm: ColumnModel) -> None:
        self.arm = arm

    def __call__(self, rng: np.random.Generator) -> FloatArray:
        """Draw variables of the arm at random and minimise the residual from there."""
        return _residual_solver(self.arm).solve(self.arm.sample(rng)).variables


@lru_cache(maxsize=4)
def _residual_solver(arm: ColumnModel) -> Solver:
    return Solver(residual.build(arm), residual.OPTIONS)
