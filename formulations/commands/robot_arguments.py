"""Arguments that say which robot is meant, and the arm that they make."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import positive
from nlp.errors import InputError

if TYPE_CHECKING:
    from formulations.robots.robot_arm import RobotArm
    from formulations.robots.tree import RobotTree

Robot = Annotated[Path, typer.Argument(metavar="URDF", help="The robot, a URDF file.")]
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
        help="Point of the tip's link that counts, in its frame, in metres.",
        show_default="its origin",
    ),
]
TaskDirections = Annotated[
    str,
    typer.Option(
        "--task",
        metavar="DIRECTIONS",
        help="Directions that count: all, position, orientation, or some of vx,vy,vz,wx,wy,wz.",
    ),
]
Frame = Annotated[
    str, typer.Option(metavar="FRAME", help="Whose axes they are along: base or tip.")
]
Length = Annotated[
    float | None,
    typer.Option(
        parser=positive,
        metavar="METRES",
        help="Characteristic length: all lengths are measured in it.",
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


def robot_arm(
    file: Path,
    *,
    tip: str | None,
    base: str | None,
    point: str | None,
    task: str,
    frame: str,
    length: float | None,
    held: list[str] | None,
) -> RobotArm:
    """Read the robot and return the arm; InputError if anything is wrong with it."""
    from formulations.robots.chain_between import chain_between
    from formulations.robots.configuration import number, pairs
    from formulations.robots.directions import Task
    from formulations.robots.read_urdf import read_urdf
    from formulations.robots.robot_arm import RobotArm

    directions = Task.parse(task, frame)
    offset = [number("--point", part) for part in (point or "0,0,0").split(",")]
    if len(offset) != 3:
        raise InputError("--point", point, "three numbers X,Y,Z, in metres")
    locked = pairs(held or [], "--held")
    tree = read_urdf(file)
    links = chain_between(tree, _tip(tree, tip), base, locked, offset)
    return RobotArm(links, directions, length)


def _tip(tree: RobotTree, tip: str | None) -> str:
    from formulations.robots.chain import listed

    if tip is not None:
        return tip
    if len(tree.leaves) > 1:
        allowed = f"a link of {tree.name}; its last ones are {listed(tree.leaves)}"
        raise InputError("--tip", "missing", allowed)
    return tree.leaves[0]
