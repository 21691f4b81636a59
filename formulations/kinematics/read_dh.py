"""Read a robot from a Denavit–Hartenberg table."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping

import numpy as np

from formulations.io.files import real_in
from formulations.kinematics.tree import Limit, RobotTree, TreeJoint
from nlp.arrays import FloatArray
from nlp.errors import InputError

# More rows are refused.
_MOST = 10_000
_IDENTITY = np.eye(4)
# Kinds of rows, columns, and those of them that are angles.
_KINDS = {"r": "revolute", "p": "prismatic", "f": "fixed"}
_ANGLES, _RANGES = ("theta", "alpha"), ("lower", "upper", "velocity")
_COLUMNS = ("joint", "kind", "d", "a")
_CONVENTIONS = ("standard", "modified")


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
    joints: list[TreeJoint] = []
    parent, carried = "base", _IDENTITY
    for before, kind, after, title, limit in _dh_rows(lines, convention == "modified"):
        carried = carried @ before
        if kind != "fixed":
            child = f"link_{len(joints) + 1}"
            title = title or f"joint_{len(joints) + 1}"
            joints.append(TreeJoint(parent, child, title, kind, carried, limit=limit))
            parent, carried = child, _IDENTITY
        carried = carried @ after
    joints.append(TreeJoint(parent, "tip", "fixed tip", "fixed", carried))
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
    header = [cell.strip().lower() for cell in header]
    units = {column: _unit(column, header) for column in (*_ANGLES, *_RANGES)}
    known = {*_COLUMNS, *(f"{column}_{unit}" for column, unit in units.items())}
    for column in header:
        if column not in known or header.count(column) > 1:
            allowed = "kind, a, d, alpha_rad, theta_rad (or _deg), joint, " + ", ".join(
                f"{limit}_rad" for limit in _RANGES
            )
            raise InputError("column", column or "without a name", f"{allowed}, each once")
    missing = [column for column in ("kind", "a", "d") if column not in header]
    if missing or not rows:
        what = f"without {missing[0]}" if missing else "without rows"
        raise InputError("table", what, "columns kind, a, d, alpha and theta, and rows")
    if len(rows) > _MOST:
        raise InputError("table", f"of {len(rows)} rows", f"at most {_MOST} rows")
    for k, row in enumerate(rows, start=1):
        if len(row) != len(header):
            allowed = f"{len(header)} cells, as in the line of columns"
            raise InputError(f"row {k}", f"of {len(row)} cells", allowed)
        cells = dict(zip(header, (cell.strip() for cell in row), strict=True))
        kind = cells["kind"].lower()
        kind = _KINDS.get(kind, kind)
        if kind not in _KINDS.values():
            raise InputError(f"kind in row {k}", cells["kind"], "revolute, prismatic or fixed")
        theta, alpha = (_cell(cells, k, column, units[column]) for column in _ANGLES)
        d, a = (_cell(cells, k, column) for column in ("d", "a"))
        along_x, along_z = _screw(0, alpha, a), _screw(2, theta, d)
        before, after = (along_x, along_z) if modified else (_IDENTITY, along_z @ along_x)
        lower, upper, speed = (
            _cell(cells, k, column, units[column] if kind == "revolute" else "rad", none)
            for column, none in zip(_RANGES, (-np.inf, np.inf, 0.0), strict=True)
        )
        yield before, kind, after, cells.get("joint", ""), Limit(lower, upper, speed)


def _unit(angle: str, header: list[str]) -> str:
    """Return the unit that the header states for an angle."""
    units = [unit for unit in ("rad", "deg") if f"{angle}_{unit}" in header]
    if len(units) > 1 or (not units and (angle in header or angle in _ANGLES)):
        shown = "there twice" if units else "without a unit" if angle in header else "missing"
        raise InputError(f"column {angle}", shown, f"{angle}_rad or {angle}_deg, one of them")
    return units[0] if units else "rad"


def _cell(
    cells: Mapping[str, str], row: int, column: str, unit: str = "", none: float | None = None
) -> float:
    """Return a number of a row in radians or metres."""
    full = [title for title in (column, f"{column}_rad", f"{column}_deg") if title in cells]
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
    first, second = ((axis + 1) % 3, (axis + 2) % 3)
    cos, sin = math.cos(angle), math.sin(angle)
    pose[first, first] = pose[second, second] = cos
    pose[second, first], pose[first, second] = sin, -sin
    pose[axis, 3] = travel
    return pose
