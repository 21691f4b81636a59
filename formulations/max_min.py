"""Second statement: the worst case after a failure, maximised directly (eq. 5).

::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − J_F J_Fᵀ) ≥ t      for every set F of k joints
               the joints' own bounds

At the optimum √t is the worst-case smallest singular value after any k joints lock. The
eigenvalue constraints are stated smoothly in one of several encodings:

two-stage
    the default for k = 1: a few Gauss–Newton steps on the residual, then ``schur-complement``;
schur-complement
    no auxiliary variables, derivatives written out: see `encodings.schur_complement`;
shared-factor, principal-minors, factor-per-deletion, positive-factor-per-deletion
    auxiliary factors, for any k: see `encodings.factors`. These are `unequal_max_min` where
    all joints fail alike. Unequal failures are stated there, too.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from formulations import measures, residual, unequal_max_min
from formulations.bounds.certified import Bound, largest_worst_case
from formulations.bounds.so3_moments.global_bound import GlobalBound, unit_revolute_joints
from formulations.encodings import schur_complement
from formulations.encodings.factors import ENCODINGS
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.measures.unequal_failures import FailureModel, Scenarios, scenarios
from formulations.unequal_max_min import Goal
from nlp.arrays import FloatArray
from nlp.errors import InputError, of_kind
from nlp.options import OptionValue
from nlp.problem import Evaluation, Problem, Sense, Stage
from nlp.solver import Solver

NAME = "max-min"
SENSE: Sense = "maximise"
SETTINGS: Mapping[str, object] = MappingProxyType(
    {
        "encoding": "",
        "from_residual_minima": False,
        "locked": 1,
        "failures": None,
        "goal": "worst",
    }
)
WITHOUT_FACTORS = ("two-stage", "schur-complement")
# A start that has not converged in 500 iterations (the median is below 30) does not. Steps need
# no second look.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"max_iter": 500, "fast_step_computation": "yes"}
)
# The first stage: most iterations, and the ‖JJᵀ − (T/m)I‖_F/T up to which J attains eq. (6).
_ITERATIONS = 12
_ISOTROPIC = 1e-8


def build(
    arm: ColumnModel,
    locked: int = 1,
    encoding: str = "",
    failures: Scenarios | None = None,
    goal: Goal = "worst",
    from_residual_minima: bool = False,  # noqa: ARG001
) -> Problem:
    """State the problem for an arm.

    Parameters
    ----------
    arm
        The joints.
    locked
        How many joints lock at once, k.
    encoding
        ``"two-stage"``, ``"schur-complement"`` or one of ``encodings.factors.ENCODINGS``; by
        default the one that suits the failures, see `check`.
    failures
        Which joints may fail and how likely; all alike by default.
    goal
        What is maximised where failures are unequal; see `unequal_max_min`.
    from_residual_minima
        Of `sampler`.

    Raises
    ------
    InputError
        As `check` does, or if no configuration that was tried keeps full rank after k joints
        lock.
    """
    encoding = str(check(arm, locked, encoding, failures, goal)["encoding"])
    if encoding in WITHOUT_FACTORS:
        alike = FailureModel.equally_likely(arm.shape[1], locked)
        unequal_max_min.attained_score(arm, alike, enough=0.01)
        first = _residual_stage(arm) if encoding == "two-stage" else None
        return schur_complement.build(arm, first, OPTIONS)
    models = failures or FailureModel.equally_likely(arm.shape[1], locked)
    problem = unequal_max_min.build(arm, models, goal, encoding)
    options = {"ipopt": {**unequal_max_min.OPTIONS, **OPTIONS}}
    return replace(problem, name=problem.name if failures else NAME, options=options)


def check(
    arm: ColumnModel,
    locked: int = 1,
    encoding: str = "",
    failures: Scenarios | None = None,
    goal: str = "worst",
    from_residual_minima: bool = False,
) -> Mapping[str, object]:
    """Return the settings with the encoding that takes the least time, unless one is given.

    Raises
    ------
    InputError
        If k is out of range, the encoding is unknown or does not state the problem, the goal
        is unknown or the failures are not of k joints.
    """
    m, n = arm.shape
    goal = unequal_max_min.checked_goal(goal)
    of_kind("encoding", encoding, (str, type(None)), "an encoding, as text")
    of_kind("from residual minima", from_residual_minima, bool, "true or false")
    models = () if failures is None else scenarios(failures)
    if not models and goal != "worst":
        raise InputError("goal", goal, "'worst' where all joints are alike")
    for model in models:
        if model.locked != locked:
            allowed = f"{model.locked}, as in the failure model"
            raise InputError("locked joints", locked, allowed)
    fallible = min((len(model.fallible) for model in models), default=n)
    unequal_max_min.check_locked(n - m, fallible, locked)
    if not encoding and failures is not None:
        encoding = unequal_max_min.default_encoding(failures, goal)
    encoding = encoding or ("two-stage" if locked == 1 else "shared-factor")
    if encoding not in (*WITHOUT_FACTORS, *ENCODINGS):
        allowed = "one of " + ", ".join((*WITHOUT_FACTORS, *ENCODINGS))
        raise InputError("encoding", encoding, allowed)
    if encoding in WITHOUT_FACTORS and (locked != 1 or models):
        allowed = f"one of {', '.join(ENCODINGS)} for several locked joints or unequal failures"
        raise InputError("encoding", encoding, allowed)
    return {
        "encoding": encoding,
        "from_residual_minima": from_residual_minima,
        "locked": locked,
        "failures": failures,
        "goal": goal,
    }


def score(
    jacobian: FloatArray,
    locked: int = 1,
    failures: Scenarios | None = None,
    goal: Goal = "worst",
    **_: object,
) -> float:
    """What the statement maximises, from J alone: the worst-case singular value √t.

    Where failures are unequal, see `unequal_max_min.score`.
    """
    if failures is not None:
        return unequal_max_min.score(jacobian, failures, goal)
    return measures.worst_case_sigma(jacobian, locked)


def bound(arm: ColumnModel, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return what no worst case of the arm is above; see `Formulation`."""
    return largest_worst_case(arm, locked, certified) if isinstance(arm, Arm) else None


def compute_bound(
    arm: ColumnModel, locked: int = 1, rigorous: bool = False, **options: Any
) -> GlobalBound:
    """Compute a bound now; see `Formulation`."""
    from formulations.bounds.so3_moments.unit_revolute_bounds import max_min_bound

    joints = unit_revolute_joints(arm, locked)
    return max_min_bound(joints=joints, rigorous=rigorous, **options)


def sampler(
    arm: ColumnModel, from_residual_minima: bool = False, **_: object
) -> Callable[[np.random.Generator], FloatArray]:
    """Return what draws starts: at random, or residual minima reached from there."""
    return partial(residual_minimum, arm) if from_residual_minima else arm.sample


def _residual_stage(arm: ColumnModel) -> Stage:
    """Return the residual to be made small first; the answer where it attains eq. (6)."""
    variables = arm.symbols()
    matrix = arm.matrix(variables)
    gram, norms = matrix @ matrix.T, ca.sum1(matrix**2)
    trace = ca.sum2(norms)
    defect = gram - trace / arm.shape[0] * ca.SX.eye(arm.shape[0])
    unlike = ca.mmax(ca.fabs(norms - trace / arm.shape[1]))
    evaluation = Evaluation(variables, [trace, ca.norm_fro(defect), unlike])
    fixed = arm.fixed_trace is not None

    def is_answer(point: FloatArray) -> bool:
        total, *gaps = (value[0, 0] for value in evaluation(point))
        return fixed and bool(max(gaps) <= _ISOTROPIC * total)

    stated = residual.build(arm, hessian="gauss-newton")
    before = replace(stated, options={"ipopt": residual.OPTIONS})
    return Stage(before, _ITERATIONS, is_answer)


def residual_minimum(arm: ColumnModel, rng: np.random.Generator) -> FloatArray:
    """Return the residual minimum that is reached from variables drawn at random."""
    return _residual_solver(arm).solve(arm.sample(rng)).variables


@lru_cache(maxsize=4)
def _residual_solver(arm: ColumnModel) -> Solver:
    return Solver(residual.build(arm))
