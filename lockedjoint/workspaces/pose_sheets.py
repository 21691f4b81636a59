"""Self-motion as surfaces: of an arm with two or more joints beyond those that a pose needs.

What comes in: points of voxels. What goes out: marks, at which slices each joint may lock so
that the others keep the pose, and some of the configurations. Surfaces are not followed whole:
each joint in turn is led through its slices while the others follow, from random
configurations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.serial_chain import Bits
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.workspaces.held_poses import HeldPoses
from lockedjoint.workspaces.pose_curves import MOST_FAILED_STARTS

# Each joint is led through its slices from so many random configurations: fewer miss more.
_MOST_SHEETS = 12
# One of so many configurations on the way through the slices is stored: a larger number needs
# less memory, and finds less that is reached before a failure.
_STORED_EVERY = 3


def mark_sheets(
    held: HeldPoses,
    points: FloatArray,
    slices: dict[int, FloatArray],
    marks: dict[int, Bits],
    own: IntArray,
    rng: np.random.Generator,
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Mark at which slices each joint may lock, for some voxels.

    Parameters
    ----------
    held
        The arm and the orientation that it holds.
    points
        The point of each voxel, shape (voxels, 3).
    slices
        The positions at which each joint may lock, by joint.
    marks
        By joint, shape (voxels, slices): these are set.
    own
        The numbers of the voxels that are looked at, shape (k,).
    rng
        Where the random starts of inverse kinematics come from.

    Yields
    ------
    (IntArray, FloatArray)
        Some of the configurations, shape (c, 1, n), and which of `own` they are of, (c,).
    """
    joint_count = len(held.arm.joints)
    # The last configuration of each point, NaN as long as there is none.
    latest = np.full((len(own), joint_count), np.nan)
    for attempt in range(_MOST_SHEETS):
        unmarked = np.transpose([~marked[own].all(axis=1) for marked in marks.values()])
        if attempt >= MOST_FAILED_STARTS:
            unmarked &= ~np.isnan(latest[:, :1])
        which, joint = np.nonzero(unmarked)
        start = held.random_starts(len(which), rng)
        q, reached = held.solved(points[own[which]], start, *held.ends)
        latest[which[reached]] = q[reached]
        q = np.where(reached[:, None], q, latest[which])
        begins = ~np.isnan(q[:, 0])
        which = which[begins]
        for direction in (1, -1):
            leads = _Leads(np.arange(len(which)), joint[begins], q[begins])
            for number, passed in _led(
                held, points[own[which]], slices, marks, own[which], leads, direction
            ):
                yield which[number], passed


@dataclass(frozen=True, eq=False)
class _Leads:
    """Joints that are being led through their slices, one each; arrays of one length c."""

    number: IntArray  #: Which of the leads that began this is.
    joint: IntArray  #: The joint that is led.
    q: FloatArray  #: The configuration that it has come to, shape (c, n).

    def __getitem__(self, which: BoolArray) -> _Leads:
        return replace(
            self, number=self.number[which], joint=self.joint[which], q=self.q[which]
        )


def _led(
    held: HeldPoses,
    points: FloatArray,
    slices: dict[int, FloatArray],
    marks: dict[int, Bits],
    voxels: IntArray,
    leads: _Leads,
    direction: int,
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Lead a joint of each configuration through its slices, up or down, the others after it.

    A lead ends where the others cannot follow. `points` and `voxels` are those of the leads
    that begin. Yields some of the configurations, (c, 1, n), and the numbers of their leads.
    """
    first, second = np.array([places[:2] for places in slices.values()]).T
    slice_width, counts = second - first, np.array([len(places) for places in slices.values()])
    continuous = np.array([joint.continuous for joint in held.arm.joints])
    led_position = leads.q[leads.number, leads.joint]
    at = (led_position - first[leads.joint]) / slice_width[leads.joint]
    # The number of the next slice of each lead.
    place = np.floor(at).astype(int) + (direction > 0)
    for step in range(counts.max()):
        in_range = (place >= 0) & (place < counts[leads.joint])
        inside = continuous[leads.joint] | in_range
        leads, place = leads[inside], place[inside]
        lower, upper = (np.tile(end, (len(leads.q), 1)) for end in held.ends)
        row = np.arange(len(leads.q))
        locked_at = first[leads.joint] + place * slice_width[leads.joint]
        lower[row, leads.joint] = upper[row, leads.joint] = locked_at
        q, reached = held.solved(points[leads.number], leads.q, lower, upper)
        reached[reached] = held.is_clear(q[reached])
        leads, place = replace(leads, q=q)[reached], place[reached]
        for joint, marked in marks.items():
            of_joint = leads.joint == joint
            slice_number = place[of_joint] % counts[joint]
            marked[voxels[leads.number[of_joint]], slice_number] = True
        if step % _STORED_EVERY == 0:
            yield leads.number, leads.q[:, None]
        place = place + direction
