"""What commands share: the fields of a robot that they take, failures, output files, pictures.

The first part names sets of fields of `Robot`, for the annotations of commands: each field is
an option (`options` makes them), and the command gets the robot, or with `FieldsOf` a dict of
the fields that the user gave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.options import FieldsOf, Only
from lockedjoint.commands.vocabulary import numbers
from lockedjoint.formulations.io.files import prepare_file
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.robot import Robot

if TYPE_CHECKING:
    from lockedjoint.figures.style import Look
    from lockedjoint.formulations.measures.unequal_failures import FailureModel
    from lockedjoint.nlp.arrays import FloatArray

# Fields that every command takes which has a robot: what is read, and both ends of the arm.
_OF_FILES = ("source", "srdf", "group", "tip", "base")
# The same, and joints that have locked.
_ARM = (*_OF_FILES, "locked")
# Fields that say what links keep from each other and from obstacles.
_APART = ("clearance", "obstacles")
#: A robot whose whole reach counts; the same, and what its links keep.
BareRobot = Annotated[Robot, Only(_ARM)]
RobotReach = Annotated[Robot, Only((*_ARM, *_APART))]
#: A robot and its task; the same, and what its links keep.
OneTask = Annotated[Robot, Only((*_ARM, "task", "length"))]
WholeRobot = Annotated[Robot, Only((*_ARM, "task", "length", *_APART))]
#: A robot and the task of a path or goal, and what its links keep.
RobotOnPath = Annotated[Robot, Only((*_ARM, "task", *_APART))]
#: A robot whose failures are not among its fields, and what its links keep.
DamagedRobot = Annotated[Robot, Only((*_OF_FILES, *_APART))]
#: Fields of a robot that is made when its configuration is read: there joints may have locked.
FieldsOfRobot = Annotated[dict[str, Any], FieldsOf(Robot, (*_ARM, "task", "length"))]
FieldsOfTask = Annotated[dict[str, Any], FieldsOf(Robot, (*_ARM[1:], "task", "length"))]

#: What is printed of collisions where nothing was asked to keep links apart.
NOT_CHECKED = "not checked (--clearance)"


@dataclass(frozen=True)
class Failures:
    """How many joints lock at once, and how likely.

    Parameters
    ----------
    failures
        How many joints lock at once.
    failure_probabilities
        Each joint's probability of failure, or one number for all; 0 for a joint that never
        fails, also as JOINT=0, the others being alike. Joints are counted from 0; those of a
        robot have names, too.
    """

    failures: int = 1
    failure_probabilities: str | None = None

    @property
    def probabilities_known(self) -> bool:
        """Whether probabilities mean anything beyond their ratios."""
        return self.failure_probabilities is not None and "=" not in self.failure_probabilities

    def model(self, names: Sequence[str]) -> FailureModel | None:
        """Return the failure model of joints; None without ``--failure-probabilities``.

        The names are those of all joints, or "" for each joint that has none. InputError if the
        option names an unknown joint, or has another number of probabilities.
        """
        text = self.failure_probabilities
        if text is None:
            return None
        from lockedjoint.formulations.measures.unequal_failures import FailureModel

        if "=" in text:
            from lockedjoint.kinematics.state import settings_of

            never = [_never(part, names) for part in settings_of(text)]
            return FailureModel.equally_likely(len(names), self.failures, never)
        values = numbers("--failure-probabilities", text)
        values = values * len(names) if len(values) == 1 else values
        if len(values) != len(names):
            allowed = f"{len(names)} numbers, one for each joint, or one for all"
            raise InputError("--failure-probabilities", text, allowed)
        return FailureModel(tuple(values), self.failures)


def _never(text: str, names: Sequence[str]) -> int:
    """Return the number of the joint in ``JOINT=0``; InputError if it is another text."""
    joint, _, value = (part.strip() for part in text.rpartition("="))
    known = {name: k for k, name in enumerate(names) if name} | {
        str(k): k for k in range(len(names))
    }
    if joint not in known or numbers("--failure-probabilities", value) != [0.0]:
        allowed = f"JOINT=0 for joints that never fail, of {', '.join(known)}"
        raise InputError("--failure-probabilities", text, allowed)
    return known[joint]


def robot_at(
    source: Any, fields: Mapping[str, Any], q: Any
) -> tuple[Robot, FloatArray, tuple[str, ...]]:
    """Return a robot, its configuration, shape (n,), and notes on how that was read.

    `fields` are those of `Robot` that the user gave, but the source. A joint of ``--locked``
    without a value has locked where the configuration q has it. InputError if q does not say.
    """
    given = fields.get("locked") or {}
    degrees = isinstance(given, InDegrees)
    locked = dict(given.stated if isinstance(given, InDegrees) else given)
    others = {name: value for name, value in fields.items() if name != "locked"}
    stated = {name: at for name, at in locked.items() if at is not None}
    robot = Robot(source, **others, locked=InDegrees(stated) if degrees else stated)
    known = dict(robot.chain.locked_at)
    point, notes = robot.configuration(q)
    if len(known) == len(locked):
        return robot, point, notes
    where = dict(zip(robot.chain.names, point.tolist(), strict=True))
    for name in locked.keys() - known.keys():
        if q is None or name not in where:
            allowed = f"{name}=VALUE, or a joint whose position --q states"
            raise InputError("--locked", name, allowed)
        known[name] = where.pop(name)
    robot = robot.changed(locked=known)
    return robot, robot.configuration(where)[0], notes


def checked_effort(effort: Mapping[str, Any] | None, kind: type[Any]) -> dict[str, Any]:
    """Return what --effort states; InputError if a dataclass has no field of such a name."""
    from lockedjoint.kinematics.chain import check_named

    given = dict(effort or {})
    for name in given:
        known = [one.name for one in fields(kind) if one.init and one.name != "progress"]
        check_named("--effort", name, known)
    return given


@dataclass(frozen=True)
class Outputs:
    """The files that a command writes: one for each ending of a name, such as ``.json``."""

    files: Mapping[str, Path]

    @classmethod
    def checked(
        cls, given: Sequence[Path] | None, endings: Sequence[str], inputs: Sequence[Any] = ()
    ) -> Outputs:
        """Check that files can be written, and overwrite no input.

        FileError if one has another ending than `endings`, which are lower-case; InputError for
        two files of one kind, of which all pictures are.
        """
        files: dict[str, Path] = {}
        read = [path for path in inputs if isinstance(path, Path)]
        for path in given or ():
            ending = path.suffix.lower()
            if ending not in endings:
                raise FileError("--out", str(path), f"a name that ends in {_listed(endings)}")
            prepare_file(path, inputs=[*read, *files.values()])
            alike = PICTURES if ending in PICTURES else (ending,)
            for other in (files[end] for end in alike if end in files):
                raise InputError("--out", f"{other} and {path}", "one file of a kind")
            files[ending] = path
        return cls(files)

    @property
    def picture(self) -> Path | None:
        """The file of a picture."""
        return next((self.files[end] for end in PICTURES if end in self.files), None)

    def of(self, ending: str) -> Path | None:
        """Return the file with an ending."""
        return self.files.get(ending)


#: How the names of pictures end.
PICTURES = (".svg", ".png", ".pdf")


def _listed(endings: Sequence[str]) -> str:
    """Return endings in words: ``.a, .b or .c``."""
    return f"{', '.join(endings[:-1])} or {endings[-1]}" if len(endings) > 1 else endings[0]


@contextmanager
def looking_like(style: Path | None) -> Iterator[None]:
    """Draw within this context as a style file says."""
    from lockedjoint.figures.style import looking

    with looking(look_of(style)):
        yield


def look_of(style: Path | None) -> Look:
    """Return how figures look; FileError if the style file is not allowed."""
    from lockedjoint.figures.style import Look, read_style

    return Look() if style is None else read_style(style, "--figure-style")


def check_style(style: Path | None, is_drawn: bool, allowed: str) -> None:
    """Refuse a style file that is wrong, or that is given where no figure is drawn."""
    if style is not None and not is_drawn:
        raise InputError("--figure-style", style, allowed)
    look_of(style)


def draw(path: Path | None, style: Path | None, figure: Callable[[], Any]) -> None:
    """Draw what a function returns, a figure of matplotlib, into a file, if there is one."""
    if path is None:
        return
    from lockedjoint.figures.style import content, kind_of
    from lockedjoint.formulations.io.files import write_bytes

    with looking_like(style):
        write_bytes(path, content(figure(), kind_of(path)))


def source_file(robot: Robot) -> Path | None:
    """Return the file that a robot was read from."""
    return robot.description.file
