"""What is read for a robot's clearance: links, obstacles, and the pairs that are looked at."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from formulations.clearance.link_clearance import Link, LinkClearance
from formulations.clearance.obstacles import Obstacles
from formulations.clearance.shapes import (
    Geometry,
    box_around,
    capsule_around,
    coal_library,
    read_shapes,
)
from formulations.kinematics.chain import Bodies, Chain
from formulations.kinematics.chain_between import bodies_of
from formulations.kinematics.forward import Kinematics
from formulations.kinematics.read_urdf import from_file, is_urdf, urdf_tree, xml_root
from formulations.kinematics.tree import RobotTree
from nlp.errors import InputError

# Random configurations at which links are looked at: those in contact at all of them are left
# out.
_SAMPLES = 500


def read_clearance(
    path: str | os.PathLike[str],
    chain: Chain,
    least: float,
    obstacles: Obstacles | None = None,
) -> LinkClearance:
    """Read the links' geometry of a URDF file and fit the capsules.

    Parameters
    ----------
    path
        The file that the chain was read from, and meshes that it names.
    chain
        The joints that move.
    least
        What links keep from each other, and from obstacles, at least, in metres.
    obstacles
        What stands about the robot.

    Raises
    ------
    FileError
        If geometry is malformed, or a mesh cannot be read.
    InputError
        If the file is no URDF, coal is not installed, there are no two links that could touch,
        or a link touches an obstacle at every random configuration.
    """
    coal_library()  # a missing library is better known at once
    path = Path(path)
    if not from_file(path, is_urdf):
        allowed = "a URDF file: of MJCF only joints are read, and tables have no shapes"
        raise InputError("clearance", f"of {path}", allowed)
    tree, geometry = from_file(path, partial(_read, path))
    bodies, places = bodies_of(tree, chain)
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
    moving = [i for i, link in enumerate(links) if link.body != 0]
    body, base = places[chain.base]
    for name, shapes, pose in obstacles.bodies if obstacles else ():
        place = (base if body == 0 else np.eye(4)) @ pose
        capsule, box = capsule_around(shapes, place), box_around(shapes)
        pairs += [(i, len(links)) for i in moving]
        links.append(Link(name, 0, place, shapes, capsule, "obstacle", box))
    if not pairs:
        allowed = "a robot with geometry on two links that are not adjacent"
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return _without_contacts(
        LinkClearance(least, bodies, len(chain.joints), tuple(links), tuple(pairs)), chain
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
        # The first joint moves a link that stands on an obstacle.
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
        raise InputError("clearance", f"of {chain.robot}", allowed)
    return replace(whole, pairs=tuple(pairs), left_out=tuple(out), nearer=nearer)


def _parents(bodies: Bodies) -> dict[int, int]:
    """Return the body before each one's joint, by number; -1, where there is none."""
    return {-1: -1, 0: -1} | {k + 1: parent for k, (parent, _) in enumerate(bodies)}
