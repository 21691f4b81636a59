"""Arms whose descriptions ship in Python packages, and the list of those surveyed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from formulations.files.table import read_rows
from formulations.robots.chain_between import chain_between
from formulations.robots.read_urdf import read_urdf
from formulations.robots.robot_arm import RobotArm, Task
from nlp.errors import InputError

# Where each distribution keeps its robots.
_FOLDERS = {
    "example-robot-data": "cmeel.prefix/share/example-robot-data/robots",
    "rtb-data": "rtbdata/xacro",
}


@dataclass(frozen=True)
class SurveyArm:
    """An arm of the survey.

    Attributes
    ----------
    name
        The robot and the part of it that is meant.
    file
        Its URDF, within the package's folder of robots.
    tip
        The link that the Jacobian is of; the chain starts at the robot's root.
    task
        Task directions, as `Task.parse` reads them.
    package
        The distribution that it comes in.
    """

    name: str
    file: str
    tip: str
    task: str = "all"
    package: str = "example-robot-data"

    @property
    def path(self) -> Path:
        """Where the URDF is; InputError if the package is not installed."""
        try:
            found = distribution(self.package).locate_file(_FOLDERS[self.package])
        except PackageNotFoundError:
            allowed = f"an installed one, which 'pip install {self.package}' provides"
            raise InputError("package", f"{self.package}, not there", allowed) from None
        return Path(str(found)) / self.file

    def arm(self) -> RobotArm:
        """Return the arm at the default characteristic length."""
        chain = chain_between(read_urdf(self.path), self.tip)
        return RobotArm(chain, Task.parse(self.task))


#: The arms of the survey, those in six dimensions first.
ARMS = tuple(read_rows(Path(__file__).with_suffix(".csv"), SurveyArm))
