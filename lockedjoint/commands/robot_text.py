"""The text that is printed of a robot that was measured, for `measure` and `posture`.

σ is the least singular value that a failure leaves of the Jacobian, in units of the
characteristic length ℓ: see `RobotAssessment`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

from lockedjoint.commands.output import as_table, as_text

if TYPE_CHECKING:
    from lockedjoint.robots.by_length import AtLength
    from lockedjoint.robots.robot_assessment import AssessedFailure, RobotAssessment

# Names under which values are printed: they say the units.
_UNITS = {
    "q": "q (rad or m)",
    "tool": "tool at (m, rad)",
    "characteristic_length": "characteristic length (m)",
}
# Columns of the table of failures, beside the directions of the task.
_LOCKED = "locked"
_LEFT = "sigma left"
# Largest singular value that is shown as 0: rounding.
_ROUNDING = 1e-12
# Number of decimals of a pose, metres and radians: it fits a line.
_POSE_DECIMALS = 5
# Number of failures that are shown, the worst first; all of them are in the JSON.
_SHOWN = 12
# Fields of an assessment that stand in a table of their own, or in the JSON alone.
_HIDDEN = ("by_failure", "structural", "by_length", "best_length", "jacobian", "notes")


def robot_text(
    assessment: RobotAssessment,
    above: Mapping[str, object],
    source: str,
    columns: Sequence[str] | None = None,
) -> str:
    """Return the text of an assessment: robot, posture, each failure, dependence on ℓ.

    It begins with the values `above`, by name; `source` says in words where the configuration
    is from. `columns` are those of both tables that are shown, from `chosen_of_robot`.
    """
    structural: dict[str, str] = {}
    for joint in assessment.structural:
        before = f"{structural[joint.kind]}. " if joint.kind in structural else ""
        structural[joint.kind] = before + joint.sentence
    shown = {
        k: v for k, v in vars(assessment).items() if k not in _HIDDEN and v not in ({}, "")
    }
    values = {
        **above,
        **{_UNITS.get(name, name): value for name, value in shown.items()},
        "at_limits": ", ".join(assessment.at_limits) or "none",
        _UNITS["tool"]: _pose(assessment.tool),
        "q is": source,
        **_rounded(assessment),
        "percent_of_reachable": f"{assessment.percent_of_reachable:.2f}",
        "worst_case_direction": _direction(assessment.worst_case_direction),
        **structural,
    }
    failures = _failures(assessment.by_failure, columns)
    parts = [as_text(values), failures, _lengths(assessment, columns)]
    return "\n\n".join(part for part in parts if part)


def chosen_of_robot(
    columns: Sequence[str] | None, directions: Sequence[str]
) -> list[str] | None:
    """Return the columns of `robot_text` that are asked for, of a task's directions.

    InputError if neither table has one of them.
    """
    from lockedjoint.formulations.io.table import chosen_names
    from lockedjoint.robots.by_length import AtLength

    if columns is None:
        return None
    names = [_LOCKED, _LEFT, *directions, *(_named(field.name) for field in fields(AtLength))]
    headings = {name: name.replace("_", " ") for name in names}
    return chosen_names("--columns", columns, headings)


def _named(field: str) -> str:
    """Return the name of the column of a field of `AtLength`."""
    return "length (m)" if field == "length" else field


def _failures(failures: Sequence[AssessedFailure], columns: Sequence[str] | None) -> str:
    """Return a table of the worst failures: joints, σ and the weakest direction."""
    lines = [
        {
            _LOCKED: failure.joints,
            _LEFT: _sigma(failure.sigma),
            **_direction(failure.direction),
        }
        for failure in failures[:_SHOWN]
    ]
    more = f"\n… and {len(failures) - _SHOWN} failures that leave more"
    return as_table(lines, columns=_of(lines, columns)) + (
        more if len(failures) > _SHOWN else ""
    )


def _lengths(assessment: RobotAssessment, columns: Sequence[str] | None) -> str:
    """Return a table of the worst case at several ℓ, or why there is none."""
    if not assessment.by_length:
        return "The characteristic length is only a unit here: percentages do not depend on it."
    chosen = assessment.best_length
    best = "" if chosen is None else f", best percent of bound at {chosen.length:.4g} m"
    lines = [
        {_named(name): value for name, value in row.items()}
        for row in (vars(each) | _rounded(each) for each in assessment.by_length)
    ]
    return f"by length{best}\n{as_table(lines, columns=_of(lines, columns))}"


def _of(
    lines: Sequence[Mapping[str, object]], columns: Sequence[str] | None
) -> Sequence[str] | None:
    """Return those of the columns that one of two tables has; None if it has none of them."""
    chosen = [name for name in columns or () if name in lines[0]]
    return chosen or None


def _rounded(assessment: RobotAssessment | AtLength) -> dict[str, object]:
    """Return the worst case and its share of the bound, without digits that are rounding."""
    return {
        "worst_case_sigma": _sigma(assessment.worst_case_sigma),
        "percent_of_bound": f"{assessment.percent_of_bound:.2f}",
    }


def _sigma(value: float) -> str:
    """Return a singular value as text; 0 where it is rounding."""
    return f"{value:.6g}" if value > _ROUNDING else "0"


def _pose(values: Mapping[str, float]) -> str:
    """Return a pose as --at and a file of waypoints take it: x,y,z,roll,pitch,yaw."""
    # Adding 0.0 makes −0.0 to 0.0.
    return ",".join(f"{round(value, _POSE_DECIMALS) + 0.0:.9g}" for value in values.values())


def _direction(values: Mapping[str, float]) -> dict[str, str]:
    """Return the components of a unit vector as text, by direction."""
    return {name: f"{value:+.3f}" for name, value in values.items()}
