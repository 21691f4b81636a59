"""A URDF file rewritten for the library that draws it, which reads less of URDF than we do.

That library (yourdfpy) opens any file that a mesh names, does not read quaternions, takes the
units of COLLADA for metres, and has no capsules. What comes in: the root element of the robot's
file. What goes out: the text of a URDF file that it draws rightly and that names safe files.
Poses are 4×4, in metres, in the frame of the link.
"""

from __future__ import annotations

import copy
import warnings
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

from scipy.spatial.transform import Rotation

from lockedjoint.clearance.meshes import mesh_file
from lockedjoint.clearance.shapes import mesh
from lockedjoint.kinematics.read_urdf import numbers, pose_of
from lockedjoint.nlp.arrays import FloatArray


def drawn_urdf(root: Element, path: Path) -> tuple[bytes, set[str]]:
    """Return the text of a URDF file to be drawn, and names of meshes that may not be opened.

    Origins become angles, meshes become files that may be opened, in metres, and each capsule
    becomes a cylinder and two spheres. `path` is the robot's file, which names are relative to.
    InputError if an origin or a mesh is wrong.
    """
    robot, missing = copy.deepcopy(root), set[str]()
    robot.attrib.pop("version", None)
    for link in robot.iter("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                link.remove(shape)
                for one in _pieces(shape, path, missing):
                    link.append(one)
    for joint in robot.iter("joint"):
        if joint.find("origin") is not None:
            _place(joint, pose_of(joint, f"joint {joint.get('name')}"))
    return tostring(robot), missing


def _pieces(shape: Element, path: Path, missing: set[str]) -> list[Element]:
    """Return the elements that draw a shape; none if its mesh may not be opened.

    The name of such a mesh is added to `missing`.
    """
    where = f"<{shape.tag}>"
    pose = pose_of(shape, where)
    drawn, capsule = shape.find("geometry/mesh"), shape.find("geometry/capsule")
    if drawn is not None:
        scale, name = numbers(drawn, "scale", "1 1 1", where), drawn.get("filename", "")
        file = mesh_file(name, path)
        if file is None:
            missing.add(name)
            return []
        found = mesh(file, scale, pose)
        drawn.set("filename", str(file))
        drawn.set("scale", " ".join(map(repr, found.size)))
        return [_place(shape, found.pose)]
    if capsule is None:
        return [_place(shape, pose)]
    pieces = []
    (half,) = (length / 2 for length in numbers(capsule, "length", "0", where))
    for tag, along in (("cylinder", 0.0), ("sphere", half), ("sphere", -half)):
        piece, place = copy.deepcopy(shape), pose.copy()
        place[:3, 3] += along * pose[:3, 2]
        (geometry,) = piece.findall("geometry")
        geometry.clear()
        sizes = {key: capsule.get(key, "") for key in ("radius", "length")}
        if tag == "sphere":
            sizes.pop("length")
        SubElement(geometry, tag, sizes)
        pieces.append(_place(piece, place))
    return pieces


def _place(element: Element, pose: FloatArray) -> Element:
    """Set the origin of an element to a pose, as position and angles; return the element."""
    origin = element.find("origin")
    if origin is None:
        origin = SubElement(element, "origin")
    with warnings.catch_warnings():
        # At a turn of 90° about y only a sum of the two other angles counts: any two will do.
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
    origin.attrib.clear()
    origin.set("xyz", " ".join(map(repr, pose[:3, 3].tolist())))
    origin.set("rpy", " ".join(map(repr, angles.tolist())))
    return element
