"""The second statement where failures are unequal: two variants of max-min.

Over the sets F of k joints that can fail, P(F) their shares and w_F = P(F)/max P::

    worst      maximise log t        subject to  λ_min(JJᵀ − J_F J_Fᵀ) ≥ w_F² t
    expected   maximise Σ P(F) s_F   subject to  λ_min(JJᵀ − J_F J_Fᵀ) ≥ s_F²,  s_F ≥ 0

and the joints' own bounds. The first maximises the probability-weighted worst case
min_F σ_F/w_F, the second the expected dexterity Σ P(F) σ_F. With equal probabilities and every
joint fallible the first is `max_min`, which is built here too.

Over several scenarios of P the worst takes the largest w_F of any, and the expectation is the
least over them: maximise e subject to e ≤ Σ P_i(F) s_F for every scenario i.

Sets of one level share the factors of an encoding: one group per distinct weight for the
first, one per set for the second. At an optimum of the expectation that gives a joint up,
s_f = 0, the constraint s_f² ≤ λ_min has no multiplier: Ipopt slows down there, and the answer,
as any, is judged from J alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import comb
from types import MappingProxyType
from typing import Literal, cast, get_args

import casadi as ca
import numpy as np

from formulations import measures
from formulations.encodings.factors import ENCODINGS, Encoding
from formulations.joints.joint import ColumnModel
from formulations.measures import unequal_failures
from formulations.measures.jacobian import check_sets
from formulations.measures.unequal_failures import Scenarios, largest_weights, scenarios
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError, one_of
from nlp.options import OptionValue
from nlp.problem import Constraint, Problem

Goal = Literal["worst", "expected"]
Sets = tuple[tuple[int, ...], ...]
# Following the central path closely loses fewer starts to lesser optima.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"barrier_tol_factor": 1.0, "mu_init": 1.0}
)
_SAMPLES = 100
# Where JJᵀ − tI may be singular at the optimum its factor stays this share of √t away from it:
# what is lost of t is the square.
_NEARLY_SINGULAR = 1e-4
# The level starts at most at this share of what keeps the start's own factor regular.
_LEVEL_SHARE = 0.5
# Each set of joints that lock at once is a matrix inequality: 1000 take 10 s to state.
MOST_SETS = 1000


@dataclass(frozen=True, eq=False)
class _Levels:
    """Symbols that say how much is left, what is maximised, and the encoded inequalities."""

    symbols: ca.SX
    lower: FloatArray
    objective: ca.SX
    encoded: tuple[Encoding, ...]
    start: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    constraints: tuple[Constraint, ...] = ()


def build(
    arm: ColumnModel, failures: Scenarios, goal: Goal = "worst", encoding: str | None = None
) -> Problem:
    """State the problem for an arm, of settings that `max_min.check` has seen.

    Parameters
    ----------
    arm
        The joints.
    failures
        Which joints may fail, how likely, and how many at once; or several such models, for
        the least over them.
    goal
        ``"worst"`` or ``"expected"``.
    encoding
        One of ``encodings.factors.ENCODINGS``; by default `default_encoding`.

    Raises
    ------
    InputError
        If the model is of another number of joints, or no configuration that was tried has a
        score above zero.
    """
    encoding = encoding or default_encoding(failures, goal)
    attained = attained_score(arm, failures, goal)
    variables = arm.symbols()
    jacobian = arm.matrix(variables)
    state = _worst if goal == "worst" else _expected
    levels = state(jacobian, failures, attained, encoding)
    least, largest = arm.bounds
    lower = np.concatenate([least, levels.lower, *(part.lower for part in levels.encoded)])

    def complete_start(point: FloatArray) -> FloatArray:
        numeric = arm.jacobian(point)
        own, squares = levels.start(numeric)
        pairs = zip(levels.encoded, squares, strict=True)
        starts = (part.complete_start(numeric, float(t)) for part, t in pairs)
        return np.concatenate([point, own, *starts])

    return Problem(
        name=f"max-min, {goal}",
        variables=ca.vertcat(
            variables, levels.symbols, *(part.variables for part in levels.encoded)
        ),
        objective=levels.objective,
        sense="maximise",
        constraints=(
            *arm.constraints(variables),
            *levels.constraints,
            *(constraint for part in levels.encoded for constraint in part.constraints),
        ),
        lower=lower,
        upper=np.append(largest, np.full(lower.size - largest.size, np.inf)),
        outputs={"jacobian": jacobian},
        complete_start=complete_start,
        options={"ipopt": OPTIONS},
    )


def default_encoding(failures: Scenarios, goal: Goal = "worst") -> str:
    """Return the encoding that most starts succeed with.

    The shared factor where all joints are alike. Elsewhere JJᵀ − tI may be singular at the
    optimum, which stalls it: on planar 4R with one joint twice as likely to fail 20 instead
    of 8 of 20 starts reach the best with one positive factor per deletion.
    """
    models, groups = scenarios(failures), list(_by_weight(failures).values())
    alike = len(groups) == 1 and len(groups[0]) == comb(models[0].joints, models[0].locked)
    return "shared-factor" if goal == "worst" and alike else "positive-factor-per-deletion"


def score(jacobian: FloatArray, failures: Scenarios, goal: Goal = "worst") -> float:
    """What the statement maximises, from J alone."""
    if goal == "expected":
        return unequal_failures.expected_sigma(jacobian, failures)
    return unequal_failures.weighted_worst_case(jacobian, failures)[0]


def check_locked(redundancy: int, fallible: int, locked: int) -> None:
    """Raise InputError if `locked` of the joints that may fail cannot lock at once.

    They can if that is at most the degree of redundancy and leaves at most `MOST_SETS` sets.
    """
    if whole_number("locked joints", locked, 1) > redundancy:
        allowed = f"at most the degree of redundancy, {redundancy}"
        raise InputError("locked joints", locked, allowed)
    check_sets(fallible, locked, MOST_SETS)


def attained_score(
    arm: ColumnModel, failures: Scenarios, goal: Goal = "worst", enough: float = np.inf
) -> float:
    """Return the best score of configurations drawn at random, or the first above enough.

    Raises
    ------
    InputError
        If no configuration has a score above zero.
    """
    rng = np.random.default_rng(1995)
    best = 0.0
    for _ in range(_SAMPLES):
        best = max(best, score(arm.jacobian(arm.sample(rng)), failures, goal))
        if best > enough:
            break
    if best < 1e-6:
        allowed = "joints that can keep full rank after those that may fail lock"
        raise InputError("arm", f"of {arm.description}", allowed)
    return best


def checked_goal(goal: str) -> Goal:
    """Return the value if it is a `Goal`; InputError otherwise."""
    return cast(Goal, one_of("goal", goal, get_args(Goal)))


def _worst(jacobian: ca.SX, failures: Scenarios, attained: float, encoding: str) -> _Levels:
    level, floor = ca.SX.sym("t"), 0.5 * attained**2
    groups = _by_weight(failures)
    encoded = tuple(
        ENCODINGS[encoding](
            jacobian, weight**2 * level, sets, _pivot(jacobian.shape, weight, sets, floor)
        )
        for weight, sets in groups.items()
    )

    def start(numeric: FloatArray) -> tuple[FloatArray, FloatArray]:
        reach = _LEVEL_SHARE * measures.singular_values(numeric)[-1] ** 2
        t = min(max(score(numeric, failures) ** 2, floor), reach)
        return np.array([t]), np.square(list(groups)) * t

    return _Levels(level, np.array([floor]), ca.log(level), encoded, start)


def _expected(jacobian: ca.SX, failures: Scenarios, attained: float, encoding: str) -> _Levels:
    models = scenarios(failures)
    sets = list(largest_weights(failures))
    symbols, least = ca.SX.sym("s", len(sets)), ca.SX.sym("e")
    shares = np.array([[model.shares().get(s, 0.0) for s in sets] for model in models])
    means = ca.DM(shares) @ symbols
    pivot = _NEARLY_SINGULAR * attained
    encoded = tuple(
        ENCODINGS[encoding](jacobian, symbols[i] ** 2, (joints,), pivot)
        for i, joints in enumerate(sets)
    )

    several = len(models) > 1

    def start(numeric: FloatArray) -> tuple[FloatArray, FloatArray]:
        sigmas = measures.remaining_singular_values(numeric, sets)[:, -1]
        reach = np.sqrt(_LEVEL_SHARE) * measures.singular_values(numeric)[-1]
        sigmas = np.clip(sigmas, min(0.1 * attained, reach), reach)
        level = np.append(sigmas, np.min(shares @ sigmas)) if several else sigmas
        return level, sigmas**2

    if not several:
        return _Levels(symbols, np.zeros(len(sets)), means[0], encoded, start)
    rows = Constraint("scenario", means - least, 0.0, np.inf)
    unknowns = ca.vertcat(symbols, least)
    return _Levels(unknowns, np.zeros(len(sets) + 1), least, encoded, start, (rows,))


def _by_weight(failures: Scenarios) -> Mapping[float, Sets]:
    """Sets by weight, the largest first; weights that differ by rounding are one."""
    groups: dict[float, list[tuple[int, ...]]] = {}
    for joints, weight in largest_weights(failures).items():
        near = [known for known in groups if abs(known - weight) <= 1e-9 * weight]
        groups.setdefault(near[0] if near else weight, []).append(joints)
    return MappingProxyType({w: tuple(groups[w]) for w in sorted(groups, reverse=True)})


def _pivot(
    shape: tuple[int, int], weight: float, sets: Sequence[tuple[int, ...]], floor: float
) -> float:
    """Return what every diagonal entry of a factor of JJᵀ − w²tI may be held above.

    If w < 1, JJᵀ ⪰ tI for the likeliest failures' sake leaves (1 − w²)t; if every joint is
    in a set of weight 1, λ_min(JJᵀ − tI) ≥ t/(n − m), see `measures.sigma_bound`; else
    JJᵀ − tI may be singular.
    """
    m, n = shape
    nearly = _NEARLY_SINGULAR * np.sqrt(floor)
    if weight < 1:
        return float(max(np.sqrt((1 - weight**2) * floor), nearly))
    everywhere = {f for joints in sets for f in joints} == set(range(n))
    return float(np.sqrt(floor / (n - m)) if everywhere else nearly)
