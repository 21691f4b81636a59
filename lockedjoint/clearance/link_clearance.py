"""How near the links of a robot are to each other: by their geometry, as coal measures it.

The geometry of a link is its collision geometry or, where it has none, its visual geometry. Two
points of two links, fixed in them, can be no nearer to each other than the links have to be: a
smooth *condition* on the joints' positions. A search begins without any, and adds those of the
two nearest points wherever its answers leave links too near (an exchange method, as for
semi-infinite programs, see `robots.kept_apart`). An optimum under some conditions that keeps
all distances is one of the problem with all distances.

Every link also has one capsule around its geometry: links whose capsules are far enough apart
are not looked at more closely. Obstacles are links, too, of the body that does not move.

Some pairs are left out, by `read_clearance`: links that one joint connects, pairs in contact at
every one of 500 random configurations, and pairs that an SRDF file disables. Links two joints
apart that are nearer than asked for at all of these configurations, as in wrists, keep half of
the largest of their distances.

Letters: n joints, B configurations as columns, shape (n, B), radians or (prismatic joints)
metres; P pairs of links. Lengths and distances are metres. A *body* is what a joint moves; it
may be several links. Body 0 does not move.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np

from lockedjoint.clearance.around_shapes import Capsule
from lockedjoint.clearance.distances import Ends, Placed, distance, gap_of
from lockedjoint.clearance.placed_bodies import BodyPlacement, body_placements, placed_frames
from lockedjoint.clearance.shapes import Shape
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import listed
from lockedjoint.kinematics.forward import body_frames
from lockedjoint.kinematics.geometry import BoolArray, IntArray, homogeneous, segment_distance
from lockedjoint.kinematics.motion import Bodies
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# Length by which conditions ask for more than the distance, so that answers that miss them by
# a solver's tolerance still keep the distance itself. A larger one keeps links farther apart
# than they have to be.
_MARGIN_M = 1e-5
# Number of pairs times configurations that are done together. More take more memory.
_PAIRS_AT_ONCE = 100_000


@dataclass(frozen=True, eq=False)
class Link:
    """A link with geometry, or an obstacle. Lengths are metres, poses homogeneous matrices."""

    name: str
    body: int  #: Number of its body in `LinkClearance.bodies`; 0 for obstacles.
    pose: FloatArray  #: Its frame in the body's frame, shape (4, 4).
    shapes: tuple[Shape, ...]  #: Its geometry, in its own frame.
    capsule: Capsule  #: A capsule around the shapes, in the body's frame.
    source: str  #: Where the geometry is from: ``collision``, ``visual`` or ``obstacle``.
    #: An obstacle has a box around its shapes, too: the least and the largest coordinates in
    #: its own frame, shape (3,) each.
    box: tuple[FloatArray, FloatArray] | None = None


class NoPairsError(InputError):
    """A robot without any two links of which a distance can be looked at."""

    exit_status: ClassVar[int] = 1


@dataclass(frozen=True)
class Closest:
    """The two links that are nearest to each other, and their distance."""

    distance: float  #: Metres, of the geometry itself, by coal; zero or below in contact.
    links: tuple[str, str]  #: Names of the two links.
    #: On a way, the distance is the least that was found, and no two links are nearer than this
    #: anywhere on it; None for single configurations.
    at_least: float | None = None

    def __str__(self) -> str:
        """Say how near they are, and which they are."""
        nowhere = "" if self.at_least is None else f", nowhere below {self.at_least:.4g} m"
        return f"{self.distance:.4g} m: {' and '.join(self.links)}{nowhere}"


@dataclass(frozen=True, eq=False)
class PointPair:
    """Two points of two links that are to keep a distance."""

    bodies: tuple[int, int]  #: Numbers of the links' bodies in `LinkClearance.bodies`.
    points: tuple[FloatArray, FloatArray]  #: Each in its body's frame, shape (3,).
    least: float  #: The distance, metres.


@dataclass(frozen=True, eq=False)
class _Box:
    """The box around an obstacle, and the pairs that it is in."""

    link: int  #: Number of the obstacle in `LinkClearance.links`.
    pairs: IntArray  #: Numbers of the pairs with it, shape (pairs,).
    links: IntArray  #: Number of the other link in each of these pairs, shape (pairs,).
    to_box: FloatArray  #: Transform from the base's to the obstacle's own frame, (4, 4).
    #: Least and largest coordinates in that frame, shape (3, 1) each, metres.
    corners: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class LinkClearance:
    """Which pairs of links are to keep which distance, and how near they are."""

    least: float  #: The distance that a pair keeps at least, but for those of `nearer`; metres.
    #: For bodies 1, 2, … the number of the parent, and the motion; body 0 is fixed.
    bodies: Bodies
    links: tuple[Link, ...]  #: Those with geometry.
    #: Pairs of links that are looked at, by number in `links`; an obstacle is always second.
    pairs: tuple[tuple[int, int], ...]
    #: Pairs that are not looked at though no joint connects the two, because they are always in
    #: contact; by number in `links`.
    left_out: tuple[tuple[int, int], ...] = ()
    #: What pairs keep that are never so far apart as `least`: metres, by number in `pairs`.
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
        """Sentences on links that are in no pair; none if there are no such links."""
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
        """Return rotations and origins of all bodies at configurations (n, B).

        Shapes (bodies + 1, 3, 3, B) and (bodies + 1, 3, B), see `placed_frames`.
        """
        return placed_frames(self._placements, configurations)

    @cached_property
    def _placements(self) -> list[BodyPlacement]:
        """What `frames` needs of each body."""
        return body_placements(self.bodies)

    def distances(self, configurations: FloatArray) -> FloatArray:
        """Return the distance of the two capsules of each pair at configurations (n, B).

        Metres, shape (P, B); below zero where capsules overlap. It is a lower bound of the
        distance of the links. For a pair with an obstacle it may be that from the obstacle's
        box, where this is larger.
        """
        size = max(1, _PAIRS_AT_ONCE // len(self.pairs))
        starts = range(0, max(1, configurations.shape[1]), size)
        parts = [self._distances(configurations[:, k : k + size]) for k in starts]
        return np.concatenate(parts, axis=1)

    def _distances(self, configurations: FloatArray) -> FloatArray:
        """Return what `distances` does, for as many configurations as the memory allows.

        Each pair has the distance of the segments of two capsules less their radii.
        """
        rotations, origins = self.frames(configurations)
        bodies = [link.body for link in self.links]
        # The ends of the capsules' segments, (links, 3) each, and then (links, 3, B).
        segments = np.array([[link.capsule.start, link.capsule.end] for link in self.links])
        turned = np.einsum("kijb,kej->ekib", rotations[bodies], segments)
        starts, ends = turned + origins[bodies]
        radii = np.array([link.capsule.radius for link in self.links])
        first, second = np.transpose(self.pairs)
        gap = segment_distance(starts[first], ends[first], starts[second], ends[second], axis=1)
        # An obstacle is in a box, too. Its distance from a segment is at least that from the
        # box, along the obstacle's axes, around the segment.
        for obstacle in self._boxes:
            links, to_box, (low, high) = obstacle.links, obstacle.to_box, obstacle.corners
            # The segments' ends in the obstacle's frame, shape (pairs, 3, B) each, and by how
            # much each segment is beside the box along each axis.
            own = [to_box[:3, :3] @ e[links] + to_box[:3, 3:] for e in (starts, ends)]
            over = np.maximum(low - np.maximum(*own), np.minimum(*own) - high)
            box = np.sqrt(np.sum(np.maximum(over, 0.0) ** 2, axis=1))
            pairs = obstacle.pairs
            # The radius of the obstacle's capsule, which a box does not have, is taken away
            # below.
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
                to_box = np.asarray(np.linalg.inv(link.pose), dtype=float)
                boxes.append(_Box(j, np.array(pairs), links, to_box, (low, high)))
        return boxes

    def slack(self, configurations: FloatArray) -> FloatArray:
        """Return by how much all pairs are farther apart than they have to be, at (n, B).

        Metres, shape (B,): the least over the pairs, below zero where one is too near. Where
        capsules keep the distance it is theirs, a lower bound, else that of the geometry.
        """
        return np.asarray(np.min(self.gaps(configurations) - self.leasts[:, None], axis=0))

    def gaps(
        self,
        configurations: FloatArray,
        wanted: BoolArray | None = None,
        distances: FloatArray | None = None,
    ) -> FloatArray:
        """Return lower bounds of the distances of all pairs, metres, shape (P, B).

        Parameters
        ----------
        configurations
            Positions of the joints, shape (n, B).
        wanted
            Where the geometry is to be measured, shape (P, B); by default where capsules do not
            keep what is asked for. There the result is the distance itself, or at least what
            the pair has to keep.
        distances
            The result elsewhere, shape (P, B); by default what `distances` returns.
        """
        gaps = self.distances(configurations) if distances is None else distances.copy()
        wanted = gaps < self.leasts[:, None] if wanted is None else wanted
        columns = np.flatnonzero(wanted.any(axis=0))
        some = wanted[:, columns]
        rotations, origins = self.frames(configurations[:, columns])
        found = library("coal").DistanceResult()
        placed: dict[int, list[_PlacedShape]] = {}
        for i in np.flatnonzero(some.any(axis=1)).tolist():
            for k in self.pairs[i]:
                if k not in placed:
                    body = self.links[k].body
                    placed[k] = _placed_shapes(self.links[k], rotations[body], origins[body])
            first, second = (placed[k] for k in self.pairs[i])
            which, enough = np.flatnonzero(some[i]), float(self.leasts[i])
            gaps[i, columns[which]] = [
                _nearest(first, second, place, enough, found) for place in which.tolist()
            ]
        return gaps

    def is_kept(self, configurations: FloatArray) -> BoolArray:
        """Whether all pairs keep their distance at configurations (n, B), shape (B,)."""
        return np.asarray(self.slack(configurations) >= 0)

    def violated(self, configuration: FloatArray) -> list[PointPair]:
        """Return the nearest two points of every pair that is too near at one posture, (n,)."""
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
        """What each pair keeps, metres, shape (P,)."""
        return np.array([self.nearer.get(k, self.least) for k in range(len(self.pairs))])

    def shares(self, positions: ca.SX) -> ca.SX:
        """Return for each condition (d/d_min)², symbolic, to be at least 1.

        The distance of its two points is d at the positions, shape (n, 1), and d_min is what
        they keep and the margin `_MARGIN_M`. The result has one row for each condition.
        """
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
        """Return the nearest of some pairs at one configuration, (n,), by the geometry itself.

        Pairs are numbers in `links`. A distance of infinity and no names if there are no pairs.
        """
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
        """Yield each pair, and the shapes of its two links where they are.

        Rotations, (bodies + 1, 3, 3), and origins, (bodies + 1, 3), are those of one
        configuration. A link that is in several pairs is placed once.
        """
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


class _PlacedShape(NamedTuple):
    """A shape of a link, and where it is at some configurations, one after another."""

    shape: Shape
    frame: Any  #: coal's Transform3s, which is set to the place that is asked for.
    rotations: FloatArray  #: Shape (B, 3, 3).
    origins: FloatArray  #: Shape (B, 3), metres.


def _placed_shapes(link: Link, rotation: FloatArray, origin: FloatArray) -> list[_PlacedShape]:
    """Return the shapes of a link whose body has these frames, (3, 3, B) and (3, B)."""
    turned, coal, placed = rotation.transpose(2, 0, 1), library("coal"), []
    for shape in link.shapes:
        pose = link.pose @ shape.pose
        rotations, origins = turned @ pose[:3, :3], turned @ pose[:3, 3] + origin.T
        placed.append(_PlacedShape(shape, coal.Transform3s(), rotations, origins))
    return placed


def _nearest(
    first: list[_PlacedShape],
    second: list[_PlacedShape],
    place: int,
    enough: float,
    found: Any,
) -> float:
    """Return the least distance of two links' shapes at one place of their configurations.

    It need not be exact from `enough` on. `found` is a DistanceResult of coal.
    """
    for _, frame, rotations, origins in (*first, *second):
        frame.setTransform(rotations[place], origins[place])
    least = np.inf
    for one, other in product(first, second):
        gap = gap_of(one[:2], other[:2], min(least, enough), found)
        least = min(least, gap)
    return least


def _nearest_points(
    first: list[Placed], second: list[Placed], enough: float
) -> tuple[float, Ends]:
    """Return the least distance of two links' shapes, and the two nearest points.

    The points, shape (3,) each in the base's axes, are valid if the distance is below `enough`.
    """
    least, ends = np.inf, (np.zeros(3), np.zeros(3))
    for one, other in product(first, second):
        gap, points = distance(one, other, min(least, enough))
        if gap < least:
            least, ends = gap, points or ends
    return least, ends
