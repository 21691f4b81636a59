"""Arms whose descriptions ship in Python packages: what the survey is of."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from formulations.robots.chain_between import chain_between
from formulations.robots.read_urdf import read_urdf
from formulations.robots.robot_arm import RobotArm, Task
from nlp.errors import InputError

_DATA = "cmeel.prefix/share/example-robot-data/robots"
_TOOLBOX = "rtbdata/xacro"
_FOLDERS = {"example-robot-data": _DATA, "rtb-data": _TOOLBOX}


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
        Directions that count, as `Task.parse` reads them.
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


_IIWA = "kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf"
_PANDA = "panda_description/urdf/panda.urdf"
_TALOS = "talos_data/robots/talos_full_v2.urdf"
_KINOVA = "kinova_description/robots/kinova.urdf"

ARMS: tuple[SurveyArm, ...] = (
    SurveyArm("Franka Panda", _PANDA, "panda_hand"),
    SurveyArm("KUKA LBR iiwa 14", _IIWA, "tool0", package="rtb-data"),
    SurveyArm("UFactory xArm7", "xarm_description/urdf/xarm7.urdf", "link_eef"),
    SurveyArm("Baxter, left arm", "baxter_description/urdf/baxter.urdf", "left_gripper"),
    SurveyArm("Centauro, torso and arm", "centauro_description/urdf/centauro.urdf", "arm1_8"),
    SurveyArm("TIAGo, torso and arm", "tiago_description/robots/tiago.urdf", "arm_tool_link"),
    SurveyArm(
        "TIAGo Pro, torso and left arm",
        "tiago_pro_description/robots/tiago_pro.urdf",
        "gripper_left_base_link",
    ),
    SurveyArm(
        "PR2, torso and right arm", "pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame"
    ),
    SurveyArm("Romeo, trunk and left arm", "romeo_description/urdf/romeo.urdf", "l_gripper"),
    SurveyArm("Talos, torso and left arm", _TALOS, "gripper_left_base_link"),
    SurveyArm("iCub, torso and left arm", "icub_description/robots/icub.urdf", "l_gripper"),
    SurveyArm(
        "Unitree G1, waist and left arm",
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        "left_rubber_hand",
    ),
    SurveyArm("UR3", "ur_description/urdf/ur3_robot.urdf", "tool0", "position"),
    SurveyArm("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", "position"),
    SurveyArm("UR10", "ur_description/urdf/ur10_robot.urdf", "tool0", "position"),
    SurveyArm("Kinova Jaco 2, 6 joints", _KINOVA, "j2s6s200_end_effector", "position"),
    SurveyArm("Franka Panda", _PANDA, "panda_hand", "position"),
    SurveyArm("KUKA LBR iiwa 14", _IIWA, "tool0", "position", "rtb-data"),
)
