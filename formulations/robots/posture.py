"""The most failure-tolerant posture of a robot within its joints' limits.

Of all postures, or of those at a pose of the tool, with links that keep a distance from each
other: see `pose_constrained_arm`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from formulations.clearance.link_clearance import Clearance
from formulations.kinematics.tree import RobotError
from formulations.measures.unequal_failures import scenarios
from formulations.robots.pose_constrained_arm import Pose, PoseConstrainedArm
from formulations.robots.posture_found import Posture, describe
from formulations.robots.posture_search import Search, searched
from formulations.robots.robot_arm import RobotArm
from formulations.robots.structural import structural_failures
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.problem import Constraint


def best_posture(
    arm: RobotArm,
    search: Search | None = None,
    *,
    at: Pose | None = None,
    clearance: Clearance | None = None,
) -> Posture:
    """Search for the posture that is best by a formulation's score.

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
        formulation's score is best for a small Jacobian. If the pose is out of reach.
    KeyboardInterrupt
        If interrupted before the first start ended.
    """
    search = search or Search()
    if at is not None or clearance is not None:
        arm = PoseConstrainedArm(arm.chain, arm.task, arm.length, at, clearance)
    # At once, because it fails where the arm has no characteristic length.
    middle = arm.jacobian(arm.chain.mid_range)
    if _hopeless(arm, search):
        return _any_posture(arm, search)
    _check(arm, search, middle)
    outcome = searched(arm, search)
    if not outcome.records:
        raise KeyboardInterrupt
    if not any(record.valid for record in outcome.records):
        counts = outcome.status_counts.items()
        listed = ", ".join(f"{status} {count}" for status, count in counts)
        where = f"posture of {arm.description} for {search.stated.NAME}"
        free = "pose or distance" if isinstance(arm, PoseConstrainedArm) else "task or robot"
        allowed = f"a {free} for which one exists ({listed})"
        raise RobotError(where, f"not found from {len(outcome.records)} starts", allowed)
    return describe(
        arm,
        search,
        outcome.best.variables,
        starts=len(outcome.records),
        reached_best=len(outcome.reached),
        status_counts=outcome.status_counts,
        complete=outcome.complete,
    )


def _hopeless(arm: RobotArm, search: Search) -> bool:
    """Whether the formulation needs full rank after a failure that leaves it nowhere."""
    if "locked" not in search.stated.SETTINGS:
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


def _any_posture(arm: RobotArm, search: Search) -> Posture:
    """Return that midway between the limits or, with something to keep to, one that does."""
    if not isinstance(arm, PoseConstrainedArm):
        return describe(arm, search, arm.chain.mid_range)
    point = arm.sample(np.random.default_rng(search.seed))
    if not arm.admits(arm.jacobian(point), point):
        where = f"posture of {arm.description}"
        allowed = "a pose or distance that one draw meets: every posture is as bad"
        raise RobotError(where, "not found", allowed)
    return describe(arm, search, point)


def _check(arm: RobotArm, search: Search, middle: FloatArray) -> None:
    """Refuse what the search cannot find; `middle` is the Jacobian midway between limits."""
    stated = search.stated
    minimised = stated.SENSE == "minimise" and arm.length is not None and not arm.task.mixed
    if minimised and stated.score(middle / 2) < stated.score(middle):
        name = stated.NAME
        allowed = f"none for the {name} of such a task, which a small Jacobian makes small"
        raise InputError("length", arm.length, allowed)
    program = search.case(arm).build()
    equations = sum(int(np.sum(_equal(one))) for one in program.constraints)
    unknowns = program.variables.numel()
    if equations > unknowns:
        where = f"{stated.NAME} of {arm.description}"
        allowed = f"at most {unknowns}; the residual comes as near to isotropy as can be"
        raise RobotError(where, f"a matter of {equations} independent equations", allowed)


def _equal(constraint: Constraint) -> npt.NDArray[np.bool_]:
    rows = constraint.expression.numel()
    lower, upper = (np.broadcast_to(end, rows) for end in (constraint.lower, constraint.upper))
    return np.asarray(lower == upper)
