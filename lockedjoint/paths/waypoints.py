"""The path of a tool: waypoints in order of time, and samples between them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lockedjoint.formulations.io.files import load_json, read_bytes
from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.chain import LARGEST
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.pose import FAR_M, Pose
from lockedjoint.kinematics.tool_poses import ToolPoses
from lockedjoint.nlp.arrays import FloatArray, as_floats, check_length, whole_number
from lockedjoint.nlp.errors import FileError, InputError, as_path, shown

# A position has these columns.
_POSITION = ("x", "y", "z")
# An orientation in angles has these columns.
_ANGLES = ("roll", "pitch", "yaw")
# An orientation as a quaternion has these columns.
_QUATERNION = ("qx", "qy", "qz", "qw")
# The time has this column.
_TIME = "t"
# An error of a table of waypoints allows this.
_ALLOWED = (
    "columns x,y,z (metres), with commas between, and, for poses, roll,pitch,yaw (radians) or "
    "qx,qy,qz,qw; t (seconds) may come besides; units may be stated as in x_mm or roll_deg; "
    "without a header three, six or seven numbers"
)
# The name of a column of positions may end so: the number says how many metres its unit has.
_METRES = {"_m": 1.0, "_cm": 0.01, "_mm": 0.001}
# The name of a column of angles may end so: the number says how many radians its unit has.
_RADIANS = {"_rad": 1.0, "_deg": np.pi / 180}
# An angle beyond this may be in degrees.
_TWO_TURNS_RAD = 4 * np.pi
# An error of a pose allows this.
_POSE = (
    "x,y,z, metres; or with roll,pitch,yaw (radians) or qx,qy,qz,qw (length 1) besides; or a "
    "JSON file with such a list or object"
)
# A table without a header has these columns, by their number.
_WITHOUT_HEADER = {
    len(names): names
    for names in (_POSITION, (*_POSITION, *_ANGLES), (*_POSITION, *_QUATERNION))
}
# A pose on the command line may have these columns, with angles in degrees.
_IN_DEGREES = (*_POSITION, *(f"{angle}_deg" for angle in _ANGLES))
# A path with more waypoints is refused.
_MOST_WAYPOINTS = 1000
# A quaternion may be longer or shorter than 1 by less than this.
_QUATERNION_SLACK = 1e-2
# A place is a waypoint if it differs from a whole number by less: rounding.
_WAYPOINT_ROUNDING = 1e-9
# A radian counts for so many metres where times are shared out by length.
_METRES_PER_RADIAN = 0.3


@dataclass(frozen=True, eq=False)
class Poses:
    """The samples of a path: positions (N, 3), rotations (N, 3, 3), and rows that count."""

    positions: FloatArray
    rotations: FloatArray
    rows: Sequence[int]  #: Numbers of rows of the tool's velocity (v; ω).

    def __len__(self) -> int:
        return len(self.positions)

    def at(self, samples: int | IntArray) -> ToolPoses:
        """Return the pose of one sample, or one for each of B."""
        chosen = np.atleast_1d(samples)
        # Rotations lie in memory as they are read: products of many are ten times as fast.
        rotations = np.moveaxis(self.rotations, 0, 2)
        positions = np.take(self.positions.T, chosen, axis=1)
        return ToolPoses(positions, np.take(rotations, chosen, axis=2), self.rows)


@dataclass(frozen=True, eq=False, repr=False)
class ToolPath(Brief):
    """Waypoints, with straight lines between positions and slerp between orientations.

    Attributes
    ----------
    positions
        Metres, in the axes of the base, shape (W, 3).
    quaternions
        Orientations, scalar last, shape (W, 4); None if the orientation is free.
    times
        Seconds, increasing, shape (W,); None if a duration is divided in proportion to lengths.
    notes
        Sentences about numbers of a file that look wrong.

    Examples
    --------
    >>> import numpy as np
    >>> import lockedjoint as lj
    >>> way = lj.ToolPath(np.array([[0.45, -0.15, 0.3], [0.5, 0.2, 0.35]]))
    >>> way.has_orientation
    False
    """

    positions: FloatArray
    quaternions: FloatArray | None = None
    times: FloatArray | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._hold("positions", 2, 3)
        count = len(self.positions)
        self._hold("quaternions", 2, 4, count)
        self._hold("times", 1, 0, count)
        if not 2 <= count <= _MOST_WAYPOINTS:
            allowed = "at least two" if count < 2 else f"at most {_MOST_WAYPOINTS}"
            raise InputError("waypoints", count, allowed)
        if self.quaternions is not None:
            off = np.abs(np.linalg.norm(self.quaternions, axis=1) - 1)
            for k in np.flatnonzero(~(off < _QUATERNION_SLACK))[:1]:
                value = ", ".join(f"{x:.6g}" for x in self.quaternions[k])
                allowed = "a quaternion of length 1, scalar last"
                raise InputError(f"waypoint {k + 1}", value, allowed)
        if self.times is not None:
            for k in np.flatnonzero(~(np.diff(self.times) > 0))[:1]:
                value = f"{self.times[k + 1]:g} s after {self.times[k]:g} s"
                allowed = "times that increase from waypoint to waypoint"
                raise InputError(f"time of waypoint {k + 2}", value, allowed)
        else:
            for k in np.flatnonzero(self._lengths() < 1e-9)[:1]:
                allowed = "another pose, or times"
                raise InputError(f"waypoint {k + 2}", "the same as the one before", allowed)

    def _hold(self, name: str, dimensions: int, columns: int, rows: int | None = None) -> None:
        """Keep what was given under a name as an array; InputError if its shape is another."""
        given = getattr(self, name)
        if given is None and rows is not None:
            return
        array = as_floats(name, given)
        shape = array.shape
        fits = array.ndim == dimensions and (dimensions == 1 or shape[1] == columns)
        if not fits or (rows is not None and shape[0] != rows):
            first = "W" if rows is None else rows
            allowed = f"shape ({first}, {columns})" if dimensions == 2 else f"shape ({first},)"
            raise InputError(name, f"an array of shape {shape}", allowed)
        if not np.all(np.abs(array) <= LARGEST):
            largest = float(np.max(np.abs(array)))
            raise InputError(f"largest of {name}", largest, f"finite, at most {LARGEST:g}")
        object.__setattr__(self, name, array)

    @property
    def has_orientation(self) -> bool:
        """Whether orientations are given."""
        return self.quaternions is not None

    def sampled(self, samples: int, duration: float) -> tuple[FloatArray, Poses, FloatArray]:
        """Return times (N,) in seconds, poses and places of samples, every waypoint among them.

        There are about as many as asked for. The duration in seconds is of the whole path, if
        no times are given. Without orientations rotations are the identity. Places are counted
        in waypoints from 1: 2.5 is midway from waypoint 2 to 3.
        """
        whole_number("samples", samples, 2)
        check_length("duration", duration)
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
        positions = np.stack([np.interp(place, index, x) for x in self.positions.T], axis=1)
        rotations = np.repeat(np.eye(3)[None], len(place), axis=0)
        if self.quaternions is not None:
            rotations = Slerp(index, Rotation.from_quat(self.quaternions))(place).as_matrix()
        poses = Poses(positions, rotations, range(6 if self.has_orientation else 3))
        return np.interp(place, index, times), poses, place + 1

    def _lengths(self) -> FloatArray:
        lengths = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        if self.quaternions is not None:
            poses = Rotation.from_quat(self.quaternions)
            lengths = lengths + _METRES_PER_RADIAN * (poses[1:] * poses[:-1].inv()).magnitude()
        return np.asarray(lengths)


def at_waypoints(places: FloatArray) -> IntArray:
    """Return which samples are at waypoints, by their places, shape (N,)."""
    return np.flatnonzero(np.abs(places - np.round(places)) < _WAYPOINT_ROUNDING)


def place_name(place: float) -> str:
    """Return where a sample is, in words: ``waypoint 2``, ``between waypoints 2 and 3``."""
    if abs(place - round(place)) < _WAYPOINT_ROUNDING:
        return f"waypoint {round(place)}"
    return f"the path between waypoints {int(place)} and {int(place) + 1}"


def read_waypoints(path: Path | str) -> ToolPath:
    r"""Read waypoints from a CSV or JSON file.

    Parameters
    ----------
    path
        A ``.json`` file has a list of waypoints, or an object with it under ``waypoints``:
        each a list of numbers, or an object with the columns' names. Any other file is CSV.

    Raises
    ------
    InputError
        If it cannot be read, or a waypoint is not what is allowed; the sentence names it.

    Examples
    --------
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> _ = Path("way.csv").write_text("x_mm,y_mm,z_mm\n450,-150,300\n500,200,350\n")
    >>> lj.read_waypoints("way.csv").positions
    array([[ 0.45, -0.15,  0.3 ],
           [ 0.5 ,  0.2 ,  0.35]])
    """
    path = as_path("path", path)
    content = read_bytes(path, "waypoints")
    if path.suffix.lower() == ".json":
        loaded = load_json(content, path)
        listed = loaded.get("waypoints") if isinstance(loaded, dict) else loaded
        if not isinstance(listed, list) or not listed:
            raise FileError("waypoints", str(path), "a list of waypoints in JSON")
        head = list(listed[0]) if isinstance(listed[0], dict) else None
        return ToolPath(*_columns(head, listed))
    try:
        text = content.decode("utf-8-sig")
        lines = [line for line in csv.reader(io.StringIO(text)) if any(map(str.strip, line))]
    except (UnicodeDecodeError, csv.Error):
        raise FileError("waypoints", str(path), "a CSV file in UTF-8") from None
    if not lines:
        raise FileError("waypoints", str(path), "a file with waypoints, which is not empty")
    head = [cell.strip().lower() for cell in lines[0]]
    known = {_unit(name)[0] for name in head} & {*_POSITION, *_ANGLES, *_QUATERNION, _TIME}
    # A line without any number is a head, too: `_columns` says which heads it knows.
    if known or not any(map(_is_number, head)):
        return ToolPath(*_columns(head, lines[1:]))
    return ToolPath(*_columns(None, lines))


def read_pose(text: str, angles: str = "rad") -> Pose:
    """Read a position in metres and, if there is one, an orientation.

    Parameters
    ----------
    text
        Three, six or seven numbers with commas, as a line of waypoints without header; or the
        path of a ``.json`` file with such a list, or with an object of the columns' names.
    angles
        Unit of roll, pitch and yaw in the text, ``"rad"`` or ``"deg"``. A file has its own:
        radians, or what its columns' names state.

    Raises
    ------
    InputError
        If it is something else.
    """
    content: object = text.split(",")
    head: Sequence[str] | None = None
    is_file = text.lower().endswith(".json")
    if is_file:
        content = load_json(read_bytes(Path(text), "pose"), Path(text))
    if not isinstance(content, list | dict):
        raise InputError("pose", shown(text), _POSE)
    try:
        if isinstance(content, dict):
            head = list(content)
        elif angles == "deg" and isinstance(content, list) and not is_file:
            head = _IN_DEGREES if len(content) == len(_IN_DEGREES) else None
        positions, quaternions, _, notes = _columns(head, [content])
    except InputError as error:
        raise InputError("pose", f"{shown(text)} ({error.value})", _POSE) from None
    notes = tuple(note.replace("Columns", "Of the pose") for note in notes)
    if quaternions is None:
        return Pose(tuple(positions[0].tolist()), notes=notes)
    length = float(np.linalg.norm(quaternions[0]))
    if not abs(length - 1) < _QUATERNION_SLACK:
        raise InputError("pose", f"{shown(text)} (length {length:.3g})", _POSE)
    rotation = tuple((quaternions[0] / length).tolist())
    return Pose(tuple(positions[0].tolist()), rotation, notes=notes)


def _columns(
    head: Sequence[str] | None, waypoints: Sequence[object]
) -> tuple[FloatArray, FloatArray | None, FloatArray | None, tuple[str, ...]]:
    """Positions, quaternions, times and notes of lists of numbers, or of objects with names."""
    if head is None:
        width = len(waypoints[0]) if isinstance(waypoints[0], list) else 1
        if width not in _WITHOUT_HEADER:
            raise InputError("waypoint 1", f"of {width} numbers", _ALLOWED)
        head = _WITHOUT_HEADER[width]
    stated = [_unit(str(name)) for name in head]
    given, head = head, [name for name, _ in stated]
    extra = set(head) - {_TIME, *_POSITION}
    known = not extra or extra in (set(_ANGLES), set(_QUATERNION))
    if not (set(_POSITION) <= set(head) and known and len(set(head)) == len(head)):
        raise InputError("columns of the waypoints", ",".join(map(str, head)), _ALLOWED)
    table = np.array([_numbers(k, given, cells) for k, cells in enumerate(waypoints)])
    table = table * [factor for _, factor in stated]

    def columns(*names: str) -> FloatArray:
        return table.reshape(-1, len(head))[:, [head.index(name) for name in names]]

    notes = _hardly_meant(given, table)
    quaternions = columns(*_QUATERNION) if set(_QUATERNION) <= extra else None
    if set(_ANGLES) <= extra:
        # Angles turn about the fixed axes x, y, z, one after the other, as in URDF.
        quaternions = Rotation.from_euler("xyz", columns(*_ANGLES)).as_quat()
    times = columns(_TIME)[:, 0] if _TIME in head else None
    return columns(*_POSITION), quaternions, times, notes


def _is_number(cell: str) -> bool:
    """Whether a cell is a number, NaN and infinity included."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _unit(name: str) -> tuple[str, float]:
    """Return the name of a column without its unit, and what makes it metres or radians."""
    for names, units in ((_POSITION, _METRES), (_ANGLES, _RADIANS)):
        for one in names:
            for ending, factor in units.items():
                if name == one + ending:
                    return one, factor
    return name, 1.0


def _hardly_meant(head: Sequence[str], table: FloatArray) -> tuple[str, ...]:
    """Return sentences on numbers without a unit that may be millimetres or degrees."""
    large = np.max(np.abs(table.reshape(-1, len(head))), axis=0)
    size = dict(zip(head, large.tolist(), strict=True))
    kinds = (
        (_POSITION, FAR_M, "metres", "millimetres", "x_mm,y_mm,z_mm"),
        (_ANGLES, _TWO_TURNS_RAD, "radians", "degrees", "roll_deg,pitch_deg,yaw_deg"),
    )
    return tuple(
        f"Columns {','.join(names)} reach {most:g} {unit}, which may be {other}: columns"
        f" {columns} state that."
        for names, limit, unit, other, columns in kinds
        if (most := max(size.get(name, 0.0) for name in names)) > limit
    )


def _numbers(k: int, head: Sequence[str], waypoint: object) -> list[float]:
    name = f"waypoint {k + 1}"
    if isinstance(waypoint, dict):
        waypoint = [waypoint.get(column) for column in head]
    cells = waypoint if isinstance(waypoint, list) else [waypoint]
    if len(cells) != len(head):
        allowed = f"{len(head)} numbers, as the others"
        raise InputError(name, f"of {len(cells)} entries", allowed)
    try:
        numbers = [float(str(cell)) for cell in cells]
    except ValueError:
        numbers = [float("nan")]
    if not all(abs(x) <= LARGEST for x in numbers):
        raise InputError(name, ",".join(shown(str(x), 30) for x in cells), "finite numbers")
    return numbers
