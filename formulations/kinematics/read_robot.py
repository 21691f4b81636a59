"""A robot from whatever describes it: URDF, MJCF, a Denavit–Hartenberg table, or a model.

========================  ================================================================
source                    what it must be
========================  ================================================================
path that ends in .csv    a Denavit–Hartenberg table, see `read_dh`
any other path            XML: ``<robot>`` is URDF, ``<mujoco>`` is MJCF, see `read_mujoco`
yourdfpy.URDF             as it was loaded
pinocchio.Model           see `read_pinocchio`
mujoco.MjModel            see `read_mujoco`
========================  ================================================================
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from formulations.kinematics.read_dh import dh_tree
from formulations.kinematics.read_mujoco import mjcf_tree, mujoco_tree
from formulations.kinematics.read_pinocchio import pinocchio_tree
from formulations.kinematics.read_urdf import urdf_tree, yourdfpy_tree
from formulations.kinematics.read_xml import from_file, xml_root
from formulations.kinematics.tree import RobotTree
from nlp.errors import InputError

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
        path = Path(source)
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
            return pinocchio_tree(model)
    if "mujoco" in origins and hasattr(model, "jnt_type"):
        return mujoco_tree(model)
    raise InputError("robot", f"of type {type(source).__name__}", _SOURCES)


def _xml_tree(content: bytes, folder: Path) -> RobotTree:
    root = xml_root(content)
    if root.tag == "robot":
        return urdf_tree(root)
    if root.tag == "mujoco":
        return mjcf_tree(root, folder)
    raise InputError("root element", f"<{root.tag}>", "<robot> (URDF) or <mujoco> (MJCF)")
