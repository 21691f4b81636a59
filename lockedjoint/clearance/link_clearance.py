"""How near the links of a robot are to each other: by their geometry, as coal measures it.

The geometry of a link is its collision geometry or, where it has none, its visual geometry. Two
points of two links, fixed in them, can be no nearer to each other than the links have to be: a
smooth condition on the joints' positions. A search begins without any, and adds those of the
two nearest points wherever its answers leave links too near (an exchange method, as for
semi-infinite programs). What meets all conditions and keeps the distance is an optimum of the
problem with all distances.

Every link also has one capsule around its geometry: links whose capsules are far enough apart
are not looked at more closely.

Obstacles are links, too, of the body that does not move.

Left out are links that one joint connects, pairs in contact at every one of 500 random
configurations, and pairs that an SRDF file disables. Links two joints apart that are nearer
than asked for at all of these configurations, as in wrists, keep half of the largest of their
distances.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import ClassVar

import casadi as ca
import numpy as np

from lockedjoint.clearance.around_shapes import Capsule
from lockedjoint.clearance.distances import Ends, Placed, distance
from lockedjoint.clearance.shapes import Shape
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import listed
from lockedjoint.kinematics.forward import body_frames
from lockedjoint.kinematics.geometry import BoolArray, IntArray, homogeneous, segment_distance
from lockedjoint.kinematics.motion import Bodies, Motion
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# Length in metres by which conditions ask for more than the distance: the gate is the distance
# itself.
_MARGIN_M = 1e-5
# Number of pairs times configurations done together: memory stays bounded.
_CHUNK = 100_000


@dataclass(frozen=True, eq=False)
class Link:
    """A link with geometry, ``collision`` or ``visual``; or an ``obstacle``.

    It is part of a body, by number in `LinkClearance.bodies`: the pose, 4×4, and the capsule
    around the shapes are in that body's frame. The number is 0 for obstacles. An obstacle has a
    box around them, too, its least and largest coordinates in its own frame.
    """

    name: str
    body: int
    pose: FloatArray
    shapes: tuple[Shape, ...]
    capsule: Capsule
    source: str
    box: tuple[FloatArray, FloatArray] | None = None


class NoPairsError(InputError):
    """A robot without any two links of which a distance can be looked at."""

    exit_status: ClassVar[int] = 1


@dataclass(frozen=True)
class Closest:
    """The two links that are nearest to each other, and their distance.

    In metres, of the geometry itself, by coal; zero or below where they touch. Of a way, it is
    the least that was found, and `at_least` what no two links are nearer than anywhere on it.
    """

    distance: float
    links: tuple[str, str]
    at_least: float | None = None

    def __str__(self) -> str:
        """Say how near they are, and which they are."""
        nowhere = "" if self.at_least is None else f", nowhere below {self.at_least:.4g} m"
        return f"{self.distance:.4g} m: {' and '.join(self.links)}{nowhere}"


@dataclass(frozen=True, eq=False)
class PointPair:
    """Two points of two links, in their bodies' frames, and what they keep, in metres."""

    bodies: tuple[int, int]
    points: tuple[FloatArray, FloatArray]
    least: float


@dataclass(frozen=True, eq=False)
class _Box:
    """An obstacle's number, pairs with it, the links in these, its frame's inverse, corners."""

    link: int
    pairs: IntArray
    links: IntArray
    back: FloatArray
    corners: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LinkClearance:
    """The distance that links keep from each other, at least, in metres."""

    least: float
    #: Number of the parent and motion of bodies 1, 2, …; body 0 is fixed.
    bodies: Bodies
    links: tuple[Link, ...]  #: Those with geometry.
    #: Pairs of links that are looked at, by number in `links`; an obstacle is always second.
    pairs: tuple[tuple[int, int], ...]
    #: Pairs that are not, though no joint connects the two: see above.
    left_out: tuple[tuple[int, int], ...] = ()
    #: What pairs keep that are never so far apart as asked for, by number in `pairs`.
    nearer: Mapping[int, float] = field(default_factory=dict)
    conditions: tuple[PointPair, ...] = ()  #: Points that are to keep a distance.
    #: Pairs that an SRDF file says are not to be looked at.
    allowed: tuple[tuple[int, int], ...] = ()

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Names of the robot's links with geometry that are in no pair that is looked at."""
        paired = {k for pair in self.pairs for k in pair}
        return tuple(
            link.name
            for k, link in enumerate(self.links)
            if k not in paired and link.source != "obstacle"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know of the pairs, one sentence each."""
        if not self.unchecked:
            return ()
        why = "a joint connects them to the others, or they are always in contact with these"
        if self.allowed:
            why += ", or the SRDF file lets them touch"
        return (f"Links of which no distance is looked at: {listed(self.unchecked)} ({why}).",)

    @property
    def visual(self) -> tuple[str, ...]:
        """Names of links whose visual geometry is taken, because they have no other."""
        return tuple(link.name for link in self.links if link.source == "visual")

    def names(self, pair: tuple[int, int]) -> tuple[str, str]:
        """Names of the two links of a pair."""
        return self.links[pair[0]].name, self.links[pair[1]].name

    def frames(self, configurations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (bodies + 1, 3, 3, B), origins (bodies + 1, 3, B) at configurations (n, B).

        Body 0 is fixed. The parts of a rotation are stored transposed and stacked, those that
        count 1, sin and 1 − cos of the angle: one product with the parent's rotation then turns
        all three.
        """
        q = configurations
        rotations = np.empty((len(self.bodies) + 1, 3, 3, q.shape[1]))
        origins = np.zeros((len(self.bodies) + 1, 3, q.shape[1]))
        rotations[0] = np.eye(3)[:, :, None]
        for k, (parent, motion, turns, shift, axis) in enumerate(self._placements, 1):
            value = motion.multiplier * q[motion.variable] + motion.offset
            parts = np.matmul(turns, rotations[parent])
            rotations[k] = parts[:, :3]
            origins[k] = origins[parent] + np.matmul(shift, rotations[parent])
            if motion.prismatic:
                origins[k] += value * np.matmul(axis, rotations[parent])
            else:
                rotations[k] += np.sin(value) * parts[:, 3:6]
                rotations[k] += (1 - np.cos(value)) * parts[:, 6:]
        return rotations, origins

    @cached_property
    def _placements(self) -> list[tuple[int, Motion, FloatArray, FloatArray, FloatArray]]:
        """Each body's parent and motion; its rotation's parts at 0, its shift and its axis.

        The parts are those that count 1, the sine and the versine of the angle, (9, 3).
        """
        placements = []
        for parent, motion in self.bodies:
            pose, axis = np.array(motion.placement), np.array(motion.axis)
            skew = np.cross(np.eye(3), axis)
            turned = (pose[:3, :3], pose[:3, :3] @ skew, pose[:3, :3] @ skew @ skew)
            parts = np.concatenate([part.T for part in turned])
            placements.append((parent, motion, parts, pose[:3, 3], pose[:3, :3] @ axis))
        return placements

    def distances(self, configurations: FloatArray) -> FloatArray:
        """Distance of the two capsules of each pair at configurations (n, B), in metres.

        Shape (pairs, B); below zero where capsules overlap.
        """
        size = max(1, _CHUNK // len(self.pairs))
        starts = range(0, max(1, configurations.shape[1]), size)
        parts = [self._distances(configurations[:, k : k + size]) for k in starts]
        return np.concatenate(parts, axis=1)

    def _distances(self, configurations: FloatArray) -> FloatArray:
        rotations, origins = self.frames(configurations)
        bodies = [link.body for link in self.links]
        segments = np.array([[link.capsule.start, link.capsule.end] for link in self.links])
        turned = np.einsum("kijb,kej->ekib", rotations[bodies], segments)
        starts, ends = turned + origins[bodies]
        radii = np.array([link.capsule.radius for link in self.links])
        first, second = np.transpose(self.pairs)
        gap = segment_distance(starts[first], ends[first], starts[second], ends[second], axis=1)
        # Obstacles are boxes, too: of those about the capsules' segments, the distance.
        for obstacle in self._boxes:
            links, back, (low, high) = obstacle.links, obstacle.back, obstacle.corners
            own = [back[:3, :3] @ e[links] + back[:3, 3:] for e in (starts, ends)]
            over = np.maximum(low - np.maximum(*own), np.minimum(*own) - high)
            box = np.sqrt(np.sum(np.maximum(over, 0.0) ** 2, axis=1))
            pairs = obstacle.pairs
            gap[pairs] = np.maximum(gap[pairs], box + radii[obstacle.link])
        return np.asarray(gap - (radii[first] + radii[second])[:, None])

    @cached_property
    def _boxes(self) -> list[_Box]:
        """Return the obstacles that have a box, and are in a pair."""
        boxes = []
        for j, link in enumerate(self.links):
            pairs = [k for k, (_, other) in enumerate(self.pairs) if other == j]
            if link.box is not None and pairs:
                links = np.array([self.pairs[k][0] for k in pairs])
                low, high = (corner[:, None] for corner in link.box)
                back = np.asarray(np.linalg.inv(link.pose), dtype=float)
                boxes.append(_Box(j, np.array(pairs), links, back, (low, high)))
        return boxes

    def slack(self, configurations: FloatArray) -> FloatArray:
        """By how much all pairs are farther apart than they have to be, at points (n, B).

        In metres, shape (B,): the least over the pairs, below zero where one is too near. By
        the geometry, but by capsules where these keep the distance.
        """
        return np.asarray(np.min(self.gaps(configurations) - self.leasts[:, None], axis=0))

    def gaps(
        self,
        configurations: FloatArray,
        wanted: BoolArray | None = None,
        distances: FloatArray | None = None,
    ) -> FloatArray:
        """Lower bounds of the distances of all pairs at configurations (n, B), (pairs, B).

        Where wanted, by default where capsules do not keep what is asked for, they are
        distances by the geometry, or keep it. Elsewhere they are `distances`, if known.
        """
        gaps = self.distances(configurations) if distances is None else distances.copy()
        wanted = gaps < self.leasts[:, None] if wanted is None else wanted
        columns = np.flatnonzero(wanted.any(axis=0))
        rotations, origins = self.frames(configurations[:, columns])
        for place, k in enumerate(columns):
            which = np.flatnonzero(wanted[:, k])
            pairs = [self.pairs[i] for i in which]
            placed = self._placed(rotations[..., place], origins[..., place], pairs)
            for i, (_, frames) in zip(which, placed, strict=True):
                gaps[i, k] = _nearest_points(*frames, float(self.leasts[i]))[0]
        return gaps

    def is_kept(self, configurations: FloatArray) -> BoolArray:
        """Whether all pairs keep their distance at configurations (n, B), shape (B,)."""
        return np.asarray(self.slack(configurations) >= 0)

    def violated(self, configuration: FloatArray) -> list[PointPair]:
        """Return the nearest two points of every pair that is too near at a configuration."""
        point = configuration[:, None]
        near = np.flatnonzero(self.distances(point)[:, 0] < self.leasts)
        rotations, origins = (side[..., 0] for side in self.frames(point))
        placed = self._placed(rotations, origins, [self.pairs[k] for k in near])
        conditions = []
        for least, ((i, j), frames) in zip(self.leasts[near].tolist(), placed, strict=True):
            gap, ends = _nearest_points(*frames, least)
            if gap < least:
                bodies = self.links[i].body, self.links[j].body
                first, second = (
                    rotations[k].T @ (end - origins[k])
                    for k, end in zip(bodies, ends, strict=True)
                )
                conditions.append(PointPair(bodies, (first, second), least))
        return conditions

    @cached_property
    def leasts(self) -> FloatArray:
        """What each pair keeps, in metres, shape (pairs,)."""
        return np.array([self.nearer.get(k, self.least) for k in range(len(self.pairs))])

    def shares(self, positions: ca.SX) -> ca.SX:
        """State the conditions: squared distances over what they have to be, at least 1."""
        rotations, origins, _ = body_frames(self.bodies, positions)
        rows = []
        for pair in self.conditions:
            first, second = (
                origins[body] + rotations[body] @ ca.DM(point)
                for body, point in zip(pair.bodies, pair.points, strict=True)
            )
            rows.append(ca.sumsqr(first - second) / (pair.least + _MARGIN_M) ** 2)
        return ca.vertcat(*rows)

    def closest(self, configuration: FloatArray, pairs: Sequence[tuple[int, int]]) -> Closest:
        """Return the nearest of some pairs by the geometry itself, as coal measures it."""
        nearest = Closest(np.inf, ("", ""))
        rotations, origins = (side[..., 0] for side in self.frames(configuration[:, None]))
        for pair, frames in self._placed(rotations, origins, pairs):
            gap, _ = _nearest_points(*frames, nearest.distance)
            if gap < nearest.distance:
                nearest = Closest(gap, self.names(pair))
        return nearest

    def _placed(
        self, rotations: FloatArray, origins: FloatArray, pairs: Sequence[tuple[int, int]]
    ) -> Iterator[tuple[tuple[int, int], tuple[list[Placed], list[Placed]]]]:
        """Yield pairs of links with their shapes where they are."""
        coal = library("coal")
        placed: dict[int, list[Placed]] = {}
        for pair in pairs:
            for i in pair:
                if i not in placed:
                    link = self.links[i]
                    body = homogeneous(rotations[link.body], origins[link.body])
                    poses = [body @ link.pose @ shape.pose for shape in link.shapes]
                    frames = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in poses]
                    placed[i] = list(zip(link.shapes, frames, strict=True))
            yield pair, (placed[pair[0]], placed[pair[1]])

    def __getstate__(self) -> dict[str, object]:
        """Travel to other processes without the computed values whose names begin with ``_``.

        The others, such as `leasts`, are small, and stay.
        """
        return {k: v for k, v in self.__dict__.items() if not k.startswith("_")}


def _nearest_points(
    first: list[Placed], second: list[Placed], enough: float
) -> tuple[float, Ends]:
    """Return the least distance of shapes, and the points if it is below what is enough."""
    least, ends = np.inf, (np.zeros(3), np.zeros(3))
    for one, other in product(first, second):
        gap, points = distance(one, other, min(least, enough))
        if gap < least:
            least, ends = gap, points or ends
    return least, ends
