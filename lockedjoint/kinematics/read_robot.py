"""A robot from whatever describes it: URDF, MJCF, a Denavit–Hartenberg table, or a model.

========================  ================================================================
source                    what it must be
========================  ================================================================
``example``               the arm of seven joints that this package brings, `example.urdf`
``robot_descriptions:X``  the URDF or MJCF file of the package's module X
path that ends in .csv    a Denavit–Hartenberg table, see `dh_tree`
any other path            XML: ``<robot>`` is URDF, ``<mujoco>`` is MJCF, see `read_mujoco`
yourdfpy.URDF             as it was loaded
pinocchio.Model           its bodies and operational frames are links
mujoco.MjModel            see `read_mujoco`
========================  ================================================================
"""

from __future__ import annotations

import csv
import math
import os
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations.io.files import real_in
from lockedjoint.kinematics.chain import listed
from lockedjoint.kinematics.geometry import screw
from lockedjoint.kinematics.read_mujoco import mjcf_tree, mujoco_tree
from lockedjoint.kinematics.read_urdf import (
    content_of,
    parsed,
    urdf_tree,
    xml_root,
    yourdfpy_tree,
)
from lockedjoint.kinematics.tree import Limit, Mimic, RobotTree, TreeJoint, unused
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, MissingLibraryError

# The arm with this name comes with the library; a file with this name is read instead.
_EXAMPLE = "example"
# The description of this arm.
_EXAMPLE_FILE = Path(__file__).with_name("example.urdf")
# This package has descriptions of robots.
_DESCRIPTIONS = "robot_descriptions"
# An error says so which sources are allowed.
_SOURCES = (
    "the path of a URDF, of an MJCF file, or of a Denavit–Hartenberg table in .csv; or a "
    "model of yourdfpy, pinocchio or mujoco"
)
# A table with more rows is refused.
_MOST_ROWS = 10_000
# The identity is the pose of a link that does not differ from the one before it.
_IDENTITY = np.eye(4)
# The x axis is that about which alpha turns.
_X_AXIS = np.eye(3)[0]
# The z axis is that about which theta turns.
_Z_AXIS = np.eye(3)[2]
# Kinds of rows are written in full, or by their first letters.
_KINDS = {"r": "revolute", "p": "prismatic", "f": "fixed"}
# These columns have angles.
_ANGLES = ("theta", "alpha")
# These columns have limits.
_RANGES = ("lower", "upper", "velocity")
# These columns have lengths.
_LENGTHS = ("a", "d")
# The name of a column of lengths may end so: the number says how many metres its unit has.
_METRES = {"": 1.0, "_m": 1.0, "_cm": 0.01, "_mm": 0.001}
# A length beyond this may be in millimetres.
_FAR_M = 20.0
# An angle beyond this may be in degrees.
_TURN_RAD = 2 * math.pi
# A table states one of these conventions.
_CONVENTIONS = ("standard", "modified")


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
    if isinstance(source, str | os.PathLike):
        path = robot_file(source)
        return tree_of_text(path, content_of(path))
    return read_model(source)


def tree_of_text(path: Path, content: bytes) -> RobotTree:
    """Return the robot in the content of a file; FileError, which names it, if none is."""
    if path.suffix.lower() == ".csv":
        return parsed(path, content, lambda text: dh_tree(text, path.stem))
    return parsed(path, content, lambda text: _xml_tree(text, path.parent))


def is_model(source: object) -> bool:
    """Whether something is a model that a library has loaded, or was read from one."""
    if isinstance(source, RobotTree):
        return True
    origins = {kind.__module__.partition(".")[0] for kind in type(source).__mro__}
    return bool(origins & {"yourdfpy", "pinocchio", "mujoco"})


def read_model(source: object) -> RobotTree:
    """Return the robot of a model that is loaded already, or of a tree; InputError if none."""
    if isinstance(source, RobotTree):
        return source
    origins = {kind.__module__.partition(".")[0] for kind in type(source).__mro__}
    model: Any = source
    if "yourdfpy" in origins and hasattr(model, "robot"):
        return yourdfpy_tree(model.robot)
    if "pinocchio" in origins:
        model = getattr(model, "model", model)  # of a RobotWrapper
        if hasattr(model, "jointPlacements"):
            return _pinocchio_tree(model)
    if "mujoco" in origins and hasattr(model, "jnt_type"):
        return mujoco_tree(model)
    raise InputError("robot", f"of type {type(source).__name__}", _SOURCES)


def robot_file(source: str | os.PathLike[str]) -> Path:
    """Return the path of a robot's file, also for the names in the table above.

    The package robot_descriptions downloads what is not in its cache yet. If its cache is
    empty, that is refused.
    InputError if the package is not installed, or has no file of that name.
    """
    if os.fspath(source) == _EXAMPLE and not Path(_EXAMPLE).exists():
        return _EXAMPLE_FILE
    package, colon, name = os.fspath(source).partition(":")
    if package != _DESCRIPTIONS or not colon:
        return Path(source)
    if find_spec(package) is None:
        raise MissingLibraryError(package)
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions"))
    fetched = cache.expanduser().is_dir() and any(cache.expanduser().iterdir())
    why = f"its cache {cache} is empty"
    if not name.isidentifier() or find_spec(f"{package}.{name}") is None:
        allowed = f"a module of {package}, such as panda_description"
        raise InputError("robot description", name, allowed)
    if fetched:
        try:
            module = import_module(f"{package}.{name}")
            for kind in ("URDF_PATH", "MJCF_PATH"):
                if hasattr(module, kind):
                    return Path(getattr(module, kind))
            why = "it has neither URDF nor MJCF"
        except Exception as error:  # of git, of the network, of the module
            why = str(error).strip().rpartition("\n")[2]
    fill = f"`{sys.executable} -m {package} pull {name}`"
    allowed = f"one that is in the package's cache, which {fill} fills ({why})"
    raise InputError("robot description", name, allowed)


def _xml_tree(content: bytes, folder: Path) -> RobotTree:
    root = xml_root(content)
    if root.tag == "robot":
        return urdf_tree(root)
    if root.tag == "mujoco":
        return mjcf_tree(root, folder)
    raise InputError("root element", f"<{root.tag}>", "<robot> (URDF) or <mujoco> (MJCF)")


def _pinocchio_tree(model: Any) -> RobotTree:
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
    titles = [title for title, _, _ in frames]
    links = [unused(name, titles) for name in ("universe", *list(model.names)[1:])]
    own: dict[int, int] = {}
    for k, (_, joint, pose) in enumerate(frames):
        if joint not in own and np.allclose(pose, np.eye(4), rtol=0, atol=1e-15):
            own[joint] = k
    for joint, k in own.items():
        links[joint] = titles[k]
    followed = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    joints = []
    for k in range(1, model.njoints):
        joint, title = model.joints[k], model.names[k]
        kind, axis = _pinocchio_motion(joint)
        limit, mimic = Limit(), None
        if k in followed:
            ratio = joint.extract()
            mimic = Mimic(model.names[followed[k]], float(ratio.scaling), float(ratio.offset))
            axis = axis / ratio.scaling if ratio.scaling else axis
        elif kind in ("revolute", "prismatic"):
            lower = float(model.lowerPositionLimit[joint.idx_q])
            upper = float(model.upperPositionLimit[joint.idx_q])
            limit = Limit(lower, upper, float(model.velocityLimit[joint.idx_v]))
        ends = links[model.parents[k]], links[k]
        origin = model.jointPlacements[k].homogeneous
        joints.append(TreeJoint(*ends, title, kind, origin, axis, limit, mimic))
    names, fixed = list(links), set(model.names)
    for k, (given, joint, pose) in enumerate(frames):
        if k not in own.values():
            # A body and an operational frame may have the same name.
            title = unused(given, names)
            names.append(title)
            fixed.add(between := unused(f"fixed {title}", fixed))
            joints.append(TreeJoint(links[joint], title, between, "fixed", pose))
    return RobotTree(model.name or "robot", tuple(names), tuple(joints))


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


def dh_tree(content: bytes, name: str = "robot") -> RobotTree:
    """Read a robot from a Denavit–Hartenberg table, one row per joint from base to tip.

    The first lines begin with ``#``; one of them is ``# convention: standard`` or
    ``# convention: modified``. Then come the columns' names and the rows.

    ====================  ===========================================================
    column                what
    ====================  ===========================================================
    kind                  revolute, prismatic or fixed (or R, P, F); fixed rows are
                          transforms of the base, of the tool, or between joints
    a, d                  metres, also as a_m, d_m; or a_cm, d_cm; or a_mm, d_mm
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
    joints: list[TreeJoint] = []
    parent, carried = "base", _IDENTITY
    rows = list(_dh_rows(lines, convention == "modified"))
    remarks = tuple(_hardly_meant(*_table(lines)))
    given = {title for _, kind, _, title, _ in rows if kind != "fixed"}
    for before, kind, after, title, limit in rows:
        carried = carried @ before
        if kind != "fixed":
            child = f"link_{len(joints) + 1}"
            title = title or unused(f"joint_{len(joints) + 1}", given)
            joints.append(TreeJoint(parent, child, title, kind, carried, limit=limit))
            parent, carried = child, _IDENTITY
        carried = carried @ after
    joints.append(TreeJoint(parent, "tip", unused("fixed tip", given), "fixed", carried))
    links = ("base", *(joint.child for joint in joints))
    return RobotTree(stated.get("name") or name, links, tuple(joints), remarks)


def _dh_rows(
    lines: list[str], modified: bool
) -> Iterator[tuple[FloatArray, str, FloatArray, str, Limit]]:
    """Each row: motion before the joint, its kind, motion after it, its name and limits."""
    header, rows = _table(lines)
    titles = {name: _title(name, header) for name in (*_ANGLES, *_RANGES)}
    titles |= {name: _length_title(name, header) for name in _LENGTHS}
    for column in header:
        if column not in ("joint", "kind", *titles.values()) or header.count(column) > 1:
            allowed = "kind, a, d (or _mm), alpha_rad, theta_rad (or _deg), joint, "
            allowed += ", ".join(f"{limit}_rad" for limit in _RANGES)
            raise InputError("column", column or "without a name", f"{allowed}, each once")
    missing = [name for name in ("kind", *_LENGTHS) if titles.get(name, name) not in header]
    if missing or not rows:
        what = f"without {missing[0]}" if missing else "without rows"
        raise InputError("table", what, "columns kind, a, d, alpha and theta, and rows")
    if len(rows) > _MOST_ROWS:
        raise InputError("table", f"of {len(rows)} rows", f"at most {_MOST_ROWS} rows")
    for k, row in enumerate(rows, start=1):
        if len(row) != len(header):
            allowed = f"{len(header)} cells, as in the line of columns"
            raise InputError(f"row {k}", f"of {len(row)} cells", allowed)
        cells = dict(zip(header, (cell.strip() for cell in row), strict=True))
        kind = cells["kind"].lower()
        kind = _KINDS.get(kind, kind)
        if kind not in _KINDS.values():
            raise InputError(f"kind in row {k}", cells["kind"], "revolute, prismatic or fixed")
        theta, alpha = (_cell(cells, k, titles[name]) for name in _ANGLES)
        a, d = (_cell(cells, k, titles[name]) for name in _LENGTHS)
        along_x, along_z = screw(_X_AXIS, alpha, a), screw(_Z_AXIS, theta, d)
        before, after = (along_x, along_z) if modified else (_IDENTITY, along_z @ along_x)
        turns, defaults = kind == "revolute", (-np.inf, np.inf, 0.0)
        limits = (
            _cell(cells, k, titles[name], turns, none)
            for name, none in zip(_RANGES, defaults, strict=True)
        )
        yield before, kind, after, cells.get("joint", ""), Limit(*limits)


def _table(lines: list[str]) -> tuple[list[str], list[list[str]]]:
    """Return the names of columns, and the rows, of lines of a table."""
    # Lines are read one by one, so that no quotation mark joins them.
    texts = [line for line in lines if line.strip() and not line.startswith("#")]
    try:
        header, *rows = (next(csv.reader([text], strict=True)) for text in texts)
    except (csv.Error, ValueError):
        raise InputError("content", "no table", "a line of columns' names, and rows") from None
    return [cell.strip().lower() for cell in header], rows


def _hardly_meant(header: list[str], rows: list[list[str]]) -> Iterator[str]:
    """Yield sentences on numbers of a right table that may be millimetres or degrees."""
    kinds = (
        (_LENGTHS, ("", "_m"), _FAR_M, "20 m", "millimetres", "a_mm and d_mm"),
        (
            _ANGLES,
            ("_rad",),
            _TURN_RAD,
            "a turn (±2π rad)",
            "degrees",
            "alpha_deg and theta_deg",
        ),
    )
    for names, endings, most, shown, other, columns in kinds:
        titles = {name + ending for name in names for ending in endings}
        large = [
            f"{title} of row {k}"
            for k, row in enumerate(rows, start=1)
            for title, cell in zip(header, row, strict=True)
            if title in titles and abs(real_in(cell)) > most
        ]
        if large:
            what = f"Entries beyond {shown} may be {other}, which columns {columns} state"
            yield f"{what}: {listed(large)}."


def _length_title(length: str, header: list[str]) -> str:
    """Return the title of a length's column, which may state its unit."""
    titles = [title for title in (length + ending for ending in _METRES) if title in header]
    if len(titles) > 1:
        raise InputError(f"column {length}", "there twice", "one of " + ", ".join(titles))
    return titles[0] if titles else length


def _title(angle: str, header: list[str]) -> str:
    """Return the title of an angle's column, which states its unit."""
    titles = [title for title in (f"{angle}_rad", f"{angle}_deg") if title in header]
    if len(titles) > 1 or (not titles and (angle in header or angle in _ANGLES)):
        shown = "there twice" if titles else "without a unit" if angle in header else "missing"
        raise InputError(f"column {angle}", shown, f"{angle}_rad or {angle}_deg, one of them")
    return titles[0] if titles else angle


def _cell(
    cells: Mapping[str, str],
    row: int,
    title: str,
    turns: bool = True,
    none: float | None = None,
) -> float:
    """Return a number of a row, in radians where it turns, or in metres."""
    text = cells.get(title, "")
    if not text and none is not None:
        return none
    try:
        value = real_in(text)
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isinf(value) and none is None):
        raise InputError(f"{title} in row {row}", text or "empty", "a finite number")
    if title.startswith(tuple(f"{length}_" for length in _LENGTHS)):
        return value * _METRES[title[1:]]
    return math.radians(value) if turns and title.endswith("_deg") else value
