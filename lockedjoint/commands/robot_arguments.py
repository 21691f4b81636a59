"""Options that name a robot, its tool and its configuration, and what is read from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lockedjoint.commands.arguments import argument, option, separated
from lockedjoint.formulations.io.files import load_json, read_bytes, real_in
from lockedjoint.nlp.errors import FileError, InputError

if TYPE_CHECKING:
    from lockedjoint.clearance.link_clearance import LinkClearance
    from lockedjoint.kinematics.chain import Chain
    from lockedjoint.kinematics.serial_arm import Ranges, SerialArm
    from lockedjoint.kinematics.tree import RobotTree
    from lockedjoint.nlp.arrays import FloatArray
    from lockedjoint.robots.pose_constrained_arm import Pose
    from lockedjoint.robots.robot_arm import RobotArm

Configuration = Annotated[
    str | None,
    option(
        "Q",
        "Radians or metres: one number per joint from base to tip, or JOINT=VALUE pairs, "
        "with commas; or a JSON file, such as posture writes; by default midway between the "
        "limits.",
        ...,
    ),
]
# Metres that links keep from obstacles unless told otherwise.
_LEAST = 0.005
_ALLOWED = "one number per joint, JOINT=VALUE pairs (both with commas), or a JSON file"


@dataclass(frozen=True)
class LinkOptions:
    """Which robot, and which of its links."""

    file: Annotated[
        Path,
        argument(
            "ROBOT",
            "The robot: a URDF file, an MJCF file, a Denavit–Hartenberg table (.csv), or "
            "robot_descriptions:NAME, a robot of the package robot_descriptions.",
        ),
    ]
    tip: str | None = option(
        "LINK",
        "Link whose motion the Jacobian is of, anywhere on the robot; by default the last"
        " link, if there is only one.",
    )
    base: str | None = option(
        "LINK",
        "Link that the motion is relative to, also the other hand of a robot with two arms;"
        " by default the root.",
    )
    point: str | None = option(
        "X,Y,Z",
        "Point of the tip's link whose velocity is taken, in its frame, in metres; by "
        "default its origin.",
    )

    def __post_init__(self) -> None:
        from lockedjoint.kinematics.read_robot import robot_file

        object.__setattr__(self, "file", robot_file(self.file))

    def offset(self) -> list[float]:
        """Return the tip's point, in its link's frame; InputError if it is none."""
        offset = numbers("--point", self.point or "0,0,0")
        if len(offset) != 3:
            raise InputError("--point", self.point, "three numbers X,Y,Z, in metres")
        return offset

    def read(self) -> tuple[RobotTree, str]:
        """Read the robot and the name of its tip; InputError if anything is wrong with it."""
        from lockedjoint.kinematics.read_robot import read_robot

        tree = read_robot(self.file)
        return tree, tree.last_link("--tip") if self.tip is None else self.tip


@dataclass(frozen=True)
class ChainOptions(LinkOptions):
    """Which robot, between which of its links, and which joints have locked."""

    held: list[str] | None = option(
        "JOINT=VALUE",
        "A joint that has locked already, and where, in radians or metres; it has no"
        " column in the Jacobian. May be repeated.",
    )

    def chain(self, locked: Mapping[str, float] | None = None) -> Chain:
        """Read the robot and return its chain; InputError if anything is wrong with it.

        More joints may have locked, by name and position.
        """
        from lockedjoint.kinematics.chain_between import chain_between

        offset, (tree, tip) = self.offset(), self.read()
        held = pairs(self.held or [], "--held", [joint.name for joint in tree.joints])
        return chain_between(tree, tip, self.base, held | dict(locked or {}), offset)


@dataclass(frozen=True)
class ArmOptions(ChainOptions):
    """Which robot, and which directions of its tip count."""

    length: float | None = option(
        "METRES",
        "Characteristic length: all lengths are measured in it; by default the root mean "
        "square of the revolute joints' lever arms.",
        positive=True,
    )
    task: str = option(
        "DIRECTIONS",
        "Task directions: all, position, orientation, or some of vx,vy,vz,wx,wy,wz.",
        "all",
    )
    frame: str = option("FRAME", "Whose axes the directions are along: base or tip.", "base")

    def arm(self) -> RobotArm:
        """Read the robot and return the arm; InputError if anything is wrong with it."""
        from lockedjoint.kinematics.task_space import TaskSpace
        from lockedjoint.robots.robot_arm import RobotArm

        directions = TaskSpace.parse(self.task, self.frame)
        return RobotArm(self.chain(), directions, self.length)


@dataclass(frozen=True)
class PoseOptions:
    """Where the tool is to be."""

    at: str | None = option(
        "POSE",
        "Where the tip's point is to be, in the base's frame: x,y,z in metres, and for "
        "an orientation too roll,pitch,yaw in radians or qx,qy,qz,qw; or a JSON file; "
        "by default anywhere.",
    )
    tolerance: str | None = option(
        "METRES[,RADIANS]", "How far the tip may be from --at; by default 0,0."
    )

    def pose(self) -> Pose | None:
        """Read the pose; InputError if it is not what is allowed."""
        if self.at is None:
            if self.tolerance is not None:
                raise InputError("--tolerance", self.tolerance, "none without --at")
            return None
        return read_near_pose(self.at, self.tolerance)


@dataclass(frozen=True)
class ClearanceOptions:
    """What links keep from each other and from obstacles."""

    clearance: float | None = option(
        "METRES",
        "Distance that the links keep from each other and from obstacles; by default they may "
        "touch, or with --obstacles 0.005. Needs coal, and reads the meshes that the URDF file "
        "names.",
        positive=True,
    )
    obstacles: Path | None = option(
        "FILE",
        "What stands around the robot: a URDF file with fixed joints, or a mesh; in the frame "
        "of the base, or of the root if the base is another arm's hand.",
    )
    obstacles_at: str | None = option(
        "POSE", "Pose of the file's own frame in that frame, written as for posture --at."
    )

    def read(self, robot: Path, chain: Chain) -> LinkClearance | None:
        """Read them; None if links may touch; InputError if anything is wrong."""
        if self.obstacles is None and self.obstacles_at is not None:
            raise InputError("--obstacles-at", self.obstacles_at, "none without --obstacles")
        if self.obstacles is None and self.clearance is None:
            return None
        import numpy as np
        from scipy.spatial.transform import Rotation

        from lockedjoint.clearance.read_clearance import Obstacles, read_clearance
        from lockedjoint.paths.waypoints import read_pose

        obstacles, pose = None, np.eye(4)
        if self.obstacles_at is not None:
            pose[:3, 3], quaternion = read_pose(self.obstacles_at)
            if quaternion is not None:
                pose[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
        if self.obstacles is not None:
            obstacles = Obstacles.read(self.obstacles, pose)
        return read_clearance(robot, chain, self.clearance or _LEAST, obstacles)


@dataclass(frozen=True)
class LimitOptions:
    """Narrower limits of joints."""

    limits: list[str] | None = option(
        "JOINT=LOWER:UPPER",
        "Artificial limits of a joint, radians or metres. May be repeated; by default "
        "the physical limits.",
    )

    def read(self, joints: Sequence[str] = ()) -> dict[str, tuple[float, float]]:
        """Read them, of some joints; InputError if one is something else or repeated."""
        return ranges(self.limits or (), "--limits", joints)


def chosen_limits(limits: LimitOptions, arm: SerialArm) -> Ranges:
    """Return the limits of all joints of an arm: those that are given, else the physical."""
    from lockedjoint.kinematics.chain import check_named

    ranges = {step.name: ends for step, ends in zip(arm.steps, arm.physical, strict=True)}
    given = limits.read(list(ranges))
    for name in given:
        check_named("--limits of joint", name, list(ranges))
    return tuple((ranges | given).values())


def ranges(
    settings: Sequence[str], name: str, joints: Sequence[str] = ()
) -> dict[str, tuple[float, float]]:
    """Read ``JOINT=LOWER:UPPER``; InputError if one is something else or repeated."""
    allowed = "JOINT=LOWER:UPPER, radians or metres"
    read = {}
    for joint, ends in _by_joint(settings, name, allowed, joints).items():
        lower, colon, upper = ends.partition(":")
        if not colon:
            raise InputError(name, f"{joint}={ends}", allowed)
        where = f"{name} of {joint}"
        read[joint] = number(where, lower), number(where, upper)
    return read


def read_near_pose(at: str, tolerance: str | None) -> Pose:
    """Read a pose and how near it is to be reached; InputError if it is none."""
    from lockedjoint.paths.waypoints import read_pose
    from lockedjoint.robots.pose_constrained_arm import Pose

    position, quaternion = read_pose(at)
    text = "0" if tolerance is None else tolerance
    near = numbers("--tolerance", text)
    if len(near) > (1 if quaternion is None else 2):
        words = "METRES" if quaternion is None else "METRES or METRES,RADIANS"
        raise InputError("--tolerance", text, f"{words} for such a pose")
    rotation = None if quaternion is None else tuple(quaternion.tolist())
    return Pose(tuple(position.tolist()), rotation, *near)


def read_configuration(
    text: str | None, chain: Chain, name: str = "--configuration"
) -> FloatArray:
    """Read the option of a configuration: radians or metres, shape (n,), within the limits.

    Joints that are not named are midway between their limits. InputError if it is none of what
    the option allows, a joint is unknown, or a position is outside its limits.
    """
    from lockedjoint.kinematics.chain import check_named

    values: Mapping[str, float] | Sequence[float] = {}
    if text is None:
        pass
    elif text.lower().endswith(".json"):
        values = _read_json(Path(text))
    elif "=" in text:
        values = pairs(separated(text, chain.names), name, chain.names)
    else:
        values = numbers(name, text)
    if isinstance(values, Mapping):
        for joint in values:
            still = ", which cannot move" if joint in dict(chain.immobile) else ""
            check_named("joint", joint, chain.names, still)
        middle = dict(zip(chain.names, chain.mid_range.tolist(), strict=True))
        values = list({**middle, **values}.values())
    if len(values) != len(chain.names):
        names = ", ".join(chain.names)
        allowed = f"{len(chain.names)} of them ({names}); or {_ALLOWED}"
        raise InputError(name, f"{len(values)} numbers", allowed)
    return chain.within_limits(values)


def pairs(
    settings: Sequence[str], name: str = "--configuration", joints: Sequence[str] = ()
) -> dict[str, float]:
    """Read ``JOINT=VALUE`` settings; InputError if one is something else or repeated.

    Where the joints are known, their names may have ``=``, commas and blanks in them.
    """
    named = _by_joint(settings, name, "JOINT=VALUE, radians or metres", joints)
    return {joint: number(f"{name} of {joint}", value) for joint, value in named.items()}


def _by_joint(
    settings: Sequence[str], name: str, allowed: str, joints: Sequence[str] = ()
) -> dict[str, str]:
    values: dict[str, str] = {}
    for setting in settings:
        # Values have no "=" in them, names may.
        joint, equals, value = setting.rpartition("=")
        joint = joint if joint in joints else joint.strip()
        if not (joint and equals):
            raise InputError(name, setting, allowed)
        if joint in values:
            raise InputError(name, f"{joint} twice", "every joint once")
        values[joint] = value.strip()
    return values


def numbers(name: str, text: str) -> list[float]:
    """Return finite numbers between commas; InputError if one is none."""
    return [number(name, part) for part in text.split(",")]


def number(name: str, value: object) -> float:
    """Return a finite number; InputError if it is none."""
    try:
        read = real_in(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        read = math.nan
    if isinstance(value, bool) or not math.isfinite(read):
        raise InputError(name, value, "a finite number, radians or metres")
    return read


def _read_json(path: Path) -> Mapping[str, float] | Sequence[float]:
    content = load_json(read_bytes(path), path)
    if isinstance(content, dict) and "configuration" in content:
        content = content["configuration"]
    if isinstance(content, dict):
        return {name: number(f"{name} in {path}", value) for name, value in content.items()}
    if isinstance(content, list):
        return [number(f"an entry of {path}", value) for value in content]
    raise FileError("file", str(path), "positions: a list, or an object by joint")
