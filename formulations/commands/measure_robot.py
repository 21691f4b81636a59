"""``lockedjoint measure-robot``: how failure tolerant a robot is at a configuration."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formulations.commands.arguments import FailureOptions, Json, JsonFile
from formulations.commands.output import as_table, as_text, show, warn
from formulations.commands.robot_arguments import ArmOptions, Configuration, read_configuration

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from formulations.robots.robot_assessment import AtLength, Failure, RobotAssessment

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
    hidden = ("failures", "structural", "by_length", "best_length", "jacobian", "notes")
    values = {
        **above,
        **{k: v for k, v in vars(found).items() if k not in hidden and v not in ({}, "")},
        "at_limits": ", ".join(found.at_limits) or "none",
        "configuration is": source,
        **_rounded(found),
        "percent_of_reachable": f"{found.percent_of_reachable:.2f}",
        "worst_case_direction": _direction(found.worst_case_direction),
        **_structural(found),
    }
    parts = [as_text(values), _failures(found.failures), _lengths(found)]
    return "\n\n".join(part for part in parts if part)


def failures_text(found: Mapping[str, Any]) -> str:
    """Return the measures of unequal failures, and those of each scenario."""
    least = {name: value for name, value in found.items() if name != "scenarios"}
    return "\n\n".join(filter(None, (as_text(least), as_table(found.get("scenarios", ())))))


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
        {"locked": one.joints, "sigma left": _sigma(one.sigma), **_direction(one.direction)}
        for one in failures[:_SHOWN]
    ]
    more = f"\n… and {len(failures) - _SHOWN} failures that leave more"
    return as_table(lines) + (more if len(failures) > _SHOWN else "")


def _lengths(found: RobotAssessment) -> str:
    if not found.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    best = "" if found.best_length is None else f", the best {found.best_length.length:.4g} m"
    lines = [vars(one) | _rounded(one) for one in found.by_length]
    return f"by length{best}\n{as_table(lines)}"


def _rounded(found: RobotAssessment | AtLength) -> dict[str, object]:
    """Return the worst case and its share of the bound, without digits that are rounding."""
    percent = f"{found.percent_of_bound:.2f}"
    return {"worst_case_sigma": _sigma(found.worst_case_sigma), "percent_of_bound": percent}


def _direction(values: Mapping[str, float]) -> dict[str, str]:
    return {name: f"{value:+.3f}" for name, value in values.items()}
