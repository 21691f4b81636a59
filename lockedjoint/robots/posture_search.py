"""The search for a posture: what is looked for, and what many starts lead to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
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
from lockedjoint.nlp.problem import FEASIBLE
from lockedjoint.nlp.starts import generator
from lockedjoint.robots.pose_constrained_arm import PoseConstrainedArm
from lockedjoint.robots.promising_starts import promising_starts
from lockedjoint.robots.search import Search
from lockedjoint.robots.solved_together import solved_together, through_ipopt
from lockedjoint.robots.structural import structural_failures

# Numbers of starts after which the search may stop, if the caller gives none.
_STAGES = (100, 150, 200, 250, 300, 350, 400, 500, 600, 800, 1200, 1600, 2400, 3200, 4800, 6400)
# Number of starts that are chosen before any is solved from, if the caller gives their number.
_STARTS_AT_ONCE = 1600
# The search stops when at least so many starts have reached the best, if in addition few optima
# are expected to be unseen. N starts and w optima then make it improbable, w(w + 1)/(N(N − 1)),
# below 0.25 %, that one more start ends at an optimum that none has ended at.
LEAST_REACHED = 10
# The share of unseen optima may be at most this. At twice as much one search in six of an arm
# with nine joints misses the best of its fifteen optima.
UNSEEN_SHARE = 0.05
# Max-min on robots: an adaptive barrier loses fewer starts; for joints to be designed it is the
# other way round. The others but one are Ipopt's defaults, which the problem's options change.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        "mu_strategy": "adaptive",
        "max_iter": 150,
        "mu_init": 0.1,
        "barrier_tol_factor": 10.0,
        "fast_step_computation": "no",
    }
)
# Promising starts are near an optimum already: a small initial barrier keeps Ipopt there. Twice
# as many starts of seven-joint arms reach the best.
NEAR_OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        **OPTIONS,
        "mu_strategy": "monotone",
        "mu_init": 1e-3,
        "bound_push": 1e-3,
        "bound_frac": 1e-3,
    }
)
# Number of random configurations whose best is a start for formulations other than max-min.
_RANDOM_CONFIGURATIONS = 512
# Number of random configurations whose best is a start if each has to be measured alone.
_RANDOM_ONE_BY_ONE = 64
# Ipopt wanders if t is below the tolerances: fewer starts reach the best after more iterations.
_POLISHED: Mapping[str, OptionValue] = MappingProxyType({"max_iter": 15})
# Share by which a polished posture may be worse, which is rounding.
_SAME_SHARE = 1e-9
# Largest number of times that conditions are added if links are too near.
_MOST_EXCHANGES = 30
# Largest number of answers whose conditions are added at once.
_MOST_ANSWERS = 10
# Difference of a joint above which answers count as apart.
_SAME_ANSWER_M_OR_RAD = 1e-3
# The encoding has one stage: a start is chosen for its worst case, and a stage of the residual
# would lose it.
_ENCODING = "schur-complement"


def case_of(search: Search, arm: RobotArm, *, polished: bool = False) -> Case:
    """Return what is solved for an arm, perhaps only until each start is polished.

    `search.stated` is the module of the formulation, `search.model` the unequal probabilities
    of failures, None if all joints are alike, and `search.failure_count` the number of joints
    that lock at once. InputError if the formulation does not have a setting that is not at its
    default.
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
            own = {**NEAR_OPTIONS, **(_POLISHED if polished else {})}
        options = CheckedOptions({**own, **options})
    return Case(search.stated, arm, settings, options=options)


def is_promising(search: Search, arm: RobotArm) -> bool:
    """Whether `promising_starts` chooses the starts: if σ is what is maximised."""
    return _measured_batched(search, arm) and search.stated is max_min


def _measured_batched(search: Search, arm: RobotArm) -> bool:
    """Whether the worst cases of many configurations can be computed at once."""
    alike = search.model is None and search.failure_count == 1
    return alike and not isinstance(arm, PoseConstrainedArm)


def is_settled(outcome: Outcome) -> bool:
    """Whether at least `LEAST_REACHED` starts reached the best, and few optima are unseen.

    At most `UNSEEN_SHARE`, by what `Outcome.unseen_share` expects.
    """
    return len(outcome.reached) >= LEAST_REACHED and outcome.unseen_share <= UNSEEN_SHARE


def searched(arm: RobotArm, search: Search) -> Outcome:
    """Look for a posture from every start, or from as many as the stopping rule wants.

    The starts, options and polish depend on the problem. σ vanishes if some failure always
    leaves none (`structural_failures`); "one" and "several" are joints that lock at once, all
    alike; "other" is a pose or distances to be kept, or unequal failures.

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

    The solver is Ipopt. Starts of the first row are solved together, if the caller gives no
    options of Ipopt; what they lead to then goes through Ipopt.
    Options of the caller replace these. A random start is the best of several configurations.
    """
    # Ipopt's tolerances are not small beside t if hardly anything is left. The polish knows
    # neither of a pose to keep nor of unequal failures.
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
            arm, ended = _kept_apart(arm, search, ended, points, look)
            case = case_of(search, arm)  # with what is to be kept
        outcome = Outcome(case, outcome.records + ended.records, ended.complete)
        settled = search.starts is None and is_settled(outcome)
        if settled or not ended.complete:
            break
    return through_ipopt(outcome) if batched else outcome


def _stages(starts: int | None) -> Iterable[int]:
    """Return the numbers of starts after which to look, or so many at a time of those asked."""
    return (
        _STAGES
        if starts is None
        else (*range(_STARTS_AT_ONCE, starts, _STARTS_AT_ONCE), starts)
    )


def _kept_apart(
    arm: PoseConstrainedArm,
    search: Search,
    ended: Outcome,
    points: FloatArray,
    look: Callable[..., Outcome],
) -> tuple[PoseConstrainedArm, Outcome]:
    """Add conditions where answers leave links too near, and solve again from these.

    What then does not converge begins once more where it began at first. The other answers meet
    all conditions: they are optima with these, too.
    """
    records = {record.index: record for record in ended.records}
    complete, again = ended.complete, set[int]()
    for _ in range(_MOST_EXCHANGES):
        failed = {k for k, record in records.items() if not record.converged} & again
        near = [  # of which only the links' distances are missing
            k
            for k, record in records.items()
            if record.converged and record.violation <= FEASIBLE and not record.valid
        ]
        again = set(near)
        if not complete or not (near or failed):
            break
        arm = _with_conditions(arm, [records[k].variables for k in near])
        where = [records[k].variables if k in again else points[k] for k in (*near, *failed)]
        more = look(case_of(search, arm), starts=len(where), sample=np.stack(where))
        complete = more.complete
        for record in more.records:
            index = (*near, *failed)[record.index]
            spent = record.cpu_seconds + records[index].cpu_seconds
            records[index] = replace(record, index=index, cpu_seconds=spent)
    return arm, Outcome(ended.case, tuple(records.values()), complete)


def _with_conditions(arm: PoseConstrainedArm, answers: list[FloatArray]) -> PoseConstrainedArm:
    """Add those of some answers that are apart from each other."""
    assert arm.clearance is not None
    conditions, seen = list(arm.clearance.conditions), list[FloatArray]()
    for q in answers:
        if all(np.max(np.abs(q - other)) > _SAME_ANSWER_M_OR_RAD for other in seen):
            conditions += arm.clearance.violated(q)
            seen.append(q)
        if len(seen) == _MOST_ANSWERS:
            break
    return arm.with_conditions(tuple(conditions))


def _starts(arm: RobotArm, search: Search, indices: range) -> FloatArray:
    """Return where the starts of these numbers begin, shape (N, n)."""
    generators = [generator(search.seed, k) for k in indices]
    if is_promising(search, arm):
        return promising_starts(arm, generators)
    return np.stack([_best_draw(arm, search, rng) for rng in generators])


def _best_draw(arm: RobotArm, search: Search, rng: np.random.Generator) -> FloatArray:
    """Draw configurations at random; return the one with the best worst case."""
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
    """Return the polished point if it is not worse, and whether that converged."""
    moved, converged = polish(arm, point, failures)
    before, after = (
        measures.worst_case_sigma(arm.jacobian(q), failures) for q in (point, moved)
    )
    return (moved, converged) if after >= before * (1 - _SAME_SHARE) else (point, False)
