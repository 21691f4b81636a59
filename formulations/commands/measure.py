"""``lockedjoint measure`` and ``measure-robot``: failure tolerance of a matrix, of a robot."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formulations.commands import arguments as cli
from formulations.commands.arguments import option
from formulations.commands.output import as_table, as_text, show, warn
from formulations.commands.robot_arguments import ArmOptions, Configuration, read_configuration

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from formulations.robots.robot_assessment import AtLength, Failure, RobotAssessment
    from nlp.arrays import FloatArray

# A singular value up to this is rounding.
_ROUNDING = 1e-12
# Failures shown, the worst first; the rest is in the JSON.
_SHOWN = 12


def measure(
    file: cli.JacobianFile,
    failures: cli.FailureOptions,
    tolerance: float = option(
        "TOL",
        "Relative tolerance of the verdict 'optimally failure tolerant'.",
        1e-6,
        positive=True,
    ),
    as_json: cli.Json = False,
) -> None:
    """Measure the failure tolerance of a Jacobian.

    Reads a matrix from CSV, NPY, NPZ or JSON (a list of rows, an object with the key
    "jacobian", or a list of such objects as in jacobians.json) and prints its singular values,
    its worst case after locked joints with the joints and direction that realise it, the
    bound, its isotropy, and whether it is optimally failure tolerant. Joints are counted from
    0. Of several locked joints the bound is the mean over failures; the sharpest one known of
    all Jacobians of this shape and norm is shown too. With failure probabilities or joints that
    never fail also the expected dexterity and the probability-weighted worst case.
    """
    from formulations.measures.read_jacobians import read_jacobians

    rows = [
        {"name": name, **jacobian_values(matrix, failures, tolerance)}
        for name, matrix in read_jacobians(file)
    ]
    text = "\n\n".join(map(as_text, rows))
    show(rows if len(rows) > 1 else rows[0], as_json, lambda _: text)


def jacobian_values(
    jacobian: FloatArray, failures: cli.FailureOptions, tolerance: float = 1e-6
) -> dict[str, Any]:
    """Return what `measure` shows of a Jacobian, by name."""
    from formulations.bounds.certified import sharpest_worst_case_of
    from formulations.bounds.unequal_failures import assess_failures
    from formulations.measures.assessment import measure as measured

    locked, known = failures.locked, failures.probabilities_known
    assessment = measured(jacobian, locked, tolerance)
    values = assessment.to_dict()
    if locked > 1:
        limit = sharpest_worst_case_of(jacobian, locked)
        values |= {
            "sharpest_bound": limit.value,
            "sharpest_bound_kind": limit.kind,
            "gap_to_sharpest_percent": limit.gap_percent(assessment.worst_case_sigma),
        }
    model = failures.model(jacobian.shape[1])
    if model is not None:
        values |= assess_failures(jacobian, model, probabilities_known=known)
    return values


def measure_robot(
    robot: ArmOptions,
    failures: cli.FailureOptions,
    configuration: Configuration = None,
    out: cli.JsonFile = None,
    as_json: cli.Json = False,
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


def robot_text(assessment: RobotAssessment, above: Mapping[str, object], source: str) -> str:
    """Return the text of an assessment: robot, posture, each failure, dependence on ℓ.

    Parameters
    ----------
    assessment
        What is shown.
    above
        Named values to begin with.
    source
        Where the configuration is from, in words.
    """
    hidden = ("failures", "structural", "by_length", "best_length", "jacobian", "notes")
    values = {
        **above,
        **{k: v for k, v in vars(assessment).items() if k not in hidden and v not in ({}, "")},
        "at_limits": ", ".join(assessment.at_limits) or "none",
        "configuration is": source,
        **_rounded(assessment),
        "percent_of_reachable": f"{assessment.percent_of_reachable:.2f}",
        "worst_case_direction": _direction(assessment.worst_case_direction),
        **_structural(assessment),
    }
    parts = [as_text(values), _failures(assessment.failures), _lengths(assessment)]
    return "\n\n".join(part for part in parts if part)


def failures_text(values: Mapping[str, Any]) -> str:
    """Return the measures of unequal failures, and those of each scenario."""
    least = {name: value for name, value in values.items() if name != "scenarios"}
    return "\n\n".join(filter(None, (as_text(least), as_table(values.get("scenarios", ())))))


def _structural(assessment: RobotAssessment) -> dict[str, str]:
    sentences: dict[str, list[str]] = {}
    for joint in assessment.structural:
        sentences.setdefault(joint.kind, []).append(joint.sentence)
    return {kind: ". ".join(parts) for kind, parts in sentences.items()}


def _sigma(value: float) -> str:
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _failures(failures: Sequence[Failure]) -> str:
    lines = [
        {
            "locked": failure.joints,
            "sigma left": _sigma(failure.sigma),
            **_direction(failure.direction),
        }
        for failure in failures[:_SHOWN]
    ]
    more = f"\n… and {len(failures) - _SHOWN} failures that leave more"
    return as_table(lines) + (more if len(failures) > _SHOWN else "")


def _lengths(assessment: RobotAssessment) -> str:
    if not assessment.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    chosen = assessment.best_length
    best = "" if chosen is None else f", the best {chosen.length:.4g} m"
    lines = [vars(row) | _rounded(row) for row in assessment.by_length]
    return f"by length{best}\n{as_table(lines)}"


def _rounded(assessment: RobotAssessment | AtLength) -> dict[str, object]:
    """Return the worst case and its share of the bound, without digits that are rounding."""
    sigma = _sigma(assessment.worst_case_sigma)
    return {
        "worst_case_sigma": sigma,
        "percent_of_bound": f"{assessment.percent_of_bound:.2f}",
    }


def _direction(values: Mapping[str, float]) -> dict[str, str]:
    return {name: f"{value:+.3f}" for name, value in values.items()}
