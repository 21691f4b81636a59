"""How near the links of a robot are to each other: capsules for the search, coal for the check.

Every link has one capsule, fitted around its collision geometry, or around its visual geometry
if it has no other. A capsule is the set of points within a radius of a segment. It contains the
geometry, so that capsules that keep a distance keep the links at that distance or more.

The distance of two segments is stated in CasADi for the nonlinear program: continuous, with a
continuous gradient except where the segments are parallel. The answer is checked twice: the
capsules in NumPy, by another formula; and the geometry itself, meshes too, by coal.

Not looked at are links that one joint connects; pairs whose capsules are in contact at every
one of 500 random configurations; and links two joints apart whose capsules are always nearer
than asked for, as in wrists.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations
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
    gap_squared,
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
# Pairs that come no nearer than this beyond what is asked for are no constraints, in metres.
_NEAR = 0.1
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
    """

    least: float
    bodies: Bodies
    size: int
    links: tuple[Link, ...]
    pairs: tuple[tuple[int, int], ...]
    left_out: tuple[tuple[int, int], ...] = ()

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
        ends = np.array([[link.capsule.start, link.capsule.end] for link in self.links])
        placed = np.einsum("kijb,kej->keib", rotations[bodies], ends) + origins[bodies, None]
        radii = np.array([link.capsule.radius for link in self.links])
        first, second = np.transpose(self.pairs)
        (start, end), (other, far) = (placed[i].swapaxes(0, 1) for i in (first, second))
        gap = segment_distance(start, end, other, far, axis=1)
        return np.asarray(gap - (radii[first] + radii[second])[:, None])

    def is_kept(self, configurations: FloatArray) -> BoolArray:
        """Whether all pairs of capsules keep the distance, shape (B,)."""
        return np.asarray(np.min(self.distances(configurations), axis=0) >= self.least - 1e-6)

    def near(self, configurations: FloatArray) -> list[int]:
        """Pairs that are, or come near to be, too close at one of these configurations."""
        closest = np.min(self.distances(configurations), axis=1)
        return [int(k) for k in np.flatnonzero(closest < self.least + _NEAR)]

    def excess(self, positions: ca.SX, which: Sequence[int]) -> ca.SX:
        """Squared distance of segments over what it has to be, for some pairs, by number.

        At symbols of the joints' positions, shape (pairs, 1): at least 1 where one is kept.
        """
        rotations, origins, _ = body_frames(self.bodies, positions)
        points = [
            [
                origins[link.body] + rotations[link.body] @ ca.DM(point)
                for point in (link.capsule.start, link.capsule.end)
            ]
            for link in self.links
        ]
        rows = []
        for i, j in (self.pairs[k] for k in which):
            radii = self.links[i].capsule.radius + self.links[j].capsule.radius
            rows.append(gap_squared(*points[i], *points[j]) / (radii + self.least) ** 2)
        return ca.vertcat(*rows)

    def closest(self, configuration: FloatArray, pairs: Sequence[tuple[int, int]]) -> Closest:
        """Return the nearest of some pairs by the geometry itself, as coal measures it."""
        coal = coal_library()
        rotations, origins = self.frames(configuration[:, None])
        placed = []
        for link, own in zip(self.links, self._geometry, strict=True):
            body = np.eye(4)
            body[:3, :3], body[:3, 3] = rotations[link.body][..., 0], origins[link.body][:, 0]
            whole = [body @ link.pose @ shape.pose for shape in link.shapes]
            frames = [coal.Transform3s(pose[:3, :3], pose[:3, 3]) for pose in whole]
            placed.append(list(zip(own, frames, strict=True)))
        request = coal.DistanceRequest()
        nearest = []
        for i, j in pairs:
            gaps = [
                coal.distance(*first, *second, request, coal.DistanceResult())
                for first in placed[i]
                for second in placed[j]
            ]
            nearest.append(Closest(min(gaps), self.names((i, j))))
        return min(nearest, key=lambda pair: pair.distance)

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
    """Leave out pairs whose capsules are always in contact, or in wrists always too near."""
    low, high = Kinematics(chain).ranges
    drawn = np.random.default_rng(1995).uniform(low, high, (len(low), _SAMPLES))
    largest, parents = np.max(whole.distances(drawn), axis=1), _parents(whole.bodies)
    pairs: list[tuple[int, int]] = []
    out: list[tuple[int, int]] = []
    for pair, gap in zip(whole.pairs, largest.tolist(), strict=True):
        first, second = (whole.links[i].body for i in pair)
        wrist = first == parents[parents[second]] or second == parents[parents[first]]
        (out if gap < (whole.least if wrist else 0.0) else pairs).append(pair)
    if not pairs:
        allowed = "a robot with two links that are not always in contact"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return replace(whole, pairs=tuple(pairs), left_out=tuple(out))


def _parents(bodies: Bodies) -> dict[int, int]:
    """Return the body before each one's joint, by number; -1, where there is none."""
    return {-1: -1, 0: -1} | {k + 1: parent for k, (parent, _) in enumerate(bodies)}
