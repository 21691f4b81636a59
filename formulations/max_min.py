"""Second statement: the worst case after a failure, maximised directly (eq. 5).

J is the Jacobian, shape (m, n), one column per joint; J_F has the columns of the joints in a
set F that lock at once, k of them. M = JJᵀ, T = tr M, and JJᵀ − J_F J_Fᵀ is what the joints
that are left give. λ_min is the smallest eigenvalue; σ_F = √λ_min(JJᵀ − J_F J_Fᵀ) is the
smallest singular value after F has locked. t is a level of λ_min: in the code `level`, in
squared units of J. ::

    maximise   log t                    over the joints' parameters and t
    subject to λ_min(JJᵀ − J_F J_Fᵀ) ≥ t      for every set F of k joints
               the joints' own bounds

At the optimum √t is the worst-case smallest singular value after any k joints lock.

Where failures are unequal (`FailureModel`), F runs over the sets that can fail. P(F) is the
probability of F, given that k joints fail (`shares`), and w_F = P(F)/max P its weight
(`weights`)::

    worst      maximise log t        subject to  λ_min(JJᵀ − J_F J_Fᵀ) ≥ w_F² t
    expected   maximise Σ P(F) s_F   subject to  λ_min(JJᵀ − J_F J_Fᵀ) ≥ s_F²,  s_F ≥ 0

The first maximises the probability-weighted worst case min_F σ_F/w_F, the second the expected
dexterity Σ P(F) σ_F.

The isotropy defect may have a limit, ½‖JJᵀ − (T/m)I‖_F² ≤ ε, on the way to `isotropy`.
At 0 itself that has no gradient: ask `isotropy`.

The eigenvalue constraints are stated smoothly in one of several encodings:

two-stage
    the default for k = 1: a few Gauss–Newton steps on the residual, then ``schur-complement``;
schur-complement
    no auxiliary variables, derivatives written out: see `encodings.schur_complement`;
shared-factor, principal-minors, factor-per-deletion, positive-factor-per-deletion
    auxiliary factors, for any k and unequal failures: see `encodings.factors`. Sets whose
    constraint has the same right side share factors: one group per distinct weight for the
    worst, one per set for the expectation. Where an optimum of the expectation gives a joint
    up, s_F = 0, the constraint s_F² ≤ λ_min has no multiplier: Ipopt slows down there.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Literal, get_args

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures, residual
from lockedjoint.formulations.bounds.certified import Bound, largest_worst_case
from lockedjoint.formulations.encodings import schur_complement
from lockedjoint.formulations.encodings.factors import (
    ENCODINGS,
    NEARLY_SINGULAR,
    Encoding,
    least_pivot,
)
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.formulations.measures import unequal_failures
from lockedjoint.formulations.measures.jacobian import check_locked
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.arrays import FloatArray, real_number, whole_number
from lockedjoint.nlp.errors import InputError, of_kind, one_of
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Problem, Sense

Goal = Literal["worst", "expected"]
GOALS: tuple[str, ...] = get_args(Goal)
NAME = "max-min"
SENSE: Sense = "maximise"
SCORE = "worst-case σ"
SETTINGS: Mapping[str, object] = MappingProxyType(
    {
        "encoding": "",
        "from_residual_minima": False,
        "failures": 1,
        "maximise": "worst",
        "largest_defect": np.inf,
    }
)
#: Encodings without auxiliary factors: of one locked joint, all joints equally likely to fail.
WITHOUT_FACTORS = ("two-stage", "schur-complement")
#: Options of Ipopt. A start that has not converged in 500 iterations (the median is below 30)
#: does not. The fast step leaves out a check of the linear system, which is needless here.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"max_iter": 500, "fast_step_computation": "yes"}
)
# Options of Ipopt with factors. Following the central path closely loses fewer starts to lesser
# optima.
_FACTOR_OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"barrier_tol_factor": 1.0, "mu_init": 1.0, **OPTIONS}
)
# The level starts at most at this share of λ_min(JJᵀ) of the start: at 1 the factor of JJᵀ − tI
# would be singular there.
_LEVEL_SHARE = 0.5
# Lower bound on t, as a share of the best t that was drawn at random: no optimum is lost by it.
_FLOOR_SHARE = 0.5
# Least value that an s_F starts at, as a share of the best expectation that was drawn: 0 would
# have no multiplier.
_LEAST_START = 0.1
# Relative amount by which the isotropy defect of an answer may pass its limit: a solver's
# error.
_DEFECT_TOLERANCE = 1e-6
# Number of configurations that are drawn at random to see what the arm can attain. More of them
# raise the lower bound on t a little, and take longer.
_DRAWS = 100
# Seed of these configurations: the lower bound must be the same for every start.
_DRAWS_SEED = 1995
# A worst case σ below this counts as zero. If no configuration that was drawn has a larger one
# the arm is refused: it does not keep full rank after the failures.
_SINGULAR = 1e-6
# A worst case σ above this shows that the arm keeps rank; encodings without factors need no
# more.
_CLEARLY_REGULAR = 0.01


def build(
    arm: ArmModel,
    failures: int | FailureModel = 1,
    encoding: str = "",
    maximise: Goal = "worst",
    largest_defect: float = np.inf,
    **_: object,
) -> Problem:
    """State the problem for an arm, as a nonlinear program with the output ``jacobian``.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, k; or a `FailureModel`, how likely each failure is.
    encoding
        One of those above; by default the one that suits the failures, see `check`.
    maximise
        What is maximised where failures are unequal, ``"worst"`` or ``"expected"``.
    largest_defect
        The largest isotropy defect ε allowed, above 0, in the units of J to the fourth.

    Raises
    ------
    InputError
        As `check` does, or if no configuration that was tried keeps full rank after k joints
        lock.
    """
    settings = check(arm, failures, encoding, maximise, largest_defect=largest_defect)
    encoding = str(settings["encoding"])
    unequal = isinstance(failures, FailureModel)
    model = failures if isinstance(failures, FailureModel) else None
    model = model or FailureModel.equally_likely(arm.shape[1], count_of(failures))
    if encoding in WITHOUT_FACTORS:
        attained_score(arm, model, enough=_CLEARLY_REGULAR)
        first = residual.first_stage(arm) if encoding == "two-stage" else None
        return schur_complement.build(arm, first, OPTIONS)
    attained = attained_score(arm, model, maximise)
    variables = arm.symbols()
    jacobian = arm.matrix(variables)
    state = _worst if maximise == "worst" else _expected
    levels = state(jacobian, model, attained, encoding)
    parts = levels.encoded
    least, largest = arm.bounds
    lower = np.concatenate([least, levels.lower, *(part.lower for part in parts)])

    def complete_start(point: FloatArray) -> FloatArray:
        """Return all variables from those of the joints: these, the levels, the factors."""
        numeric = arm.jacobian(point)
        level_values, right_sides = levels.start(numeric)
        pairs = zip(parts, right_sides, strict=True)
        factors = (part.complete_start(numeric, float(right)) for part, right in pairs)
        return np.concatenate([point, level_values, *factors])

    return Problem(
        name=f"{NAME}, {maximise}" if unequal else NAME,
        variables=ca.vertcat(variables, levels.symbols, *(part.variables for part in parts)),
        objective=levels.objective,
        sense=SENSE,
        constraints=(
            *arm.constraints(variables),
            *(constraint for part in parts for constraint in part.constraints),
            *_defect_limit(arm, variables, largest_defect),
        ),
        lower=lower,
        upper=np.append(largest, np.full(lower.size - largest.size, np.inf)),
        outputs={"jacobian": jacobian},
        complete_start=complete_start,
        options={"ipopt": _FACTOR_OPTIONS},
    )


def check(
    arm: ArmModel,
    failures: int | FailureModel = 1,
    encoding: str = "",
    maximise: str = "worst",
    from_residual_minima: bool = False,
    largest_defect: float = np.inf,
) -> Mapping[str, object]:
    """Return the settings with the encoding that takes the least time, unless one is given.

    Parameters are those of `build`, and `from_residual_minima`, whether starts are residual
    minima. The keys of what is returned are those of `SETTINGS`.

    Raises
    ------
    InputError
        If k is out of range, the encoding is unknown or does not state the problem, what is to
        be maximised is unknown, or the largest defect is not above 0.
    """
    m, n = arm.shape
    one_of("maximise", maximise, GOALS)
    of_kind("encoding", encoding, (str, type(None)), "an encoding, as text")
    of_kind("from residual minima", from_residual_minima, bool, "true or false")
    if not isinstance(largest_defect, float) or largest_defect != np.inf:
        real_number("isotropy defect", largest_defect, "a number above 0", math.ulp(0.0))
    k, model = count_of(failures), failures if isinstance(failures, FailureModel) else None
    if model is None and maximise != "worst":
        raise InputError("maximise", maximise, "'worst' where all joints are alike")
    check_locked(n - m, n if model is None else len(model.fallible), k)
    plain = k == 1 and model is None and largest_defect == np.inf
    encoding = encoding or ("two-stage" if plain else _default_encoding(model, k, maximise))
    one_of("encoding", encoding, (*WITHOUT_FACTORS, *ENCODINGS))
    if encoding in WITHOUT_FACTORS and not plain:
        others = "several failures at once, unequal ones or a limited defect"
        raise InputError("encoding", encoding, f"one of {', '.join(ENCODINGS)} for {others}")
    given = (encoding, from_residual_minima, failures, maximise, largest_defect)
    return dict(zip(SETTINGS, given, strict=True))


def score(
    jacobian: FloatArray,
    failures: int | FailureModel = 1,
    maximise: Goal = "worst",
    largest_defect: float = np.inf,
    **_: object,
) -> float:
    """Return what is maximised, from J alone, shape (m, n); see the parameters of `build`.

    It is min_F σ_F, min_F σ_F/w_F or Σ P(F) σ_F, in units of J; −∞ if the isotropy defect is
    above its limit.
    """
    most = largest_defect * (1 + _DEFECT_TOLERANCE)
    if largest_defect < np.inf and measures.isotropy_defect(jacobian) > most:
        return -np.inf
    if not isinstance(failures, FailureModel):
        return measures.worst_case_sigma(jacobian, failures)
    if maximise == "expected":
        return unequal_failures.expected_sigma(jacobian, failures)
    return unequal_failures.weighted_worst_case(jacobian, failures)[0]


def count_of(failures: int | FailureModel) -> int:
    """Return how many joints lock at once, k; InputError if that is no such number."""
    if isinstance(failures, FailureModel):
        return failures.failures
    return whole_number("failures", failures, 1)


def bound(arm: ArmModel, failures: int = 1) -> Bound | None:
    """Return what no worst case of the arm is above; see `Formulation`."""
    return largest_worst_case(arm, failures) if isinstance(arm, Arm) else None


def sampler(
    arm: ArmModel, from_residual_minima: bool = False, **_: object
) -> Callable[[np.random.Generator], FloatArray]:
    """Return what draws starts: at random, or residual minima reached from there."""
    return partial(residual.minimum, arm) if from_residual_minima else arm.sample


def _defect_limit(
    arm: ArmModel, variables: ca.SX, largest_defect: float
) -> tuple[Constraint, ...]:
    """Return the constraint ½‖JJᵀ − (T/m)I‖_F² ≤ ε, or none where ε is infinite.

    Both sides are divided by ε, so that the solver's tolerance is relative.
    """
    if largest_defect == np.inf:
        return ()
    stated = residual.build(arm)
    defect = ca.substitute(stated.objective, stated.variables, variables)
    return (Constraint("isotropy defect", defect / largest_defect, -np.inf, 1.0),)


def attained_score(
    arm: ArmModel, failures: FailureModel, maximise: Goal = "worst", enough: float = np.inf
) -> float:
    """Return the best score of configurations drawn at random, or the first above `enough`.

    `maximise` says which score, as in `build`.

    Raises
    ------
    InputError
        If no configuration has a score above zero.
    """
    rng = np.random.default_rng(_DRAWS_SEED)
    best = 0.0
    for _ in range(_DRAWS):
        drawn = arm.jacobian(arm.sample(rng))
        best = max(best, score(drawn, failures=failures, maximise=maximise))
        if best > enough:
            break
    if best < _SINGULAR:
        allowed = "joints that can keep full rank after those that may fail lock"
        raise InputError("arm", f"of {arm.description}", allowed)
    return best


def _default_encoding(model: FailureModel | None, failures: int, maximise: str) -> str:
    """Return the encoding with factors that is fastest, or that most starts succeed with.

    Where joints are not alike JJᵀ − tI may be singular at the optimum, which stalls the shared
    factor: on planar 4R with one joint twice as likely to fail 20 instead of 8 of 20 starts
    reach the best with one positive factor per deletion.
    """
    if model is None:
        return "shared-factor"
    groups = list(unequal_failures.sets_by_weight(model).values())
    alike = len(groups) == 1 and len(groups[0]) == math.comb(model.joints, failures)
    return "shared-factor" if maximise == "worst" and alike else "positive-factor-per-deletion"


@dataclass(frozen=True, eq=False)
class _Levels:
    """The part of the problem that differs between the two things that can be maximised."""

    symbols: ca.SX  # t, or all s_F: a column
    lower: FloatArray  # their lower bounds
    objective: ca.SX  # what is maximised
    encoded: tuple[Encoding, ...]  # the inequalities on λ_min, one group of sets each
    # From a numeric J, shape (m, n): values of the symbols to start from, and the right side of
    # the inequalities of each group.
    start: Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def _worst(jacobian: ca.SX, failures: FailureModel, attained: float, encoding: str) -> _Levels:
    """State log t, and λ_min ≥ w² t for each group of sets of one weight w.

    `attained` is a score min_F σ_F/w_F that the arm has somewhere.
    """
    level, floor = ca.SX.sym("t"), _FLOOR_SHARE * attained**2
    groups = unequal_failures.sets_by_weight(failures)
    encoded = tuple(
        ENCODINGS[encoding](
            jacobian, weight**2 * level, sets, least_pivot(jacobian.shape, weight, sets, floor)
        )
        for weight, sets in groups.items()
    )

    def start(numeric: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return t, shape (1,), and w² t of each group."""
        most = _LEVEL_SHARE * measures.singular_values(numeric)[-1] ** 2
        worst, _ = unequal_failures.weighted_worst_case(numeric, failures)
        t = min(max(worst**2, floor), most)
        return np.array([t]), np.square(list(groups)) * t

    return _Levels(level, np.array([floor]), ca.log(level), encoded, start)


def _expected(
    jacobian: ca.SX, failures: FailureModel, attained: float, encoding: str
) -> _Levels:
    """State Σ P(F) s_F, and λ_min ≥ s_F² for each set F.

    `attained` is a score Σ P(F) σ_F that the arm has somewhere.
    """
    shares = failures.shares()
    sets, symbols = list(shares), ca.SX.sym("s", len(shares))
    pivot = NEARLY_SINGULAR * attained
    encoded = tuple(
        ENCODINGS[encoding](jacobian, symbols[i] ** 2, (joints,), pivot)
        for i, joints in enumerate(sets)
    )

    def start(numeric: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return s_F and s_F² of each set."""
        sigmas = measures.remaining_singular_values(numeric, sets)[:, -1]
        most = np.sqrt(_LEVEL_SHARE) * measures.singular_values(numeric)[-1]
        sigmas = np.clip(sigmas, min(_LEAST_START * attained, most), most)
        return sigmas, sigmas**2

    mean = ca.dot(ca.DM(list(shares.values())), symbols)
    return _Levels(symbols, np.zeros(len(sets)), mean, encoded, start)
