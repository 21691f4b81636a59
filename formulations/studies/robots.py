"""The best postures of arms that exist, side by side, as a study."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from formulations.io.table import HIDDEN, column, read_rows
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.read_robot import read_robot
from formulations.robots.posture import Posture, best_posture
from formulations.robots.posture_search import Search
from formulations.robots.robot_arm import RobotArm
from formulations.robots.robot_assessment import best_7r
from formulations.robots.task import TaskSpace
from formulations.studies.study import Effort, Part, Study
from nlp.errors import InputError, MissingLibraryError

STARTS = 200
# Where each distribution of robots keeps them.
_FOLDERS = {
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
    "rtb-data": "rtbdata/xacro",
    # Without the libraries that it needs to run: pip install --no-deps robosuite
    "robosuite": "robosuite/models/assets/robots",
}


@dataclass(frozen=True)
class SurveyArm:
    """An arm of the survey.

    Attributes
    ----------
    name
        The robot and the part of it that is meant.
    file
        Its URDF or MJCF, within the package's folder of robots.
    tip
        The link that the Jacobian is of.
    task
        TaskSpace directions, as `TaskSpace.parse` reads them.
    package
        The distribution that it comes in.
    base
        The link that it is relative to; empty for the robot's root.
    """

    name: str
    file: str
    tip: str
    task: str = "all"
    package: str = "example-robot-data"
    base: str = ""

    @property
    def path(self) -> Path:
        """Where the file is; MissingLibraryError if the package is not installed."""
        try:
            found = distribution(self.package).locate_file(_FOLDERS[self.package])
        except PackageNotFoundError:
            package = "--no-deps robosuite" if self.package == "robosuite" else ""
            raise MissingLibraryError(self.package, package) from None
        return Path(str(found)) / self.file

    def arm(self) -> RobotArm:
        """Return the arm at the default characteristic length."""
        chain = chain_between(read_robot(self.path), self.tip, self.base or None)
        return RobotArm(chain, TaskSpace.parse(self.task))


#: The arms of the survey, those in six dimensions first.
ARMS = tuple(read_rows(Path(__file__).with_suffix(".csv"), SurveyArm))


@dataclass(frozen=True)
class RobotRow:
    """One arm: the columns of ``robots.csv``; NaN where a column does not apply.

    Attributes
    ----------
    arm, package, file, base, tip, task
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
    structural, near_structural
        Joints whose failure is fatal at every posture, or nearly so. Where there are any of the
        first kind no search is made.
    structural_ratio
        What the worst of them leaves, as a share of σ before it; NaN if there is none.
    at_limits
        Joints at a limit.
    starts, reached_best, status_counts
        Of the search.
    configuration
        The posture, radians and metres by joint.
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
    configuration: Mapping[str, float] = field(metadata=HIDDEN)


def study(only: str | None = None) -> Study:
    """Return the study of the arms, or of those with a text in their name.

    Raises
    ------
    InputError
        If no name has it.
    """
    arms = [one for one in ARMS if only is None or only.lower() in one.name.lower()]
    if not arms:
        names = ", ".join(dict.fromkeys(one.name for one in ARMS))
        raise InputError("--only", only, f"part of one of {names}")

    def compute(effort: Effort, _: Path) -> Iterator[Part]:
        search = Search(
            starts=effort.starts or STARTS,
            seed=effort.seed,
            workers=effort.workers,
            progress=effort.bars,
        )
        for one in arms:
            effort.progress(f"{one.name}, {one.task}")
            posture = best_posture(one.arm(), search)
            row = row_of(one, posture)
            entry = {"arm": one.name, "variant": one.task, **posture.to_dict()}
            yield Part(rows=[row], entries=[entry], complete=posture.complete)

    return Study(
        name="robots",
        title="the best postures of arms that exist",
        page="robots.md",
        template="robots.md.j2",
        tables={"robots": RobotRow},
        command="lockedjoint robots --out results/robots",
        takes="up to a quarter of an hour, and packages of robots",
        compute=compute,
        long=True,
        entries="postures.json",
        settings={"best_7r": best_7r()},
        # A missing package is better known at once than after an hour.
        check=lambda: [one.arm() for one in arms],
    )


def row_of(one: SurveyArm, found: Posture) -> RobotRow:
    """Return an arm and its best posture as a row."""
    arm = one.arm()
    m, n = arm.shape
    nan = float("nan")
    at = found.assessment
    kinds = {
        kind: ", ".join(each.joint for each in at.structural if each.kind == kind)
        for kind in ("structural", "near-structural")
    }
    return RobotRow(
        arm=one.name,
        package=one.package,
        file=one.file,
        base=one.base,
        tip=one.tip,
        task=one.task,
        joints=n,
        prismatic=sum(arm.chain.prismatic),
        task_dimension=m,
        characteristic_length=at.characteristic_length,
        worst_case_sigma=at.worst_case_sigma,
        worst_case_joint=at.worst_case_joints[0],
        equally_bad=at.equally_bad,
        sigma_bound=at.sigma_bound,
        percent_of_bound=at.percent_of_bound,
        percent_of_best_7r=100 * at.worst_case_sigma / best_7r() if m == 6 else nan,
        mid_range_sigma=found.mid_range_sigma,
        structural=kinds["structural"],
        near_structural=kinds["near-structural"],
        structural_ratio=min((each.ratio for each in at.structural), default=nan),
        at_limits=", ".join(at.at_limits),
        starts=found.starts,
        reached_best=found.reached_best,
        status_counts=dict(found.status_counts),
        configuration=dict(at.configuration),
    )


def _worst(row: RobotRow) -> str:
    if row.structural:
        return f"{row.structural}: structural"
    if row.near_structural:
        return f"{row.near_structural}: near-structural"
    return row.worst_case_joint
