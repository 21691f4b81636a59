"""Read a robot from an MJCF file, of which mujoco gets no more than bears on kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from formulations.robots.read_mujoco import mujoco_tree
from formulations.robots.tree import RobotTree
from nlp.errors import InputError, MissingLibraryError

if TYPE_CHECKING:
    from lxml.etree import _Element

# More bodies, joints and sites are refused.
_MOST = 10_000
# What bears on kinematics. Only this reaches mujoco, which then opens no other file.
_POSE = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
_JOINT = ("name", "class", "type", "pos", "axis", "range", "limited", "ref")
_SITES = ("site1", "site2")
_KEPT: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mujoco": {"compiler": ("angle", "eulerseq", "autolimits", "coordinate")},
    "default": {"default": ("class",), "joint": _JOINT, "equality": ("active",)},
    "equality": {
        "joint": ("name", "class", "active", "joint1", "joint2", "polycoef"),
        "connect": ("name", "class", "active", "body1", "body2", "anchor", *_SITES),
        "weld": ("name", "class", "active", "body1", "body2", *_SITES),
    },
    "body": {
        "body": ("name", "childclass", "mocap", *_POSE),
        "frame": ("name", "childclass", *_POSE),
        "joint": _JOINT,
        "freejoint": ("name",),
        "site": ("name", *_POSE),
    },
}
_CHILDREN = {"worldbody": "body", "frame": "body"}
# These make bodies out of other files or of nothing; a tendon may couple joints.
_REFUSED = {
    "include": "one file that includes no other (mujoco writes one: mj_saveLastXML)",
    "attach": "one file that attaches no other (mujoco writes one: mj_saveLastXML)",
    "replicate": "bodies written out",
}


def mjcf_tree(root: _Element) -> RobotTree:
    """Read a robot from the root element of an MJCF file, which mujoco compiles.

    Only what bears on kinematics reaches mujoco: bodies, frames, joints, sites, equalities
    and their defaults. Meshes, textures, plugins and other files are not opened.

    Raises
    ------
    InputError
        If it includes, attaches or replicates anything, or mujoco cannot compile it.
    """
    try:
        import mujoco
        from lxml import etree
    except ModuleNotFoundError:
        raise MissingLibraryError("mujoco") from None

    for tag, allowed in _REFUSED.items():
        if root.find(f".//{tag}") is not None:
            raise InputError("content", f"MJCF with <{tag}>", allowed)
    if root.find("equality/tendon") is not None:
        raise InputError("content", "an equality of tendons", "joints that no tendon couples")
    count = sum(1 for _ in root.iter("body", "joint", "site"))
    if count > _MOST:
        raise InputError("content", f"{count} bodies, joints and sites", f"at most {_MOST}")
    reduced = etree.Element("mujoco", model=root.get("model", "robot"))
    # Bodies lose their masses here, which moving ones must have.
    etree.SubElement(reduced, "compiler", boundmass="1", boundinertia="1")
    _copy_kinematics(root, reduced, "mujoco")
    try:
        model = mujoco.MjModel.from_xml_string(etree.tostring(reduced, encoding="unicode"))
    except ValueError as reason:
        why = " ".join(str(reason).split())
        raise InputError("content", f"MJCF that mujoco refuses ({why})", "valid MJCF") from None
    return mujoco_tree(model)


def _copy_kinematics(source: _Element, target: _Element, place: str) -> None:
    from lxml import etree

    kept = _KEPT[place]
    for one in source:
        if place == "mujoco" and one.tag in ("default", "worldbody", "equality"):
            attributes: tuple[str, ...] = ("class",) if one.tag == "default" else ()
        elif one.tag in kept:
            attributes = kept[one.tag]
        else:
            continue
        values = {name: value for name, value in one.items() if name in attributes}
        inner = _CHILDREN.get(one.tag, one.tag)
        copied = etree.SubElement(target, one.tag, values)
        if (
            inner in _KEPT
            and place != "equality"
            and (place, one.tag) != ("default", "equality")
        ):
            _copy_kinematics(one, copied, inner)
