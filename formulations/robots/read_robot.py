"""A robot from whatever describes it: URDF, MJCF, a Denavit–Hartenberg table, or a model.

========================  ================================================================
source                    what it must be
========================  ================================================================
path that ends in .csv    a Denavit–Hartenberg table, see `dh_tree`
any other path            XML: ``<robot>`` is URDF, ``<mujoco>`` is MJCF, see `mjcf_tree`
yourdfpy.URDF             as it was loaded
pinocchio.Model           see `pinocchio_tree`
mujoco.MjModel            see `mujoco_tree`
========================  ================================================================
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from formulations.robots.read_urdf import (
    from_file,
    urdf_tree,
    xml_root,
    yourdfpy_tree,
)
from formulations.robots.tree import Joint, Limit, Mimic, RobotTree, joint_between
from nlp.arrays import FloatArray
from nlp.errors import InputError, MissingLibraryError
from nlp.files import real_in

if TYPE_CHECKING:
    from lxml.etree import _Element

_SOURCES = (
    "the path of a URDF, of an MJCF file, or of a Denavit–Hartenberg table in .csv; or a "
    "model of yourdfpy, pinocchio or mujoco"
)
# More rows of a table, or bodies of an MJCF file, are refused.
_MOST = 10_000
_IDENTITY = np.eye(4)

# Denavit–Hartenberg tables: kinds of rows, columns, and those of them that are angles.
_KINDS = {"r": "revolute", "p": "prismatic", "f": "fixed"}
_ANGLES, _RANGES = ("theta", "alpha"), ("lower", "upper", "velocity")
_COLUMNS = ("joint", "kind", "d", "a")
_CONVENTIONS = ("standard", "modified")

# MJCF: what bears on kinematics. Only this reaches mujoco, which then opens no other file.
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


def read_robot(source: object) -> RobotTree:
    """Read a robot.

    Parameters
    ----------
    source
        A path or a model; see the table above.

    Returns
    -------
    RobotTree
        Its links and joints, with positions as the source counts them.

    Raises
    ------
    FileError
        If a file cannot be read, is of no such form, or does not describe one tree.
    InputError
        If the source is of another type, or a library that reads it is not installed.
    """
    if isinstance(source, RobotTree):
        return source
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        table = path.suffix.lower() == ".csv"
        return from_file(path, (lambda text: dh_tree(text, path.stem)) if table else _xml_tree)
    origins = {kind.__module__.partition(".")[0] for kind in type(source).__mro__}
    model: Any = source
    if "yourdfpy" in origins and hasattr(model, "robot"):
        return yourdfpy_tree(model.robot)
    if "pinocchio" in origins:
        model = getattr(model, "model", model)  # of a RobotWrapper
        if hasattr(model, "jointPlacements"):
            return pinocchio_tree(model)
    if "mujoco" in origins and hasattr(model, "jnt_type"):
        return mujoco_tree(model)
    raise InputError("robot", f"of type {type(source).__name__}", _SOURCES)


def _xml_tree(content: bytes) -> RobotTree:
    root = xml_root(content)
    if root.tag == "robot":
        return urdf_tree(root)
    if root.tag == "mujoco":
        return mjcf_tree(root)
    raise InputError("root element", f"<{root.tag}>", "<robot> (URDF) or <mujoco> (MJCF)")


# --- Denavit–Hartenberg tables -----------------------------------------------------------


def dh_tree(content: bytes, name: str = "robot") -> RobotTree:
    """Read a robot from a Denavit–Hartenberg table, one row per joint from base to tip.

    The first lines begin with ``#``; one of them is ``# convention: standard`` or
    ``# convention: modified``. Then come the columns' names and the rows.

    ====================  ===========================================================
    column                what
    ====================  ===========================================================
    kind                  revolute, prismatic or fixed (or R, P, F); fixed rows are
                          transforms of the base, of the tool, or between joints
    a, d                  metres
    alpha_rad, theta_rad  radians; or alpha_deg, theta_deg: degrees
    joint                 its name, by default joint_1, joint_2, …
    lower_rad, upper_rad  limits, or lower_deg, upper_deg; of prismatic joints in
                          metres; none where the cell is empty
    velocity_rad          largest speed, likewise
    ====================  ===========================================================

    A row is Rz(θ) Tz(d) Tx(a) Rx(α) in the standard convention, distal frames, and
    Rx(α) Tx(a) Rz(θ) Tz(d) in the modified one of Craig, proximal frames. At joint position q,
    θ + q stands for θ of a revolute joint and d + q for d of a prismatic one. Links are
    called base, link_1, …, tip.

    Raises
    ------
    InputError
        If the text is no such table.
    """
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError("content", "not in UTF-8", "a table in CSV, in UTF-8") from None
    notes = [line.lstrip("# ").partition(":") for line in lines if line.startswith("#")]
    stated = {key.strip().lower(): value.strip() for key, _, value in notes}
    convention = stated.get("convention", "missing").lower()
    if convention not in _CONVENTIONS:
        allowed = "a line '# convention: standard' or '# convention: modified' at the beginning"
        raise InputError("convention", convention, allowed)
    joints: list[Joint] = []
    parent, carried = "base", _IDENTITY
    for before, kind, after, title, limit in _dh_rows(lines, convention == "modified"):
        carried = carried @ before
        if kind != "fixed":
            child = f"link_{len(joints) + 1}"
            title = title or f"joint_{len(joints) + 1}"
            joints.append(joint_between(parent, child, title, kind, carried, limit=limit))
            parent, carried = child, _IDENTITY
        carried = carried @ after
    joints.append(joint_between(parent, "tip", "fixed tip", "fixed", carried))
    links = ("base", *(joint.child for joint in joints))
    return RobotTree(stated.get("name") or name, links, tuple(joints))


def _dh_rows(
    lines: list[str], modified: bool
) -> Iterator[tuple[FloatArray, str, FloatArray, str, Limit]]:
    """Each row: motion before the joint, its kind, motion after it, its name and limits."""
    # One by one, so that no quotation mark joins lines.
    texts = [line for line in lines if line.strip() and not line.startswith("#")]
    try:
        header, *rows = (next(csv.reader([text], strict=True)) for text in texts)
    except (csv.Error, ValueError):
        raise InputError("content", "no table", "a line of columns' names, and rows") from None
    header = [one.strip().lower() for one in header]
    units = {one: _unit(one, header) for one in (*_ANGLES, *_RANGES)}
    known = {*_COLUMNS, *(f"{one}_{unit}" for one, unit in units.items())}
    for column in header:
        if column not in known or header.count(column) > 1:
            allowed = "kind, a, d, alpha_rad, theta_rad (or _deg), joint, " + ", ".join(
                f"{one}_rad" for one in _RANGES
            )
            raise InputError("column", column or "without a name", f"{allowed}, each once")
    missing = [one for one in ("kind", "a", "d") if one not in header]
    if missing or not rows:
        what = f"without {missing[0]}" if missing else "without rows"
        raise InputError("table", what, "columns kind, a, d, alpha and theta, and rows")
    if len(rows) > _MOST:
        raise InputError("table", f"of {len(rows)} rows", f"at most {_MOST} rows")
    for k, row in enumerate(rows, start=1):
        if len(row) != len(header):
            allowed = f"{len(header)} cells, as in the line of columns"
            raise InputError(f"row {k}", f"of {len(row)} cells", allowed)
        cells = dict(zip(header, (one.strip() for one in row), strict=True))
        kind = cells["kind"].lower()
        kind = _KINDS.get(kind, kind)
        if kind not in _KINDS.values():
            raise InputError(f"kind in row {k}", cells["kind"], "revolute, prismatic or fixed")
        theta, alpha = (_cell(cells, k, one, units[one]) for one in _ANGLES)
        d, a = (_cell(cells, k, one) for one in ("d", "a"))
        along_x, along_z = _screw(0, alpha, a), _screw(2, theta, d)
        before, after = (along_x, along_z) if modified else (_IDENTITY, along_z @ along_x)
        lower, upper, speed = (
            _cell(cells, k, one, units[one] if kind == "revolute" else "rad", none)
            for one, none in zip(_RANGES, (-np.inf, np.inf, 0.0), strict=True)
        )
        yield before, kind, after, cells.get("joint", ""), Limit(lower, upper, speed)


def _unit(angle: str, header: list[str]) -> str:
    """Return the unit that the header states for an angle."""
    found = [unit for unit in ("rad", "deg") if f"{angle}_{unit}" in header]
    if len(found) > 1 or (not found and (angle in header or angle in _ANGLES)):
        shown = "there twice" if found else "without a unit" if angle in header else "missing"
        raise InputError(f"column {angle}", shown, f"{angle}_rad or {angle}_deg, one of them")
    return found[0] if found else "rad"


def _cell(
    cells: Mapping[str, str], row: int, column: str, unit: str = "", none: float | None = None
) -> float:
    """Return a number of a row in radians or metres."""
    full = [one for one in (column, f"{column}_rad", f"{column}_deg") if one in cells]
    text = cells[full[0]] if full else ""
    if not text and none is not None:
        return none
    try:
        value = real_in(text)
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isinf(value) and none is None):
        raise InputError(f"{full[0]} in row {row}", text or "empty", "a finite number")
    return math.radians(value) if unit == "deg" else value


def _screw(axis: int, angle: float, travel: float) -> FloatArray:
    """Return a rotation about the x axis (0) or the z axis (2) and a travel along it, 4×4."""
    pose = np.eye(4)
    one, other = ((axis + 1) % 3, (axis + 2) % 3)
    cos, sin = math.cos(angle), math.sin(angle)
    pose[one, one] = pose[other, other] = cos
    pose[other, one], pose[one, other] = sin, -sin
    pose[axis, 3] = travel
    return pose


# --- pinocchio ---------------------------------------------------------------------------


def pinocchio_tree(model: Any) -> RobotTree:
    """Return the robot of a `pinocchio.Model`.

    The links are the bodies: a joint's is named after the first body frame in its place, or
    after the joint. Other frames of bodies and operational frames are links fixed to them.
    A joint of more than one degree of freedom cannot be part of a chain.
    """
    frames = [
        (frame.name, int(frame.parentJoint), np.array(frame.placement.homogeneous))
        for frame in model.frames
        if frame.type.name in ("BODY", "OP_FRAME")
    ]
    links = ["universe", *list(model.names)[1:]]
    named: set[str] = set()
    for title, joint, pose in frames:
        if links[joint] not in named and np.allclose(pose, _IDENTITY, rtol=0, atol=1e-15):
            links[joint] = title
            named.add(title)
    followed = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    joints = []
    for k in range(1, model.njoints):
        joint, title = model.joints[k], model.names[k]
        kind, axis = _pinocchio_motion(joint)
        limit, mimic = Limit(), None
        if k in followed:
            own = joint.extract()
            mimic = Mimic(model.names[followed[k]], float(own.scaling), float(own.offset))
            axis = axis / own.scaling if own.scaling else axis
        elif kind in ("revolute", "prismatic"):
            lower = float(model.lowerPositionLimit[joint.idx_q])
            upper = float(model.upperPositionLimit[joint.idx_q])
            limit = Limit(lower, upper, float(model.velocityLimit[joint.idx_v]))
        ends = links[model.parents[k]], links[k]
        origin = model.jointPlacements[k].homogeneous
        joints.append(joint_between(*ends, title, kind, origin, axis, limit, mimic))
    others = [one for one in frames if one[0] not in named]
    joints += [
        joint_between(links[joint], title, f"fixed {title}", "fixed", pose)
        for title, joint, pose in others
    ]
    names = (*links, *(title for title, _, _ in others))
    return RobotTree(model.name or "robot", names, tuple(joints))


def _pinocchio_motion(joint: Any) -> tuple[str, FloatArray]:
    """Return kind and axis of a joint, from the subspace (v; ω) of its motion."""
    screw = np.array(joint.createData().S, dtype=float).T
    kind = joint.shortname().removeprefix("JointModel")
    # Helical joints, whose name begins with H, turn and move along.
    if screw.shape != (6,) or not kind.startswith(("R", "P", "Mimic")):
        return kind, np.zeros(3)
    if np.any(screw[3:]):
        return "continuous" if joint.nq == 2 else "revolute", screw[3:]
    return "prismatic", screw[:3]


# --- MJCF --------------------------------------------------------------------------------


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
        raise MissingLibraryError("mujoco", "mujoco") from None

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


def mujoco_tree(model: Any) -> RobotTree:
    """Return the robot of a `mujoco.MjModel`.

    Bodies and sites are links. Positions of joints count as in ``qpos``. An equality that
    makes one joint a linear function of another is mimicry; joints that any other active
    equality couples, and ball and free joints, cannot be part of a chain. Tendons, and welds
    to mocap bodies, are not looked at.
    """
    import mujoco

    bodies = _names(model.body, model.nbody, "body")
    titles = _names(model.joint, model.njnt, "joint")
    sites = _names(model.site, model.nsite, "site")
    # A body and a site may have the same name.
    sites = [f"{one} (site)" if one in bodies else one for one in sites]
    followed, coupled = _equalities(model, titles)
    kinds = {
        int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
        int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
    }
    links, joints = list(bodies), []
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
                origin = origin @ _placed(np.zeros(3), _turned(axis, reference))
            elif kind == "prismatic":
                origin = origin @ _placed(reference * axis)
            limit = Limit(*model.jnt_range[k].tolist()) if model.jnt_limited[k] else Limit()
            whole = k == _joints_of(model, body)[-1] and not np.any(model.jnt_pos[k])
            child = bodies[body] if whole else f"after {titles[k]}"
            links += [] if whole else [child]
            more = (origin, axis, limit, followed.get(k))
            joints.append(joint_between(parent, child, titles[k], kind, *more))
            parent, carried = child, _placed(-model.jnt_pos[k])
        if parent != bodies[body]:
            title = f"fixed {bodies[body]}"
            joints.append(joint_between(parent, bodies[body], title, "fixed", carried))
    for k, title in enumerate(sites):
        place = _placed(model.site_pos[k], model.site_quat[k])
        on = bodies[model.site_bodyid[k]]
        joints.append(joint_between(on, title, f"fixed {title}", "fixed", place))
    name = model.names.split(b"\0", 1)[0].decode("utf-8", "replace")
    return RobotTree(name or "robot", (*links, *sites), tuple(joints))


def _equalities(model: Any, titles: list[str]) -> tuple[dict[int, Mimic], set[int]]:
    """Return which joints follow others, and which are coupled in any other way."""
    from mujoco import mjtEq, mjtObj

    followed: dict[int, Mimic] = {}
    coupled: set[int] = set()
    for k in np.flatnonzero(model.eq_active0):
        kind, one, other = (
            int(v[k]) for v in (model.eq_type, model.eq_obj1id, model.eq_obj2id)
        )
        if kind == mjtEq.mjEQ_JOINT:
            # q - q0 = a0 + a1 (p - p0) + a2 (p - p0)^2 + …
            shift, factor, *curved = model.eq_data[k, :5].tolist()
            if other < 0 or any(curved) or one in followed:
                coupled.add(one)
                continue
            zero, driver = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (one, other))
            followed[one] = Mimic(titles[other], factor, zero + shift - factor * driver)
        elif kind in (mjtEq.mjEQ_CONNECT, mjtEq.mjEQ_WELD):
            if model.eq_objtype[k] == mjtObj.mjOBJ_SITE:
                one, other = int(model.site_bodyid[one]), int(model.site_bodyid[other])
            if model.body_mocapid[one] < 0 and model.body_mocapid[other] < 0:
                # A loop: every joint on it, from where the two branches part.
                loop = _joints_below_root(model, one) ^ _joints_below_root(model, other)
                coupled |= loop
    return followed, coupled


def _joints_below_root(model: Any, body: int) -> set[int]:
    found: set[int] = set()
    while body > 0:
        found.update(_joints_of(model, body))
        body = int(model.body_parentid[body])
    return found


def _joints_of(model: Any, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def _names(named: Any, count: int, kind: str) -> list[str]:
    """Return the names of a model's bodies, joints or sites; those without have a number."""
    return [named(k).name or f"{kind}_{k}" for k in range(count)]


def _placed(position: FloatArray, quaternion: FloatArray | None = None) -> FloatArray:
    """Return a pose, 4×4, from a position and a quaternion (w, x, y, z)."""
    pose = np.eye(4)
    pose[:3, 3] = position
    if quaternion is not None:
        w, x, y, z = (np.asarray(quaternion) / np.linalg.norm(quaternion)).tolist()
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    return pose


def _turned(axis: FloatArray, angle: float) -> FloatArray:
    """Return the quaternion (w, x, y, z) of a rotation about a unit vector."""
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
