"""Where a tool can be before a failure, and after each one, as bits on a grid of voxels.

What is reached after a failure does not depend on the artificial limits. It is stored for each
joint and each of a grid of positions ("slices") at which it may lock.

A flat grid has its voxels in one row, in C order. Packed bits are eight voxels of it in a byte,
the first one in the highest bit, as `numpy.packbits` has them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.serial_chain import Bits, Ranges, at_zero, opened, physical_ranges
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.workspaces.link_shortfall import links_suffice

#: Positions at which a joint may lock are this far apart by default. Less is more exact, and
#: takes more time and memory.
SLICE_RAD = np.deg2rad(5.0)
# The end of a range is on a slice if it is beyond it by less than this share of a slice.
_ROUNDING_SLICES = 1e-9
# Slices may not be narrower than 0.1 degrees, less a little for rounding: more of them need too
# much memory.
_LEAST_SLICE_RAD = np.deg2rad(0.0999)
# Inverse kinematics has at most so many random starts for a point: fewer miss more points.
_MOST_STARTS = 24
# Rounds of starts are made together as long as they have at most so many starts: about as many
# take hardly longer than one. It changes no result.
_STARTS_AT_ONCE = 2000


class FailureSets(ABC):
    """Where the tool can be before a failure, and after each one, on a grid of voxels.

    Attributes
    ----------
    arm, voxel, step
        The arm, the edge of a voxel in metres, and the distance of the positions at which a
        revolute joint may lock, in radians; those of a prismatic joint are two voxels apart.
    dimension
        2 or 3.
    shape, corner
        Numbers of voxels along the axes of the frame of joint 1, and where the centre of the
        first voxel is, in voxels, (dimension,).
    slices
        By joint, the positions at which it may lock.
    clearance
        What links keep from each other and from obstacles, if anything. A grid disregards it;
        points that inverse kinematics checks do not.
    seed
        Of the points that are sampled, and of the starts of inverse kinematics.
    """

    #: Each voxel stands for one of its points if this is True, else for all that touches it.
    sampled = False
    clearance: LinkClearance | None = None
    seed: int = 0
    arm: Chain
    voxel: float
    step: float
    dimension: int
    shape: tuple[int, ...]
    corner: IntArray
    slices: dict[int, FloatArray]
    # Each joint has the packed voxels that are reached after each slice, shape (slices, bytes).
    _reached: dict[int, npt.NDArray[np.uint8]]

    @abstractmethod
    def before(self, limits: Ranges) -> Bits:
        """Voxels that are reached within limits, before a failure: truth values of `shape`."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, int] | None:
        """Draw a configuration, and its tip's voxel in the flat grid; None if it has none."""

    def points(
        self, voxels: Bits, rng: np.random.Generator, count: int
    ) -> tuple[FloatArray, IntArray]:
        """Return random points of voxels, shape (count, 3), and which voxel each is in.

        Where voxels stand for a point each, it is this.
        """
        own, wide = self.kept_points(voxels), self.dimension
        drawn = rng.integers(len(own), size=count)
        points = own[drawn]
        if not self.sampled:
            points[:, :wide] += rng.uniform(-0.5, 0.5, (count, wide)) * self.voxel
        return points, drawn

    @abstractmethod
    def _solved(
        self, points: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, Bits]:
        """Return where inverse kinematics ends from one start each, (k, n); what it reaches."""

    def reaches(self, points: FloatArray, lower: FloatArray, upper: FloatArray) -> Bits:
        """Return for which points (k, 3), in the frame of joint 1, inverse kinematics succeeds.

        From random configurations; a point that is not reached may still be reachable. Limits
        are those of each point, shape (k, n); equal ones are a locked joint.
        """
        rng = np.random.default_rng(self.seed)
        reached = np.zeros(len(points), dtype=bool)
        near_enough = links_suffice(self.arm, points, lower, upper)
        done, together = 0, 1
        while done < _MOST_STARTS:
            rest = np.flatnonzero(~reached)
            tried = rest[near_enough[rest]]
            if not tried.size:
                break
            count = min(together, _MOST_STARTS - done, _STARTS_AT_ONCE // len(tried) or 1)
            # Starts are drawn for all points, so that they do not depend on which are tried.
            drawn, states = [], []
            for _ in range(count):
                start = rng.uniform(lower[rest], upper[rest])
                drawn.append(start[near_enough[rest]])
                states.append(rng.bit_generator.state)
            there = self._reached_from(points, np.concatenate(drawn), tried, lower, upper)
            # The rounds after one that reached a point would have had other starts.
            rounds = there.reshape(count, len(tried))
            found = np.flatnonzero(rounds.any(axis=1))
            used = int(found[0]) + 1 if found.size else count
            reached[tried] = rounds[used - 1]
            rng.bit_generator.state = states[used - 1]
            done += used
            together = 1 if found.size else 2 * together
        return reached

    def _reached_from(
        self,
        points: FloatArray,
        start: FloatArray,
        tried: IntArray,
        lower: FloatArray,
        upper: FloatArray,
    ) -> Bits:
        """Return which starts reach their points, (s·t,): s starts for each of t points.

        `tried` are the numbers of the points, (t,); limits are those of all points, (k, n).
        """
        own = np.tile(tried, len(start) // len(tried))
        ends = opened(self.arm, lower[own], upper[own])
        q, there = self._solved(points[own], start, *ends)
        if self.clearance is not None:
            there[there] = self.clearance.is_kept(q[there].T)
        return there

    def after(self, limits: Ranges) -> Bits:
        """Voxels that are reached after every failure within limits: values of `shape`."""
        bits = [self._after_joint(joint, limits) for joint in self.slices]
        return self._unpacked(np.bitwise_and.reduce(bits))

    def missing(self, limits: Ranges) -> int:
        """Return how many failures, of a joint at a slice, stand against a voxel at least.

        It is a score where the workspace is empty.
        """
        count = np.zeros(self.shape, dtype=np.int32)
        for joint in self.slices:
            for reached in self._after_each(joint, limits):
                count += ~self._unpacked(reached)
        return int(count.min())

    def around(self, configuration: FloatArray, voxel: int) -> Ranges | None:
        """Return the widest limits about a configuration whose failures leave a voxel.

        The voxel is one of the flat grid. Joints that do not move the tip keep their physical
        limits. None if the voxel is lost where a joint is.
        """
        limits = list(physical_ranges(self.arm))
        for joint, places in self.slices.items():
            unit, wraps = places[1] - places[0], self.arm.joints[joint].continuous
            # The voxel's bit is number voxel % 8 of byte voxel // 8, for each slice.
            there = np.unpackbits(self._reached[joint][:, voxel >> 3, None], axis=1)
            place = float(configuration[joint] - places[0]) / unit
            run = _run(there[:, voxel & 7].astype(bool), place, wraps)
            if run is None:
                return None
            limits[joint] = (places[0] + run[0] * unit, places[0] + run[1] * unit)
        return tuple(limits)

    def critical(self, limits: Ranges) -> tuple[str, ...]:
        """Joints whose own failures, by themselves, leave nothing."""
        return tuple(
            self.arm.joints[joint].name
            for joint in self.slices
            if not self._after_joint(joint, limits).any()
        )

    def places(self, joint: int, limits: Ranges) -> FloatArray:
        """Positions of a joint's slices within limits, and the limits themselves."""
        low, high = limits[joint]
        places = self.slices[joint]
        if self.arm.joints[joint].continuous:
            turns = np.round((low + high) / 2 / (2 * np.pi))
            around = [places + 2 * np.pi * (turns + k) for k in (-1, 0, 1)]
            places = np.concatenate(around)
        inner = places[(places > low) & (places < high)]
        return np.unique([low, *inner.tolist(), high])

    def centres(self, voxels: Bits) -> FloatArray:
        """Centres of voxels in the frame of joint 1, shape (k, dimension)."""
        return np.asarray((np.argwhere(voxels) + self.corner) * self.voxel)

    def kept_points(self, voxels: Bits) -> FloatArray:
        """Points that voxels stand for, in the frame of joint 1, shape (k, 3)."""
        wide = self.dimension
        points = np.tile(at_zero(self.arm).end_effector, (int(voxels.sum()), 1))
        points[:, :wide] = self.centres(voxels)
        return points

    @property
    def unit(self) -> float:
        """Area or volume of a voxel, in m² or m³."""
        return float(self.voxel**self.dimension)

    def _after_joint(self, joint: int, limits: Ranges) -> npt.NDArray[np.uint8]:
        """Return what is reached wherever in limits a joint locks: packed bits, (bytes,)."""
        return np.asarray(np.bitwise_and.reduce(self._after_each(joint, limits)))

    def _after_each(self, joint: int, limits: Ranges) -> npt.NDArray[np.uint8]:
        """Return what is reached after each slice in limits: packed bits, (slices, bytes)."""
        return self._reached[joint][self._within(joint, limits)]

    def _positions(self, joint: int) -> FloatArray:
        """Return a joint's slices in its physical range, evenly spaced, in radians or metres.

        Of a joint that turns without end the last one is left out: it is the first again.
        """
        moves = self.arm.joints[joint]
        step = 2 * self.voxel if moves.prismatic else self.step
        count = max(2, int(np.ceil((moves.upper - moves.lower) / step)) + 1)
        places = np.linspace(moves.lower, moves.upper, count)
        return places[:-1] if moves.continuous else places

    def _within(self, joint: int, limits: Ranges) -> IntArray:
        """Return the numbers of a joint's slices in limits, and of the next ones outside."""
        places = self.slices[joint]
        first, last = ((end - places[0]) / (places[1] - places[0]) for end in limits[joint])
        chosen = np.arange(
            np.floor(first + _ROUNDING_SLICES), np.ceil(last - _ROUNDING_SLICES) + 1
        ).astype(int)
        if self.arm.joints[joint].continuous:
            return np.unique(chosen % len(places))
        return np.unique(np.clip(chosen, 0, len(places) - 1))

    def _unpacked(self, bits: npt.NDArray[np.uint8]) -> Bits:
        """Return packed bits, (bytes,), as truth values of the grid's shape."""
        count = int(np.prod(self.shape))
        return np.unpackbits(bits, count=count).view(bool).reshape(self.shape)


def _run(there: Bits, place: float, wraps: bool) -> tuple[int, int] | None:
    """Return the numbers of the first and last True of the run about a place, or None.

    `place` is in slices, and may be between two: both have to be True. If `wraps`, the last
    slice has the first beside it; ends may be beyond 0 to the number of slices, and the run is
    one turn long at most.
    """
    count, shift = len(there), 0
    if wraps:
        shift = count * (math.floor(place / count) - 1)
        there = np.tile(there, 3)
        place -= shift
    else:
        place = min(max(place, 0), count - 1)
    first, end = math.floor(place), math.ceil(place)
    if not (there[first] and there[end]):
        return None
    gaps = np.flatnonzero(~there)
    first = int(max(gaps[gaps < first].max(initial=-1) + 1, end - count))
    end = int(min(gaps[gaps > end].min(initial=len(there)) - 1, first + count))
    return first + shift, end + shift


def check_step(voxel: float, step: float) -> None:
    """Raise InputError unless a voxel and the distance of slices can be used."""
    if not 0 < voxel < np.inf:
        raise InputError("voxel", voxel, "a finite number above 0, in metres")
    if not _LEAST_SLICE_RAD <= step <= np.pi / 4:
        raise InputError("slice", f"{np.rad2deg(step):g} degrees", "0.1 to 45 degrees")
