"""A damaged arm where it is, how fast it may move, and how much is to be tried."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import check_limits
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import of_kind
from lockedjoint.paths.connecting import Connector
from lockedjoint.paths.motion_limits import MotionLimits, for_each
from lockedjoint.paths.timing import TimedTrajectory, timed
from lockedjoint.recovery.failures import Damage
from lockedjoint.recovery.recovery_search import RecoverySearch

# A joint reaches its largest speed in this time, if the user gives no accelerations: with more
# of it a recovery is gentler, and slower.
_TO_SPEED_S = 0.5
# A joint without a speed in its file moves at most so fast: rad/s or m/s.
_SPEED_PER_S = 1.0
# Corners that are nearer to the first one than this, in rad or m, are the same place.
_SAME_PLACE_M_OR_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class DamagedState:
    """A damaged arm where it is, how it may move, and how much is to be tried."""

    arm: Damage
    whole: FloatArray  #: Positions of the n joints of the healthy arm, (n,), rad or m.
    start: FloatArray  #: Positions of the m joints that can move, shape (m,), rad or m.
    limits: MotionLimits  #: Limits of the joints that can move.
    connector: Connector  #: Finds ways, and knows which links stay apart.
    search: RecoverySearch

    @classmethod
    def of(
        cls,
        arm: Damage,
        start: npt.ArrayLike,
        acceleration: Sequence[float] | float | None = None,
        velocity: Sequence[float] | float | None = None,
        jerk: Sequence[float] | float | None = None,
        clearance: LinkClearance | None = None,
        search: RecoverySearch | None = None,
    ) -> DamagedState:
        """Return an arm at a configuration of all its joints, shape (n,), rad or m.

        `acceleration`, `velocity` and `jerk` are one number for all joints of the healthy arm,
        or n of them, in rad/s², rad/s and rad/s³, those of sliders in m. See
        `lockedjoint.recovery.recover`.
        """
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
        connector.check_free("start", begin)
        healthy = np.array([joint.velocity for joint in arm.healthy.joints])
        given = healthy if velocity is None else for_each("velocity", velocity, len(whole))
        fastest = np.where(np.isfinite(given), given, _SPEED_PER_S)[arm.free]
        # Failures may have reduced what the file states.
        left = np.array([joint.velocity for joint in arm.chain.joints])
        fastest = np.minimum(fastest, left)
        if acceleration is None:
            strongest = fastest / _TO_SPEED_S
        else:
            strongest = for_each("acceleration", acceleration, len(whole))[arm.free]
        roughest = None
        if jerk is not None:
            roughest = for_each("jerk", jerk, len(whole))[arm.free].tolist()
        limits = MotionLimits.of(arm.chain, strongest.tolist(), fastest.tolist(), roughest)
        return cls(arm, whole, begin, limits, connector, search or RecoverySearch())

    def run_along(self, corners: FloatArray, stops: Sequence[int]) -> TimedTrajectory:
        """Return a trajectory of all joints along configurations of those that can move.

        `corners` has the shape (N, m); `stops` are the numbers of corners at which the arm
        stands.
        """
        chain, arm = self.arm.chain, self.arm
        if np.max(np.abs(corners - corners[0])) < _SAME_PLACE_M_OR_RAD:
            corners = corners[[0, 0]]
        run = timed(chain, corners, self.limits, stops)
        rates = np.zeros((2, len(run.times), len(arm.healthy.names)))
        rates[:, :, arm.free] = run.velocities, run.accelerations
        whole = {"velocities": rates[0], "accelerations": rates[1]}
        return replace(
            run,
            joints=arm.healthy.names,
            positions=arm.whole(run.positions),
            units=tuple(joint.unit for joint in arm.healthy.joints),
            **whole,
        )
