"""Arms side by side: the best posture of each, and how much of what is possible it is."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from formulations.robots.posture import (
    FatalFailureError,
    Posture,
    Search,
    best_posture,
    fatal_failures,
)
from formulations.robots.robot_arm import RobotArm
from formulations.robots.robot_assessment import best_7r
from formulations.studies.robots.survey_arms import SurveyArm


@dataclass(frozen=True)
class SurveyRow:
    """The columns of ``robots.csv``; NaN where a column does not apply.

    Attributes
    ----------
    arm, package, file, tip, task
        What was searched; see `SurveyArm`.
    joints, prismatic, task_dimension
        n, how many of them are prismatic, and m.
    characteristic_length
        ℓ at the posture, in metres: the default one, see `robot_arm`.
    worst_case_sigma, worst_case_joint, equally_bad
        Eq. (5) at the best posture found, in units of ℓ; a joint whose failure it is, and
        the number of joints of which that is true.
    sigma_bound, percent_of_bound
        The bound (6) at the same ‖J‖_F.
    percent_of_best_7r
        Of the best that seven revolute joints are known to reach in six dimensions, `best_7r`,
        both in units of ℓ; arms with more joints may pass it. NaN in other dimensions.
    mid_range_sigma
        Worst case midway between the limits.
    fatal_failures
        Joints whose failure is fatal at every posture tried; no search is made then.
    at_limits
        Joints at a limit.
    starts, reached_best, status_counts
        Of the search.
    configuration
        The posture, radians and metres by joint, as JSON.
    """

    arm: str
    package: str
    file: str
    tip: str
    task: str
    joints: int
    prismatic: int
    task_dimension: int
    characteristic_length: float
    worst_case_sigma: float
    worst_case_joint: str
    equally_bad: int
    sigma_bound: float
    percent_of_bound: float
    percent_of_best_7r: float
    mid_range_sigma: float
    fatal_failures: str
    at_limits: str
    starts: int
    reached_best: int
    status_counts: str
    configuration: str

    def to_dict(self) -> dict[str, object]:
        """Return the columns as plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Surveyed:
    """A row, and the posture that it shows; None where a failure is fatal."""

    row: SurveyRow
    posture: Posture | None


def survey(one: SurveyArm, search: Search) -> Surveyed:
    """Search for the best posture of an arm; KeyboardInterrupt if no start ended."""
    arm = one.arm()
    try:
        found = best_posture(arm, search)
    except FatalFailureError:
        return Surveyed(_row(one, arm, None), None)
    return Surveyed(_row(one, arm, found), found)


def _row(one: SurveyArm, arm: RobotArm, found: Posture | None) -> SurveyRow:
    m, n = arm.shape
    nan = float("nan")
    at = None if found is None else found.assessment
    fatal = fatal_failures(arm) if found is None else ()
    return SurveyRow(
        arm=one.name,
        package=one.package,
        file=one.file,
        tip=one.tip,
        task=one.task,
        joints=n,
        prismatic=sum(arm.chain.prismatic),
        task_dimension=m,
        characteristic_length=at.characteristic_length if at else nan,
        worst_case_sigma=at.worst_case_sigma if at else 0.0,
        worst_case_joint=at.worst_case_joints[0] if at else fatal[0],
        equally_bad=at.equally_bad if at else len(fatal),
        sigma_bound=at.sigma_bound if at else nan,
        percent_of_bound=at.percent_of_bound if at else 0.0,
        percent_of_best_7r=_percent_of_best_7r(m, at.worst_case_sigma if at else 0.0),
        mid_range_sigma=found.mid_range_sigma if found else 0.0,
        fatal_failures=", ".join(fatal),
        at_limits=", ".join(at.at_limits) if at else "",
        starts=found.starts if found else 0,
        reached_best=found.reached_best if found else 0,
        status_counts=json.dumps(dict(found.status_counts) if found else {}),
        configuration=json.dumps(at.configuration if at else {}),
    )


def _percent_of_best_7r(task_dimension: int, sigma: float) -> float:
    return 100 * sigma / best_7r() if task_dimension == 6 else float("nan")
