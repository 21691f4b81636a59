"""Read a robot from a model of mujoco, or from an MJCF file.

What comes in: a `mujoco.MjModel`, or the root element of an MJCF file, which mujoco compiles to
one. What goes out: a `RobotTree`, in radians and metres. Bodies, joints, sites and tendons are
numbers in a model, their places in its arrays; names are for the tree.

Mujoco gets no more of a file than bears on kinematics. Pinocchio's reader is not used: it loses
the bodies in a ``<frame>`` and the equalities that couple joints, and does not say so. Its
wheels cannot read SDF.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element, tostring

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.geometry import homogeneous, screw
from lockedjoint.kinematics.read_urdf import attribute, from_file, xml_root
from lockedjoint.kinematics.tree import Limit, Mimic, RobotTree, TreeJoint, unused
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# A file with more bodies, joints and sites is refused: compiling would take too long.
_MOST_PARTS = 10_000
# A file that includes more files than these is refused.
_MOST_FILES = 100
# The attributes below bear on kinematics: they are those of bodies, frames, joints, sites,
# equalities and their defaults. Only these reach mujoco, which then opens no meshes, textures,
# plugins or other files.
#
# A body, frame or site keeps these attributes.
_POSE = {"name", "class", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"}
# A joint keeps these attributes.
_JOINT = {"name", "class", "type", "pos", "axis", "range", "limited", "ref"}
# An equality of any kind keeps these attributes.
_EQUALITY = {"name", "class", "active"}
# An equality that closes a loop keeps these attributes.
_LOOP = {*_EQUALITY, "body1", "body2", "site1", "site2"}
# Elements with these tags keep these attributes; most others are left out.
_KEPT = {
    "compiler": {"angle", "eulerseq", "autolimits", "coordinate"},
    "default": {"class"},
    "worldbody": set(),
    "body": {"childclass", "mocap", *_POSE},
    "frame": {"childclass", *_POSE},
    "joint": {*_JOINT, *_EQUALITY, "joint1", "joint2", "polycoef", "joint", "coef"},
    "freejoint": {"name"},
    "site": {"site", *_POSE},
    "equality": {"active"},
    "connect": {*_LOOP, "anchor"},
    "weld": _LOOP,
    # The tag "tendon" is an equality; the tags after it are parts of tendons that it names.
    "tendon": {*_EQUALITY, "tendon1", "tendon2", "polycoef"},
    "fixed": {"name"},
    "spatial": {"name"},
    "pulley": {"divisor"},
}
# A tendon that an equality names winds around this: any shape that mujoco accepts would do.
_WOUND = {"type": "sphere", "size": "0.01"}
# Names of elements; None of those that have none.
_Names: TypeAlias = set[str | None]
# These elements make bodies out of other files or of nothing.
_REFUSED = {
    "attach": "one file that attaches no other (mujoco writes one: mj_saveLastXML)",
    "replicate": "bodies written out",
}


def mujoco_tree(model: Any) -> RobotTree:
    """Return the robot of a `mujoco.MjModel`.

    Bodies and sites are links. Positions of joints count as in ``qpos``. An equality that
    makes one joint a linear function of another is mimicry; joints that any other active
    equality couples, also by a tendon, and ball and free joints, cannot be part of a chain.
    Welds to mocap bodies are not looked at.
    """
    import mujoco

    bodies = _names(model.body, model.nbody, "body")
    titles = _names(model.joint, model.njnt, "joint")
    sites = _names(model.site, model.nsite, "site")
    # A body and a site may have the same name.
    for k, site in enumerate(sites):
        if site in bodies:
            sites[k] = unused(f"{site} (site)", {*bodies, *sites})
    followed, coupled = _equalities(model, titles)
    kinds = {
        int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
        int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    }
    # The set has all names of joints so far, those of fixed ones too.
    links, joints, fixed = list(bodies), list[TreeJoint](), set(titles)
    for body in range(1, model.nbody):
        parent = bodies[model.body_parentid[body]]
        carried = _placed(model.body_pos[body], model.body_quat[body])
        for k in _joints_of(model, body):
            kind = kinds.get(int(model.jnt_type[k]), "ball or free")
            kind = "coupled by an equality" if k in coupled else kind
            anchor, axis = _placed(model.jnt_pos[k]), model.jnt_axis[k]
            reference = -float(model.qpos0[model.jnt_qposadr[k]])
            # Joints of one body move it one after the other, each about its own anchor.
            origin = carried @ anchor
            if kind == "revolute":
                origin = origin @ screw(axis, reference, 0.0)
            elif kind == "prismatic":
                origin = origin @ screw(axis, 0.0, reference)
            limit = Limit(*model.jnt_range[k].tolist()) if model.jnt_limited[k] else Limit()
            whole = k == _joints_of(model, body)[-1] and not np.any(model.jnt_pos[k])
            child = bodies[body] if whole else unused(f"after {titles[k]}", {*links, *sites})
            links += [] if whole else [child]
            more = (origin, axis, limit, followed.get(k))
            joints.append(TreeJoint(parent, child, titles[k], kind, *more))
            parent, carried = child, _placed(-model.jnt_pos[k])
        if parent != bodies[body]:
            title = unused(f"fixed {bodies[body]}", fixed)
            fixed.add(title)
            joints.append(TreeJoint(parent, bodies[body], title, "fixed", carried))
    for k, title in enumerate(sites):
        place = _placed(model.site_pos[k], model.site_quat[k])
        on, joint = bodies[model.site_bodyid[k]], unused(f"fixed {title}", fixed)
        fixed.add(joint)
        joints.append(TreeJoint(on, title, joint, "fixed", place))
    name = model.names.split(b"\0", 1)[0].decode("utf-8", "replace")
    return RobotTree(name or "robot", (*links, *sites), tuple(joints))


def _equalities(model: Any, titles: list[str]) -> tuple[dict[int, Mimic], set[int]]:
    """Return what joints follow, by number, and the numbers of joints coupled in another way.

    The titles are the joints' names. Only equalities that are active from the start count.
    """
    from mujoco import mjtEq, mjtObj

    followed: dict[int, Mimic] = {}
    coupled: set[int] = set()
    for k in np.flatnonzero(model.eq_active0):
        given = model.eq_type, model.eq_obj1id, model.eq_obj2id
        kind, first, second = (int(values[k]) for values in given)
        if kind == mjtEq.mjEQ_JOINT:
            # q - q0 = a0 + a1 (p - p0) + a2 (p - p0)^2 + …, q of the first joint, p of the
            # second, at q0 and p0 in the model's first configuration. Without a2 and more
            # q = a1 p + (q0 + a0 - a1 p0).
            shift, factor, *curved = model.eq_data[k, :5].tolist()
            if second < 0 or any(curved) or first in followed:
                coupled.add(first)
                continue
            q0, p0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second))
            followed[first] = Mimic(titles[second], factor, q0 + shift - factor * p0)
        elif kind in (mjtEq.mjEQ_CONNECT, mjtEq.mjEQ_WELD):
            if model.eq_objtype[k] == mjtObj.mjOBJ_SITE:
                first, second = int(model.site_bodyid[first]), int(model.site_bodyid[second])
            if model.body_mocapid[first] < 0 and model.body_mocapid[second] < 0:
                # A loop couples every joint on it, from where the two branches part.
                loop = _joints_below_root(model, first) ^ _joints_below_root(model, second)
                coupled |= loop
        elif kind == mjtEq.mjEQ_TENDON:
            for tendon in (first, second):
                if tendon >= 0:
                    coupled |= _joints_of_tendon(model, tendon)
    return followed, coupled


def _joints_of_tendon(model: Any, tendon: int) -> set[int]:
    """Return the numbers of the joints on which the length of a tendon depends, or may."""
    from mujoco import mjtWrap

    begin = int(model.tendon_adr[tendon])
    wraps = range(begin, begin + int(model.tendon_num[tendon]))
    kinds, things = model.wrap_type[wraps], model.wrap_objid[wraps]
    if np.any(kinds == mjtWrap.mjWRAP_JOINT):
        return set(things.tolist())
    bodies = set(model.site_bodyid[things[kinds == mjtWrap.mjWRAP_SITE]].tolist())
    wound = np.isin(kinds, (mjtWrap.mjWRAP_SPHERE, mjtWrap.mjWRAP_CYLINDER))
    bodies |= set(model.geom_bodyid[things[wound]].tolist())
    above = [_joints_below_root(model, int(body)) for body in bodies]
    # A joint that moves all points of the tendon does not change its length.
    return set[int]().union(*above) - above[0].intersection(*above)


def _joints_below_root(model: Any, body: int) -> set[int]:
    """Return the numbers of all joints that move a body."""
    joints: set[int] = set()
    while body > 0:
        joints.update(_joints_of(model, body))
        body = int(model.body_parentid[body])
    return joints


def _joints_of(model: Any, body: int) -> range:
    """Return the numbers of a body's own joints, between it and its parent."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def _names(named: Any, count: int, kind: str) -> list[str]:
    """Return the names of a model's bodies, joints or sites; those without have a number."""
    given = [named(k).name for k in range(count)]
    return [name or unused(f"{kind}_{k}", given) for k, name in enumerate(given)]


def _placed(position: FloatArray, quaternion: npt.ArrayLike = (1, 0, 0, 0)) -> FloatArray:
    """Return a pose, 4×4, from a position, (3,), and a quaternion (w, x, y, z), normalised."""
    w, x, y, z = np.divide(quaternion, np.linalg.norm(quaternion)).tolist()
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return homogeneous(np.array(turn), position)


def mjcf_tree(root: Element, folder: Path | None = None) -> RobotTree:
    """Read a robot from the root element of an MJCF file, which mujoco compiles.

    Files that it includes are in its folder or in folders below; none may be included if that
    is left out. InputError if it attaches or replicates anything, or mujoco cannot compile it;
    FileError if a file that it includes cannot be read.
    """
    mujoco = library("mujoco")
    _include(root, folder, folder, set())
    for tag, allowed in _REFUSED.items():
        if root.find(f".//{tag}") is not None:
            raise InputError("content", f"MJCF with <{tag}>", allowed)
    count = sum(element.tag in ("body", "joint", "site") for element in root.iter())
    if count > _MOST_PARTS:
        raise InputError(
            "content", f"{count} bodies, joints and sites", f"at most {_MOST_PARTS}"
        )
    reduced = Element("mujoco", model=root.get("model", "robot"))
    # Bodies lose their masses here, which moving ones must have.
    reduced.append(Element("compiler", boundmass="1", boundinertia="1"))
    _copy_kinematics(root, reduced, _coupling(root))
    try:
        model = mujoco.MjModel.from_xml_string(tostring(reduced, encoding="unicode"))
    except ValueError as reason:
        why = " ".join(str(reason).split())
        raise InputError("content", f"MJCF that mujoco refuses ({why})", "valid MJCF") from None
    return mujoco_tree(model)


def _include(
    element: Element, folder: Path | None, including: Path | None, read: set[Path]
) -> None:
    """Put what other files hold in the place of the ``<include>`` that names them.

    As mujoco does, a file is looked for in the folder of the whole, then in that of the
    including file. The element is changed in place, and so is `read`, the files read so far.
    """
    for k in reversed(range(len(element))):
        if element[k].tag != "include":
            _include(element[k], folder, including, read)
            continue
        name = attribute(element[k], "file", "<include>")
        try:
            places = [((one or Path()) / name).resolve() for one in (folder, including)]
        except (OSError, ValueError, RuntimeError):  # a NUL, or links in a circle
            raise InputError("file of <include>", name, "the name of a file") from None
        path = next((place for place in places if _is_file(place)), places[-1])
        if folder is None or not path.is_relative_to(folder.resolve()):
            allowed = "one in the folder of the file, or below"
            raise InputError("file of <include>", name, allowed)
        if path in read or len(read) >= _MOST_FILES:
            allowed = f"every file once, and at most {_MOST_FILES} files"
            raise InputError("file of <include>", name, allowed)
        read.add(path)
        included = from_file(path, xml_root)
        _include(included, folder, path.parent, read)
        element[k : k + 1] = list(included)


def _is_file(path: Path) -> bool:
    """Whether there is such a file; names that are too long are none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _coupling(root: Element) -> tuple[_Names, _Names]:
    """Return the names of tendons that equalities are about, and of what these wind around."""
    named = {
        one.get(side)
        for one in root.iterfind("equality/tendon")
        for side in ("tendon1", "tendon2")
    }
    spatial = (one for one in root.iterfind("tendon/spatial") if one.get("name") in named)
    return named, {geom.get("geom") for one in spatial for geom in one.iterfind("geom")}


def _copy_kinematics(source: Element, target: Element, coupling: tuple[_Names, _Names]) -> None:
    """Copy what bears on kinematics into a target, which is changed in place.

    The coupling is that of `_coupling`: tendons that equalities are about are copied, too.
    """
    tendons, wound = coupling
    for element in source:
        name = element.get("name")
        if source.tag == "tendon" and name not in tendons:
            continue
        if element.tag in _KEPT:
            values = {k: text for k, text in element.items() if k in _KEPT[element.tag]}
        elif element.tag == "geom" and source.tag == "spatial":
            values = {"geom": element.get("geom", "")}
        elif element.tag == "geom" and name is not None and name in wound:
            values = {"name": name, **_WOUND}
        else:
            continue
        copied = Element(element.tag, values)
        target.append(copied)
        _copy_kinematics(element, copied, coupling)
