"""What stands about a robot: a cell in a URDF file, or a mesh."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from formulations.clearance.shapes import MESHES, Geometry, Shape, read_shapes
from formulations.kinematics.read_urdf import from_file, urdf_tree, xml_root
from formulations.kinematics.tree import RobotError, RobotTree
from nlp.arrays import FloatArray, as_floats
from nlp.errors import FileError, InputError, as_path


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Bodies that do not move: names, shapes, and where each is, 4×4, in a robot's base."""

    bodies: tuple[tuple[str, tuple[Shape, ...], FloatArray], ...]

    @classmethod
    def read(cls, path: str | os.PathLike[str], at: FloatArray | None = None) -> Obstacles:
        """Read obstacles from a file.

        Parameters
        ----------
        path
            A URDF file whose joints are fixed, with boxes, spheres, cylinders or meshes as the
            geometry of its links; or a mesh, in metres (.stl, .obj, .dae, .ply).
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
            shape = Shape("mesh", (1.0, 1.0, 1.0), path, np.eye(4))
            return cls(((path.stem, (shape,), pose),))
        tree, geometry = from_file(path, partial(_read, path))
        places = {tree.root: pose}
        for joint in tree.parents_first:
            places[joint.child] = places[joint.parent] @ joint.origin
        bodies = tuple(
            (name, shapes, places[name]) for name, (shapes, _) in geometry.items() if shapes
        )
        if not bodies:
            raise FileError("obstacles", str(path), "a file with <collision> geometry")
        return cls(bodies)


def _read(path: Path, content: bytes) -> tuple[RobotTree, Geometry]:
    root = xml_root(content)
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", "<robot> (URDF), or a mesh's file")
    tree = urdf_tree(root)
    for joint in tree.joints:
        if joint.type != "fixed":
            raise RobotError(f"joint {joint.name}", joint.type, "fixed joints, of obstacles")
    return tree, read_shapes(root, path)
