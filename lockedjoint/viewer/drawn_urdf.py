"""A URDF file as readers of pictures take it, which know less of URDF than `read_urdf`.

They open any file that a mesh names, take quaternions for no rotation and the units of COLLADA
for metres, and have no capsules.
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
    """Return the text of a URDF file to be drawn, and the meshes that are nowhere allowed.

    Origins have angles, meshes are files that may be opened, in metres, and capsules are a
    cylinder and two spheres. InputError if an origin or a mesh is wrong.
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
    """Return the shapes by which one is drawn; none if its mesh is nowhere allowed."""
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
    """Return an element with its origin by angles."""
    origin = element.find("origin")
    if origin is None:
        origin = SubElement(element, "origin")
    with warnings.catch_warnings():
        # Of a turn of 90° about y only a sum of the two other angles counts; any will do.
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
    origin.attrib.clear()
    origin.set("xyz", " ".join(map(repr, pose[:3, 3].tolist())))
    origin.set("rpy", " ".join(map(repr, angles.tolist())))
    return element
