"""Read a robot from an MJCF file, of which mujoco gets no more than bears on kinematics.

Pinocchio's reader is not used: it loses the bodies in a ``<frame>`` and the equalities that
couple joints, and does not say so. Its wheels cannot read SDF.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, tostring

from formulations.kinematics.read_mujoco import mujoco_tree
from formulations.kinematics.read_xml import attribute, from_file, xml_root
from formulations.kinematics.tree import RobotTree
from nlp.errors import InputError, MissingLibraryError

# More bodies, joints and sites, and files that one file includes, are refused.
_MOST, _MOST_FILES = 10_000, 100
# What bears on kinematics. Only this reaches mujoco, which then opens no other file.
_POSE = {"name", "class", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"}
_JOINT = {"name", "class", "type", "pos", "axis", "range", "limited", "ref"}
_EQUALITY = {"name", "class", "active"}
_LOOP = {*_EQUALITY, "body1", "body2", "site1", "site2"}
_KEPT = {
    "compiler": {"angle", "eulerseq", "autolimits", "coordinate"},
    "default": {"class"},
    "worldbody": set(),
    "body": {"childclass", "mocap", *_POSE},
    "frame": {"childclass", *_POSE},
    "joint": {*_JOINT, *_EQUALITY, "joint1", "joint2", "polycoef"},
    "freejoint": {"name"},
    "site": _POSE,
    "equality": {"active"},
    "connect": {*_LOOP, "anchor"},
    "weld": _LOOP,
}
# These make bodies out of other files or of nothing; a tendon may couple joints.
_REFUSED = {
    "attach": "one file that attaches no other (mujoco writes one: mj_saveLastXML)",
    "replicate": "bodies written out",
}


def mjcf_tree(root: Element, folder: Path | None = None) -> RobotTree:
    """Read a robot from the root element of an MJCF file, which mujoco compiles.

    Only what bears on kinematics reaches mujoco: bodies, frames, joints, sites, equalities
    and their defaults. Meshes, textures, plugins and other files are not opened.

    Parameters
    ----------
    root
        The element ``<mujoco>``.
    folder
        Of its file. Files that it includes are there or in folders below; none may be
        included if it is left out.

    Raises
    ------
    InputError
        If it attaches or replicates anything, or mujoco cannot compile it.
    FileError
        If a file that it includes cannot be read.
    """
    try:
        import mujoco
    except ModuleNotFoundError:
        raise MissingLibraryError("mujoco", "mujoco") from None

    _include(root, folder, set())
    for tag, allowed in _REFUSED.items():
        if root.find(f".//{tag}") is not None:
            raise InputError("content", f"MJCF with <{tag}>", allowed)
    if root.find("equality/tendon") is not None:
        raise InputError("content", "an equality of tendons", "joints that no tendon couples")
    count = sum(element.tag in ("body", "joint", "site") for element in root.iter())
    if count > _MOST:
        raise InputError("content", f"{count} bodies, joints and sites", f"at most {_MOST}")
    reduced = Element("mujoco", model=root.get("model", "robot"))
    # Bodies lose their masses here, which moving ones must have.
    reduced.append(Element("compiler", boundmass="1", boundinertia="1"))
    _copy_kinematics(root, reduced)
    try:
        model = mujoco.MjModel.from_xml_string(tostring(reduced, encoding="unicode"))
    except ValueError as reason:
        why = " ".join(str(reason).split())
        raise InputError("content", f"MJCF that mujoco refuses ({why})", "valid MJCF") from None
    return mujoco_tree(model)


def _include(element: Element, folder: Path | None, read: set[Path]) -> None:
    """Put what other files hold in the place of the ``<include>`` that names them."""
    for k in reversed(range(len(element))):
        if element[k].tag != "include":
            _include(element[k], folder, read)
            continue
        name = attribute(element[k], "file", "<include>")
        path = ((folder or Path()) / name).resolve()
        if folder is None or not path.is_relative_to(folder.resolve()):
            raise InputError(
                "file of <include>", name, "one in the folder of the file, or below"
            )
        if path in read or len(read) >= _MOST_FILES:
            allowed = f"every file once, and at most {_MOST_FILES} files"
            raise InputError("file of <include>", name, allowed)
        read.add(path)
        included = from_file(path, xml_root)
        _include(included, folder, read)
        element[k : k + 1] = list(included)


def _copy_kinematics(source: Element, target: Element) -> None:
    for element in source:
        if element.tag in _KEPT:
            names = _KEPT[element.tag]
            values = {key: text for key, text in element.items() if key in names}
            copied = Element(element.tag, values)
            target.append(copied)
            _copy_kinematics(element, copied)
