"""A configuration of an arm, from whatever states it: numbers, names, a file, a ROS message.

Every joint of the arm must be stated. What the state of a whole robot has beside them, such as
grippers, is left aside, with a note.

The way of a configuration is: anything that is accepted (`read_state`) → a mapping from joints
to numbers or a row of numbers, in radians and metres (`stated_positions`, from texts by
`_of_text`, from files by `_of_file`) → an array, shape (n,), within the limits. To accept a new
form, add it to `stated_positions` or `_of_text`, and to `ALLOWED`.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations.io.files import load_json, read_bytes, real_in
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import TWO_TURNS, Chain, listed, nearest
from lockedjoint.kinematics.in_degrees import ANGLES, InDegrees, in_radians
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import FileError, InputError

#: The sentence says what `read_state` accepts.
ALLOWED = (
    "one number per joint from base to tip, JOINT=VALUE pairs (both with commas), the name of a"
    " state, or a file in JSON or YAML, such as a ROS JointState"
)
# A text that ends so, in capitals too, is the path of a file.
_FILES = (".json", ".yaml", ".yml")
# The pattern matches "=", a number, and the comma that ends it. Names may contain commas and
# "=", numbers may not.
_SETTING = re.compile(
    r"=\s*[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|nan|inf(?:inity)?)\s*(,|$)", re.IGNORECASE
)
# A locked joint may be stated this far from where it has locked: files are rounded. One that is
# stated further away is refused.
_SAME_PLACE_M_OR_RAD = 1e-6


def read_state(
    q: Any,
    chain: Chain,
    states: Mapping[str, Mapping[str, float]] | None = None,
    slides: Collection[str] = (),
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the positions of a chain's free joints, within their limits, and notes.

    Parameters
    ----------
    q
        Radians or metres: one number per free joint from base to tip, shape (n,); or by name, a
        mapping or a ROS JointState; or text: numbers or JOINT=VALUE pairs with commas, the name
        of a state, or the path of a file in JSON or YAML; with angles in degrees as
        `InDegrees`. None for midway between the limits. A file may state its unit: an object
        with the positions under ``q``, and ``"angles": "deg"`` beside it.
    chain
        The joints.
    states
        States that have a name.
    slides
        Prismatic joints, those of the chain excepted.

    Returns
    -------
    numpy.ndarray
        Shape (n,).
    tuple of str
        What was left aside, and what can hardly be meant, in sentences.

    Raises
    ------
    InputError
        If joints are missing, which are named, or a position is outside its limits.
    """
    if q is None:
        return chain.mid_range, ()
    said = isinstance(q, InDegrees)
    q = stated_positions(q, chain, states or {}, slides)
    if isinstance(q, Mapping):
        point, notes = _of_mapping(q, chain, said)
        return point, notes if said else (*notes, *_hardly_meant(point, chain))
    values = as_floats("q", q)
    if values.shape != (len(chain.names),):
        names = listed(chain.names)
        given = f"{values.size} numbers" if values.ndim == 1 else f"of shape {values.shape}"
        raise InputError("q", given, f"{len(chain.names)} of them ({names}); or {ALLOWED}")
    point = chain.within_limits(values, said)
    return point, () if said else _hardly_meant(point, chain)


def stated_positions(
    q: Any,
    chain: Chain,
    states: Mapping[str, Mapping[str, float]],
    slides: Collection[str] = (),
) -> Any:
    """Return what states a configuration as a mapping from joints, or as a row of numbers.

    Numbers are in radians and metres; a row goes from base to tip, and is not checked here. The
    argument q is what `read_state` accepts, other than None; `states` has positions by the
    state's name and the joint's; `slides` has prismatic joints that are not of the chain.
    """
    degrees = isinstance(q, InDegrees)
    q = q.stated if isinstance(q, InDegrees) else q
    if isinstance(q, str | os.PathLike):
        text = os.fspath(q)
        # Files and states have their own unit.
        degrees = degrees and text not in states and not _is_file(text)
        q = _of_text(text, states)
    if hasattr(q, "name") and hasattr(q, "position"):  # a message of rclpy or rosbags
        q = _joint_state(list(q.name), list(q.position), "q")
    if isinstance(q, InDegrees):
        degrees, q = True, q.stated
    if not degrees:
        return q
    own = [joint.name for joint in chain.joints if joint.prismatic]
    return in_radians(q, {*own, *slides}, chain.names)


def _hardly_meant(point: FloatArray, chain: Chain) -> tuple[str, ...]:
    """Return a sentence on angles of positions (n,) that may be degrees, or none."""
    far = [
        f"{joint.name} at {value:g}"
        for joint, value in zip(chain.joints, point.tolist(), strict=True)
        if not joint.prismatic and abs(value) > TWO_TURNS
    ]
    if not far:
        return ()
    return (
        "Positions beyond two turns (±4π rad) may be degrees, which --angles deg and"
        f" lj.InDegrees state: {listed(far)}.",
    )


def _is_file(text: str) -> bool:
    """Whether a text is the path of a file, by its ending."""
    return Path(text).suffix.lower() in _FILES


def _of_mapping(
    named: Mapping[str, float], chain: Chain, in_degrees: bool
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return positions by joint as an array, (n,), and a note on joints that it leaves aside.

    They are in radians and metres; `in_degrees` says how angles were stated, for errors.
    InputError if a joint is missing, or one that stands is stated elsewhere.
    """
    values = {str(name): number(f"q of {name}", value) for name, value in named.items()}
    missing = [name for name in chain.names if name not in values]
    # These joints have no column: they cannot move, or have locked.
    still = {**dict(chain.immobile), **dict(chain.locked_at)}
    others = [name for name in values if name not in chain.names and name not in still]
    if missing:
        unknown = f"; not of the arm: {listed(others)}" if others else ""
        near = nearest(others[0], missing) if others else ""
        allowed = f"every joint of the arm, {listed(chain.names)}{unknown}{near}"
        raise InputError("q", f"without {listed(missing)}", allowed)
    for name, at in still.items():
        if name in values and abs(values[name] - at) > _SAME_PLACE_M_OR_RAD:
            why = "which cannot move" if name in dict(chain.immobile) else "where it has locked"
            units = "(rad or m)"
            raise InputError(f"q of {name}", f"{values[name]:.7g} {units}", f"{at:.7g}, {why}")
    notes = [f"Joints that are not of the arm are left aside: {listed(others)}."]
    positions = np.array([values[name] for name in chain.names])
    point = chain.within_limits(positions, in_degrees)
    return point, tuple(notes if others else ())


def _of_text(text: str, states: Mapping[str, Mapping[str, float]]) -> Any:
    """Return what a text states: a state, a file, JOINT=VALUE pairs, or numbers with commas."""
    if text in states:
        return states[text]
    if _is_file(text):
        return _of_file(Path(text))
    if "=" in text:
        return pairs(settings_of(text), "q")
    parts = text.split(",")
    if len(parts) == 1 and not _is_number(text):
        known = f" (states: {listed(list(states))}{nearest(text, list(states))})"
        raise InputError("q", text, f"{ALLOWED}{known if states else ''}")
    return [number("q", part) for part in parts]


def _of_file(path: Path) -> Any:
    """Return positions of a file: a list, by name, as commands write them, or a JointState.

    They are in radians and metres, or `InDegrees` if the file says so under ``angles``.
    """
    content = read_bytes(path)
    if path.suffix.lower() == ".json":
        found = load_json(content, path)
    else:
        found = _first_document(content, path)
    unit = "rad"
    is_state = isinstance(found, dict) and isinstance(found.get("name"), list)
    if is_state or (isinstance(found, dict) and isinstance(found.get("q"), dict | list)):
        unit = found.get("angles", unit)
    if not (isinstance(unit, str) and unit in ANGLES):
        raise InputError(f"angles in {path}", unit, "rad or deg")
    values: Any = None
    if is_state:
        positions = found.get("position")
        values = _joint_state(found["name"], positions, f"the JointState in {path}")
    elif isinstance(found, dict) and isinstance(found.get("q"), dict | list):
        found = found["q"]  # as `measure` and `posture` write it
    if values is not None:
        return InDegrees(values) if unit == "deg" else values
    if isinstance(found, dict):
        for name in (name for name, value in found.items() if isinstance(value, list | dict)):
            allowed = "a number; a list under q, or under name and position as in a JointState"
            raise InputError(f"{name} in {path}", found[name], allowed)
        values = {name: number(f"{name} in {path}", value) for name, value in found.items()}
    elif isinstance(found, list):
        values = [number(f"an entry of {path}", value) for value in found]
    if values is not None:
        return InDegrees(values) if unit == "deg" else values
    raise FileError("file", str(path), "positions: a list, or an object by joint")


def _first_document(content: bytes, path: Path) -> Any:
    """Return the first document of YAML, as `ros2 topic echo` prints it."""
    yaml = library("yaml", package="pyyaml")
    try:
        return next(iter(yaml.safe_load_all(content.decode("utf-8-sig"))), None)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        why = str(error).partition("\n")[0]
        raise FileError("file", str(path), f"valid YAML ({why})") from None


def _joint_state(names: Sequence[Any], positions: Any, what: str) -> dict[str, float]:
    """Return the positions of a ROS JointState by name; InputError if they do not fit."""
    if not isinstance(positions, list) or len(positions) != len(names):
        count = len(positions) if isinstance(positions, list) else "no"
        allowed = "one position for each name"
        raise InputError(what, f"with {len(names)} names and {count} positions", allowed)
    if len({str(name) for name in names}) < len(names):
        raise InputError(what, "with a name twice", "every joint once")
    return {
        str(name): number(f"{name} of {what}", value)
        for name, value in zip(names, positions, strict=True)
    }


def settings_of(text: str) -> list[str]:
    """Return what is between the commas of ``JOINT=VALUE`` pairs, but for commas of names."""
    ends = [one.start(1) for one in _SETTING.finditer(text)]
    if not ends or ends[-1] != len(text):
        return text.split(",")
    begins = [0, *(end + 1 for end in ends)]
    return [text[begin:end] for begin, end in zip(begins, ends, strict=False)]


def pairs(settings: Sequence[str], name: str) -> dict[str, float]:
    """Read ``JOINT=VALUE`` settings; InputError if one is something else or repeated."""
    return by_joint(settings, name, "JOINT=VALUE, radians or metres", number)


def by_joint(
    settings: Sequence[str], name: str, allowed: str, read: Callable[[str, str], Any]
) -> dict[str, Any]:
    """Read settings of joints, such as ``JOINT=VALUE``, with what reads the right side."""
    values: dict[str, Any] = {}
    for setting in settings:
        # Names may have "=" in them, values have not.
        joint, equals, text = (part.strip() for part in setting.rpartition("="))
        if not (joint and equals):
            raise InputError(name, setting, allowed)
        if joint in values:
            raise InputError(name, f"{joint} twice", "every joint once")
        values[joint] = read(f"{name} of {joint}", text)
    return values


def number(name: str, value: object) -> float:
    """Return a finite number; InputError if it is none."""
    try:
        read = real_in(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        read = math.nan
    if isinstance(value, bool) or not math.isfinite(read):
        raise InputError(name, value, "a finite number, radians or metres")
    return read


def interval(name: str, text: str) -> tuple[float, float]:
    """Read ``LOWER:UPPER``; InputError if it is something else."""
    lower, colon, upper = text.partition(":")
    if not colon:
        raise InputError(name, text, "LOWER:UPPER, radians or metres")
    return number(name, lower), number(name, upper)


def _is_number(text: str) -> bool:
    """Whether a text is a number, NaN and infinity included."""
    try:
        real_in(text)
    except ValueError:
        return False
    return True
