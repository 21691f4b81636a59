"""``lockedjoint measure-robot``: how failure tolerant a robot is at a configuration."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formulations.commands.arguments import FailureOptions, Json, JsonFile
from formulations.commands.output import as_text, show, warn
from formulations.commands.robot_arguments import (
    ArmOptions,
    Configuration,
    read_configuration,
)
from formulations.io.table import written

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from formulations.robots.robot_assessment import Failure, RobotAssessment

# A singular value up to this is rounding.
_ROUNDING = 1e-12
# Failures shown, the worst first; the rest is in the JSON.
_SHOWN = 12


def measure_robot(
    robot: ArmOptions,
    failures: FailureOptions,
    configuration: Configuration = None,
    out: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Measure how failure tolerant a robot is at a configuration.

    Which joint's failure is the worst and in which direction, how far from the bound that is,
    and how the answer depends on the characteristic length in which metres are measured.
    By default joints without limits are at 0.
    """
    from formulations.io.files import prepare_file
    from formulations.robots.robot_assessment import measure_robot as measured
    from formulations.robots.robot_assessment import measure_robot_unequal

    arm = robot.arm()
    models = failures.scenarios(arm.chain.names)
    prepare_file(out, inputs=[robot.file, Path(configuration or robot.file)])
    position = read_configuration(configuration, arm.chain)
    assessment = measured(arm, position, failures.locked)
    warn(*(f"Note: {note}" for note in assessment.notes))
    source = "midway between the limits" if configuration is None else "as given"
    plain = {"model": assessment.robot, **asdict(assessment)}
    text = robot_text(assessment, {}, source)
    if models is not None:
        known = failures.probabilities_known
        unequal = measure_robot_unequal(arm, assessment.jacobian, models, known)
        plain |= unequal
        text += f"\n\n{failures_text(unequal)}"
    show(plain, as_json, lambda _: text, out)


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
        **({"locked_at": _positions(found.locked_at)} if found.locked_at else {}),
        **({"cannot move": _positions(found.immobile)} if found.immobile else {}),
        "configuration": f"{_positions(found.configuration)} ({source})",
        "at their limits": ", ".join(found.at_limits) or "none",
        "characteristic length": f"{found.characteristic_length:.6g} m",
        "worst-case sigma": _sigma(found.worst_case_sigma),
        "worst failure": _worst(found),
        **_structural(found),
        "worst direction": _direction(found.worst_case_direction),
        "bound": f"{found.sigma_bound:.9g}, reached to {found.percent_of_bound:.2f} %",
        "reachable": f"{found.reachable_sigma:.9g}, reached to "
        f"{found.percent_of_reachable:.2f} %",
        "singular values": found.singular_values,
    }
    parts = [as_text(values), _failures(found.failures), _lengths(found)]
    return "\n\n".join(part for part in parts if part)


def failures_text(found: Mapping[str, Any]) -> str:
    """Return the measures of unequal failures, and those of each scenario."""
    least = {name: value for name, value in found.items() if name != "scenarios"}
    parts = [as_text(least)]
    for k, one in enumerate(found.get("scenarios", ()), 1):
        parts.append(f"scenario {k}\n{as_text(one)}")
    return "\n\n".join(parts)


def _worst(found: RobotAssessment) -> str:
    joints = " and ".join(found.worst_case_joints)
    others = found.equally_bad - 1
    return f"{joints} ({others} more leave as little)" if others else joints


def _structural(found: RobotAssessment) -> dict[str, str]:
    said: dict[str, str] = {}
    for one in found.structural:
        before = f"{said[one.kind]}. " if one.kind in said else ""
        said[one.kind] = before + one.sentence
    return said


def _sigma(value: float) -> str:
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _failures(failures: Sequence[Failure]) -> str:
    lines = [
        (" and ".join(one.joints), _sigma(one.sigma), _direction(one.direction))
        for one in failures[:_SHOWN]
    ]
    shown = written(lines, ("locked", "sigma left", "worst direction"), "plain")
    if len(failures) > _SHOWN:
        shown += f"\n… and {len(failures) - _SHOWN} failures that leave more"
    return shown


def _lengths(found: RobotAssessment) -> str:
    if not found.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    best = [found.best_length] if found.best_length else []
    lines = [
        (
            f"{one.length:.4g}",
            _sigma(one.worst_case_sigma),
            f"{one.percent_of_bound:.2f}",
            " and ".join(one.worst_case_joints),
        )
        for one in (*found.by_length, *best)
    ]
    heads = ("length (m)", "sigma", "% of bound", "worst failure")
    shown = written(lines, heads, "plain").split("\n")
    if best:
        shown.insert(-1, "best for this configuration:")
    return "\n".join(shown)


def _positions(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name}={value:.6g}" for name, value in values.items())


def _direction(values: Mapping[str, float]) -> str:
    return "  ".join(f"{name} {value:+.3f}" for name, value in values.items())
