"""Read a robot from a Denavit–Hartenberg table in CSV.

What comes in: the bytes of a file, see `dh_tree` for its columns. What goes out: a `RobotTree`
with links base, link_1, …, tip. The cells are read in `table_cells`; this file knows what a
row means.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.geometry import screw
from lockedjoint.kinematics.table_cells import Row, read_rows, remarks_on_units
from lockedjoint.kinematics.tree import RobotTree, TreeJoint, unused
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

# A table states one of these conventions.
_CONVENTIONS = ("standard", "modified")
# The pose of a frame that is that of the frame before it.
_IDENTITY = np.eye(4)
# Alpha turns about the x axis.
_X_AXIS = np.eye(3)[0]
# Theta turns about the z axis.
_Z_AXIS = np.eye(3)[2]


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
    stated = _comments(lines)
    convention = stated.get("convention", "missing").lower()
    if convention not in _CONVENTIONS:
        allowed = "a line '# convention: standard' or '# convention: modified' at the beginning"
        raise InputError("convention", convention, allowed)
    joints = _joints(read_rows(lines), convention)
    links = ("base", *(joint.child for joint in joints))
    remarks = tuple(remarks_on_units(lines))
    return RobotTree(stated.get("name") or name, links, tuple(joints), remarks)


def _comments(lines: list[str]) -> dict[str, str]:
    """Return what comments such as ``# convention: standard`` state."""
    parts = [line.lstrip("# ").partition(":") for line in lines if line.startswith("#")]
    return {key.strip().lower(): value.strip() for key, _, value in parts}


def _joints(rows: list[Row], convention: str) -> list[TreeJoint]:
    """Return a joint for each row that moves, and a fixed one that leads to the tip."""
    joint_names = {row.joint for row in rows if row.kind != "fixed"}
    joints: list[TreeJoint] = []
    parent = "base"
    # The pose, in the parent's frame, of the frame that the rows so far lead to.
    pose = _IDENTITY
    for row in rows:
        before, after = _around_joint(row, convention)
        pose = pose @ before
        if row.kind != "fixed":
            number = len(joints) + 1
            child = f"link_{number}"
            name = row.joint or unused(f"joint_{number}", joint_names)
            joints.append(TreeJoint(parent, child, name, row.kind, pose, limit=row.limit))
            parent, pose = child, _IDENTITY
        pose = pose @ after
    last = unused("fixed tip", joint_names)
    joints.append(TreeJoint(parent, "tip", last, "fixed", pose))
    return joints


def _around_joint(row: Row, convention: str) -> tuple[FloatArray, FloatArray]:
    """Return a row's motion before its joint, and after it, 4×4 each."""
    along_x = screw(_X_AXIS, row.alpha, row.a)
    along_z = screw(_Z_AXIS, row.theta, row.d)
    if convention == "modified":
        return along_x, along_z
    return _IDENTITY, along_z @ along_x
