"""``lockedjoint measure``: how failure tolerant a Jacobian is, or a robot.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lockedjoint.commands.output import Answer, as_text
from lockedjoint.commands.shared import Failures, FieldsOfTask, robot_at
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.nlp.errors import InputError

if TYPE_CHECKING:
    from lockedjoint.nlp.arrays import FloatArray
    from lockedjoint.robots.measure import Jacobians

# A Jacobian counts as optimally failure tolerant within this share.
_TOLERANCE = 1e-6


def measure(
    file: Path,
    robot: FieldsOfTask,
    failing: Failures,
    q: str | InDegrees | None = None,
    relative_tolerance: float | None = None,
    columns: list[str] | None = None,
    out: Path | None = None,
) -> Answer:
    """Measure how failure tolerant a Jacobian is, or a robot at a configuration.

    For a Jacobian it shows the singular values, the worst case after joints lock with the
    joints and the direction that realise it, the bound, the isotropy, and whether the Jacobian
    is optimally failure tolerant. Joints are counted from 0.

    For a robot it shows which joint's failure is the worst and in which direction, how far from
    the bound that is, and how the answer depends on the characteristic length in which metres
    are measured.

    Parameters
    ----------
    file
        A Jacobian in CSV, TSV, TXT, NPY, NPZ or JSON, one column per joint, after # its number
        in a file of several, counted from 0 (in text, a header line has no number, and rows
        have no names); or a robot: a URDF file, an MJCF file, a Denavit–Hartenberg
        table in CSV, robot_descriptions:NAME, or example, an arm in the package.
    q
        Only robots have one; by default it is midway between the limits.
    relative_tolerance
        A relative tolerance: that of the verdict that a Jacobian is optimally failure tolerant,
        by default 1e-6. No robot has one.
    out
        The file that is written: all that is measured, as JSON.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.robots.measure import Jacobians, opened

    named = ":" in str(file) and not file.exists()  # a robot of a package
    found: Any = str(file) if named else opened(file)
    if isinstance(found, Jacobians):
        _refuse_of_matrix(robot, q, columns)
        prepare_file(out, inputs=[found.path])
        tolerance = _TOLERANCE if relative_tolerance is None else relative_tolerance
        return _of_jacobians(found, failing, tolerance, out)
    if relative_tolerance is not None:
        allowed = "none of a robot, only of a Jacobian"
        raise InputError("--relative-tolerance", relative_tolerance, allowed)
    stated = q.stated if isinstance(q, InDegrees) else q
    prepare_file(out, inputs=[file, Path(stated or file)])
    return _of_robot(found, robot, failing, q, columns, out)


def _refuse_of_matrix(
    robot: FieldsOfTask, q: str | InDegrees | None, columns: list[str] | None
) -> None:
    """Raise InputError if an option is given that only a robot has."""
    for name, value in {**robot, "q": q, "columns": columns}.items():
        if value is not None:
            raise InputError(f"--{name}", "given", "none of a Jacobian, only of a robot")


def _of_jacobians(
    found: Jacobians, failing: Failures, tolerance: float, out: Path | None
) -> Answer:
    """Measure each Jacobian of a file."""
    rows = [
        {"name": name, **jacobian_values(matrix, failing, tolerance)}
        for name, matrix in found.named
    ]
    values = rows if len(rows) > 1 else rows[0]
    return Answer(values, "\n\n".join(map(as_text, rows)), out)


def _of_robot(
    source: Any,
    fields: Mapping[str, Any],
    failing: Failures,
    q: str | InDegrees | None,
    columns: list[str] | None,
    out: Path | None,
) -> Answer:
    """Measure a robot, made from a source and the fields that the user gave, at q."""
    from lockedjoint.commands.robot_text import chosen_of_robot, robot_text
    from lockedjoint.robots.robot_assessment import measure_robot, measure_robot_unequal

    robot, point, notes = robot_at(source, fields, q)
    columns = chosen_of_robot(columns, robot.arm.task.directions)
    model = failing.model(robot.chain.names)
    assessment = measure_robot(robot.arm, point, failing.failures, notes)
    # The unit is one that `--q FILE` reads.
    plain = {"model": assessment.robot, **asdict(assessment), "angles": "rad"}
    where = "midway between the limits" if q is None else "as given"
    text = robot_text(assessment, {}, where, columns)
    if model is not None:
        known = failing.probabilities_known
        unequal = measure_robot_unequal(robot.arm, assessment.jacobian, model, known)
        plain |= unequal
        text += f"\n\n{as_text(unequal)}"
    return Answer(plain, text, out, assessment.notes)


def jacobian_values(
    jacobian: FloatArray, failing: Failures, tolerance: float = _TOLERANCE
) -> dict[str, Any]:
    """Return what `measure` shows of a Jacobian, shape (m, n), by name."""
    from lockedjoint.formulations.bounds.certified import sharpest_worst_case_of
    from lockedjoint.formulations.bounds.unequal_failures import assess_failures
    from lockedjoint.formulations.measures.assessment import measure as measured

    assessment = measured(jacobian, failing.failures, tolerance)
    values = assessment.to_dict()
    if failing.failures > 1:
        limit = sharpest_worst_case_of(jacobian, failing.failures)
        values |= {
            "sharpest_bound": limit.value,
            "sharpest_bound_kind": limit.kind,
            "gap_to_sharpest_percent": limit.gap_percent(assessment.worst_case_sigma),
        }
    if model := failing.model([""] * jacobian.shape[1]):
        known = failing.probabilities_known
        values |= assess_failures(jacobian, model, probabilities_known=known)
    return values
