"""The most failure-tolerant posture of a robot within its joints' limits.

What comes in: a robot, a `Search`, and perhaps a pose of the tool. What goes out: a `Posture`,
measured from the Jacobian anew. `pose_constrained_arm` holds a pose and keeps links apart,
`posture_search` makes the starts; this file refuses what cannot be found, calls them, and
describes the best answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from html import escape
from typing import Any

import numpy as np

from lockedjoint.clearance.link_clearance import Closest, LinkClearance
from lockedjoint.formulations import isotropy, measures
from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.tree import RobotError
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind, printable
from lockedjoint.nlp.problem import Constraint
from lockedjoint.robot import Robot, with_settings
from lockedjoint.robots.pose_constrained_arm import LockedReach, PoseConstrainedArm
from lockedjoint.robots.posture_search import case_of, is_settled, searched
from lockedjoint.robots.robot_assessment import (
    RobotAssessment,
    measure_robot,
    measure_robot_unequal,
)
from lockedjoint.robots.search import Search
from lockedjoint.robots.structural import structural_failures


@dataclass(frozen=True, eq=False)
class Posture:
    """The best posture found, and how it was found.

    Attributes
    ----------
    formulation
        Name of the formulation, such as max-min: what was optimised.
    assessment
        Configuration, worst case and more of the robot at the posture.
    mid_range_sigma
        Worst case σ (eq. 5) midway between the limits, for comparison, in units of ℓ.
    seed, starts, reached_best
        Seed, starts that ended, and those that converged to a score within `REACHED_BEST` of
        the best such score. If none converged, `reached_best` is 0 and the posture is the best
        at which a start stopped: within the limits, and no optimum. No starts are made where
        a failure is structural.
    optima, unseen_share
        How many different scores the starts ended at, and the expected share of optima that
        none has ended at yet, from 0 to 1; see `Outcome.unseen_share`.
    settled
        Whether the stopping rule holds, see `Search`: that a better posture exists is then
        unlikely, and not excluded.
    status_counts
        How starts ended, in words of Ipopt, and how often each came.
    complete
        Whether all starts ended.
    at
        At a pose: how nearly it is reached, and where each joint may lock so that the others
        can still reach it; else None.
    clearance
        Where links keep a distance: the nearest two, and what was looked at; else None.
    unequal
        Where failures are unequal: what `measure_robot_unequal` returns; else None.
    """

    formulation: str
    assessment: RobotAssessment
    mid_range_sigma: float
    seed: int
    starts: int
    reached_best: int
    optima: int
    unseen_share: float
    settled: bool
    status_counts: Mapping[str, int]
    complete: bool
    at: AtPose | None = None
    clearance: KeptClearance | None = None
    unequal: Mapping[str, Any] | None = None

    def __repr__(self) -> str:
        """Say in one line what was found, and how surely."""
        at = self.assessment
        locked = printable(", ".join(at.worst_case_joints))
        found = f"worst case σ = {at.worst_case_sigma:.6g} ({locked} locked)"
        starts = f"best reached by {self.reached_best} of {self.starts} starts"
        return f"<Posture: {self.formulation}, {found}, {starts}>"

    def _repr_html_(self) -> str:
        """Return the line and what each failure leaves, for notebooks."""
        return f"<p>{escape(repr(self))}</p>{self.assessment._repr_html_()}"

    def to_dict(self) -> dict[str, object]:
        """Return the fields by name as plain values; the assessment's stand beside them."""
        plain = asdict(self)
        for name in ("at", "clearance"):  # only where they were asked for
            plain = plain if plain[name] else {k: v for k, v in plain.items() if k != name}
        plain |= plain.pop("unequal") or {}
        formulation, assessment = plain.pop("formulation"), plain.pop("assessment")
        model = assessment["robot"]
        return {"formulation": formulation, "model": model, **assessment, **plain}


@dataclass(frozen=True)
class AtPose:
    """The pose that was asked for, and how it is reached, by forward kinematics in NumPy."""

    pose: Pose
    position_error: float  #: Distance, metres.
    orientation_error: float  #: Angle, radians.
    #: Each entry says where one joint may lock so that the others can reach the pose.
    after_failure: tuple[LockedReach, ...]


@dataclass(frozen=True)
class KeptClearance:
    """How near links come to each other, by their geometry, metres."""

    least: float  #: The distance that was asked for.
    closest: Closest  #: The nearest two links.
    pairs: int  #: Number of pairs of links that were checked.
    left_out: tuple[tuple[str, str], ...]  #: Pairs that were not, see `LinkClearance`.
    closest_left_out: Closest | None  #: The nearest of these.
    #: Distances that pairs keep which are never so far apart, by "LINK and LINK".
    nearer: Mapping[str, float]
    visual: tuple[str, ...]  #: Links whose visual geometry was taken, for want of another.
    unchecked: tuple[str, ...]  #: Links with geometry that are in none of the pairs.


def posture(
    robot: object, search: Search | None = None, *, at: Pose | None = None, **settings: Any
) -> Posture:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one. Its links keep its `clearance` from each other and from
        its obstacles.
    search
        What is optimised, and from how many starts; by default max-min, from as many as the
        stopping rule wants.
    at
        The pose that the tool has to keep; by default any.
    **settings
        Fields of `Search`, in place of those of the search, such as ``starts=20``.

    Returns
    -------
    Posture
        The configuration, what each failure leaves there, and how it was found.

    Raises
    ------
    RobotError
        If no start gave a posture that satisfies the formulation.
    InputError
        If an argument is not allowed, or the pose is out of reach.
    KeyboardInterrupt
        If interrupted before the first start ended.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> best = lj.posture("example", starts=3)
    >>> print(f"{best.assessment.worst_case_sigma:.1f}")
    0.2
    >>> at = lj.posture("example", at=lj.Pose((0.45, 0.1, 0.4)), starts=2)
    >>> at.at.position_error < 1e-6
    True
    """
    opened = Robot.of(robot)
    chosen = with_settings(Search, search, settings)
    return best_posture(opened.arm, chosen, at=at, clearance=opened.apart)


def best_posture(
    arm: RobotArm,
    search: Search | None = None,
    *,
    at: Pose | None = None,
    clearance: LinkClearance | None = None,
) -> Posture:
    """Search for the posture that is best by a formulation's score.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    search
        What is optimised, and from how many starts; by default max-min, from as many as the
        stopping rule wants.
    at
        Where the tip's point is to be; free if left out.
    clearance
        Which distance links keep from each other; they may touch if left out.

    Returns
    -------
    Posture
        For max-min on an arm with a structural failure, after which σ is 0 at every posture,
        any one, from no start: that midway between the limits, or at the pose; see
        `lockedjoint.robots.structural`.

    Raises
    ------
    RobotError
        If no start gave a posture that satisfies the formulation, it has more equations than
        variables, or, for max-min, the arm cannot do the task even before a failure.
    InputError
        If the length is given, the task has linear or rotational directions only, and the
        formulation's score is best for a small Jacobian. If the pose is out of reach.
    KeyboardInterrupt
        If interrupted before the first start ended.
    """
    of_kind("arm", arm, RobotArm, "a RobotArm, such as Robot(file, tip).arm")
    search = Search() if search is None else search
    of_kind("search", search, Search, "a Search, such as Search(starts=100)")
    allowed = "a LinkClearance, as `read_clearance` returns it"
    of_kind("clearance", clearance, (LinkClearance, type(None)), allowed)
    of_kind("at", at, (Pose, type(None)), "a Pose, such as Pose((x, y, z))")
    if at is not None or clearance is not None:
        arm = PoseConstrainedArm(arm.chain, arm.task, arm.length, at, clearance)
    # The Jacobian comes first, because it fails if the arm has no characteristic length.
    middle = arm.jacobian(arm.chain.mid_range)
    if _zero_everywhere(arm, search):
        return _described(arm, search, _any_posture(arm, search))
    _check(arm, search, middle)
    outcome = searched(arm, search)
    if not outcome.records:
        raise KeyboardInterrupt
    if not any(record.valid for record in outcome.records):
        counts = ", ".join(f"{name} {count}" for name, count in outcome.status_counts.items())
        where = f"posture of {arm.description} for {search.stated.NAME}"
        free = "pose or distance" if isinstance(arm, PoseConstrainedArm) else "task or robot"
        allowed = f"a {free} for which one exists ({counts})"
        raise RobotError(where, f"not found from {len(outcome.records)} starts", allowed)
    return _described(arm, search, outcome.best.variables, outcome)


def _zero_everywhere(arm: RobotArm, search: Search) -> bool:
    """Whether the score is zero at every posture, because a failure is structural.

    RobotError if the arm cannot do its task even before a failure.
    """
    stated = search.stated
    counts_failures = "failures" in stated.SETTINGS and stated.NAME != isotropy.NAME
    if not counts_failures or search.maximise != "worst":
        return False
    unconstrained = RobotArm(arm.chain, arm.task, arm.length)
    structural = [
        failure
        for failure in structural_failures(unconstrained)
        if failure.kind == "structural"
    ]
    if len(structural) == arm.size and all(failure.miss is None for failure in structural):
        directions = ",".join(arm.task.directions)
        allowed = "directions in which the tip can move at some posture"
        raise RobotError(f"task of {arm.description}", directions, allowed)
    model = search.model
    may_fail = range(arm.size) if model is None else model.fallible
    names = {arm.chain.names[joint] for joint in may_fail}
    return any(failure.joint in names for failure in structural)


def _any_posture(arm: RobotArm, search: Search) -> FloatArray:
    """Return the posture, (n,), midway between the limits, or one that the constraints admit.

    RobotError if the only one drawn is not admitted.
    """
    if not isinstance(arm, PoseConstrainedArm):
        return arm.chain.mid_range
    point = arm.sample(np.random.default_rng(search.seed))
    if not arm.admits(arm.jacobian(point), point):
        where = f"posture of {arm.description}"
        allowed = "a pose or distance that one draw meets: every posture is as bad"
        raise RobotError(where, "not found", allowed)
    return point


def _check(arm: RobotArm, search: Search, middle: FloatArray) -> None:
    """Refuse what the search cannot find; InputError and RobotError as `best_posture` says.

    `middle` is the Jacobian midway between the limits, shape (m, n).
    """
    stated = search.stated
    # A given length scales a Jacobian of linear or of angular rows alone: a score that falls
    # with J would only reward a short reach.
    minimised = stated.SENSE == "minimise" and arm.length is not None and not arm.task.mixed
    if minimised and stated.score(middle / 2) < stated.score(middle):
        score = f"the {stated.NAME} of such a task"
        allowed = f"none for {score}, which a small Jacobian makes small"
        raise InputError("length", arm.length, allowed)
    program = case_of(search, arm).build()
    equations, unknowns = sum(map(_equations, program.constraints)), program.variables.numel()
    if equations > unknowns:
        where = f"{stated.NAME} of {arm.description}"
        allowed = f"at most {unknowns}; the residual comes as near to isotropy as can be"
        raise RobotError(where, f"a matter of {equations} independent equations", allowed)


def _equations(constraint: Constraint) -> int:
    """Return how many rows of a constraint are equations."""
    rows = constraint.expression.numel()
    lower, upper = (np.broadcast_to(end, rows) for end in (constraint.lower, constraint.upper))
    return int(np.sum(lower == upper))


def _described(
    arm: RobotArm, search: Search, configuration: FloatArray, outcome: Outcome | None = None
) -> Posture:
    """Measure the arm at a configuration, (n,), and say how it was found.

    Without an outcome there were no starts.
    """
    matrix, middle = arm.jacobian(configuration), arm.jacobian(arm.chain.mid_range)
    failures, known = search.model, search.probabilities_known
    constrained = arm if isinstance(arm, PoseConstrainedArm) else None
    return Posture(
        formulation=search.stated.NAME,
        assessment=measure_robot(arm, configuration, search.failure_count),
        mid_range_sigma=measures.worst_case_sigma(middle, search.failure_count),
        seed=search.seed,
        starts=len(outcome.records) if outcome else 0,
        reached_best=len(outcome.reached) if outcome else 0,
        optima=len(outcome.scores) if outcome else 0,
        unseen_share=outcome.unseen_share if outcome else 0.0,
        settled=is_settled(outcome) if outcome else True,
        status_counts=dict(outcome.status_counts) if outcome else {},
        complete=outcome.complete if outcome else True,
        at=_at_pose(constrained, configuration) if constrained else None,
        clearance=_kept_clearance(constrained, configuration) if constrained else None,
        unequal=measure_robot_unequal(arm, matrix, failures, known) if failures else None,
    )


def _at_pose(arm: PoseConstrainedArm, configuration: FloatArray) -> AtPose | None:
    """Measure how a configuration, (n,), reaches the pose; None if no pose is asked for."""
    if arm.pose is None:
        return None
    distances, angles = arm.pose.errors(arm.chain, configuration[:, None])
    return AtPose(
        pose=arm.pose,
        position_error=float(distances[0]),
        orientation_error=float(angles[0]),
        after_failure=arm.locked_reach(configuration),
    )


def _kept_clearance(arm: PoseConstrainedArm, configuration: FloatArray) -> KeptClearance | None:
    """Measure how near links come at a configuration, (n,); None if they may touch."""
    clearance = arm.clearance
    if clearance is None:
        return None
    left_out = (*clearance.left_out, *clearance.allowed)
    return KeptClearance(
        least=clearance.least,
        closest=clearance.closest(configuration, clearance.pairs),
        pairs=len(clearance.pairs),
        left_out=tuple(map(clearance.names, left_out)),
        closest_left_out=clearance.closest(configuration, left_out) if left_out else None,
        nearer={
            " and ".join(clearance.names(clearance.pairs[k])): least
            for k, least in clearance.nearer.items()
        },
        visual=clearance.visual,
        unchecked=clearance.unchecked,
    )
