"""The best postures of arms that exist, side by side.

A posture is a configuration of the joints; the best has the largest worst-case σ, the smallest
singular value of J after the worst joint locks. What comes in: the arms of `survey`. What goes
out: ``robots.csv``, a `RobotRow` for each arm, and ``postures.json``, all that is known of each
posture. To add an arm, add a line to ``survey.csv``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.robots.posture import Posture, best_posture
from lockedjoint.robots.robot_assessment import best_7r
from lockedjoint.robots.search import Search
from results.robots.survey import ARMS, SurveyArm
from results.script import main, study_of


@dataclass(frozen=True)
class RobotRow:
    """One arm: the columns of ``robots.csv``; NaN where a column does not apply.

    All σ are in units of the default characteristic length ℓ, in metres. The worst case is
    eq. (5) at the best posture found, and `worst_case_joint` one of those whose failure it is.
    The bound (6) is at the same ‖J‖_F. Arms of more joints may pass the best that seven
    revolute joints are known to reach in six dimensions. Joints whose failure is fatal at every
    posture are `structural`, and no search is made; `structural_ratio` is what the worst of
    them, or of those that are nearly so, leaves, as a share of σ before it. `q` is
    in radians and metres by joint.
    """

    arm: str
    package: str = field(metadata=HIDDEN)
    file: str = field(metadata=HIDDEN)
    base: str = field(metadata=HIDDEN)
    tip: str = field(metadata=HIDDEN)
    task: str
    joints: int
    prismatic: int = field(metadata=HIDDEN)
    task_dimension: int = field(metadata=HIDDEN)
    characteristic_length: float = field(metadata=column("ℓ (m)", ".3f"))
    worst_case_sigma: float = field(metadata=column("worst-case σ", ".5f"))
    worst_case_joint: str = field(metadata=column("worst failure", lambda row: _worst(row)))
    equally_bad: int = field(metadata=column("as bad"))
    sigma_bound: float = field(metadata=HIDDEN)
    percent_of_bound: float = field(metadata=column("% of the bound", ".2f"))
    percent_of_best_7r: float = field(metadata=column("% of the best 7R", ".2f"))
    mid_range_sigma: float = field(metadata=column("σ at mid-range", ".5f"))
    structural: str = field(metadata=HIDDEN)
    near_structural: str = field(metadata=HIDDEN)
    structural_ratio: float = field(metadata=HIDDEN)
    at_limits: str = field(metadata=column("at a limit", empty="–"))
    starts: int
    reached_best: int
    status_counts: Mapping[str, int] = field(metadata=HIDDEN)
    q: Mapping[str, float] = field(metadata=HIDDEN)


def compute(effort: Effort, folder: Path) -> Iterator[RobotRow]:
    """Yield a row for each arm of the survey, and write the postures."""
    search = Search(
        starts=effort.starts, seed=effort.seed, workers=effort.workers, progress=effort.bars
    )
    arms = [robot.arm() for robot in ARMS]  # a missing package is better known at once
    entries = []
    for robot, arm in zip(ARMS, arms, strict=True):
        effort.progress(f"{robot.name}, {robot.task}")
        posture = best_posture(arm, search)
        entries.append({"arm": robot.name, "variant": robot.task, **posture.to_dict()})
        write_json(folder / "postures.json", entries)
        yield row_of(robot, posture)
        if not posture.complete:
            raise KeyboardInterrupt


def row_of(robot: SurveyArm, posture: Posture) -> RobotRow:
    """Return an arm and its best posture as a row."""
    arm, at, nan = robot.arm(), posture.assessment, float("nan")
    m, n = arm.shape

    def structural(kind: str) -> str:
        return ", ".join(each.joint for each in at.structural if each.kind == kind)

    return row_from(
        RobotRow,
        robot,
        at,
        posture,
        arm=robot.name,
        joints=n,
        prismatic=sum(arm.chain.prismatic),
        task_dimension=m,
        worst_case_joint=at.worst_case_joints[0],
        percent_of_best_7r=100 * at.worst_case_sigma / best_7r() if m == 6 else nan,
        structural=structural("structural"),
        near_structural=structural("near-structural"),
        structural_ratio=min((each.ratio for each in at.structural), default=nan),
        at_limits=", ".join(at.at_limits),
        status_counts=dict(posture.status_counts),
    )


def _worst(row: RobotRow) -> str:
    """Return the words of the table for the worst failure of an arm."""
    if row.structural:
        return f"{row.structural}: structural"
    if row.near_structural:
        return f"{row.near_structural}: near-structural"
    return row.worst_case_joint


STUDY = study_of(
    __file__,
    compute,
    RobotRow,
    title="the best postures of arms that exist",
    takes="under a minute, and packages of robots",
    long=True,
    settings={"best_7r": best_7r()},
)

if __name__ == "__main__":
    main(STUDY, __file__)
