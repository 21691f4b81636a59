"""A robot from whatever describes it: URDF, MJCF, a Denavit–Hartenberg table, or a model.

What comes in: a source of the table below. What goes out: a `RobotTree`. This file only finds
out which form the source has; each form has a reader in a file of its own.

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

import os
import re
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lockedjoint.kinematics.chain import nearest
from lockedjoint.kinematics.read_dh_table import dh_tree
from lockedjoint.kinematics.read_mujoco import mjcf_tree, mujoco_tree
from lockedjoint.kinematics.read_pinocchio import pinocchio_tree
from lockedjoint.kinematics.read_urdf import (
    content_of,
    parsed,
    urdf_tree,
    xml_root,
    yourdfpy_tree,
)
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.errors import FileError, InputError, MissingLibraryError

# The arm with this name comes with the library; a file with this name is read instead.
_EXAMPLE = "example"
# A text like this could be such a name, written wrong; files of robots have an ending.
_WORD = re.compile(r"[\w-]{1,100}")
# The description of this arm.
_EXAMPLE_FILE = Path(__file__).with_name("example.urdf")
# This package has descriptions of robots.
_DESCRIPTIONS = "robot_descriptions"
# An error says so which files are allowed.
_FILES = (
    "the path of a URDF, of an MJCF file, or of a Denavit–Hartenberg table in .csv; "
    f"{_DESCRIPTIONS}:NAME"
)
# An error says so which sources are allowed.
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
    return bool(_libraries(source) & {"yourdfpy", "pinocchio", "mujoco"})


def _libraries(source: object) -> set[str]:
    """Return the names of the packages that define the classes of an object."""
    return {kind.__module__.partition(".")[0] for kind in type(source).__mro__}


def read_model(source: object) -> RobotTree:
    """Return the robot of a model that is loaded already, or of a tree; InputError if none."""
    if isinstance(source, RobotTree):
        return source
    libraries = _libraries(source)
    model: Any = source
    if "yourdfpy" in libraries and hasattr(model, "robot"):
        return yourdfpy_tree(model.robot)
    if "pinocchio" in libraries:
        model = getattr(model, "model", model)  # A RobotWrapper has the model.
        if hasattr(model, "jointPlacements"):
            return pinocchio_tree(model)
    if "mujoco" in libraries and hasattr(model, "jnt_type"):
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
        if _WORD.fullmatch(package) and not colon and not Path(package).exists():
            near = nearest(package, [_EXAMPLE])
            raise FileError("robot", package, f"{_FILES}, or {_EXAMPLE}{near}")
        return Path(source)
    if find_spec(package) is None:
        raise MissingLibraryError(package)
    if not name.isidentifier() or find_spec(f"{package}.{name}") is None:
        allowed = f"a module of {package}, such as panda_description"
        raise InputError("robot description", name, allowed)
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions"))
    folder = cache.expanduser()
    reason = f"its cache {cache} is empty"
    # An import with an empty cache would begin a download.
    if folder.is_dir() and any(folder.iterdir()):
        try:
            module = import_module(f"{package}.{name}")
            for kind in ("URDF_PATH", "MJCF_PATH"):
                if hasattr(module, kind):
                    return Path(getattr(module, kind))
            reason = "it has neither URDF nor MJCF"
        except Exception as error:  # Git, the network or the module may fail in any way.
            reason = str(error).strip().rpartition("\n")[2]
    fill = f"`{sys.executable} -m {package} pull {name}`"
    allowed = f"one that is in the package's cache, which {fill} fills ({reason})"
    raise InputError("robot description", name, allowed)


def _xml_tree(content: bytes, folder: Path) -> RobotTree:
    """Return the robot in XML; the folder has the files that MJCF includes."""
    root = xml_root(content)
    if root.tag == "robot":
        return urdf_tree(root)
    if root.tag == "mujoco":
        return mjcf_tree(root, folder)
    raise InputError("root element", f"<{root.tag}>", "<robot> (URDF) or <mujoco> (MJCF)")
