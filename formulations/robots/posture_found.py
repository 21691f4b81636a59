"""The posture that was found: how tolerant the robot is there, and what it keeps to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from formulations import measures
from formulations.clearance.link_clearance import Closest
from formulations.robots.pose_constrained_arm import LockedReach, Pose, PoseConstrainedArm
from formulations.robots.posture_search import Search
from formulations.robots.robot_arm import RobotArm
from formulations.robots.robot_assessment import (
    RobotAssessment,
    measure_robot,
    measure_robot_unequal,
)
from nlp.arrays import FloatArray


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
        Seed, starts that ended, and those that converged to a score within `REACHED_BEST` of
        the best such score. If none converged, `reached_best` is 0 and the posture is the best
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
        Where failures are unequal: what `measure_robot_unequal` says.
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


def describe(
    arm: RobotArm,
    search: Search,
    configuration: FloatArray,
    *,
    starts: int = 0,
    reached_best: int = 0,
    status_counts: Mapping[str, int] | None = None,
    complete: bool = True,
) -> Posture:
    """Measure the robot at a posture, and what the arm keeps to.

    Parameters
    ----------
    arm
        The robot; a `PoseConstrainedArm` where there is a pose or a distance to keep.
    search
        What was looked for.
    configuration
        The posture, shape (n,).
    starts, reached_best, status_counts, complete
        As of `Posture`; no starts by default.
    """
    failures = None
    if search.failures is not None:
        known = search.probabilities_known
        failures = measure_robot_unequal(
            arm, arm.jacobian(configuration), search.failures, known
        )
    middle = arm.jacobian(arm.chain.mid_range)
    return Posture(
        formulation=search.stated.NAME,
        assessment=measure_robot(arm, configuration, search.locked),
        mid_range_sigma=measures.worst_case_sigma(middle, search.locked),
        seed=search.seed,
        starts=starts,
        reached_best=reached_best,
        status_counts=dict(status_counts or {}),
        complete=complete,
        at=_at_pose(arm, configuration) if isinstance(arm, PoseConstrainedArm) else None,
        clearance=_kept_clearance(arm, configuration)
        if isinstance(arm, PoseConstrainedArm)
        else None,
        failures=failures,
    )


def _at_pose(arm: PoseConstrainedArm, configuration: FloatArray) -> AtPose | None:
    if arm.pose is None:
        return None
    off, angle = arm.pose.errors(arm.kinematics, configuration[:, None])
    reach = arm.locked_reach(configuration)
    return AtPose(arm.pose, float(off[0]), float(angle[0]), reach)


def _kept_clearance(arm: PoseConstrainedArm, configuration: FloatArray) -> KeptClearance | None:
    clearance = arm.clearance
    if clearance is None:
        return None
    left_out = clearance.left_out
    return KeptClearance(
        least=clearance.least,
        capsules=float(np.min(clearance.distances(configuration[:, None]))),
        closest=clearance.closest(configuration, clearance.pairs),
        pairs=len(clearance.pairs),
        left_out=tuple(map(clearance.names, left_out)),
        closest_left_out=clearance.closest(configuration, left_out) if left_out else None,
        visual=clearance.visual,
    )
