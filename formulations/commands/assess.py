"""``lockedjoint assess``: how failure tolerant a robot is at a configuration."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    read_configuration,
    robot_arm,
)
from formulations.commands.text import as_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from formulations.robots.robot_assessment import AtLength, Failure, RobotAssessment

# A singular value up to this is rounding.
_ROUNDING = 1e-12
# Failures shown, the worst first; the rest is in the JSON.
_SHOWN = 12


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
    content = json.dumps({"model": found.robot, **asdict(found)}, indent=1)
    if out is not None:
        prepare_folder(out.parent, "folder of --out")
        write_text(out, content + "\n")
    source = "midway between the limits" if configuration is None else "as given"
    typer.echo(content if as_json else robot_text(found, {}, source))


def robot_text(found: RobotAssessment, above: Mapping[str, object], source: str) -> str:
    """Return what was found: the robot, its posture, each failure, the dependence on ℓ.

    Parameters
    ----------
    found
        The assessment.
    above
        Named values to begin with.
    source
        Where the configuration is from, in words.
    """
    values = {
        **above,
        "robot": f"{found.robot}, from {found.base} to {found.tip}",
        "task": ", ".join(found.task) + (f" ({found.frame})" if found.frame == "tip" else ""),
        **({"held": _positions(found.held)} if found.held else {}),
        "configuration": f"{_positions(found.configuration)} ({source})",
        "at their limits": ", ".join(found.at_limits) or "none",
        "characteristic length": f"{found.characteristic_length:.6g} m",
        "worst-case sigma": _sigma(found.worst_case_sigma),
        "worst failure": _worst(found),
        "hurts most": _direction(found.worst_case_direction),
        "bound": f"{found.sigma_bound:.9g}, reached to {found.percent_of_bound:.2f} %",
        "reachable": f"{found.reachable_sigma:.9g}, reached to "
        f"{found.percent_of_reachable:.2f} %",
        "singular values": found.singular_values,
    }
    parts = [as_text(values), _failures(found.failures), _lengths(found)]
    return "\n\n".join(part for part in parts if part)


def _worst(found: RobotAssessment) -> str:
    joints = " and ".join(found.worst_case_joints)
    others = found.equally_bad - 1
    return f"{joints} ({others} more leave as little)" if others else joints


def _sigma(value: float) -> str:
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _failures(failures: Sequence[Failure]) -> str:
    width = max(len(" and ".join(one.joints)) for one in failures)
    width = max(width, len("locked"))
    lines = [f"{'locked':<{width}}  sigma left   direction that suffers most"]
    for one in failures[:_SHOWN]:
        joints, direction = " and ".join(one.joints), _direction(one.direction)
        lines.append(f"{joints:<{width}}  {_sigma(one.sigma):<11}  {direction}")
    if len(failures) > _SHOWN:
        lines.append(f"… and {len(failures) - _SHOWN} failures that leave more")
    return "\n".join(lines)


def _lengths(found: RobotAssessment) -> str:
    if not found.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    lines = ["length (m)   sigma        % of bound   worst failure"]
    lines += [_length(one) for one in found.by_length]
    if found.best_length is not None:
        lines += ["best for this configuration:", _length(found.best_length)]
    return "\n".join(lines)


def _length(one: AtLength) -> str:
    joints, sigma = " and ".join(one.worst_case_joints), _sigma(one.worst_case_sigma)
    return f"{one.length:<11.4g}  {sigma:<11}  {one.percent_of_bound:<11.2f}  {joints}"


def _positions(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:.6g}" for name, value in values.items())


def _direction(values: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {value:+.3f}" for name, value in values.items())
