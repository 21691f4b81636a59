"""The search for a posture: what is looked for, and what many random starts lead to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from formulations import max_min, measures, registry
from formulations.io.objects import Brief
from formulations.measures.unequal_failures import FailureModel
from formulations.registry import Formulation
from formulations.robots.pose_constrained_arm import PoseConstrainedArm
from formulations.robots.robot_arm import RobotArm
from formulations.robots.structural import structural_failures
from formulations.solving.case import Case
from formulations.solving.outcome import Outcome
from formulations.solving.polish import polish
from formulations.solving.solve import run
from nlp.arrays import FloatArray, whole_number
from nlp.errors import of_kind, one_of
from nlp.options import CheckedOptions, OptionValue, check_options
from nlp.problem import FEASIBLE
from nlp.starts import generator

# A start is the best of so many random configurations: a robot has many poor optima, and
# near-singular postures from which max-min hardly moves. The best optimum of a seven-joint arm
# is reached by two to five times as many starts as with 64. It is fewer where each has to be
# measured alone.
_DRAWS, _DRAWS_ONE_BY_ONE = 512, 64
# Numbers of starts after which the search may stop, where the caller gives none.
_STAGES = (100, 200, 400, 800, 1600, 3200, 6400)
# It stops when at most this share of all optima is expected to be unseen, and the best was
# reached by so many starts.
UNSEEN, REACHED = 0.05, 10
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
# A polished posture may be worse by this share, which is rounding.
_SAME = 1e-9
# Where links are too near: so often conditions are added, those of so many answers at once that
# are at least this far apart, in radians or metres.
_EXCHANGES, _ANSWERS, _SAME_ANSWER = 30, 10, 1e-3
# In one stage: a start is chosen for its worst case, which a residual stage would lose.
_ENCODING = "schur-complement"


@dataclass(frozen=True, repr=False)
class Search(Brief):
    """How to look for a posture.

    Attributes
    ----------
    formulation
        What is optimised: a formulation, or its name.
    locked
        How many joints lock at once; other than 1 if the formulation has that setting.
    failures, goal
        How likely each failure is, and what is maximised then; see `max_min`. Of
        max-min. All joints alike if left out.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.
    starts
        How many starts. If left out, as many as the stopping rule wants: 100, and then twice
        as many again and again up to 6400, until at most the share `UNSEEN` of all optima is
        expected to be unseen (`Outcome.unseen_share`) and `REACHED` starts reached the best.
    seed, workers
        See `nlp.multistart.multistart`.
    options
        Ipopt options, over the formulation's own.
    progress
        Whether to show a progress bar.
    """

    formulation: str | Formulation = max_min.NAME
    locked: int = 1
    starts: int | None = None
    seed: int = 0
    workers: int = 1
    options: Mapping[str, object] = field(default_factory=dict)
    progress: bool = False
    failures: FailureModel | None = None
    probabilities_known: bool = True
    goal: max_min.Goal = "worst"

    def __post_init__(self) -> None:
        for name, least in (("locked", 1), ("seed", 0), ("workers", 1)):
            whole_number(name, getattr(self, name), least)
        if self.starts is not None:
            whole_number("starts", self.starts, 1)
        for name in ("progress", "probabilities_known"):
            of_kind(name, getattr(self, name), bool, "true or false")
        of_kind("options", self.options, Mapping, "a mapping from names of options to values")
        one_of("goal", self.goal, max_min.GOALS)
        of_kind("failures", self.failures, (FailureModel, type(None)), "a FailureModel")

    @property
    def stated(self) -> Formulation:
        """The formulation."""
        return registry.formulation_of(self.formulation)

    def case(self, arm: RobotArm) -> Case:
        """Return what is solved for an arm.

        InputError if the formulation does not have a setting that is not at its default.
        """
        of_kind("arm", arm, RobotArm, "a RobotArm")
        defaults = {"locked": 1, "failures": None, "goal": "worst"}
        settings: dict[str, Any] = {
            name: getattr(self, name)
            for name, default in defaults.items()
            if getattr(self, name) != default
        }
        options: Mapping[str, OptionValue] = check_options(self.options)
        if self.stated is max_min:
            if self.locked == 1 and self.failures is None:
                settings["encoding"] = _ENCODING
            options = CheckedOptions({**OPTIONS, **options})
        return Case(self.stated, arm, settings, options=options)


def enough(outcome: Outcome) -> bool:
    """Whether the stopping rule of `Search` holds."""
    return len(outcome.reached) >= REACHED and outcome.unseen_share <= UNSEEN


def searched(arm: RobotArm, search: Search) -> Outcome:
    """Look for a posture from every start, or from as many as the stopping rule wants."""
    case = search.case(arm)
    # Where hardly anything is left, Ipopt's tolerances are not small beside t. A pose to keep,
    # or unequal failures, are not what the polish knows of.
    free = search.failures is None and not isinstance(arm, PoseConstrainedArm)
    near = free and search.stated is max_min and bool(structural_failures(arm))
    look = partial(
        run,
        seed=search.seed,
        workers=search.workers,
        progress=search.progress,
        polish=partial(_careful_polish, arm, search.locked) if near else None,
    )
    draw: Any = partial(_promising_start, arm, search)
    points: list[FloatArray] = []
    outcome = Outcome(case, (), complete=True)
    for stage in _STAGES if search.starts is None else (search.starts,):
        first = len(outcome.records)
        more = partial(look, first=first, starts=stage - first)
        if isinstance(arm, PoseConstrainedArm):  # its configurations are found once, here
            points += [draw(generator(search.seed, k)) for k in range(first, stage)]
            ended = more(case, sample=np.stack(points))
            if arm.clearance is not None:
                arm, ended = _kept_apart(arm, search, ended, points, look)
                case = search.case(arm)
        else:
            ended = more(case, sample=draw)
        outcome = Outcome(case, outcome.records + ended.records, ended.complete)
        if enough(outcome) or not ended.complete:
            break
    return outcome


def _kept_apart(
    arm: PoseConstrainedArm,
    search: Search,
    ended: Outcome,
    points: Sequence[FloatArray],
    look: Callable[..., Outcome],
) -> tuple[PoseConstrainedArm, Outcome]:
    """Add conditions where answers leave links too near, and solve again from these.

    What then does not converge begins once more where it began at first. The other answers meet
    all conditions: they are optima with these, too.
    """
    records = {record.index: record for record in ended.records}
    complete, again = ended.complete, set[int]()
    for _ in range(_EXCHANGES):
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
        more = look(search.case(arm), starts=len(where), sample=np.stack(where))
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
        if all(np.max(np.abs(q - other)) > _SAME_ANSWER for other in seen):
            conditions += arm.clearance.violated(q)
            seen.append(q)
        if len(seen) == _ANSWERS:
            break
    stricter = replace(arm, clearance=replace(arm.clearance, conditions=tuple(conditions)))
    # What starts are drawn from does not depend on the conditions.
    stricter.__dict__["configurations"] = arm.configurations
    return stricter


def _promising_start(arm: RobotArm, search: Search, rng: np.random.Generator) -> FloatArray:
    """Draw configurations at random; return the one with the best worst case."""
    alike = search.failures is None and search.locked == 1
    if alike and not isinstance(arm, PoseConstrainedArm):
        points = arm.samples(rng, _DRAWS)
        return np.asarray(points[np.argmax(arm.worst_case(points)[0])])

    def score(point: FloatArray) -> float:
        jacobian = arm.jacobian(point)
        if search.failures is None:
            return measures.worst_case_sigma(jacobian, search.locked)
        return max_min.score(jacobian, failures=search.failures, goal=search.goal)

    return max((arm.sample(rng) for _ in range(_DRAWS_ONE_BY_ONE)), key=score)


def _careful_polish(arm: RobotArm, locked: int, point: FloatArray) -> tuple[FloatArray, bool]:
    """Return the polished point if it is not worse, and whether that converged."""
    moved, converged = polish(arm, point, locked)
    before, after = (measures.worst_case_sigma(arm.jacobian(q), locked) for q in (point, moved))
    return (moved, converged) if after >= before * (1 - _SAME) else (point, False)
