"""Arguments that name a robot and its configuration, and the arm that they make."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import positive_option
from nlp.errors import FileError, InputError
from nlp.files import load_json, read_bytes, real_in

if TYPE_CHECKING:
    from formulations.clearance.link_clearance import LinkClearance
    from formulations.kinematics.chain import Chain
    from formulations.robots.pose_constrained_arm import Pose
    from formulations.robots.robot_arm import RobotArm
    from formulations.robots.robot_assessment import RobotAssessment
    from nlp.arrays import FloatArray

File = Annotated[
    Path,
    typer.Argument(
        metavar="ROBOT",
        help="The robot: a URDF file, an MJCF file, or a Denavit–Hartenberg table (.csv).",
    ),
]
Tip = Annotated[
    str | None,
    typer.Option(
        metavar="LINK",
        help="Link that the Jacobian is of, anywhere on the robot.",
        show_default="the last link, if there is only one",
    ),
]
Base = Annotated[
    str | None,
    typer.Option(metavar="LINK", help="Link that it is relative to.", show_default="the root"),
]
Point = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z",
        help="Point of the tip's link whose velocity is taken, in its frame, in metres.",
        show_default="its origin",
    ),
]
TaskDirections = Annotated[
    str,
    typer.Option(
        "--task",
        metavar="DIRECTIONS",
        help="Task directions: all, position, orientation, or some of vx,vy,vz,wx,wy,wz.",
    ),
]
Frame = Annotated[
    str, typer.Option(metavar="FRAME", help="Whose axes they are along: base or tip.")
]
Length = Annotated[
    float | None,
    positive_option(
        "METRES",
        "Characteristic length: all lengths are measured in it.",
        show_default="root mean square of the revolute joints' lever arms",
    ),
]
Held = Annotated[
    list[str] | None,
    typer.Option(
        "--held",
        metavar="JOINT=VALUE",
        help="A joint that has locked already, and where, in radians or metres; no column "
        "of its own. May be repeated.",
        show_default=False,
    ),
]
NeverFails = Annotated[
    str | None,
    typer.Option(
        "--never-fails",
        metavar="JOINT,…",
        help="Joints that never fail, by name or counted from 0.",
        show_default=False,
    ),
]
At = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="POSE",
        help="Where the tip's point is to be, in the base's frame: x,y,z in metres, and for an "
        "orientation too roll,pitch,yaw in radians or qx,qy,qz,qw; or a JSON file.",
        show_default="anywhere",
    ),
]
PoseTolerance = Annotated[
    str | None,
    typer.Option(
        "--tolerance",
        metavar="METRES[,RADIANS]",
        help="How far the tip may be from --at.",
        show_default="0,0",
    ),
]
KeptDistance = Annotated[
    float | None,
    positive_option(
        "METRES",
        "Distance that the links keep from each other. Needs coal; reads the meshes that "
        "the URDF file names.",
        "--clearance",
        show_default="they may touch",
    ),
]
Configuration = Annotated[
    str | None,
    typer.Option(
        metavar="Q",
        help="Radians or metres: one number per joint from base to tip, or JOINT=VALUE "
        "pairs, with commas; or a JSON file, such as posture writes.",
        show_default="midway between the limits",
    ),
]
JsonFile = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help="Write the JSON there, Jacobian included."),
]

_ALLOWED = "one number per joint, JOINT=VALUE pairs (both with commas), or a JSON file"


def arm(
    file: Path,
    tip: str | None,
    base: str | None,
    point: str | None,
    task: str,
    frame: str,
    length: float | None,
    held: list[str] | None,
) -> RobotArm:
    """Read the robot and return the arm; InputError if anything is wrong with it."""
    from formulations.robots.robot_arm import RobotArm
    from formulations.robots.task import TaskSpace

    directions = TaskSpace.parse(task, frame)
    return RobotArm(chain(file, tip, base, point, held), directions, length)


def chain(
    file: Path, tip: str | None, base: str | None, point: str | None, held: list[str] | None
) -> Chain:
    """Read the robot and return its chain; InputError if anything is wrong with it."""
    from formulations.kinematics.chain_between import chain_between
    from formulations.kinematics.read_robot import read_robot

    offset = [number("--point", part) for part in (point or "0,0,0").split(",")]
    if len(offset) != 3:
        raise InputError("--point", point, "three numbers X,Y,Z, in metres")
    locked = pairs(held or [], "--held")
    tree = read_robot(file)
    tip = tree.last_link("--tip") if tip is None else tip
    return chain_between(tree, tip, base, locked, offset)


def pose(text: str | None, tolerance: str | None) -> Pose | None:
    """Read --at and --tolerance; InputError if they are not what is allowed."""
    from formulations.paths.waypoints import read_pose
    from formulations.robots.pose_constrained_arm import Pose

    if text is None:
        if tolerance is not None:
            raise InputError("--tolerance", tolerance, "none without --at")
        return None
    position, quaternion = read_pose(text)
    near = [
        number("--tolerance", part)
        for part in ("0" if tolerance is None else tolerance).split(",")
    ]
    if len(near) > (1 if quaternion is None else 2):
        words = "METRES" if quaternion is None else "METRES or METRES,RADIANS"
        raise InputError("--tolerance", tolerance, f"{words} for such a pose")
    turn = None if quaternion is None else tuple(quaternion.tolist())
    return Pose(tuple(position.tolist()), turn, *near)


def kept_distance(file: Path, chain: Chain, least: float | None) -> LinkClearance | None:
    """Read the links' geometry for --clearance; None if that is not given."""
    if least is None:
        return None
    from formulations.clearance.link_clearance import read_clearance

    return read_clearance(file, chain, least)


def print_notes(found: RobotAssessment) -> None:
    """Print what to check in the robot's file on standard error."""
    for note in found.notes:
        typer.echo(f"Note: {note}", err=True)


def read_configuration(text: str | None, chain: Chain) -> FloatArray:
    """Read a configuration.

    Parameters
    ----------
    text
        Numbers in the order of the chain's joints; or ``JOINT=VALUE`` pairs, with the other
        joints midway between their limits; or the path of a ``.json`` file with a
        list, an object of positions by name, or an object with either under the key
        ``configuration``, as `lockedjoint posture` writes it. Midway if None.
    chain
        The joints.

    Returns
    -------
    numpy.ndarray
        Radians or metres, shape (n,), within the limits.

    Raises
    ------
    InputError
        If it is none of these, a joint is unknown, or a position is outside its limits.
    """
    from formulations.kinematics.chain import listed, nearest

    values: Mapping[str, float] | Sequence[float] = {}
    if text is None:
        pass
    elif text.lower().endswith(".json"):
        values = _read_json(Path(text))
    elif "=" in text:
        values = pairs(text.split(","))
    else:
        values = [number("--configuration", part) for part in text.split(",")]
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in chain.names]
        if unknown:
            wrong = unknown[0]
            still = ", which cannot move" if wrong in dict(chain.immobile) else ""
            allowed = f"one of {listed(chain.names)}{nearest(wrong, chain.names)}"
            raise InputError("joint", f"{wrong}{still}", allowed)
        middle = dict(zip(chain.names, chain.mid_range.tolist(), strict=True))
        values = list({**middle, **values}.values())
    if len(values) != len(chain.names):
        names = ", ".join(chain.names)
        allowed = f"{len(chain.names)} of them ({names}); or {_ALLOWED}"
        raise InputError("--configuration", f"{len(values)} numbers", allowed)
    return chain.within_limits(values)


def pairs(settings: Sequence[str], name: str = "--configuration") -> dict[str, float]:
    """Read ``JOINT=VALUE`` settings; InputError if one is something else or repeated."""
    found: dict[str, float] = {}
    for setting in settings:
        joint, equals, value = (part.strip() for part in setting.partition("="))
        if not (joint and equals):
            raise InputError(name, setting, "JOINT=VALUE, radians or metres")
        if joint in found:
            raise InputError(name, f"{joint} twice", "every joint once")
        found[joint] = number(f"{name} of {joint}", value)
    return found


def number(name: str, value: object) -> float:
    """Return a finite number; InputError if it is none."""
    try:
        read = real_in(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        read = math.nan
    if isinstance(value, bool) or not math.isfinite(read):
        raise InputError(name, value, "a finite number, radians or metres")
    return read


def _read_json(path: Path) -> Mapping[str, float] | Sequence[float]:
    content = load_json(read_bytes(path), path)
    if isinstance(content, dict) and "configuration" in content:
        content = content["configuration"]
    if isinstance(content, dict):
        return {name: number(f"{name} in {path}", value) for name, value in content.items()}
    if isinstance(content, list):
        return [number(f"an entry of {path}", value) for value in content]
    raise FileError("file", str(path), "positions: a list, or an object by joint")
