"""The search for a posture: where starts begin, how they are solved, and when to stop.

What comes in: an arm and a `Search`. What goes out: an `Outcome`, with one record for each
start. `searched` is the whole of it, and its table says which starts, options and polish a
problem gets.

Words: the *worst case* σ(q) is the least singular value of the Jacobian at the posture q that
any failure leaves (eq. 5); the variable t of max-min is at most σ². A posture has one position
per joint, shape (n,), radians or (prismatic joints) metres. To *polish* is to improve an answer
by another method than Ipopt, see `solving.polish`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.formulations.solving.solve import run
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import of_kind
from lockedjoint.nlp.options import CheckedOptions, OptionValue, check_options
from lockedjoint.nlp.starts import generator
from lockedjoint.robots.kept_apart import kept_apart
from lockedjoint.robots.pose_constrained_arm import PoseConstrainedArm
from lockedjoint.robots.promising_starts import promising_starts
from lockedjoint.robots.search import Search
from lockedjoint.robots.solved_together import solved_together, through_ipopt
from lockedjoint.robots.structural import structural_failures

# Numbers of starts after which the search may stop, if the caller gives none.
_STAGES = (100, 150, 200, 250, 300, 350, 400, 500, 600, 800, 1200, 1600, 2400, 3200, 4800, 6400)
# Number of starts that are chosen before any is solved from, if the caller gives a number of
# starts: it bounds the memory.
_STARTS_AT_ONCE = 1600
# Number of starts that have reached the best before the search may stop. An optimum that few
# starts have reached may be one of many that are as hard to find, and some may be better. With
# fewer the search stops sooner, and more often at a posture that is not the best.
LEAST_REACHED = 10
# Expected share of unseen optima up to which the search may stop. At twice as much one search
# in six of an arm with nine joints misses the best of its fifteen optima.
UNSEEN_SHARE = 0.05
# Options of Ipopt for max-min on robots. An adaptive barrier loses fewer starts; for joints to
# be designed it is the other way round. All but `mu_strategy` and `max_iter` are Ipopt's
# defaults, in place of the options that max-min has for joints to be designed.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        "mu_strategy": "adaptive",
        "max_iter": 150,
        "mu_init": 0.1,
        "barrier_tol_factor": 10.0,
        "fast_step_computation": "no",
    }
)
# Options of Ipopt for promising starts, which are near an optimum already: a small initial
# barrier keeps Ipopt there. Twice as many starts of seven-joint arms reach the best.
NEAR_OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        **OPTIONS,
        "mu_strategy": "monotone",
        "mu_init": 1e-3,
        "bound_push": 1e-3,
        "bound_frac": 1e-3,
    }
)
# Number of random configurations whose best is a start, if many worst cases are computed at
# once.
_RANDOM_CONFIGURATIONS = 512
# Number of random configurations whose best is a start, if each has to be measured alone.
_RANDOM_ONE_BY_ONE = 64
# Option of Ipopt before a polish. If t is below the tolerances Ipopt wanders: with more
# iterations fewer starts reach the best.
_BEFORE_POLISH: Mapping[str, OptionValue] = MappingProxyType({"max_iter": 15})
# Share of σ by which a polished posture may be worse, which is rounding.
_SAME_SHARE = 1e-9
# Encoding of max-min. It has one stage: a start is chosen for its worst case, and a first stage
# that minimises the residual would lose it.
_ENCODING = "schur-complement"


def case_of(search: Search, arm: RobotArm, *, polished: bool = False) -> Case:
    """Return the case that is solved: formulation, arm, settings and options of Ipopt.

    Parameters
    ----------
    search
        `stated` is the module of the formulation, `model` has the unequal probabilities of
        failures (None if all joints are alike), and `failure_count` is the number of joints
        that lock at once.
    arm
        The arm.
    polished
        Whether each answer is polished afterwards: then Ipopt has few iterations.

    Raises
    ------
    InputError
        If a setting is not at its default, and the formulation does not have it.
    """
    of_kind("arm", arm, RobotArm, "a RobotArm")
    settings: dict[str, Any] = (
        {} if search.failure_count == 1 else {"failures": search.failure_count}
    )
    settings |= {} if search.maximise == "worst" else {"maximise": search.maximise}
    options: Mapping[str, OptionValue] = check_options(search.ipopt)
    if search.stated is max_min:
        if search.failure_count == 1 and search.model is None:
            settings["encoding"] = _ENCODING
        own = OPTIONS
        if is_promising(search, arm):
            own = {**NEAR_OPTIONS, **(_BEFORE_POLISH if polished else {})}
        options = CheckedOptions({**own, **options})
    return Case(search.stated, arm, settings, options=options)


def is_promising(search: Search, arm: RobotArm) -> bool:
    """Whether `promising_starts` chooses the starts: if the worst case itself is maximised."""
    return _measured_batched(search, arm) and search.stated is max_min


def _measured_batched(search: Search, arm: RobotArm) -> bool:
    """Whether the worst cases of many configurations can be computed at once."""
    alike = search.model is None and search.failure_count == 1
    return alike and not isinstance(arm, PoseConstrainedArm)


def is_settled(outcome: Outcome) -> bool:
    """Whether the stopping rule holds.

    It holds if at least `LEAST_REACHED` starts reached the best, and `Outcome.unseen_share`
    expects at most the share `UNSEEN_SHARE` of optima to be unseen.
    """
    return len(outcome.reached) >= LEAST_REACHED and outcome.unseen_share <= UNSEEN_SHARE


def searched(arm: RobotArm, search: Search) -> Outcome:
    """Look for a posture from every start, or from as many as the stopping rule wants.

    The starts, options and polish depend on the problem. "σ vanishes" says that some failure
    leaves σ = 0, or nearly, at every posture (`structural_failures`); "one" and "several" are
    numbers of joints that lock at once, all joints being alike; "other" is a pose or distances
    to be kept, or unequal failures.

    =========================  =========  ========================  ======
    problem                    starts     options                   polish
    =========================  =========  ========================  ======
    max-min, one               promising  `NEAR_OPTIONS`            no
    max-min, one, σ vanishes   promising  the same, few iterations  yes
    max-min, several           random     `OPTIONS`                 no
    the same, σ vanishes       random     `OPTIONS`                 yes
    max-min, other             random     `OPTIONS`                 no
    other formulations         random     their own                 no
    =========================  =========  ========================  ======

    The solver is Ipopt, and options of the caller replace these. Starts of the first row are
    solved together (`solved_together`), if the caller gives no options of Ipopt; the best
    answer then goes through Ipopt. A random start is the best of several random configurations.
    """
    # A polish is needed where σ vanishes, because Ipopt's tolerances are not small beside t. It
    # knows neither of a pose to keep nor of unequal failures.
    free = search.model is None and not isinstance(arm, PoseConstrainedArm)
    polished = free and search.stated is max_min and bool(structural_failures(arm))
    case = case_of(search, arm, polished=polished)
    look = partial(
        run,
        seed=search.seed,
        workers=search.workers,
        progress=search.progress,
        polish=partial(_careful_polish, arm, search.failure_count) if polished else None,
    )
    batched = is_promising(search, arm) and not polished and not search.ipopt
    points = np.empty((0, arm.size))
    outcome = Outcome(case, (), complete=True)
    for stage in _stages(search.starts):
        first = len(outcome.records)
        try:
            points = np.concatenate((points, _starts(arm, search, range(first, stage))))
        except KeyboardInterrupt:  # what earlier stages found is kept
            outcome = replace(outcome, complete=False)
            break
        if batched:
            ended = solved_together(arm, case, points[first:], search.seed, first, look)
        else:
            ended = look(case, first=first, starts=stage - first, sample=points[first:])
        if isinstance(arm, PoseConstrainedArm) and arm.clearance is not None:

            def solve_from(stricter: PoseConstrainedArm, starts: FloatArray) -> Outcome:
                return look(case_of(search, stricter), starts=len(starts), sample=starts)

            arm, ended = kept_apart(arm, ended, points, solve_from)
            case = case_of(search, arm)  # with the conditions that were added
        outcome = Outcome(case, outcome.records + ended.records, ended.complete)
        settled = search.starts is None and is_settled(outcome)
        if settled or not ended.complete:
            break
    return through_ipopt(outcome) if batched else outcome


def _stages(starts: int | None) -> Iterable[int]:
    """Return the numbers of starts, ascending, after which each stage ends.

    `starts` is how many the caller asks for; None if the stopping rule decides.
    """
    return (
        _STAGES
        if starts is None
        else (*range(_STARTS_AT_ONCE, starts, _STARTS_AT_ONCE), starts)
    )


def _starts(arm: RobotArm, search: Search, indices: range) -> FloatArray:
    """Return where the starts with N numbers begin, shape (N, n): each has its own seed."""
    generators = [generator(search.seed, k) for k in indices]
    if is_promising(search, arm):
        return promising_starts(arm, generators)
    return np.stack([_best_draw(arm, search, rng) for rng in generators])


def _best_draw(arm: RobotArm, search: Search, rng: np.random.Generator) -> FloatArray:
    """Draw configurations at random; return the one with the best worst case, shape (n,)."""
    if _measured_batched(search, arm):
        points = arm.samples(rng, _RANDOM_CONFIGURATIONS)
        return np.asarray(points[np.argmax(arm.worst_case(points)[0])])

    def score(point: FloatArray) -> float:
        jacobian = arm.jacobian(point)
        if search.model is None:
            return measures.worst_case_sigma(jacobian, search.failure_count)
        return max_min.score(
            jacobian, failures=search.model, maximise=cast(max_min.Goal, search.maximise)
        )

    return max((arm.sample(rng) for _ in range(_RANDOM_ONE_BY_ONE)), key=score)


def _careful_polish(arm: RobotArm, failures: int, point: FloatArray) -> tuple[FloatArray, bool]:
    """Polish a posture, shape (n,); return it if it is not worse, and whether that converged.

    If it is worse, the posture itself is returned, and False.
    """
    moved, converged = polish(arm, point, failures)
    before, after = (
        measures.worst_case_sigma(arm.jacobian(q), failures) for q in (point, moved)
    )
    return (moved, converged) if after >= before * (1 - _SAME_SHARE) else (point, False)
