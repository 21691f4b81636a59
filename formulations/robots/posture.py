"""The most failure-tolerant posture of a robot within its joints' limits.

Of all postures, or of those at a pose of the tool, with links that keep a distance from each
other: see `held_pose`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from formulations import catalogue, max_min, measures, unequal_max_min
from formulations.measures.unequal_failures import Scenarios, scenarios
from formulations.robots.chain import LARGEST
from formulations.robots.clearance import Clearance, Closest
from formulations.robots.held_pose import HeldArm, LockedReach, Pose
from formulations.robots.robot_arm import RobotArm
from formulations.robots.robot_assessment import RobotAssessment, assess, assess_unequal
from formulations.robots.structural import structural_failures
from formulations.robots.tree import RobotError
from formulations.solving.outcome import REACHED_BEST
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.multistart import Run, Study, multistart
from nlp.problem import Constraint, Problem
from nlp.solution import ACCEPTABLE, SUCCESS

# A start is the best of so many random configurations: a robot has many poor optima, and
# near-singular postures from which max-min hardly moves.
DRAWS = 64
# Max-min on robots: an adaptive barrier loses fewer starts; for joints to be designed it is the
# other way round. The last two are Ipopt's defaults, which some encodings change.
OPTIONS: Mapping[str, Mapping[str, object]] = MappingProxyType(
    {
        max_min.NAME: {
            "mu_strategy": "adaptive",
            "max_iter": 150,
            "mu_init": 0.1,
            "barrier_tol_factor": 10.0,
        }
    }
)
# A polished posture may be worse by this share, which is rounding.
_SAME = 1e-9
# In one stage: a start is chosen for its worst case, which a residual stage would lose.
_ENCODING = "reduced"


@dataclass(frozen=True, eq=False)
class Posture:
    """The best posture found, and how it was found.

    Attributes
    ----------
    formulation
        What was optimised.
    assessment
        The robot there.
    mid_range_sigma
        Worst case midway between the limits, for comparison.
    seed, starts, reached_best
        Seed, starts that ended, and those that converged to a merit within `REACHED_BEST` of
        the best such merit. If none converged, `reached_best` is 0 and the posture is the best
        at which a start stopped: within the limits, and no optimum. No starts are made where
        a failure is structural.
    status_counts
        Ipopt's return statuses and how often each came.
    complete
        Whether all starts ended.
    at
        At a pose: how nearly it is reached, and where each joint may lock so that it can be
        reached again.
    clearance
        Where links keep a distance: the nearest two, and what was looked at.
    failures
        Where failures are unequal: what `assess_unequal` says.
    """

    formulation: str
    assessment: RobotAssessment
    mid_range_sigma: float
    seed: int
    starts: int
    reached_best: int
    status_counts: Mapping[str, int]
    complete: bool
    at: AtPose | None = None
    clearance: KeptClearance | None = None
    failures: Mapping[str, Any] | None = None

    def to_dict(self) -> dict[str, object]:
        """Return the fields as plain values, the assessment's among them."""
        plain = asdict(self)
        for name in ("at", "clearance"):  # only where they were asked for
            plain = plain if plain[name] else {k: v for k, v in plain.items() if k != name}
        plain |= plain.pop("failures") or {}
        formulation, assessment = plain.pop("formulation"), plain.pop("assessment")
        model = assessment["robot"]
        return {"formulation": formulation, "model": model, **assessment, **plain}


@dataclass(frozen=True)
class AtPose:
    """A pose, and how it is reached.

    Attributes
    ----------
    pose
        What was asked for.
    position_error, orientation_error
        Distance in metres and angle in radians from it, by forward kinematics in NumPy.
    after_failure
        Where each joint may lock so that the others can reach the pose.
    """

    pose: Pose
    position_error: float
    orientation_error: float
    after_failure: tuple[LockedReach, ...]


@dataclass(frozen=True)
class KeptClearance:
    """How near links come to each other.

    Attributes
    ----------
    least
        The distance that was asked for, metres.
    capsules
        The least distance between capsules, metres.
    closest
        The nearest two links, by their geometry.
    pairs
        How many pairs of links were looked at.
    left_out
        Pairs that were not, see `clearance`.
    closest_left_out
        The nearest of these, by their geometry.
    visual
        Links whose visual geometry was taken, because they have no other.
    """

    least: float
    capsules: float
    closest: Closest
    pairs: int
    left_out: tuple[tuple[str, str], ...]
    closest_left_out: Closest | None
    visual: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """How to look for a posture.

    Attributes
    ----------
    formulation
        A name in `formulations.catalogue`.
    locked
        How many joints lock at once; other than 1 if the formulation has that setting.
    failures, goal
        How likely each failure is, and what is maximised then; see `unequal_max_min`. Of
        max-min. All joints alike if left out.
    probabilities_known
        Whether the probabilities mean anything beyond their ratios.
    starts, seed, workers
        See `nlp.multistart.multistart`.
    options
        Ipopt options, over the formulation's own.
    progress
        Whether to show a progress bar on a terminal.
    """

    formulation: str = max_min.NAME
    locked: int = 1
    starts: int = 100
    seed: int = 0
    workers: int = 1
    options: Mapping[str, object] = field(default_factory=dict)
    progress: bool = False
    failures: Scenarios | None = None
    probabilities_known: bool = True
    goal: unequal_max_min.Goal = "worst"

    def __post_init__(self) -> None:
        settings = catalogue.formulation(self.formulation).SETTINGS
        unequal_max_min.checked_goal(self.goal)
        if self.failures is not None:
            if "failures" not in settings:
                allowed = f"none for the formulation {self.formulation}"
                raise InputError("failure probabilities", "given", allowed)
            given = scenarios(self.failures)[0].locked
            if given != self.locked:
                raise InputError(
                    "locked joints", self.locked, f"{given}, as in the failure model"
                )
        elif self.goal != "worst":
            raise InputError("goal", self.goal, "worst where all failures are alike")
        if self.locked != 1 and "locked" not in settings:
            allowed = f"1 for the formulation {self.formulation}"
            raise InputError("locked joints", self.locked, allowed)


def best_posture(
    arm: RobotArm,
    search: Search | None = None,
    *,
    at: Pose | None = None,
    clearance: Clearance | None = None,
) -> Posture:
    """Search for the posture that is best by a formulation's merit.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    search
        What is optimised, and from how many starts; by default max-min from 100.
    at
        Where the tip's point is to be; free if left out.
    clearance
        Which distance links keep from each other; they may touch if left out.

    Returns
    -------
    Posture
        For max-min on an arm with a structural failure, after which σ is 0 at every posture,
        any one, from no start: that midway between the limits, or at the pose; see
        `formulations.robots.structural`.

    Raises
    ------
    RobotError
        If no start gave a posture that satisfies the formulation, it has more equations than
        variables, or, for max-min, the arm cannot do the task even before a failure.
    InputError
        If the length is given, the task has linear or rotational directions only, and the
        formulation's merit is best for a small Jacobian. If the pose is out of reach.
    KeyboardInterrupt
        If interrupted before the first start ended.
    """
    search = search or Search()
    if at is not None or clearance is not None:
        arm = HeldArm(arm.chain, arm.task, arm.length, at, clearance)
    # At once, because it fails where the arm has no characteristic length.
    middle = arm.jacobian(arm.chain.mid_range)
    if _hopeless(arm, search):
        return _any_posture(arm, search, middle, at, clearance)
    _check(arm, search, middle)
    study = _candidates(arm, search)
    if not study.results:
        raise KeyboardInterrupt
    statuses = Counter(one.return_status for one in study.results)
    valid = [one for one in study.results if np.isfinite(one.merit)]
    if not valid:
        counts = ", ".join(f"{status} {count}" for status, count in sorted(statuses.items()))
        where = f"posture of {arm.description} for {search.formulation}"
        free = "pose or distance" if isinstance(arm, HeldArm) else "task or robot"
        allowed = f"a {free} for which one exists ({counts})"
        raise RobotError(where, f"not found from {len(study.results)} starts", allowed)
    pick = min if catalogue.formulation(search.formulation).SENSE == "minimise" else max
    converged = [one for one in valid if one.converged]
    ranked = converged or valid
    merit = pick(one.merit for one in ranked)
    best = [one for one in ranked if abs(one.merit - merit) <= REACHED_BEST]
    shown = max(best, key=lambda one: one.worst_case_sigma)
    point, failures = shown.configuration, None
    if search.failures is not None:
        known = search.probabilities_known
        failures = assess_unequal(arm, arm.jacobian(point), search.failures, known)
    return Posture(
        formulation=search.formulation,
        assessment=assess(arm, point, search.locked),
        mid_range_sigma=measures.worst_case_sigma(middle, search.locked),
        seed=search.seed,
        starts=len(study.results),
        reached_best=len(best) if converged else 0,
        status_counts=dict(sorted(statuses.items())),
        complete=study.complete,
        at=None if at is None else _at_pose(arm, at, point),
        clearance=None if clearance is None else kept_clearance(clearance, point),
        failures=failures,
    )


def kept_clearance(clearance: Clearance, configuration: FloatArray) -> KeptClearance:
    """Measure how near links come to each other at a configuration, shape (n,)."""
    return KeptClearance(
        least=clearance.least,
        capsules=float(np.min(clearance.distances(configuration[:, None]))),
        closest=clearance.closest(configuration, clearance.pairs),
        pairs=len(clearance.pairs),
        left_out=tuple(map(clearance.names, clearance.left_out)),
        closest_left_out=clearance.closest(configuration, clearance.left_out)
        if clearance.left_out
        else None,
        visual=clearance.visual,
    )


def _at_pose(arm: RobotArm, pose: Pose, point: FloatArray) -> AtPose:
    assert isinstance(arm, HeldArm)
    off, angle = pose.errors(arm.kinematics, point[:, None])
    return AtPose(pose, float(off[0]), float(angle[0]), arm.locked_reach(point))


def _hopeless(arm: RobotArm, search: Search) -> bool:
    """Whether the formulation needs full rank after a failure that leaves it nowhere."""
    if "locked" not in catalogue.formulation(search.formulation).SETTINGS:
        return False
    if search.goal != "worst":
        return False
    free = RobotArm(arm.chain, arm.task, arm.length)
    exact = [one for one in structural_failures(free) if one.kind == "structural"]
    if len(exact) == arm.size and all(one.miss is None for one in exact):
        shown = ",".join(arm.task.directions)
        allowed = "directions in which the tip can move at some posture"
        raise RobotError(f"task of {arm.description}", shown, allowed)
    models = scenarios(search.failures) if search.failures else ()
    fallible = {arm.chain.names[f] for one in models for f in one.fallible}
    return any(not models or one.joint in fallible for one in exact)


def _any_posture(
    arm: RobotArm,
    search: Search,
    middle: FloatArray,
    at: Pose | None,
    clearance: Clearance | None,
) -> Posture:
    """Return that midway between the limits or, with something to keep to, one that does."""
    point, failures = arm.chain.mid_range, None
    if isinstance(arm, HeldArm):
        point = arm.sample(np.random.default_rng(search.seed))
        if not arm.holds(point):
            where = f"posture of {arm.description}"
            allowed = "a pose or distance that one draw meets: every posture is as bad"
            raise RobotError(where, "not found", allowed)
    if search.failures is not None:
        known = search.probabilities_known
        failures = assess_unequal(arm, arm.jacobian(point), search.failures, known)
    return Posture(
        formulation=search.formulation,
        assessment=assess(arm, point, search.locked),
        mid_range_sigma=measures.worst_case_sigma(middle, search.locked),
        seed=search.seed,
        starts=0,
        reached_best=0,
        status_counts={},
        complete=True,
        at=None if at is None else _at_pose(arm, at, point),
        clearance=None if clearance is None else kept_clearance(clearance, point),
        failures=failures,
    )


def _check(arm: RobotArm, search: Search, middle: FloatArray) -> None:
    """Refuse what the search cannot find; `middle` is the Jacobian midway between limits."""
    stated = catalogue.formulation(search.formulation)
    minimised = stated.SENSE == "minimise" and arm.length is not None and not arm.task.mixed
    if minimised and stated.merit(middle / 2) < stated.merit(middle):
        name = stated.NAME
        allowed = f"none for the {name} of such a task, which a small Jacobian makes small"
        raise InputError("length", arm.length, allowed)
    problem = _problem(arm, search)
    equations = sum(int(np.sum(_equal(one))) for one in problem.constraints)
    unknowns = problem.variables.numel()
    if equations > unknowns:
        where = f"{stated.NAME} of {arm.description}"
        allowed = f"at most {unknowns}; the residual comes as near to isotropy as can be"
        raise RobotError(where, f"a matter of {equations} independent equations", allowed)


def _equal(constraint: Constraint) -> npt.NDArray[np.bool_]:
    rows = constraint.expression.numel()
    lower, upper = (np.broadcast_to(end, rows) for end in (constraint.lower, constraint.upper))
    return np.asarray(lower == upper)


def _problem(arm: RobotArm, search: Search) -> Problem:
    stated = catalogue.formulation(search.formulation)
    if search.failures is not None:
        return unequal_max_min.build(arm, search.failures, search.goal)
    taken: dict[str, Any] = {"locked": search.locked} if "locked" in stated.SETTINGS else {}
    if "encoding" in stated.SETTINGS and search.locked == 1:
        taken["encoding"] = _ENCODING
    build: Callable[..., Problem] = stated.build
    return build(arm, **taken)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The posture from one start, within the limits, measured from its J alone.

    The merit is NaN if the posture does not satisfy the formulation. `polished` is whether
    `max_min.Polish` converged, None where it was not called.
    """

    return_status: str
    merit: float
    worst_case_sigma: float
    configuration: FloatArray
    polished: bool | None = None

    @property
    def converged(self) -> bool:
        if self.polished is not None:
            return self.polished
        return self.return_status in (SUCCESS, ACCEPTABLE)


def _candidates(arm: RobotArm, search: Search) -> Study[_Candidate]:
    stated = catalogue.formulation(search.formulation)
    # Where hardly anything is left, Ipopt's tolerances are not small beside t.
    # A pose to keep, or unequal failures, are not what the polish knows of.
    free = search.failures is None and not isinstance(arm, HeldArm)
    near = free and "encoding" in stated.SETTINGS and bool(structural_failures(arm))
    polish = max_min.Polish(arm, search.locked) if near else None
    own = OPTIONS.get(search.formulation, stated.OPTIONS)
    return multistart(
        partial(_problem, arm, search),
        partial(_promising_start, arm=arm, search=search),
        starts=search.starts,
        rng=search.seed,
        workers=search.workers,
        options={**own, **search.options},
        label=f"{search.formulation} {arm.chain.robot}" if search.progress else None,
        judge=partial(_judge, arm=arm, search=search, polish=polish),
        figure=lambda candidate: candidate.merit,
    )


def _promising_start(rng: np.random.Generator, arm: RobotArm, search: Search) -> FloatArray:
    """Draw configurations at random and return the one with the best worst case."""
    drawn = [arm.sample(rng) for _ in range(DRAWS)]

    def left(point: FloatArray) -> float:
        if search.failures is None:
            return measures.worst_case_sigma(arm.jacobian(point), search.locked)
        return unequal_max_min.merit(arm.jacobian(point), search.failures, search.goal)

    return max(drawn, key=left)


def _judge(
    run: Run, arm: RobotArm, search: Search, polish: max_min.Polish | None = None
) -> _Candidate:
    """Measure the posture that a start led to, moved to within the limits or one turn."""
    point = run.solution.variables[: arm.size]
    merit = sigma = float("nan")
    polished: bool | None = None
    if np.all(np.abs(point) <= LARGEST):
        lower, upper = arm.bounds
        endless = ~np.isfinite(lower) & ~np.isfinite(upper) & ~np.array(arm.chain.prismatic)
        turned = np.where(endless, (point + np.pi) % (2 * np.pi) - np.pi, point)
        point = np.clip(turned, lower, upper)
        if polish is not None:
            point, polished = _better(arm, search.locked, point, polish)
        matrix = arm.jacobian(point)
        if not arm.holds(point):
            pass
        elif search.failures is not None:
            merit = unequal_max_min.merit(matrix, search.failures, search.goal)
        else:
            merit = catalogue.formulation(search.formulation).merit(matrix, search.locked)
        sigma = measures.worst_case_sigma(matrix, search.locked)
    merit = merit if np.isfinite(merit) else float("nan")
    return _Candidate(run.solution.status.return_status, merit, sigma, point, polished)


def _better(
    arm: RobotArm, locked: int, point: FloatArray, polish: max_min.Polish
) -> tuple[FloatArray, bool]:
    """Return the polished point if it is not worse, and whether that converged."""
    found, converged = polish(point)
    before, after = (
        measures.worst_case_sigma(arm.jacobian(one), locked) for one in (point, found)
    )
    return (found, converged) if after >= before * (1 - _SAME) else (point, False)
