"""Failure-tolerant workspace of an arm that holds the orientation of its tool.

With one joint more than a pose has dimensions (four joints in the plane, seven in space) the
configurations of a pose are curves, its self-motion, and a joint may lock at θ if and
only if a curve within the physical limits passes θ. Curves are followed from random
configurations at one random point in every voxel, see `lockedjoint.kinematics.inverse`.

With more joints they are surfaces. There each joint in turn is locked at one slice after the
other while the rest keeps the pose, from random configurations again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import LIMIT_TOLERANCE, Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.inverse import SelfMotionPoses, arcs, solve_pose
from lockedjoint.kinematics.serial_chain import (
    Bits,
    Ranges,
    at_zero,
    frames_of,
    from_first_joint,
    is_planar,
    link_lengths,
    opened,
    physical_ranges,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets, check_step

# The curves of a point are looked for from so many random configurations.
_MOST_ROUNDS = 8
# A grid with more voxels is refused.
_MOST_VOXELS = 60_000
# A point that is not reached from so many configurations is not tried further.
_MOST_FAILED_STARTS = 4
# The curves of so many voxels are followed at once.
_VOXELS_AT_ONCE = 1000
# A tangent of a curve has this length.
_STEP_M_OR_RAD = 0.1
# A curve has at most so many tangents in each direction.
_MOST_STEPS = 120
# A turn has this angle.
_TURN_RAD = 2 * np.pi
# Each joint is led through its slices from so many random configurations, on a surface.
_MOST_SHEETS = 12
# One of so many configurations on the way through the slices is stored.
_STORED_EVERY = 3


class PoseSets(FailureSets):
    """What an arm reaches with one orientation of its tool, before and after every failure.

    Voxels stand for one random point each, so that an area or volume has a statistical error
    and no bias from the grid. Curves that no random configuration leads to are missed. The
    rotation is that of the tool in the frame of the base, shape (3, 3).

    Raises
    ------
    InputError
        If a planar arm has less than four joints or another one less than seven, the arm cannot
        turn its tool so, or the grid has too many voxels.
    """

    sampled = True

    def __init__(
        self,
        arm: Chain,
        rotation: FloatArray,
        voxel: float,
        step: float = SLICE_RAD,
        progress: Callable[[str], None] = lambda _: None,
        seed: int = 0,
        clearance: LinkClearance | None = None,
    ) -> None:
        self.clearance, self.seed = clearance, seed
        # The start is the orientation at q = 0, in the frame of joint 1.
        start = from_first_joint(arm).tip_at(np.zeros((len(arm.joints), 1)))[1][..., 0]
        self._rotation = frames_of(arm)[0][:3, :3].T @ rotation @ start.T
        self.corner, self.shape = _grid_of(arm, self._rotation, voxel, step)
        self.arm, self.voxel, self.step = arm, voxel, step
        self.dimension = wide = len(self.shape)
        self._rows = [0, 1, 5] if is_planar(arm) else list(range(6))
        self.slices = {k: self._positions(k) for k in range(len(arm.joints))}
        rng = np.random.default_rng(seed)
        places = np.indices(self.shape).reshape(wide, -1).T + self.corner
        self._points = np.zeros((len(places), 3))
        self._points[:, :wide] = (places + rng.uniform(-0.5, 0.5, places.shape)) * voxel
        self._points[:, wide:] = at_zero(arm).end_effector[wide:]
        near = np.flatnonzero(np.linalg.norm(self._points, axis=1) <= _reach(arm))
        bits = {k: np.zeros((len(places), len(at)), bool) for k, at in self.slices.items()}
        configurations = [np.zeros((0, len(arm.joints)), dtype=np.float32)]
        owners = [np.zeros(0, dtype=np.intp)]
        curved = len(arm.joints) == len(self._rows) + 1
        for at in range(0, len(near), _VOXELS_AT_ONCE):
            progress(Step(f"self-motion at {len(near)} points", at / len(near)))
            own = near[at : at + _VOXELS_AT_ONCE]
            found = (
                self._curves(self._points[own], rng) if curved else self._sheets(own, bits, rng)
            )
            for which, curves in found:
                there = ~np.isnan(curves[:, :, 0])
                if clearance is not None:
                    there[there] = clearance.is_kept(curves[there].T)
                    curves = np.where(there[:, :, None], curves, np.nan)
                if curved:
                    self._mark(bits, own[which], curves)
                configurations.append(curves[there].astype(np.float32))
                owners.append(np.repeat(own[which], there.sum(axis=1)))
        self._q, self._owners = np.concatenate(configurations), np.concatenate(owners)
        self._reached = {k: np.packbits(marked.T, axis=1) for k, marked in bits.items()}

    def before(self, limits: Ranges) -> Bits:
        """Voxels whose point is reached within limits, before a failure."""
        inside = np.ones(len(self._q), dtype=bool)
        for k, (low, high) in enumerate(limits):
            inside &= within(self._q[:, k], low, high, self.arm.joints[k].continuous)
        reached = np.zeros(self.shape, dtype=bool)
        reached.ravel()[self._owners[inside]] = True
        return reached

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, int] | None:
        """Draw a configuration that was found, and its voxel in the flat grid."""
        if not len(self._q):
            return None
        drawn = rng.integers(len(self._q))
        return self._q[drawn].astype(float), int(self._owners[drawn])

    def kept_points(self, voxels: Bits) -> FloatArray:
        """Points that voxels stand for, in the frame of joint 1, shape (k, 3)."""
        return self._points[voxels.ravel()]

    def _solved(
        self, points: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, Bits]:
        return solve_pose(self._poses(points), start, lower, upper)

    def _poses(self, points: FloatArray) -> SelfMotionPoses:
        rotations = np.broadcast_to(self._rotation, (len(points), 3, 3))
        return SelfMotionPoses(at_zero(self.arm), self._rows, points, rotations)

    def _curves(
        self, points: FloatArray, rng: np.random.Generator
    ) -> list[tuple[IntArray, FloatArray]]:
        """Curves of points, as pairs of which points they are of and the curves."""
        lower, upper = np.transpose(physical_ranges(self.arm))
        low, high = self._ends
        known: list[tuple[IntArray, FloatArray]] = []
        reached_once = np.zeros(len(points), dtype=bool)
        for k in range(_MOST_ROUNDS):
            own = (
                np.flatnonzero(reached_once)
                if k >= _MOST_FAILED_STARTS
                else np.arange(len(points))
            )
            if not len(own):
                break
            start = rng.uniform(lower, upper, (len(own), len(lower)))
            q, reached = solve_pose(self._poses(points[own]), start, low, high)
            own, q = own[reached], q[reached]
            reached_once[own] = True
            new = ~_on_known(own, q, known, np.isinf(low), len(points))
            own, q = own[new], q[new]
            if len(own):
                curves, _, _ = arcs(
                    self._poses(points[own]), q, low, high, _STEP_M_OR_RAD, _MOST_STEPS
                )
                known.append((own, curves))
        return known

    def _sheets(
        self, own: IntArray, bits: dict[int, Bits], rng: np.random.Generator
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Lock each joint at one slice after the other, and mark those that keep the pose.

        Yields some of the configurations, as `_curves`.
        """
        lower, upper = np.transpose(physical_ranges(self.arm))
        known = np.full((len(own), len(lower)), np.nan)  # the last configuration of each point
        for attempt in range(_MOST_SHEETS):
            unmarked = np.transpose([~marked[own].all(axis=1) for marked in bits.values()])
            if attempt >= _MOST_FAILED_STARTS:
                unmarked &= ~np.isnan(known[:, :1])
            which, joint = np.nonzero(unmarked)
            start = rng.uniform(lower, upper, (len(which), len(lower)))
            q, reached = solve_pose(self._poses(self._points[own[which]]), start, *self._ends)
            known[which[reached]] = q[reached]
            q = np.where(reached[:, None], q, known[which])
            begins = ~np.isnan(q[:, 0])
            for sign in (1, -1):
                lines = self._led(own[which[begins]], joint[begins], sign, q[begins], bits)
                for number, here in lines:
                    yield which[begins][number], here

    def _led(
        self, own: IntArray, joint: IntArray, sign: int, q: FloatArray, bits: dict[int, Bits]
    ) -> Iterator[tuple[IntArray, FloatArray]]:
        """Lead one joint of each configuration (k, n) through its slices, the others after it.

        Marks the slices; yields some of the configurations, (…, 1, n), by their number.
        """
        first, second = np.array([places[:2] for places in self.slices.values()]).T
        unit, counts = second - first, np.array([len(at) for at in self.slices.values()])
        continuous = np.array([joint.continuous for joint in self.arm.joints])
        number = np.arange(len(q))
        at = (q[number, joint] - first[joint]) / unit[joint]
        place = np.floor(at).astype(int) + (sign > 0)
        for k in range(counts.max()):
            inside = continuous[joint] | ((place >= 0) & (place < counts[joint]))
            number, joint = number[inside], joint[inside]
            place, q = place[inside], q[inside]
            low, high = (np.tile(side, (len(q), 1)) for side in self._ends)
            each = np.arange(len(q))
            low[each, joint] = high[each, joint] = first[joint] + place * unit[joint]
            q, reached = solve_pose(self._poses(self._points[own[number]]), q, low, high)
            if self.clearance is not None:
                reached[reached] = self.clearance.is_kept(q[reached].T)
            number, joint = number[reached], joint[reached]
            place, q = place[reached], q[reached]
            for f, marked in bits.items():
                of = joint == f
                marked[own[number[of]], place[of] % counts[f]] = True
            if k % _STORED_EVERY == 0:
                yield number, q[:, None]
            place = place + sign

    @property
    def _ends(self) -> tuple[FloatArray, FloatArray]:
        """The physical limits, without ends where a joint makes a full turn."""
        return opened(self.arm, *np.transpose(physical_ranges(self.arm)))

    def _mark(self, bits: dict[int, Bits], own: IntArray, curves: FloatArray) -> None:
        """Mark the slices that curves pass."""
        for k, places in self.slices.items():
            along = (curves[:, :, k] - places[0]) / (places[1] - places[0])
            low = np.ceil(np.minimum(along[:, :-1], along[:, 1:]) - 1e-6)
            high = np.floor(np.maximum(along[:, :-1], along[:, 1:]) + 1e-6)
            while (passes := low <= high).any():
                row, at = np.nonzero(passes)
                place = low[row, at].astype(int)
                if self.arm.joints[k].continuous:
                    place %= len(places)
                bits[k][own[row], np.clip(place, 0, len(places) - 1)] = True
                low += 1


def _on_known(
    own: IntArray,
    q: FloatArray,
    known: list[tuple[IntArray, FloatArray]],
    endless: Bits,
    count: int,
) -> Bits:
    """Return which configurations are on a curve of their point that is there already."""
    on_known = np.zeros(len(own), dtype=bool)
    for which, curves in known:
        place = np.full(count, -1)
        place[which] = np.arange(len(which))
        there = np.flatnonzero(place[own] >= 0)
        away = curves[place[own[there]]] - q[there, None]
        away -= np.where(endless, _TURN_RAD * np.round(away / _TURN_RAD), 0.0)
        near = np.nansum(away**2, axis=2) + np.where(np.isnan(away[:, :, 0]), np.inf, 0.0)
        on_known[there] |= near.min(axis=1) < (0.8 * _STEP_M_OR_RAD) ** 2
    return on_known


def within(q: npt.NDArray[np.floating], low: float, high: float, continuous: bool) -> Bits:
    """Whether positions are between limits, but for rounding; whole turns may be added."""
    above = q - low + LIMIT_TOLERANCE
    if continuous:
        above = above % _TURN_RAD
    return np.asarray((above >= 0) & (above <= high - low + 2 * LIMIT_TOLERANCE))


def _grid_of(
    arm: Chain, rotation: FloatArray, voxel: float, step: float
) -> tuple[IntArray, tuple[int, ...]]:
    """Return corner and shape of the grid; InputError as `PoseSets`."""
    dimension, needed = (2, 4) if is_planar(arm) else (3, 7)
    if len(arm.joints) < needed:
        kind = "a planar arm" if is_planar(arm) else "an arm"
        wanted = f"{needed} or more for {kind} that holds an orientation"
        allowed = f"{wanted}: more than its poses have dimensions"
        raise InputError("number of joints", len(arm.joints), allowed)
    check_step(voxel, step)
    if is_planar(arm) and abs(rotation[2, 2] - 1) > 1e-6:
        allowed = "a turn about the parallel axes of this planar arm from its zero posture"
        raise InputError("orientation", "out of the plane", allowed)
    reach, widest = _reach(arm), (int(_MOST_VOXELS ** (1 / dimension)) - 1) // 2
    if reach >= widest * voxel:
        most = f"with an orientation the grid has at most {_MOST_VOXELS} voxels"
        raise InputError("voxel", f"{voxel:g}", f"above {reach / widest:.4g}: {most}")
    wide = int(reach / voxel) + 1
    return np.full(dimension, -wide), (2 * wide + 1,) * dimension


def _reach(arm: Chain) -> float:
    travels = (max(abs(one.lower), abs(one.upper)) for one in arm.joints if one.prismatic)
    return float(np.sum(link_lengths(arm))) + sum(travels)
