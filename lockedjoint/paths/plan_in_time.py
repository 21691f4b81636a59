"""A plan in time: where the joints are at each moment, and what is then left of the path.

What comes in: what `path` found, as a `PathPlan` (`PathPlan.after`) or as the file path.json
(`read_plan`). What goes out: a `RestOfPlan`, which `recover` takes as its goal. W is the number
of waypoints, n that of the plan's joints, and K that of moments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation, Slerp

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.chain import Chain, listed
from lockedjoint.kinematics.task_space import DIRECTIONS
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.waypoints import ToolPath, place_name

# A robot is another one than that of the plan if its tool misses a waypoint by more than this;
# the search itself takes waypoints for reached at a tenth of it.
_SAME_TOOL_M_OR_RAD = 1e-4
# Poses that are nearer to each other than this, in metres and radians, are one waypoint.
_SAME_POSE_M_OR_RAD = 1e-6


def check_followed(rows: Sequence[int]) -> None:
    """Raise InputError unless the rest of a path with these rows of (v; ω) can be followed."""
    if sorted(rows) not in (list(range(3)), list(range(6))):
        directions = ",".join(DIRECTIONS[row] for row in rows)
        allowed = "position or all: `recover` follows no other paths"
        raise InputError("task of the plan", directions, allowed)


@dataclass(frozen=True, eq=False, repr=False)
class PlanInTime(Brief):
    """Where the joints of a plan are at each time, and where on the path its tool is.

    Attributes
    ----------
    joints
        Names of the n joints.
    positions
        Metres, along the axes of the base, of all waypoints, shape (W, 3).
    quaternions
        Orientations at the waypoints, scalar last, shape (W, 4); None if they do not count.
    at_waypoints
        Configurations at the waypoints, radians or metres, shape (W, n).
    times
        Seconds, shape (K,).
    states
        Configurations at these times, shape (1, K, n), between which joints move evenly; or
        positions, velocities and accelerations, shape (3, K, n), between which they follow
        polynomials of degree five, as a controller does.
    places
        Where on the path the plan is at these times, counted in waypoints from 1, shape (K,).
    clock
        What has these times: the plan, or the file in whose column t (s) they are.
    locked
        Positions of joints that had locked before the plan was made, by name.
    """

    joints: tuple[str, ...]
    positions: FloatArray
    quaternions: FloatArray | None
    at_waypoints: FloatArray
    times: FloatArray
    states: FloatArray
    places: FloatArray
    clock: str = "the plan"
    locked: Mapping[str, float] = field(default_factory=dict)

    def after(self, seconds: float) -> RestOfPlan:
        """Return where the arm is at a time, and the rest of the path.

        Parameters
        ----------
        seconds
            The time, as the plan counts it.

        Raises
        ------
        InputError
            If the plan is not under way then.
        """
        first, last = self.times[[0, -1]].tolist()
        allowed = f"a time of the plan, from {first:g} to below {last:g} s ({self.clock})"
        time = real_number("after", seconds, allowed)
        rest = None
        if first <= time < last:
            place = float(np.interp(time, self.times, self.places))
            rest = self._rest(place)
        if rest is None:
            raise InputError("after", f"{time:.9g} s", allowed)
        here = min(int(np.searchsorted(self.times, time, "right")), len(self.times) - 1)
        two = slice(here - 1, here + 1)
        between = BPoly.from_derivatives(self.times[two], self.states[:, two].swapaxes(0, 1))
        q = dict(zip(self.joints, between(time).tolist(), strict=True))
        return RestOfPlan(self, {**self.locked, **q}, rest, time, place)

    def _rest(self, place: float) -> ToolPath | None:
        """Return the path from a place on; None if all of it is behind."""
        index = np.arange(1, len(self.positions) + 1)
        begin = np.clip(place, 1, index[-1])
        ahead = index > begin
        position = [np.interp(begin, index, column) for column in self.positions.T]
        positions = np.vstack([position, self.positions[ahead]])
        quaternions = None
        moves = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        if self.quaternions is not None:
            turns = Rotation.from_quat(self.quaternions)
            quaternions = np.vstack(
                [Slerp(index, turns)(begin).as_quat(), self.quaternions[ahead]]
            )
            turns = Rotation.from_quat(quaternions)
            moves = moves + (turns[1:] * turns[:-1].inv()).magnitude()
        # The tool may wait at a waypoint: then two of them have one pose.
        kept = np.append(True, moves > _SAME_POSE_M_OR_RAD)
        if np.count_nonzero(kept) < 2:
            return None
        return ToolPath(positions[kept], None if quaternions is None else quaternions[kept])

    def check_robot(self, chain: Chain) -> None:
        """Raise InputError unless a chain is that of the plan: its tool is on the waypoints."""
        known = {*self.joints, *self.locked}
        if not (set(self.joints) <= set(chain.names) <= known):
            allowed = f"one of the joints of this robot, {listed(chain.names)}"
            raise InputError("plan", f"of the joints {listed(self.joints)}", allowed)
        rows = [
            self.at_waypoints[:, self.joints.index(name)]
            if name in self.joints
            else np.full(len(self.positions), self.locked[name])
            for name in chain.names
        ]
        position, rotation = chain.tip_at(np.array(rows))
        off = float(np.max(np.linalg.norm(position.T - self.positions, axis=1)))
        turned = 0.0
        if self.quaternions is not None:
            tool = Rotation.from_matrix(np.moveaxis(rotation, 2, 0))
            angles = (tool * Rotation.from_quat(self.quaternions).inv()).magnitude()
            turned = float(np.max(angles))
        if max(off, turned) > _SAME_TOOL_M_OR_RAD:
            given = f"one whose waypoints this tool misses by {off:.3g} m and {turned:.3g} rad"
            allowed = f"one of this robot with base {chain.base} and tip {chain.tip}"
            raise InputError("plan", given, allowed)


@dataclass(frozen=True, eq=False, repr=False)
class RestOfPlan(Brief):
    """What is left of a planned path at a time: a goal of `recover`.

    Attributes
    ----------
    plan
        The plan.
    q
        Where the arm is, radians or metres by joint.
    path
        The rest of the path, from where the tool has to be.
    time
        The time, in seconds.
    place
        Where on the path that is, counted in waypoints from 1.

    Examples
    --------
    >>> import numpy as np
    >>> import lockedjoint as lj
    >>> way = lj.ToolPath(np.array([[0.45, -0.15, 0.3], [0.5, 0.2, 0.35]]))
    >>> plan = lj.path("example", way, samples=6, tracks=6, rounds=1)
    >>> rest = plan.after(4.0)
    >>> print(rest)
    at 4 s of the plan, on the path between waypoints 1 and 2
    >>> lj.recover("example", None, lj.Locked("elbow"), rest).verdict
    'trajectory'
    """

    plan: PlanInTime
    q: Mapping[str, float]
    path: ToolPath
    time: float
    place: float

    def __str__(self) -> str:
        """Say in words where on the path the arm is."""
        where = place_name(self.place)
        how = "on" if where.startswith("the path") else "at"
        # While an approach lasts, the place is that of the first waypoint.
        if self.time < np.max(self.plan.times[self.plan.places <= 1]):
            how = "on the way to"
        return f"at {self.time:g} s of {self.plan.clock}, {how} {where}"

    def to_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return {
            "after": self.time,
            "clock": self.plan.clock,
            "place": self.place,
            "q": dict(self.q),
        }
