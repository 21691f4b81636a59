"""``lockedjoint assess``: how failure tolerant a robot is at a configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, Locked
from formulations.commands.robot_arguments import (
    Base,
    Frame,
    Held,
    Length,
    Point,
    Robot,
    TaskDirections,
    Tip,
    robot_arm,
)


def assess(
    file: Robot,
    tip: Tip = None,
    configuration: Annotated[
        str | None,
        typer.Option(
            metavar="Q",
            help="Radians or metres: one number per joint from base to tip, or JOINT=VALUE "
            "pairs, with commas; or a JSON file, such as posture writes.",
            show_default="midway between the limits",
        ),
    ] = None,
    length: Length = None,
    task: TaskDirections = "all",
    frame: Frame = "base",
    held: Held = None,
    locked: Locked = 1,
    base: Base = None,
    point: Point = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the JSON there, Jacobian included."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Say how failure tolerant a robot is at a configuration.

    Which joint's failure hurts most and in which direction, how far from the bound that is,
    and how the answer depends on the characteristic length in which metres are measured.
    Joints without limits are taken to be at 0 where nothing else is said.
    """
    from formulations.commands.robot_text import robot_text
    from formulations.robots.configuration import read_configuration
    from formulations.robots.robot_assessment import assess as assess_robot
    from nlp.files import prepare_folder, write_text

    arm = robot_arm(
        file,
        tip=tip,
        base=base,
        point=point,
        task=task,
        frame=frame,
        length=length,
        held=held,
    )
    found = assess_robot(arm, read_configuration(configuration, arm.chain), locked)
    content = json.dumps({"model": found.robot, **found.to_dict()}, indent=1)
    if out is not None:
        prepare_folder(out.parent, "folder of --out")
        write_text(out, content + "\n")
    source = "midway between the limits" if configuration is None else "as given"
    typer.echo(content if as_json else robot_text(found, {}, source))
