"""A damaged arm where it is, how fast it may move, and how much is to be tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import check_limits
from lockedjoint.nlp.arrays import FloatArray, finite_vector, real_number, whole_number
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.paths.timing import MotionLimits, TimedTrajectory, timed
from lockedjoint.recovery.connecting import Connector
from lockedjoint.recovery.failures import DamagedArm

# Seconds in which a joint is at its largest speed, if no accelerations are given.
_TO_SPEED = 0.5
# A joint without a speed in its file takes this, rad/s or m/s.
_SPEED = 1.0
# Starts and boxes of the first round.
_FEW_STARTS, _FEW_BOXES = 60, 20_000


@dataclass(frozen=True)
class RecoverySearch:
    """How much is tried.

    Parameters
    ----------
    starts
        Of the inverse kinematics, if fewer do not reach the goal.
    boxes
        Of a proof that the goal is out of reach, at most.
    seconds
        Of RRT-Connect.
    seed
        Of everything random.

    Raises
    ------
    InputError
        If a number is out of range.
    """

    starts: int = 1000
    boxes: int = 1_000_000
    seconds: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        whole_number("starts", self.starts, 1, 100_000)
        whole_number("boxes", self.boxes, 1, 10_000_000)
        real_number("seconds", self.seconds, "a number above 0, at most 3600", 1e-3, 3600.0)
        whole_number("seed", self.seed, 0)

    @property
    def rounds(self) -> list[tuple[int, int]]:
        """Starts and boxes, few and then all: what is easy is known soon."""
        whole = (self.starts, self.boxes)
        few = (min(_FEW_STARTS, self.starts), min(_FEW_BOXES, self.boxes))
        return [few, whole] if self.starts > _FEW_STARTS else [whole]


@dataclass(frozen=True, eq=False)
class DamagedState:
    """A damaged arm where it is, how it may move, and how much is to be tried."""

    arm: DamagedArm
    whole: FloatArray  #: Where all joints are, shape (n,).
    start: FloatArray  #: Of these, those that can move.
    limits: MotionLimits  #: Of what can move.
    connector: Connector  #: Finds ways, and knows which links stay apart.
    search: RecoverySearch

    @classmethod
    def of(
        cls,
        arm: DamagedArm,
        start: npt.ArrayLike,
        acceleration: Sequence[float] | None = None,
        velocity: Sequence[float] | None = None,
        clearance: LinkClearance | None = None,
        search: RecoverySearch | None = None,
    ) -> DamagedState:
        """Return an arm at a configuration of all its joints; see `recover`."""
        allowed = "a LinkClearance, as `read_clearance` returns it"
        of_kind("clearance", clearance, (LinkClearance, type(None)), allowed)
        of_kind("search", search, (RecoverySearch, type(None)), "a RecoverySearch")
        whole = finite_vector("start", start, len(arm.healthy.names))
        begin = arm.start(whole)
        if arm.hanging is not None:  # it is where it hangs, wherever it is said to be
            begin, joint = arm.hanging.hung(begin), arm.chain.joints[arm.hanging.own]
            place = float(begin[arm.hanging.own])
            check_limits(f"{joint.name}, where it hangs,", place, joint.lower, joint.upper)
            whole = arm.whole(begin[None])[0]
        connector = Connector(arm.chain, clearance)
        if not connector.is_free(begin):
            allowed = "a configuration in which links keep their distance"
            raise InputError("start", "in collision", allowed)
        healthy = np.array([joint.velocity for joint in arm.healthy.joints])
        given = healthy if velocity is None else finite_vector("velocity", velocity, len(whole))
        fastest = np.where(np.isfinite(given), given, _SPEED)[arm.free]
        # Failures may have reduced what the file states.
        left = np.array([joint.velocity for joint in arm.chain.joints])
        fastest = np.minimum(fastest, left)
        if acceleration is None:
            strongest = fastest / _TO_SPEED
        else:
            strongest = finite_vector("acceleration", acceleration, len(whole))[arm.free]
        limits = MotionLimits.of(arm.chain, strongest.tolist(), fastest.tolist())
        return cls(arm, whole, begin, limits, connector, search or RecoverySearch())

    def run_along(self, corners: FloatArray, stops: Sequence[int]) -> TimedTrajectory:
        """Return a trajectory of all joints along configurations (N, n) of what can move."""
        chain, arm = self.arm.chain, self.arm
        if np.max(np.abs(corners - corners[0])) < 1e-9:  # it is there already
            corners = corners[[0, 0]]
        run = timed(chain, corners, self.limits, stops)
        rates = np.zeros((2, len(run.times), len(arm.healthy.names)))
        rates[:, :, arm.free] = run.velocities, run.accelerations
        whole = {"velocities": rates[0], "accelerations": rates[1]}
        return replace(
            run, joints=arm.healthy.names, positions=arm.whole(run.positions), **whole
        )
