"""Measure how failure tolerant something is: a Jacobian, or a robot at a configuration.

`measure` only finds out which of the two it was given: `formulations.measures.assessment`
measures Jacobians, and `robot_assessment` measures robots.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy.typing as npt

from lockedjoint.formulations.io.files import read_bytes
from lockedjoint.formulations.measures import assessment
from lockedjoint.formulations.measures.assessment import Assessment
from lockedjoint.formulations.measures.read_jacobians import (
    Named,
    is_jacobian_file,
    jacobians_in,
    numbered,
    the_only,
    with_number,
)
from lockedjoint.kinematics.description import Description
from lockedjoint.kinematics.read_robot import is_model, tree_of_text
from lockedjoint.nlp.errors import InputError
from lockedjoint.robot import Robot, is_part
from lockedjoint.robots.robot_assessment import RobotAssessment, measure_robot

# Comment that makes a table in CSV one of a robot: "# convention: …".
_CONVENTION = re.compile(rb"^# *convention *:", re.MULTILINE | re.IGNORECASE)
# Columns of every table of a robot, without their units.
_DH_COLUMNS = {b"a", b"d", b"alpha", b"theta"}


@overload
def measure(
    source: Robot, q: Any = None, *, failures: int = 1, tolerance: float = 1e-6
) -> RobotAssessment: ...
@overload
def measure(
    source: npt.ArrayLike, q: None = None, *, failures: int = 1, tolerance: float = 1e-6
) -> Assessment: ...
@overload
def measure(
    source: object, q: Any = None, *, failures: int = 1, tolerance: float = 1e-6
) -> Assessment | RobotAssessment: ...
def measure(
    source: object, q: Any = None, *, failures: int = 1, tolerance: float = 1e-6
) -> Assessment | RobotAssessment:
    """Measure how failure tolerant a Jacobian is, or a robot at a configuration.

    Parameters
    ----------
    source
        A Jacobian, shape (m, n) with n > m, or the file of one; or a `Robot`, or what makes
        one.
    q
        The configuration of a robot, see `Robot.configuration`; by default midway between the
        limits.
    failures
        How many joints lock at once, fewer than all.
    tolerance
        Relative tolerance of the verdict that a Jacobian is optimally failure tolerant.

    Returns
    -------
    Assessment or RobotAssessment
        What each failure leaves, the worst case σ and its bound, of a Jacobian or of a robot.

    Raises
    ------
    InputError
        If it is neither, joints are missing in `q` or outside their limits, or so many joints
        cannot lock.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.measure([[1, 0, 1], [0, 1, 1]]).worst_case_joints
    [0, 1]
    """
    jacobian: Any = source
    if isinstance(source, str | os.PathLike):
        source = opened(Path(source))
    if isinstance(source, Jacobians):
        jacobian = source.only()[1]
    elif isinstance(source, Robot | Description) or is_model(source) or is_part(source):
        robot = Robot.of(source)
        point, notes = robot.configuration(q)
        return measure_robot(robot.arm, point, failures, notes)
    if q is not None:
        raise InputError("q", q, "none of a Jacobian, which is of one configuration")
    return assessment.measure(jacobian, failures, tolerance)


@dataclass(frozen=True)
class Jacobians:
    """The Jacobians of a file, each with its name."""

    path: Path  #: The file.
    named: list[Named]  #: Pairs of a name and a Jacobian, shape (m, n).

    def only(self) -> Named:
        """Return the only one; InputError if there are several."""
        return the_only(self.named, self.path)


def opened(path: Path) -> Jacobians | Description:
    """Read a file once: Jacobians, or the description of a robot.

    A ``.csv`` file is a Denavit–Hartenberg table if a comment states its convention, or if its
    columns are those of one. A table without a convention is refused.
    """
    if not is_jacobian_file(path):
        return Description.read(path)
    path, number = with_number(path)
    content = read_bytes(path)
    if path.suffix.lower() == ".csv" and _is_dh_table(content):
        return Description(tree_of_text(path, content), path, content)
    return Jacobians(path, numbered(jacobians_in(path, content), path, number))


def _is_dh_table(content: bytes) -> bool:
    """Whether a file in CSV is a table of a robot, by its comments or its columns' names."""
    if _CONVENTION.search(content):
        return True
    lines = (line.strip() for line in content.lower().splitlines())
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    columns = {cell.strip().partition(b"_")[0] for cell in first.split(b",")}
    return columns >= _DH_COLUMNS
