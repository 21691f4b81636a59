"""The arms of the survey: robots that ship in Python packages.

A line of ``survey.csv`` is a `SurveyArm`; its columns are the fields below. Other studies use
these arms, too. A new package of robots needs a line in `_FOLDERS`.
"""

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from lockedjoint.formulations.io.table import read_rows
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import MissingLibraryError

# Where each distribution of robots keeps them.
_FOLDERS = {
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
    "rtb-data": "rtbdata/xacro",
    # Without the libraries that it needs to run: pip install --no-deps robosuite
    "robosuite": "robosuite/models/assets/robots",
}


@dataclass(frozen=True)
class SurveyArm:
    """An arm of the survey: a chain of a robot that comes in a package."""

    name: str
    file: str  # URDF or MJCF, within the package's folder of robots
    tip: str
    task: str = "all"  # as `TaskSpace.parse` reads it
    package: str = "example-robot-data"
    base: str = ""  # the robot's root where it is empty

    @property
    def path(self) -> Path:
        """Where the file is; MissingLibraryError if the package is not installed."""
        try:
            folder = distribution(self.package).locate_file(_FOLDERS[self.package])
        except PackageNotFoundError:
            package = "--no-deps robosuite" if self.package == "robosuite" else ""
            raise MissingLibraryError(self.package, package) from None
        return Path(str(folder)) / self.file

    def arm(self) -> RobotArm:
        """Return the arm at the default characteristic length."""
        chain = chain_between(read_robot(self.path), self.tip, self.base or None)
        return RobotArm(chain, TaskSpace.parse(self.task))


#: The arms of the survey, those in six dimensions first.
ARMS = tuple(read_rows(Path(__file__).with_name("survey.csv"), SurveyArm))
