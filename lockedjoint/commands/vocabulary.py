"""The words of the command line: what each option is called, and what is given after it.

One name means one thing in every command. `WORDS` has a `Word` for each name of a parameter of
a command, or of a field of a dataclass that a command takes: `options` makes the command line
from these. What an option means is said in two places, and help shows both:

* `Word.says` is what it means in every command that has it;
* the docstring of the command or dataclass says the rest, for instance a default.

A docstring that begins as `Word.says` does, up to its first semicolon, stands alone. So a text
here that ends with a colon or without a full stop is only the common beginning: the docstrings
have the whole sentence.

Readers (`Reader`) make values of texts; their errors name the option, so that a user sees one
sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from lockedjoint.formulations.io.files import real_in, whole_in
from lockedjoint.kinematics.in_degrees import ANGLES, FromDegrees
from lockedjoint.nlp.errors import LARGEST, InputError, SolverOptionError

#: A function takes the name of an option, such as ``--seed``, and the text after it, and
#: returns the value; InputError if the text is not allowed.
Reader = Callable[[str, str], Any]


@dataclass(frozen=True)
class Word:
    """What is given after the name of an option, or as an argument.

    Attributes
    ----------
    metavar
        Word that help shows for the value, such as FILE; empty for a flag, without a value.
    read
        Reader of one value; by default the text itself is the value.
    many
        Whether the option may be repeated: `read` is then called for each, and `gather` once.
    gather
        Function of the option's name and the list of its values, if it may be repeated: it
        returns the value that the command gets. By default this is the list.
    says
        What the option means in every command that has it; see above.
    in_degrees
        Reader in place of `read` after ``--angles deg``, if the value has angles of the tool.
        For angles of joints see `OF_JOINTS`.
    """

    metavar: str
    read: Reader = lambda _, text: text
    many: bool = False
    gather: Callable[[str, list[Any]], Any] = lambda _, values: values
    says: str = ""
    in_degrees: Reader | None = None


#: Names of options with positions or limits of joints. After ``--angles deg`` their values
#: become `InDegrees`: only the robot knows which joints turn, and which slide in metres.
OF_JOINTS = ("q", "locked", "limits", "reduced")


def a_path(_: str, text: str) -> Path:
    """Return a text as a path, whether or not there is such a file."""
    return Path(text)


def whole(name: str, text: str) -> int:
    """Return a whole number; InputError if it is none, or too large for a store."""
    try:
        value = whole_in(text)
    except ValueError:
        value = LARGEST + 1
    if abs(value) > LARGEST:
        raise InputError(name, text, "a whole number")
    return value


def a_count(name: str, text: str) -> int:
    """Return a whole number of at least 1; InputError if it is none."""
    value = whole(name, text)
    if value < 1:
        raise InputError(name, text, "a whole number of at least 1")
    return value


def real(name: str, text: str) -> float:
    """Return a finite number; InputError if it is none."""
    try:
        value = real_in(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise InputError(name, text, "a finite number")
    return value


def positive(name: str, text: str) -> float:
    """Return a finite number above 0; InputError if it is none."""
    try:
        value = real_in(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise InputError(name, text, "a finite number above 0")
    return value


def names(_: str, text: str) -> list[str]:
    """Return the parts of a text between commas, without blanks around them."""
    return [part.strip() for part in text.split(",")]


def numbers(name: str, text: str) -> list[float]:
    """Return finite numbers between commas; InputError if a part is none."""
    try:
        values = [real_in(part) for part in text.split(",")]
    except ValueError:
        values = [math.nan]
    if not all(map(math.isfinite, values)):
        raise InputError(name, text, "finite numbers separated by commas")
    return values


def one_of_these(*choices: str) -> Reader:
    """Return a reader that takes only these words."""

    def read(name: str, text: str) -> str:
        if text not in choices:
            raise InputError(name, text, "one of " + ", ".join(choices))
        return text

    return read


def assigned(
    settings: Sequence[str],
    name: str,
    allowed: str,
    refusal: type[InputError] = InputError,
) -> list[tuple[str, str]]:
    """Return the two sides of settings like ``NAME=VALUE``, without blanks around them.

    `refusal` is the error, with the option's name and what is allowed, if a side is missing.
    """
    pairs = []
    for setting in settings:
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not (key and equals):
            raise refusal(name, setting, allowed)
        pairs.append((key, value))
    return pairs


def settings(name: str, given: list[str]) -> dict[str, object]:
    """Return ``NAME=VALUE`` settings by name: whole numbers, floats, booleans or texts."""
    refusal = SolverOptionError if name == "--ipopt" else InputError
    pairs = assigned(given, name, "NAME=VALUE", refusal)
    return {key: _typed(value) for key, value in pairs}


def _typed(text: str) -> str | int | float | bool:
    """Return a text as the first it can be of: true or false, a whole number, a float, text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (whole_in, real_in):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _places(name: str, given: list[str]) -> dict[str, float | None]:
    """Return positions, radians or metres, by joint, from ``JOINT[=VALUE]``; None without one.

    The last ``=`` of a text separates: a name that has one in it needs one more after it.
    """
    places: dict[str, float | None] = {}
    for text in given:
        joint, equals, value = (part.strip() for part in text.rpartition("="))
        joint = joint if equals else value
        if not joint:
            raise InputError(name, text, "JOINT or JOINT=VALUE, radians or metres")
        if joint in places:
            raise InputError(name, f"{joint} twice", "every joint once")
        places[joint] = real(f"{name} of {joint}", value) if equals and value else None
    return places


def _intervals(name: str, given: list[str]) -> dict[str, tuple[float, float]]:
    """Return limits (lower, upper), radians or metres, by joint."""
    from lockedjoint.kinematics.state import by_joint, interval

    return by_joint(given, name, "JOINT=LOWER:UPPER, radians or metres", interval)


def _pose(_: str, text: str, angles: str = "rad") -> Any:
    """Return a `Pose` from numbers with commas, or from a JSON file."""
    from lockedjoint.paths.waypoints import read_pose

    return read_pose(text, angles)


def _last_in_degrees(count: int, angles: int) -> Reader:
    """Return a reader of `count` numbers, of which the last `angles` become radians.

    Another count of numbers has no angles, or is not allowed: it is returned as it stands.
    """

    def read(name: str, text: str) -> list[float]:
        values = numbers(name, text)
        if len(values) != count:
            return values
        lengths = values[: count - angles]
        in_degrees = values[count - angles :]
        return lengths + [FromDegrees(math.radians(value)) for value in in_degrees]

    return read


def _obstacles(_: str, text: str, angles: str = "rad") -> Any:
    """Return `Obstacles` from ``FILE[@POSE]``; the pose is the file's in the base's frame."""
    import numpy as np

    from lockedjoint.clearance.read_clearance import Obstacles

    file, at, place = text.rpartition("@")
    if not at or Path(text).exists():
        return Obstacles.read(text)
    pose, frame = _pose("pose", place, angles), np.eye(4)
    frame[:3, :3], frame[:3, 3] = pose.rotation, pose.position
    found = Obstacles.read(file, frame)
    return replace(found, notes=tuple(f"Obstacles {file}: {note}" for note in pose.notes))


#: The words, by the names of parameters; an option has the same name with dashes.
WORDS: Mapping[str, Word] = {
    # Robots, their tools and tasks.
    "source": Word("ROBOT"),
    "tip": Word("LINK[:X,Y,Z]"),
    "base": Word("LINK"),
    "srdf": Word("FILE", a_path),
    "group": Word("NAME"),
    "task": Word("DIRECTIONS", says="The directions of the tool that count:"),
    "length": Word("METRES", positive),
    "locked": Word(
        "JOINT[=VALUE]",
        many=True,
        gather=_places,
        says="Joints that have locked, and where, in radians or metres;",
    ),
    "clearance": Word("METRES", positive),
    "obstacles": Word("FILE[@POSE]", _obstacles, in_degrees=partial(_obstacles, angles="deg")),
    "angles": Word(
        "UNIT",
        one_of_these(*ANGLES),
        says="Unit of angles on the command line, rad or deg: of joints' positions and limits, "
        "poses and tolerances. Files state their own unit, and speeds stay in rad/s.  "
        "[default: rad]",
    ),
    "q": Word(
        "JOINTS",
        says="The configuration: one number per joint from base to tip or JOINT=VALUE pairs, "
        "with commas, in radians or metres; the name of a state; or a file in JSON or "
        "YAML, such as a ROS JointState.",
    ),
    "at": Word(
        "POSE",
        _pose,
        says="Where the tool is to be, in the base's frame: x,y,z in metres, and for an "
        "orientation too roll,pitch,yaw in radians or qx,qy,qz,qw; or a JSON file.",
        in_degrees=partial(_pose, angles="deg"),
    ),
    "tolerance": Word(
        "METRES[,RADIANS]",
        numbers,
        says="How far the tool may be from --at, in metres and radians; by default 0,0.",
        in_degrees=_last_in_degrees(2, 1),
    ),
    "limits": Word(
        "JOINT=LOWER:UPPER",
        many=True,
        gather=_intervals,
        says="Artificial limits of a joint, in radians or metres, which hold until a joint "
        "locks. May be repeated; by default the physical limits.",
    ),
    "waypoints": Word(
        "FILE",
        a_path,
        says="The path of the tool, in CSV or JSON in order of time: columns x,y,z and, for "
        "poses, roll,pitch,yaw or qx,qy,qz,qw; and t, seconds, if times are given.",
    ),
    "acceleration": Word(
        "A,…",
        numbers,
        says="Largest accelerations of the joints, rad/s² or m/s², or one for all.",
    ),
    "velocity": Word(
        "V,…", numbers, says="Largest velocities of the joints, rad/s or m/s, or one for all;"
    ),
    "jerk": Word(
        "J,…",
        numbers,
        says="Largest jerks of the joints, rad/s³ or m/s³, or one for all; by default none: "
        "accelerations change as suddenly as the points of the trajectory can say.",
    ),
    # Failures.
    "failures": Word(
        "K",
        whole,
        says="How many joints lock at once.",
    ),
    "failure_probabilities": Word("P,…"),
    "maximise": Word("GOAL", one_of_these("worst", "expected")),
    "reduced": Word("JOINT=REST", many=True),
    # Problems.
    "formulation": Word("NAME"),
    "model": Word(
        "MODEL",
        says="A column model, see docs/howto/add_a_column_model.md.",
    ),
    "joints": Word(
        "N",
        whole,
        says="Number of joints n, above m.",
    ),
    "task_dimension": Word(
        "M",
        whole,
        says="Number of task dimensions m.",
    ),
    "setting": Word("NAME=VALUE", many=True, gather=settings),
    "level": Word("X", positive),
    "trace": Word("T", positive),
    "lever_arm": Word("L", positive),
    "measure": Word("NAME", one_of_these("max-min", "manipulability", "condition")),
    # How much is tried, and where.
    "starts": Word(
        "K",
        whole,
        says="Random starts of each problem.",
    ),
    "seed": Word(
        "S",
        whole,
        says="Random seed; reproducible across machines.",
    ),
    "workers": Word(
        "W",
        a_count,
        says="Worker processes; by default one per core.",
    ),
    "scheduler": Word(
        "ADDRESS",
        says="The Dask scheduler, such as tcp://host:8786, whose cluster is used instead of "
        "processes of this machine.",
    ),
    "solver": Word("NAME", says="Name of the solver:"),
    "ipopt": Word(
        "NAME=VALUE",
        many=True,
        gather=settings,
        says="Options of Ipopt, such as max_iter=500, over the formulation's own; one each "
        "time. May be repeated.",
    ),
    "effort": Word(
        "NAME=VALUE",
        many=True,
        gather=settings,
        says="How much is tried. May be repeated:",
    ),
    "time_limit": Word(
        "SECONDS",
        positive,
        says="Time in seconds after which",
    ),
    "chunk": Word("K", whole),
    "relative_tolerance": Word("SHARE", positive, says="A relative tolerance:"),
    "search": Word("SEARCH"),
    # What is written, and how it looks.
    "out": Word(
        "FILE",
        a_path,
        says="The file that is written:",
    ),
    "out_dir": Word(
        "DIR",
        a_path,
        says="The folder that is written to; made if missing.",
    ),
    "figure_style": Word(
        "FILE",
        a_path,
        says="A style file of matplotlib for the figure: figure.figsize is its size in "
        "inches, and with figure.titlesize: 0 it has no title.",
    ),
    "columns": Word(
        "NAME,…",
        names,
        says="The columns that the tables show, and no others; or all. By default those that "
        "fit 80 characters.",
    ),
    "to": Word(
        "FORM",
        says="The form of what is printed:",
    ),
    "name": Word("NAME"),
    # Files that are read.
    "file": Word("FILE", a_path),
    "beside": Word("FILE", a_path, many=True),
    "data": Word("DATA", a_path),
    "store": Word("DB", a_path),
    "others": Word("OTHER", a_path, many=True),
    "entries": Word("DIR", a_path),
    "bounds": Word("DIR", a_path),
    "folder": Word("DIR", a_path),
    "entry": Word("ENTRY"),
    "names": Word("ENTRY", many=True),
    # Tables of records and entries.
    "where": Word(
        "CONDITION",
        many=True,
        says="A condition on what is listed, such as 'joints == 7'. May be repeated.",
    ),
    "group_by": Word("SETTING,…", names),
    "rows": Word("KIND"),
    "by": Word("NAME"),
    # A path in time.
    "duration": Word("SECONDS", positive),
    "corners": Word("HOW", one_of_these("blend", "stop")),
    "recoveries": Word(""),
    # Workspaces.
    "orientation": Word("ANGLES", numbers, in_degrees=_last_in_degrees(3, 3)),
    "optimise": Word("WHAT", one_of_these("limits", "lengths")),
    # These words are those of `realise`.
    "space": Word("NAME"),
    "kinds": Word("RP…"),
    "metres": Word("METRES", positive),
    "criterion": Word("NAME"),
    "order": Word("J[-],…"),
    "slide": Word("HOW", one_of_these("as-needed", "never", "length")),
    # A page.
    "address": Word("HOST:PORT"),
}
