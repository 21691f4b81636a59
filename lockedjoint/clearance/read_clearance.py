"""What is read for a robot's clearance: links, obstacles, and the pairs that are looked at.

What comes in: a robot's URDF file, its chain of moving joints, and perhaps obstacles. What goes
out: a `LinkClearance`, whose header says which pairs are left out and why. A *body* is what a
joint moves, by number; body 0 does not move. Lengths are metres.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from lockedjoint.clearance.around_shapes import box_around, capsule_around
from lockedjoint.clearance.link_clearance import Link, LinkClearance, NoPairsError
from lockedjoint.clearance.meshes import MESHES
from lockedjoint.clearance.shapes import Geometry, Shape, mesh, read_shapes
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.chain_between import bodies_of
from lockedjoint.kinematics.description import Description
from lockedjoint.kinematics.motion import Bodies
from lockedjoint.kinematics.read_urdf import from_file, parsed, urdf_tree, xml_root
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import FileError, InputError, as_path

# Number of random configurations at which links are looked at: a pair in contact at all of them
# is left out. With fewer, a pair that is seldom apart may be left out wrongly.
_SAMPLES = 500
# Seed of the random configurations: any number; a fixed one gives the same answer every time.
_SEED = 1995


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Bodies that do not move: names, shapes, and where each is in a robot's base.

    Examples
    --------
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> box = '<collision><geometry><box size="1 1 0.1"/></geometry></collision>'
    >>> cell = f'<robot name="cell"><link name="table">{box}</link></robot>'
    >>> _ = Path("cell.urdf").write_text(cell)
    >>> [(name, shapes, place)] = lj.Obstacles.read("cell.urdf").bodies
    >>> name, len(shapes)
    ('table', 1)
    """

    #: Each has a name, its shapes, and the pose of their frame in the base's frame, 4×4.
    bodies: tuple[tuple[str, tuple[Shape, ...], FloatArray], ...]
    #: Sentences on what to check of the numbers of their pose.
    notes: tuple[str, ...] = ()

    @classmethod
    def read(cls, path: str | os.PathLike[str], at: FloatArray | None = None) -> Obstacles:
        """Read obstacles from a file.

        Parameters
        ----------
        path
            A URDF file whose joints are fixed, with boxes, spheres, cylinders or meshes as the
            geometry of its links; or a mesh (.stl, .obj, .ply, in metres; .dae, in its unit).
        at
            Pose of the file's root link, or of the mesh, in the frame of the robot's base, or
            for an arm from hand to hand of its root; 4×4, by default the same frame.

        Raises
        ------
        FileError
            If the file cannot be read, is neither, has joints that move, or no geometry.
        InputError
            If the pose is none.
        """
        path = as_path("obstacles", path)
        pose = np.eye(4) if at is None else as_floats("pose of the obstacles", at)
        if pose.shape != (4, 4) or not np.all(np.isfinite(pose)):
            raise InputError("pose of the obstacles", at, "a homogeneous 4×4 matrix")
        if path.suffix.lower() in MESHES:
            if not path.is_file():
                raise FileError("obstacles", str(path), "a file that is there")
            return cls(((path.stem, (mesh(path),), pose),))
        tree, geometry = from_file(path, partial(_read_urdf, path))
        for joint in tree.joints:
            if joint.type != "fixed":
                where = f"{path}: joint {joint.name}"
                raise FileError(where, joint.type, "fixed joints, of obstacles")
        places = {tree.root: pose}
        for joint in tree.parents_first:
            places[joint.child] = places[joint.parent] @ joint.origin
        bodies = tuple(
            (name, shapes, places[name]) for name, (shapes, _) in geometry.items() if shapes
        )
        if not bodies:
            raise FileError("obstacles", str(path), "a file with <collision> geometry")
        return cls(bodies)


def read_clearance(
    robot: Description | str | os.PathLike[str],
    chain: Chain,
    least: float,
    obstacles: Obstacles | None = None,
    may_touch: Callable[[str, str], bool] | None = None,
) -> LinkClearance:
    """Read the links' geometry of a URDF file, fit the capsules, and choose the pairs.

    Parameters
    ----------
    robot
        What was read of the robot, or its file; meshes that it names are read, too.
    chain
        The joints that move.
    least
        What links keep from each other, and from obstacles, at least, in metres.
    obstacles
        What stands about the robot.
    may_touch
        Function of the names of two links: whether their distance is not looked at, though no
        joint connects them; by default no pair is left out so.

    Raises
    ------
    FileError
        If geometry is malformed, or a mesh cannot be read.
    InputError
        If the file is no URDF, coal is not installed, or a link touches an obstacle at every
        random configuration.
    NoPairsError
        If there are no two links that could touch.
    """
    library("coal")  # a missing library is better known at once
    described = Description.read(robot)
    root, path = described.root, described.file or Path()
    if root is None or not described.is_urdf:
        named = described.file or "a model"
        allowed = "a URDF file: of MJCF only joints are read, and tables have no shapes"
        raise InputError("clearance", f"of {named}", allowed)
    geometry = parsed(path, described.text, lambda _: read_shapes(root, path))
    bodies, places = bodies_of(described.tree, chain)
    links = [
        Link(name, *places[name], shapes, capsule_around(shapes, places[name][1]), source)
        for name, (shapes, source) in geometry.items()
        if shapes
    ]
    parents = _parents(bodies)
    pairs = [
        (i, j)
        for (i, first), (j, second) in combinations(enumerate(links), 2)
        if first.body != second.body
        and parents[first.body] != second.body
        and parents[second.body] != first.body
    ]
    allowed_pairs = [
        (i, j) for i, j in pairs if may_touch and may_touch(links[i].name, links[j].name)
    ]
    pairs = [pair for pair in pairs if pair not in set(allowed_pairs)]
    moving = [i for i, link in enumerate(links) if link.body != 0]
    body, base = places[chain.base]
    for name, shapes, pose in obstacles.bodies if obstacles else ():
        place = (base if body == 0 else np.eye(4)) @ pose
        capsule, box = capsule_around(shapes, place), box_around(shapes)
        pairs += [(i, len(links)) for i in moving]
        links.append(Link(name, 0, place, shapes, capsule, "obstacle", box))
    if not pairs:
        allowed = "a robot with geometry on two links that are not adjacent"
        raise NoPairsError("clearance", f"of {chain.robot}", allowed)
    whole = LinkClearance(
        least, bodies, tuple(links), tuple(pairs), allowed=tuple(allowed_pairs)
    )
    return _without_contacts(whole, chain)


def _read_urdf(path: Path, content: bytes) -> tuple[RobotTree, Geometry]:
    """Return the tree and the geometry of obstacles; InputError if it is no URDF."""
    meshes = f"or the file of a mesh: {', '.join(MESHES)}"
    try:
        root = xml_root(content)
    except InputError as error:
        raise InputError(error.argument, error.value, f"{error.allowed}; {meshes}") from None
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", f"<robot> (URDF), {meshes}")
    return urdf_tree(root), read_shapes(root, path)


def _without_contacts(whole: LinkClearance, chain: Chain) -> LinkClearance:
    """Leave out pairs that are always in contact; ask less of wrists that are always nearer."""
    low, high = chain.ranges
    # Configurations, shape (n, samples). The largest distance of each pair's capsules: it is a
    # lower bound of the pair's largest distance.
    drawn = np.random.default_rng(_SEED).uniform(low, high, (len(low), _SAMPLES))
    bounds, parents = np.max(whole.distances(drawn), axis=1), _parents(whole.bodies)
    pairs: list[tuple[int, int]] = []
    out: list[tuple[int, int]] = []
    nearer: dict[int, float] = {}
    for pair, bound in zip(whole.pairs, bounds.tolist(), strict=True):
        first, second = (whole.links[i].body for i in pair)
        wrist = first == parents[parents[second]] or second == parents[parents[first]]
        # A link that stands on an obstacle and is moved by the first joint is like a wrist.
        wrist |= whole.links[pair[1]].box is not None and parents[first] == 0
        enough = whole.least if wrist else 0.0
        farthest = bound
        for point in drawn.T:
            if farthest > enough:
                break
            farthest = max(farthest, whole.closest(point, [pair]).distance)
        if farthest <= 0 and whole.links[pair[1]].box is not None:
            where = f"obstacle {whole.links[pair[1]].name}"
            value = f"in contact with {whole.links[pair[0]].name} wherever that may be"
            raise InputError(where, value, "obstacles that every link can be free of")
        if farthest <= 0:
            out.append(pair)
            continue
        if farthest <= enough:
            nearer[len(pairs)] = farthest / 2
        pairs.append(pair)
    if not pairs:
        allowed = "a robot with two links that are not always in contact"
        raise NoPairsError("clearance", f"of {chain.robot}", allowed)
    return replace(whole, pairs=tuple(pairs), left_out=tuple(out), nearer=nearer)


def _parents(bodies: Bodies) -> dict[int, int]:
    """Return the body before each one's joint, by number; -1, where there is none."""
    return {-1: -1, 0: -1} | {k + 1: parent for k, (parent, _) in enumerate(bodies)}
