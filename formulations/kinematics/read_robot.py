"""A robot from whatever describes it: URDF, MJCF, a Denavit–Hartenberg table, or a model.

========================  ================================================================
source                    what it must be
========================  ================================================================
``robot_descriptions:X``  the URDF or MJCF file of the package's module X
path that ends in .csv    a Denavit–Hartenberg table, see `read_dh`
any other path            XML: ``<robot>`` is URDF, ``<mujoco>`` is MJCF, see `read_mujoco`
yourdfpy.URDF             as it was loaded
pinocchio.Model           its bodies and operational frames are links
mujoco.MjModel            see `read_mujoco`
========================  ================================================================
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from formulations.kinematics.read_dh import dh_tree
from formulations.kinematics.read_mujoco import mjcf_tree, mujoco_tree
from formulations.kinematics.read_urdf import urdf_tree, yourdfpy_tree
from formulations.kinematics.read_xml import from_file, xml_root
from formulations.kinematics.tree import Limit, Mimic, RobotTree, TreeJoint
from nlp.arrays import FloatArray
from nlp.errors import InputError, MissingLibraryError

_DESCRIPTIONS = "robot_descriptions"
_SOURCES = (
    "the path of a URDF, of an MJCF file, or of a Denavit–Hartenberg table in .csv; or a "
    "model of yourdfpy, pinocchio or mujoco"
)


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
        path = robot_file(source)
        if path.suffix.lower() == ".csv":
            return from_file(path, lambda text: dh_tree(text, path.stem))
        return from_file(path, lambda text: _xml_tree(text, path.parent))
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
    """Return the path of a robot's file, also for ``robot_descriptions:panda_description``.

    The package downloads what is not in its cache yet; with nothing in it, that is refused.

    Raises
    ------
    InputError
        If the package is not installed, or has no file of that name.
    """
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
    links = ["universe", *list(model.names)[1:]]
    named: set[str] = set()
    for title, joint, pose in frames:
        if links[joint] not in named and np.allclose(pose, np.eye(4), rtol=0, atol=1e-15):
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
        joints.append(TreeJoint(*ends, title, kind, origin, axis, limit, mimic))
    others = [frame for frame in frames if frame[0] not in named]
    joints += [
        TreeJoint(links[joint], title, f"fixed {title}", "fixed", pose)
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
