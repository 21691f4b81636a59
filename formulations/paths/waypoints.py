"""The path of a tool: waypoints in order of time, and samples between them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from formulations.kinematics.chain import LARGEST
from formulations.paths.survival import Poses
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError, shown
from nlp.files import load_json, read_bytes

POSITION = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
QUATERNION = ("qx", "qy", "qz", "qw")
TIME = "t"
_ALLOWED = (
    "columns x,y,z and, for poses, roll,pitch,yaw (radians) or qx,qy,qz,qw; t (seconds) may "
    "come besides; without a header three, six or seven numbers"
)
_POSE = (
    "x,y,z, metres; or with roll,pitch,yaw (radians) or qx,qy,qz,qw (length 1) besides; or a "
    "JSON file with such a list or object"
)
_MOST = 1000
# How many metres a radian counts for, where times are shared out by length.
_METRES_PER_RADIAN = 0.3


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Waypoints, with straight lines between positions and slerp between orientations.

    Attributes
    ----------
    positions
        Metres, in the axes of the base, shape (W, 3).
    quaternions
        Orientations, scalar last, shape (W, 4); None if the orientation is free.
    times
        Seconds, increasing, shape (W,); None to share a duration out by length.
    """

    positions: FloatArray
    quaternions: FloatArray | None = None
    times: FloatArray | None = None

    def __post_init__(self) -> None:
        if len(self.positions) < 2:
            raise InputError("waypoints", f"{len(self.positions)}", "at least two")
        if len(self.positions) > _MOST:
            raise InputError("waypoints", f"{len(self.positions)}", f"at most {_MOST}")
        for k, point in enumerate(self.positions):
            if not np.all(np.abs(point) <= LARGEST):
                raise InputError(
                    f"waypoint {k + 1}", _shown(point), "finite numbers, in metres"
                )
        if self.quaternions is not None:
            for k, turn in enumerate(self.quaternions):
                if not abs(np.linalg.norm(turn) - 1) < 1e-2:
                    allowed = "a quaternion of length 1, scalar last"
                    raise InputError(f"waypoint {k + 1}", _shown(turn), allowed)
        for k, gap in enumerate(() if self.times is None else np.diff(self.times)):
            if not (gap > 0 and np.isfinite(gap)):
                allowed = "times that increase from waypoint to waypoint"
                raise InputError(
                    f"time of waypoint {k + 2}", _later(self.times, k + 1), allowed
                )
        still = np.flatnonzero(self._lengths() < 1e-9)
        if self.times is None and still.size:
            name = f"waypoint {still[0] + 2}"
            raise InputError(name, "the same as the one before", "another pose, or times")

    @property
    def has_orientation(self) -> bool:
        """Whether orientations are given."""
        return self.quaternions is not None

    def sampled(self, samples: int, duration: float) -> tuple[FloatArray, Poses, FloatArray]:
        """Return samples of the path, every waypoint among them.

        Parameters
        ----------
        samples
            About how many; at least one for each waypoint.
        duration
            Seconds for the whole path, if no times are given.

        Returns
        -------
        numpy.ndarray
            Times in seconds, shape (N,).
        Poses
            Positions and rotations; without orientations the latter are the identity.
        numpy.ndarray
            Where each is, counted in waypoints from 1: 2.5 is midway from waypoint 2 to 3.
        """
        times = self.times
        if times is None:
            ends = np.concatenate([[0.0], np.cumsum(self._lengths())])
            times = duration * ends / ends[-1]
        spans = np.diff(times) / (times[-1] - times[0])
        counts = np.maximum(1, np.round(spans * (samples - 1)).astype(int))
        places = [np.zeros(1)]
        places += [k + np.arange(1, count + 1) / count for k, count in enumerate(counts)]
        place = np.concatenate(places)
        index = np.arange(len(times))
        positions = np.stack([np.interp(place, index, one) for one in self.positions.T], axis=1)
        rotations = np.repeat(np.eye(3)[None], len(place), axis=0)
        if self.quaternions is not None:
            rotations = Slerp(index, Rotation.from_quat(self.quaternions))(place).as_matrix()
        return np.interp(place, index, times), Poses(positions, rotations), place + 1

    def _lengths(self) -> FloatArray:
        lengths = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        if self.quaternions is not None:
            turns = Rotation.from_quat(self.quaternions)
            lengths = lengths + _METRES_PER_RADIAN * (turns[1:] * turns[:-1].inv()).magnitude()
        return np.asarray(lengths)


def place_name(place: float) -> str:
    """Return where a sample is, in words: ``waypoint 2``, ``between waypoints 2 and 3``."""
    if abs(place - round(place)) < 1e-9:
        return f"waypoint {round(place)}"
    return f"the path between waypoints {int(place)} and {int(place) + 1}"


def read_waypoints(path: Path) -> ToolPath:
    """Read waypoints from a CSV or JSON file.

    Parameters
    ----------
    path
        A ``.json`` file has a list of waypoints, or an object with it under ``waypoints``:
        each a list of numbers, or an object with the columns' names. Any other file is CSV.

    Raises
    ------
    InputError
        If it cannot be read, or a waypoint is not what is allowed; the sentence names it.
    """
    content = read_bytes(path, "waypoints")
    if path.suffix.lower() == ".json":
        found = load_json(content, path)
        listed = found.get("waypoints") if isinstance(found, dict) else found
        if not isinstance(listed, list) or not listed:
            raise FileError("waypoints", str(path), "a list of waypoints in JSON")
        if isinstance(listed[0], dict):
            return _from_lines(list(listed[0]), [_values(listed[0], one) for one in listed])
        rows = [one if isinstance(one, list) else [one] for one in listed]
        return _from_lines(None, rows)
    try:
        text = content.decode("utf-8-sig")
        lines = [line for line in csv.reader(io.StringIO(text)) if any(map(str.strip, line))]
    except (UnicodeDecodeError, csv.Error):
        raise FileError("waypoints", str(path), "a CSV file in UTF-8") from None
    if not lines:
        raise FileError("waypoints", str(path), "a file with waypoints, which is not empty")
    head = [cell.strip().lower() for cell in lines[0]]
    named = any(cell in (*POSITION, *ANGLES, *QUATERNION, TIME) for cell in head)
    return _from_lines(head, lines[1:]) if named else _from_lines(None, lines)


def read_pose(text: str) -> tuple[FloatArray, FloatArray | None]:
    """Read one pose.

    Parameters
    ----------
    text
        Three, six or seven numbers with commas, as a line of waypoints without header has
        them; or the path of a ``.json`` file with such a list, or with an object of the
        columns' names.

    Returns
    -------
    numpy.ndarray
        Position in metres, shape (3,).
    numpy.ndarray or None
        Orientation as a quaternion of length 1, scalar last, shape (4,).

    Raises
    ------
    InputError
        If it is something else.
    """
    content: object = text.split(",")
    if text.lower().endswith(".json"):
        content = load_json(read_bytes(Path(text), "pose"), Path(text))
    head = list(content) if isinstance(content, dict) else None
    numbers = list(content.values()) if isinstance(content, dict) else content
    if not isinstance(numbers, list):
        raise InputError("pose", shown(text), _POSE)
    try:
        positions, quaternions, _ = _columns(head, [numbers])
    except InputError as error:
        raise InputError("pose", f"{shown(text)} ({error.value})", _POSE) from None
    if quaternions is None:
        return positions[0], None
    length = float(np.linalg.norm(quaternions[0]))
    if not abs(length - 1) < 1e-2:
        raise InputError("pose", f"{shown(text)} (length {length:.3g})", _POSE)
    return positions[0], quaternions[0] / length


def _values(first: Mapping[str, object], one: object) -> Sequence[object]:
    return [one.get(name) for name in first] if isinstance(one, dict) else [one]


def _from_lines(head: Sequence[str] | None, lines: Sequence[Sequence[object]]) -> ToolPath:
    return ToolPath(*_columns(head, lines))


def _columns(
    head: Sequence[str] | None, lines: Sequence[Sequence[object]]
) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
    """Positions, quaternions and times of lines of numbers."""
    if head is None:
        width = len(lines[0])
        names = {3: POSITION, 6: (*POSITION, *ANGLES), 7: (*POSITION, *QUATERNION)}.get(width)
        if names is None:
            raise InputError("waypoint 1", f"of {width} numbers", _ALLOWED)
        head = names
    extra = set(head) - {TIME, *POSITION}
    orientation = extra in (set(ANGLES), set(QUATERNION))
    unique = len(set(head)) == len(head)
    if not (set(POSITION) <= set(head) and unique and (orientation or not extra)):
        raise InputError("columns of the waypoints", ",".join(map(str, head)), _ALLOWED)
    table = np.array([_numbers(k, len(head), line) for k, line in enumerate(lines)])
    table = table.reshape(-1, len(head))
    columns = dict(zip(head, table.T, strict=True))
    quaternions = None
    if set(ANGLES) <= extra:
        angles = np.stack([columns[name] for name in ANGLES], axis=1)
        # Fixed axes x, y, z in turn, as URDF has them.
        quaternions = Rotation.from_euler("xyz", angles).as_quat()
    elif extra:
        quaternions = np.stack([columns[name] for name in QUATERNION], axis=1)
    positions = np.stack([columns[name] for name in POSITION], axis=1)
    return positions, quaternions, columns.get(TIME)


def _numbers(k: int, count: int, line: Sequence[object]) -> list[float]:
    name = f"waypoint {k + 1}"
    if len(line) != count:
        raise InputError(name, f"of {len(line)} entries", f"{count} numbers, as the others")
    try:
        numbers = [float(str(cell)) for cell in line]
    except ValueError:
        numbers = [float("nan")]
    if not all(abs(one) <= LARGEST for one in numbers):
        raise InputError(
            name, ",".join(shown(str(cell), 30) for cell in line), "finite numbers"
        )
    return numbers


def _shown(numbers: FloatArray) -> str:
    return ", ".join(f"{one:.6g}" for one in numbers)


def _later(times: FloatArray | None, k: int) -> str:
    assert times is not None
    return f"{times[k]:g} s after {times[k - 1]:g} s"
