"""How near the links of a robot are to each other: by their geometry, as coal measures it.

The geometry of a link is its collision geometry or, where it has none, its visual geometry. Two
points of two links, fixed in them, can be no nearer to each other than the links have to be: a
smooth condition on the joints' positions. A search begins without any, and adds those of the
two nearest points wherever its answers leave links too near (an exchange method, as for
semi-infinite programs). What meets all conditions and keeps the distance is an optimum of the
problem with all distances.

Every link also has one capsule around its geometry: links whose capsules are far enough apart
are not looked at more closely.

Left out are links that one joint connects, and pairs in contact at every one of 500 random
configurations. Links two joints apart that are nearer than asked for at all of these, as in
wrists, keep half of the largest of their distances.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import combinations, product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from formulations.clearance.shapes import (
    Capsule,
    Geometry,
    Shape,
    capsule_around,
    coal_library,
    read_shapes,
    solid,
)
from formulations.kinematics.chain import Bodies, Chain
from formulations.kinematics.chain_between import bodies_of
from formulations.kinematics.forward import Kinematics, body_frames
from formulations.kinematics.link_chain import BoolArray, segment_distance
from formulations.kinematics.read_urdf import from_file, is_urdf, urdf_tree, xml_root
from formulations.kinematics.tree import RobotTree
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Random configurations at which links are looked at: those in contact at all of them are left
# out.
_SAMPLES = 500
# What conditions ask for beyond the distance, in metres: the gate is the distance itself.
_MARGIN = 1e-5
# Pairs times configurations done together: memory stays bounded.
_CHUNK = 100_000


@dataclass(frozen=True, eq=False)
class Link:
    """A link with geometry, ``collision`` or ``visual``.

    It is part of a body, by number in `LinkClearance.bodies`: the pose, 4×4, and the capsule
    around the shapes are in that body's frame.
    """

    name: str
    body: int
    pose: FloatArray
    shapes: tuple[Shape, ...]
    capsule: Capsule
    source: str


@dataclass(frozen=True)
class Closest:
    """The two links that are nearest to each other, and their distance.

    In metres, of the geometry itself, by coal; zero or below where they touch.
    """

    distance: float
    links: tuple[str, str]


@dataclass(frozen=True, eq=False)
class PointPair:
    """Two points of two links, in their bodies' frames, and what they keep, in metres."""

    bodies: tuple[int, int]
    points: tuple[FloatArray, FloatArray]
    least: float


@dataclass(frozen=True, eq=False)
class LinkClearance:
    """The distance that links keep from each other.

    Attributes
    ----------
    least
        What they keep at least, in metres.
    bodies, size
        Of the whole robot, and the number of the chain's free joints that move them.
    links
        Links with geometry.
    pairs
        Pairs of links that are looked at.
    left_out
        Pairs that are not, though no joint connects the two: see above.
    nearer
        What pairs keep that are never so far apart as asked for, by number in `pairs`.
    conditions
        Points that are to keep a distance.
    """

    least: float
    bodies: Bodies
    size: int
    links: tuple[Link, ...]
    pairs: tuple[tuple[int, int], ...]
    left_out: tuple[tuple[int, int], ...] = ()
    nearer: Mapping[int, float] = field(default_factory=dict)
    conditions: tuple[PointPair, ...] = ()

    @property
    def visual(self) -> tuple[str, ...]:
        """Names of links whose visual geometry is taken, because they have no other."""
        return tuple(link.name for link in self.links if link.source == "visual")

    def names(self, pair: tuple[int, int]) -> tuple[str, str]:
        """Names of the two links of a pair."""
        return self.links[pair[0]].name, self.links[pair[1]].name

    def frames(self, configurations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (bodies, 3, 3, B) and origins (bodies, 3, B) at configurations (n, B)."""
        rotations, origins = (np.array(stacked) for stacked in self._kinematics(configurations))
        count = len(self.bodies) + 1
        # CasADi's vectors are column by column.
        rotations = rotations.reshape(count, 3, 3, -1).transpose(0, 2, 1, 3)
        return rotations, origins.reshape(count, 3, -1)

    @cached_property
    def _kinematics(self) -> ca.Function:
        q = ca.SX.sym("q", self.size)
        rotations, origins, _ = body_frames(self.bodies, q)
        stacked = [ca.vertcat(*map(ca.vec, rotations)), ca.vertcat(*origins)]
        return ca.Function("bodies", [q], stacked)

    def distances(self, configurations: FloatArray) -> FloatArray:
        """Distance of the two capsules of each pair at configurations (n, B), in metres.

        Shape (pairs, B); below zero where capsules overlap.
        """
        size = max(1, _CHUNK // len(self.pairs))
        starts = range(0, configurations.shape[1], size)
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
        return np.asarray(gap - (radii[first] + radii[second])[:, None])

    def slack(self, configurations: FloatArray) -> FloatArray:
        """By how much all pairs are farther apart than they have to be, at points (n, B).

        In metres, shape (B,): the least over the pairs, below zero where one is too near. By
        the geometry, but by capsules where these keep the distance.
        """
        bounds = self.distances(configurations) - self._leasts[:, None]
        least = np.min(bounds, axis=0)
        for k in np.flatnonzero(least < 0):
            near = np.flatnonzero(bounds[:, k] < 0)
            found = self._nearest(configurations[:, k], [self.pairs[i] for i in near])
            own = [gap - self._leasts[i] for i, (gap, _) in zip(near, found, strict=True)]
            least[k] = min(*own, np.min(np.delete(bounds[:, k], near), initial=np.inf))
        return np.asarray(least)

    def is_kept(self, configurations: FloatArray) -> BoolArray:
        """Whether all pairs keep their distance at configurations (n, B), shape (B,)."""
        return np.asarray(self.slack(configurations) >= 0)

    def violated(self, configuration: FloatArray) -> list[PointPair]:
        """Return the nearest two points of every pair that is too near at a configuration."""
        bounds = self.distances(configuration[:, None])[:, 0]
        near = np.flatnonzero(bounds < self._leasts)
        found = self._nearest(configuration, [self.pairs[i] for i in near])
        return [
            replace(points, least=float(self._leasts[i]))
            for i, (gap, points) in zip(near, found, strict=True)
            if gap < self._leasts[i]
        ]

    @property
    def _leasts(self) -> FloatArray:
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
            rows.append(ca.sumsqr(first - second) / (pair.least + _MARGIN) ** 2)
        return ca.vertcat(*rows)

    def closest(self, configuration: FloatArray, pairs: Sequence[tuple[int, int]]) -> Closest:
        """Return the nearest of some pairs by the geometry itself, as coal measures it."""
        gaps = [gap for gap, _ in self._nearest(configuration, pairs)]
        nearest = int(np.argmin(gaps))
        return Closest(gaps[nearest], self.names(pairs[nearest]))

    def _nearest(
        self, configuration: FloatArray, pairs: Sequence[tuple[int, int]]
    ) -> list[tuple[float, PointPair]]:
        """Return each pair's distance, by coal, and nearest points; in contact a common one."""
        coal = coal_library()
        rotations, origins = (side[..., 0] for side in self.frames(configuration[:, None]))
        placed: dict[int, list[tuple[Any, Any]]] = {}
        for i in {i for pair in pairs for i in pair}:
            link, body = self.links[i], np.eye(4)
            body[:3, :3], body[:3, 3] = rotations[link.body], origins[link.body]
            poses = [body @ link.pose @ shape.pose for shape in link.shapes]
            frames = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in poses]
            placed[i] = list(zip(self._geometry[i], frames, strict=True))
        nearest = []
        for i, j in pairs:
            least, ends = np.inf, (np.zeros(3), np.zeros(3))
            for first, second in product(placed[i], placed[j]):
                found = coal.DistanceResult()
                gap = coal.distance(*first, *second, coal.DistanceRequest(), found)
                if gap < least:
                    least = gap
                    ends = found.getNearestPoint1().copy(), found.getNearestPoint2().copy()
                    if gap <= 0:
                        common = coal.CollisionResult()
                        request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1)
                        coal.collide(*first, *second, request, common)
                        if common.isCollision():
                            ends = (common.getContact(0).pos.copy(),) * 2
            bodies = self.links[i].body, self.links[j].body
            a, b = (
                rotations[k].T @ (e - origins[k]) for k, e in zip(bodies, ends, strict=True)
            )
            nearest.append((float(least), PointPair(bodies, (a, b), self.least)))
        return nearest

    @cached_property
    def _geometry(self) -> list[list[Any]]:
        return [[solid(shape) for shape in link.shapes] for link in self.links]

    def __getstate__(self) -> dict[str, object]:
        """Travel to other processes without what coal and CasADi made."""
        return {k: v for k, v in self.__dict__.items() if not k.startswith("_")}


def read_clearance(path: str | os.PathLike[str], chain: Chain, least: float) -> LinkClearance:
    """Read the links' geometry of a URDF file and fit the capsules.

    Parameters
    ----------
    path
        The file that the chain was read from, and meshes that it names.
    chain
        The joints that move.
    least
        What links keep from each other at least, in metres.

    Raises
    ------
    FileError
        If geometry is malformed, or a mesh cannot be read.
    InputError
        If the file is no URDF, coal is not installed, or there are no two links that could
        touch.
    """
    coal_library()  # a missing library is better known at once
    path = Path(path)
    if not from_file(path, is_urdf):
        allowed = "a URDF file: of MJCF only joints are read, and tables have no shapes"
        raise InputError("clearance", f"of {path}", allowed)
    tree, geometry = from_file(path, partial(_read, path))
    bodies, places = bodies_of(tree, chain)
    links = tuple(
        Link(name, *places[name], shapes, capsule_around(shapes, places[name][1]), source)
        for name, (shapes, source) in geometry.items()
        if shapes
    )
    parents = _parents(bodies)
    pairs = tuple(
        (i, j)
        for (i, first), (j, second) in combinations(enumerate(links), 2)
        if first.body != second.body
        and parents[first.body] != second.body
        and parents[second.body] != first.body
    )
    if not pairs:
        allowed = "a robot with geometry on two links that are not adjacent"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return _without_contacts(
        LinkClearance(least, bodies, len(chain.joints), links, pairs), chain
    )


def _read(path: Path, content: bytes) -> tuple[RobotTree, Geometry]:
    root = xml_root(content)
    return urdf_tree(root), read_shapes(root, path)


def _without_contacts(whole: LinkClearance, chain: Chain) -> LinkClearance:
    """Leave out pairs that are always in contact; ask less of wrists that are always nearer."""
    low, high = Kinematics(chain).ranges
    drawn = np.random.default_rng(1995).uniform(low, high, (len(low), _SAMPLES))
    bounds, parents = np.max(whole.distances(drawn), axis=1), _parents(whole.bodies)
    pairs: list[tuple[int, int]] = []
    out: list[tuple[int, int]] = []
    nearer: dict[int, float] = {}
    for pair, bound in zip(whole.pairs, bounds.tolist(), strict=True):
        first, second = (whole.links[i].body for i in pair)
        wrist = first == parents[parents[second]] or second == parents[parents[first]]
        enough = whole.least if wrist else 0.0
        farthest = bound
        for point in drawn.T:
            if farthest > enough:
                break
            farthest = max(farthest, whole.closest(point, [pair]).distance)
        if farthest <= 0:
            out.append(pair)
            continue
        if farthest <= enough:
            nearer[len(pairs)] = farthest / 2
        pairs.append(pair)
    if not pairs:
        allowed = "a robot with two links that are not always in contact"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return replace(whole, pairs=tuple(pairs), left_out=tuple(out), nearer=nearer)


def _parents(bodies: Bodies) -> dict[int, int]:
    """Return the body before each one's joint, by number; -1, where there is none."""
    return {-1: -1, 0: -1} | {k + 1: parent for k, (parent, _) in enumerate(bodies)}
