"""Trajectories that survive failures, on paths of arms that exist.

A path is a line of tool poses through waypoints, at samples in time. The joints have more
freedom than the tool needs, so many trajectories follow the path; one is sought along which any
joint may lock at any sample, and the others can finish the path. The share is the percentage of
pairs (joint, sample) for which they can.

``declared.csv`` declares the paths, a `StudyPath` each: a line there adds a path. Out come
``paths.csv``, a `PathRow` each; ``trajectories.json``, a list of dicts with keys ``arm``,
``path``, ``times`` (one for each sample), ``configurations`` (for each sample the
positions of the joints, radians or metres) and ``survivors`` (the number of joints at each
sample that may lock there); and ``path.svg``, which shows the first path.
"""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.figures.robots import draw_path
from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.io.table import HIDDEN, column, read_rows, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.plan import PathPlan
from lockedjoint.paths.search import check_reach, plan_path
from lockedjoint.paths.waypoints import ToolPath
from results.robots.survey import ARMS, SurveyArm
from results.script import main, save, study_of

# The number of decimals of the positions that are stored, radians or metres.
_DECIMALS = 7
# Each path is searched with so many seeds: more of them show better how much the search depends
# on chance, and take longer.
_SEEDS = 3


@dataclass(frozen=True)
class StudyPath:
    """A path of the study, of the first arm of this name in the survey.

    Attributes
    ----------
    home
        A configuration as JSON; midway between the limits if empty.
    waypoints
        As JSON: how far each is from the tool's pose at home, along and about the base's
        axes, three numbers in metres and three in radians; the latter are zero if left out.
    """

    arm: str
    path: str
    home: str
    waypoints: str

    @property
    def robot(self) -> SurveyArm:
        """The arm in the survey."""
        return next(arm for arm in ARMS if arm.name == self.arm)

    def stated(self) -> tuple[RobotArm, ToolPath]:
        """Return the arm and the path; poses for an arm of six task directions."""
        arm = self.robot.arm()
        home = np.array(json.loads(self.home)) if self.home else arm.chain.mid_range
        origin, rotation = arm.chain.tip_at(home[:, None])
        offsets = np.array([(*place, 0, 0, 0)[:6] for place in json.loads(self.waypoints)])
        positions = origin[:, 0] + offsets[:, :3]
        if arm.shape[0] == 3:
            return arm, ToolPath(positions)
        home_rotation = Rotation.from_matrix(rotation[..., 0])
        rotations = Rotation.from_euler("xyz", offsets[:, 3:]) * home_rotation
        return arm, ToolPath(positions, rotations.as_quat())


#: The paths of the study.
PATHS = tuple(read_rows(Path(__file__).with_name("declared.csv"), StudyPath))


@dataclass(frozen=True)
class PathRow:
    """One path of one arm: the columns of ``paths.csv``.

    A percentage is of the pairs of joint and sample after whose failure the path can be
    finished: of the minimum-norm trajectory, NaN if that does not complete the path, of the
    one found, and the best of samples. The `spread` is the largest percentage that several
    seeds find less the smallest. The least worst-case σ is along
    the first two. No trajectory survives the failure of an `unrecoverable` joint at the start,
    as its ranges along the path do not meet. The polish counts where it raised the share, or
    smoothed the trajectory at the same share. The largest speed is a share of its limit, the
    `deviation` the largest distance from the path between samples, in metres. `nodes` are
    configurations tested.
    """

    arm: str
    package: str = field(metadata=HIDDEN)
    path: str
    joints: int
    task_dimension: int = field(metadata=column("m"))
    minimum_norm_percent: float = field(metadata=column("minimum norm %", ".1f"))
    percent: float = field(metadata=column("planned %", ".1f"))
    spread: float = field(metadata=column("spread of 3 seeds", ".1f"))
    best_of_samples_percent: float = field(metadata=column("best of samples %", ".1f"))
    minimum_norm_sigma: float = field(metadata=column("least σ, minimum norm", ".4f"))
    least_sigma: float = field(metadata=column("least σ, planned", ".4f"))
    unrecoverable: str = field(metadata=column("no recovery at the start", empty="–"))
    polished: str
    largest_speed: float = field(metadata=HIDDEN)
    deviation: float = field(metadata=HIDDEN)
    nodes: int = field(metadata=HIDDEN)
    cpu_seconds: float = field(metadata=column("CPU (s)", ".0f"))


def compute(effort: Effort, folder: Path) -> Iterator[PathRow]:
    """Yield a row for each path; draw the first trajectory, and write them all."""
    stated = [declared.stated() for declared in PATHS]
    for arm, path in stated:  # a waypoint out of reach is better known before all others
        check_reach(arm, path)
    entries: list[dict[str, object]] = []
    for declared, (arm, path) in zip(PATHS, stated, strict=True):
        effort.progress(f"{declared.arm}, {declared.path}")
        search = PathSearch(tracks=effort.starts or PathSearch.tracks, seed=effort.seed)
        started = time.process_time()
        plan = plan_path(arm, path, search)
        cpu = time.process_time() - started
        others = [replace(search, seed=effort.seed + k) for k in range(1, _SEEDS)]
        shares = [plan_path(arm, path, other).planned.share for other in others]
        if not entries:
            save(draw_path(plan), folder / "path.svg")
        stored = {
            "arm": declared.arm,
            "path": declared.path,
            "times": np.round(plan.times, _DECIMALS).tolist(),
            "configurations": np.round(plan.planned.configurations, _DECIMALS).tolist(),
            "survivors": plan.planned.survives.sum(axis=1).tolist(),
        }
        entries.append(stored)
        write_json(folder / "trajectories.json", entries)
        yield row_of(declared, arm, plan, shares, cpu)


def row_of(
    declared: StudyPath, arm: RobotArm, plan: PathPlan, others: Sequence[float], cpu: float
) -> PathRow:
    """Return the plan for a path as a row.

    `others` are the shares, in percent, that other seeds found; `cpu` is in seconds.
    """
    base, planned, nan = plan.minimum_norm, plan.planned, float("nan")
    shares = (planned.share, *others)
    ends = zip(plan.joints, plan.unrecoverable_until, strict=True)
    return row_from(
        PathRow,
        declared,
        plan,
        package=declared.robot.package,
        joints=arm.size,
        task_dimension=arm.shape[0],
        minimum_norm_percent=nan if base is None else base.share,
        percent=planned.share,
        spread=max(shares) - min(shares),
        best_of_samples_percent=plan.best_of_samples,
        minimum_norm_sigma=nan if base is None else float(base.sigma.min()),
        least_sigma=float(planned.sigma.min()),
        unrecoverable=", ".join(name for name, last in ends if last >= 0),
        polished="yes" if plan.polished else "no",
        largest_speed=nan if plan.speed is None else plan.speed,
        cpu_seconds=round(cpu, 1),
    )


STUDY = study_of(
    __file__,
    compute,
    PathRow,
    title="trajectories along which joints may lock",
    takes="three minutes, and packages of robots",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
