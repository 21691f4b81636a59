"""How near the links of a robot are to each other: capsules for the search, coal for the check.

Every link has one capsule, fitted around its collision geometry, or around its visual geometry
if it has no other. A capsule is the set of points within a radius of a segment. It contains the
geometry, so that capsules that keep a distance keep the links at that distance or more.

The distance of two segments is stated in CasADi for the nonlinear program: continuous, with a
continuous gradient except where the segments are parallel. The answer is checked twice: the
capsules in NumPy, by another formula; and the geometry itself, meshes too, by coal.

Joints that do not move the tip are held: at zero, or at the limit nearest to it.

Not looked at are links that one joint connects; pairs whose capsules are in contact at every
one of 500 random configurations; and links two joints apart whose capsules are always nearer
than asked for, as in wrists.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from formulations.robots.chain import LARGEST, Chain, rotation
from formulations.robots.chain_between import displacement, driven_joint
from formulations.robots.read_urdf import check_numbers, is_urdf, parse_urdf, xml_root
from formulations.robots.survival import Kinematics
from formulations.robots.tree import MOVING, RobotTree
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError, MissingLibraryError
from nlp.files import read_bytes

if TYPE_CHECKING:
    from lxml.etree import _Element

# Numbers of each geometry's attributes.
_SIZES = {"box": ("size", 3), "sphere": ("radius", 1), "cylinder": ("radius", 1)}
# A cylinder's rim as so many points, on a circle that is larger by as much as they cut off.
_RIM = 32
# Added to radii: rounding.
_MARGIN = 1e-6
# Random configurations at which links are looked at: those in contact at all of them are left
# out.
_SAMPLES = 500
# Pairs that come no nearer than this beyond what is asked for are no constraints, in metres.
_NEAR = 0.1
# Pairs times configurations done together: memory stays bounded.
_CHUNK = 100_000
# Added to squared lengths of segments, in square metres: a point is a segment, too.
_TINY = 1e-10


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry of a link.

    Attributes
    ----------
    kind
        ``box``, ``sphere``, ``cylinder`` or ``mesh``.
    size
        Edges; radius; radius and length; scale: in metres, as URDF has them.
    file
        Of a mesh.
    pose
        In the link's frame, 4×4.
    """

    kind: str
    size: tuple[float, ...]
    file: Path | None
    pose: FloatArray


@dataclass(frozen=True, eq=False)
class Link:
    """A link with geometry.

    Attributes
    ----------
    name
        Its name.
    body
        Which of `Clearance.bodies` it is fixed to.
    pose
        In that body's frame, 4×4.
    shapes
        Its geometry.
    source
        ``collision`` or ``visual``.
    """

    name: str
    body: int
    pose: FloatArray
    shapes: tuple[Shape, ...]
    source: str


@dataclass(frozen=True, eq=False)
class Body:
    """Links that move as one, after a joint; the first body does not move.

    Attributes
    ----------
    parent
        The body before the joint; -1 for the first.
    placement
        The joint's frame in the parent's, 4×4.
    axis, translates, variable, multiplier, offset
        As of a `formulations.robots.chain.Motion`.
    """

    parent: int = -1
    placement: FloatArray | None = None
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    translates: bool = False
    variable: int = 0
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Capsule:
    """Points within a radius of a segment, in metres, in a body's frame."""

    start: FloatArray
    end: FloatArray
    radius: float


@dataclass(frozen=True)
class Closest:
    """The two links that are nearest to each other.

    Attributes
    ----------
    distance
        In metres, of the geometry itself, by coal; below zero or zero where they touch.
    links
        Their names.
    """

    distance: float
    links: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Clearance:
    """The distance that links keep from each other.

    Attributes
    ----------
    least
        What they keep at least, in metres.
    size
        Number of the chain's free joints.
    bodies
        Of the whole robot, parents first.
    links
        Links with geometry.
    capsules
        One for each.
    pairs
        Pairs of links that are looked at.
    left_out
        Pairs that are not, though no joint connects the two: see above.
    """

    least: float
    size: int
    bodies: tuple[Body, ...]
    links: tuple[Link, ...]
    capsules: tuple[Capsule, ...]
    pairs: tuple[tuple[int, int], ...]
    left_out: tuple[tuple[int, int], ...] = ()

    @property
    def visual(self) -> tuple[str, ...]:
        """Names of links whose visual geometry is taken, because they have no other."""
        return tuple(one.name for one in self.links if one.source == "visual")

    def names(self, pair: tuple[int, int]) -> tuple[str, str]:
        """Names of the two links of a pair."""
        return self.links[pair[0]].name, self.links[pair[1]].name

    def distances(self, configurations: FloatArray) -> FloatArray:
        """Distance of the two capsules of each pair, in metres.

        Parameters
        ----------
        configurations
            Shape (n, B).

        Returns
        -------
        numpy.ndarray
            Shape (pairs, B), below zero where capsules overlap.
        """
        size = max(1, _CHUNK // len(self.pairs))
        count = configurations.shape[1]
        parts = [configurations[:, k : k + size] for k in range(0, count, size)]
        return np.concatenate([self._distances(one) for one in parts], axis=1)

    def _distances(self, configurations: FloatArray) -> FloatArray:
        turns, origins = self._frames(configurations)
        starts, ends = (
            np.stack(
                [
                    origins[link.body] + np.einsum("ijb,j->ib", turns[link.body], point)
                    for link, point in zip(self.links, points, strict=True)
                ]
            )
            for points in (
                [one.start for one in self.capsules],
                [one.end for one in self.capsules],
            )
        )
        first, second = (list(side) for side in zip(*self.pairs, strict=True))
        radii = np.array([one.radius for one in self.capsules])
        gap = _between_segments(starts[first], ends[first], starts[second], ends[second])
        return np.asarray(gap - (radii[first] + radii[second])[:, None])

    def is_kept(self, configurations: FloatArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether all pairs of capsules keep the distance, shape (B,)."""
        return np.asarray(np.min(self.distances(configurations), axis=0) >= self.least - 1e-6)

    def near(self, configurations: FloatArray) -> list[int]:
        """Pairs that are, or come near to be, too close at one of these configurations."""
        closest = np.min(self.distances(configurations), axis=1)
        return [int(k) for k in np.flatnonzero(closest < self.least + _NEAR)]

    def excess(self, positions: ca.SX, which: Sequence[int]) -> ca.SX:
        """Squared distance of segments over what it has to be, for some pairs.

        Parameters
        ----------
        positions
            Symbols of the joints' positions.
        which
            Pairs, by number.

        Returns
        -------
        casadi.SX
            Shape (pairs, 1): at least 1 where the pair keeps the distance.
        """
        turns, origins = _moved(self.bodies, positions)
        points = [
            [origins[link.body] + turns[link.body] @ ca.DM(p) for p in (one.start, one.end)]
            for link, one in zip(self.links, self.capsules, strict=True)
        ]
        rows = []
        for k in which:
            i, j = self.pairs[k]
            least = self.capsules[i].radius + self.capsules[j].radius + self.least
            rows.append(_gap_squared(*points[i], *points[j]) / least**2)
        return ca.vertcat(*rows)

    def closest(self, configuration: FloatArray, pairs: Sequence[tuple[int, int]]) -> Closest:
        """Return the nearest of some pairs by the geometry itself, as coal measures it."""
        coal = _coal()
        turns, origins = self._frames(configuration[:, None])
        placed = []
        for link, own in zip(self.links, self._geometry, strict=True):
            body = np.eye(4)
            body[:3, :3], body[:3, 3] = turns[link.body][..., 0], origins[link.body][:, 0]
            whole = [body @ link.pose @ shape.pose for shape in link.shapes]
            frames = [coal.Transform3s(one[:3, :3], one[:3, 3]) for one in whole]
            placed.append(list(zip(own, frames, strict=True)))
        request = coal.DistanceRequest()
        found = []
        for i, j in pairs:
            gaps = [
                coal.distance(one, at, other, there, request, coal.DistanceResult())
                for one, at in placed[i]
                for other, there in placed[j]
            ]
            found.append(Closest(min(gaps), self.names((i, j))))
        return min(found, key=lambda one: one.distance)

    @cached_property
    def _kinematics(self) -> ca.Function:
        q = ca.SX.sym("q", self.size)
        turns, origins = _moved(self.bodies, q)
        return ca.Function(
            "bodies", [q], [ca.vertcat(*map(ca.vec, turns)), ca.vertcat(*origins)]
        )

    @cached_property
    def _geometry(self) -> list[list[Any]]:
        return [[_solid(shape) for shape in link.shapes] for link in self.links]

    def __getstate__(self) -> dict[str, object]:
        """Travel to other processes without what coal and CasADi made."""
        return {k: v for k, v in self.__dict__.items() if not k.startswith("_")}

    def _frames(self, configurations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (bodies, 3, 3, B) and origins (bodies, 3, B)."""
        turns, origins = (np.array(one) for one in self._kinematics(configurations))
        count = len(self.bodies)
        # CasADi's vectors are column by column.
        turns = turns.reshape(count, 3, 3, -1).transpose(0, 2, 1, 3)
        return turns, origins.reshape(count, 3, -1)


def read_clearance(path: str | os.PathLike[str], chain: Chain, least: float) -> Clearance:
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
    _coal()
    path = Path(path)
    content = read_bytes(path)
    if not is_urdf(content):
        allowed = "a URDF file: of MJCF only joints are read, and tables have no shapes"
        raise InputError("clearance", f"of {path}", allowed)
    tree = parse_urdf(content)
    bodies, places = _bodies(tree, chain)
    geometry = _read_geometry(xml_root(content), path)
    links = tuple(
        Link(name, *places[name], shapes, source)
        for name, (shapes, source) in geometry.items()
        if shapes
    )
    capsules = tuple(_around(link) for link in links)
    pairs = tuple(
        (i, j)
        for (i, one), (j, other) in combinations(enumerate(links), 2)
        if one.body != other.body
        and bodies[one.body].parent != other.body
        and bodies[other.body].parent != one.body
    )
    if not pairs:
        allowed = "a robot with geometry on two links that are not adjacent"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    whole = Clearance(least, len(chain.joints), bodies, links, capsules, pairs)
    low, high = Kinematics(chain).ranges
    drawn = np.random.default_rng(1995).uniform(low, high, (len(low), _SAMPLES))
    largest = np.max(whole.distances(drawn), axis=1)
    kept: list[tuple[int, int]] = []
    out: list[tuple[int, int]] = []
    for pair, gap in zip(pairs, largest.tolist(), strict=True):
        one, other = (bodies[links[i].body] for i in pair)
        wrist = other.parent >= 0 and bodies[other.parent].parent == links[pair[0]].body
        wrist |= one.parent >= 0 and bodies[one.parent].parent == links[pair[1]].body
        (out if gap < (least if wrist else 0.0) else kept).append(pair)
    if not kept:
        allowed = "a robot with two links that are not always in contact"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return replace(whole, pairs=tuple(kept), left_out=tuple(out))


def _coal() -> Any:
    try:
        import coal
    except ModuleNotFoundError:
        raise MissingLibraryError("coal", "clearance") from None
    return coal


def _bodies(
    tree: RobotTree, chain: Chain
) -> tuple[tuple[Body, ...], dict[str, tuple[int, FloatArray]]]:
    """Return what moves as one, and of each link its body and its pose in the body's frame."""
    by_name = {joint.name: joint for joint in tree.joints}
    fixed = dict((*chain.immobile, *chain.held))
    bodies = [Body()]
    places: dict[str, tuple[int, FloatArray]] = {tree.root: (0, np.eye(4))}
    children: dict[str, list[Any]] = {}
    for joint in tree.joints:
        children.setdefault(joint.parent, []).append(joint)
    waiting = list(children.get(tree.root, []))
    while waiting:
        joint = waiting.pop()
        waiting += children.get(joint.child, [])
        body, pose = places[joint.parent]
        pose = pose @ np.asarray(joint.origin)
        if joint.type in MOVING:
            _, driver, multiplier, offset = driven_joint(by_name, joint)
            if driver.name in chain.names and multiplier != 0:
                x, y, z = joint.axis.tolist()
                variable = chain.names.index(driver.name)
                moves = (joint.type == "prismatic", variable, multiplier, offset)
                bodies.append(Body(body, pose, (x, y, z), *moves))
                body, pose = len(bodies) - 1, np.eye(4)
            else:
                still = float(np.clip(0.0, driver.limit.lower, driver.limit.upper))
                value = multiplier * fixed.get(driver.name, still) + offset
                pose = pose @ displacement(joint, value)
        places[joint.child] = (body, pose)
    return tuple(bodies), places


def _moved(bodies: Sequence[Body], positions: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
    """Rotation (3, 3) and origin (3, 1) of each body."""
    turns, origins = [ca.SX.eye(3)], [ca.SX.zeros(3)]
    for body in bodies[1:]:
        assert body.placement is not None
        turn, origin = turns[body.parent], origins[body.parent]
        origin = origin + turn @ ca.DM(body.placement[:3, 3])
        turn = turn @ ca.DM(body.placement[:3, :3])
        value = body.multiplier * positions[body.variable] + body.offset
        if body.translates:
            origin = origin + turn @ ca.DM(body.axis) * value
        else:
            turn = turn @ rotation(body.axis, value)
        turns.append(turn)
        origins.append(origin)
    return turns, origins


def _read_geometry(root: _Element, path: Path) -> Mapping[str, tuple[tuple[Shape, ...], str]]:
    found = {}
    for link in root.findall("link"):
        name = link.get("name")
        source = "collision" if link.find("collision/geometry") is not None else "visual"
        try:
            shapes = tuple(_shape(one, name, path) for one in link.findall(source))
        except FileError:
            raise
        except InputError as error:
            where = f"{path}: {error.argument}"
            raise FileError(where, error.value, error.allowed) from None
        found[name] = (shapes, source)
    return found


def _shape(element: _Element, link: str, path: Path) -> Shape:
    pose = np.eye(4)
    origin = element.find("origin")
    where = f"<{element.tag}> of link {link}"
    if origin is not None:
        pose[:3, 3] = _numbers(origin, "xyz", 3, where, "0 0 0")
        turn = Rotation.from_euler("xyz", _numbers(origin, "rpy", 3, where, "0 0 0"))
        pose[:3, :3] = turn.as_matrix()
    geometry = element.find("geometry")
    kinds = [] if geometry is None else [one for one in geometry if isinstance(one.tag, str)]
    if len(kinds) != 1 or kinds[0].tag not in (*_SIZES, "mesh"):
        shown = ", ".join(f"<{one.tag}>" for one in kinds) or "without geometry"
        raise InputError(where, shown, "one box, cylinder, sphere or mesh")
    one = kinds[0]
    if one.tag == "mesh":
        scale = _numbers(one, "scale", 3, where, "1 1 1")
        return Shape(
            "mesh", tuple(scale), _mesh_file(one.get("filename", ""), link, path), pose
        )
    name, count = _SIZES[one.tag]
    size = _numbers(one, name, count, where)
    if one.tag == "cylinder":
        size += _numbers(one, "length", 1, where)
    if not min(size) > 0:
        raise InputError(where, " ".join(f"{x:g}" for x in size), "sizes above 0, in metres")
    return Shape(one.tag, tuple(size), None, pose)


def _numbers(
    element: _Element, name: str, count: int, where: str, default: str | None = None
) -> list[float]:
    text = element.get(name, default)
    if text is None:
        raise InputError(where, f"without the attribute '{name}'", f"<{element.tag}> with it")
    check_numbers(f"{name} in {where}", text, count, LARGEST)
    return [float(part) for part in text.split()]


def _mesh_file(name: str, link: str, path: Path) -> Path:
    """Return where a mesh is: beside the URDF, or in the package that a folder above holds."""
    kind, _, rest = name.rpartition("://")
    places = [path.resolve().parent / rest]
    if kind == "package":
        above = path.resolve().parents
        places = [folder / rest for folder in above]
        places += [folder / rest.partition("/")[2] for folder in above]
    for place in places:
        if rest and place.is_file():
            return place
    allowed = "a file beside the URDF file, or in a package in one of the folders above"
    raise FileError(f"mesh of link {link}", name, allowed)


@lru_cache(maxsize=256)
def _solid(shape: Shape) -> Any:
    """Return the geometry as coal has it."""
    coal = _coal()
    if shape.kind == "mesh":
        try:
            return coal.MeshLoader().load(str(shape.file), np.array(shape.size))
        except (ValueError, RuntimeError) as error:
            allowed = f"a mesh that can be read ({error})"
            raise FileError("mesh", str(shape.file), allowed) from None
    makers = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder}
    return makers[shape.kind](*shape.size)


def _points(shape: Shape) -> tuple[FloatArray, float]:
    """Points, shape (k, 3) in the link's frame, and how far around them the shape may reach."""
    around = 0.0
    if shape.kind == "sphere":
        points, around = np.zeros((1, 3)), shape.size[0]
    elif shape.kind == "box":
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1)
        points = corners.T * np.array(shape.size)
    elif shape.kind == "cylinder":
        angle = 2 * np.pi * np.arange(_RIM) / _RIM
        radius, half = shape.size[0] / np.cos(np.pi / _RIM), np.full(_RIM, shape.size[1] / 2)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        points = np.concatenate([np.stack([x, y, z], axis=1) for z in (half, -half)])
    else:
        points = np.asarray(_solid(shape).vertices(), dtype=float).reshape(-1, 3)
        with suppress(QhullError):  # where all are in one plane, all are taken
            points = points[ConvexHull(points).vertices]
    return points @ shape.pose[:3, :3].T + shape.pose[:3, 3], around


def _around(link: Link) -> Capsule:
    """Return a capsule around a link's geometry, in the frame of its body.

    The smallest of those along the axes of the link's frame and along the principal axes of the
    points.
    """
    clouds = [_points(shape) for shape in link.shapes]
    points = np.concatenate([one for one, _ in clouds])
    extra = np.concatenate([np.full(len(one), around) for one, around in clouds])
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    fits = [_along(axis, points, extra) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=_volume)
    turn, origin = link.pose[:3, :3], link.pose[:3, 3]
    start, end = (turn @ one + origin for one in (best.start, best.end))
    return Capsule(start, end, best.radius + _MARGIN)


def _volume(capsule: Capsule) -> float:
    length = float(np.linalg.norm(capsule.end - capsule.start))
    return capsule.radius**2 * (length + 4 / 3 * capsule.radius)


def _along(axis: FloatArray, points: FloatArray, extra: FloatArray) -> Capsule:
    """Return a capsule along an axis around points, each with a sphere about it."""
    across = np.linalg.svd(axis[None])[2][1:]
    plane, height = points @ across.T, points @ axis
    centre = plane.mean(axis=0)
    # Badoiu and Clarkson: towards the farthest point by ever smaller steps.
    for step in range(1, 200):
        far = plane[np.argmax(np.linalg.norm(plane - centre, axis=1) + extra)]
        centre = centre + (far - centre) / (step + 1)
    off = np.linalg.norm(plane - centre, axis=1)
    radius = float(np.max(off + extra))
    reach = np.sqrt(np.maximum((radius - extra) ** 2 - off**2, 0.0))
    low, high = float(np.min(height + reach)), float(np.max(height - reach))
    low, high = (low, high) if low < high else ((low + high) / 2,) * 2
    middle = centre @ across
    return Capsule(middle + low * axis, middle + high * axis, radius)


def _gap_squared(a: ca.SX, b: ca.SX, c: ca.SX, d: ca.SX) -> ca.SX:
    """Squared distance of the segments a–b and c–d.

    C. Ericson, "Real-Time Collision Detection" (2005), section 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = ca.sumsqr(u) + _TINY, ca.sumsqr(v) + _TINY, ca.dot(u, v)
    uw, vw = ca.dot(u, w), ca.dot(v, w)
    s = _within((uv * vw - vv * uw) / (uu * vv - uv**2 + _TINY * uu))
    t = _within((uv * s + vw) / vv)
    s = _within((uv * t - uw) / uu)
    return ca.sumsqr(w + s * u - t * v)


def _within(share: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(share, 0), 1)


def _between_segments(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Distances of segments a–b and c–d, each (k, 3, B): least of five candidates.

    An end of one to the other segment, four times; or both inner points of the common
    perpendicular.
    """

    def to_segment(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
        along = end - start
        square = np.sum(along**2, axis=1)
        share = np.sum((point - start) * along, axis=1) / np.where(square > 0, square, 1.0)
        nearest = start + np.clip(share, 0, 1)[:, None] * along
        return np.asarray(np.sqrt(np.sum((point - nearest) ** 2, axis=1)))

    ends = [to_segment(*three) for three in ((a, c, d), (b, c, d), (c, a, b), (d, a, b))]
    u, v, w = b - a, d - c, c - a
    normal = np.cross(u, v, axis=1)
    square = np.sum(normal**2, axis=1)
    safe = np.where(square > 0, square, 1.0)
    s = np.sum(np.cross(w, v, axis=1) * normal, axis=1) / safe
    t = np.sum(np.cross(w, u, axis=1) * normal, axis=1) / safe
    inside = (square > 0) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    straight = np.abs(np.sum(w * normal, axis=1)) / np.sqrt(safe)
    return np.asarray(np.minimum.reduce([*ends, np.where(inside, straight, np.inf)]))
