"""The joints between two links of a robot, as one chain of motions, and its Jacobian."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError

# A configuration may be outside its limits by this, in radians or metres: rounded files.
LIMIT_TOLERANCE = 1e-6
# Rows of a homogeneous 4×4 matrix.
Transform: TypeAlias = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ChainJoint:
    """A joint that moves the tip by itself: one variable, one column of J.

    Attributes
    ----------
    name
        Its name in the robot.
    prismatic
        Whether its position is a length, in metres, and not an angle, in radians.
    lower, upper
        Its limits, narrowed by those of joints on the chain that mimic it.
    """

    name: str
    prismatic: bool
    lower: float
    upper: float


@dataclass(frozen=True)
class Motion:
    """A displacement along the chain, by ``multiplier``·q[variable] + ``offset``.

    Attributes
    ----------
    placement
        Pose of the moving joint relative to the frame that the previous motion moves, 4×4.
    axis
        Unit vector in the joint's frame.
    translates
        Whether it moves along the axis instead of turning about it.
    variable
        Position in `Chain.joints` of the joint that drives it.
    multiplier, offset
        Other than 1 and 0 if it mimics that joint.
    """

    placement: Transform
    axis: tuple[float, float, float]
    translates: bool
    variable: int
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Chain:
    """What moves a tip relative to a base.

    Attributes
    ----------
    robot, base, tip
        Names of the robot and of the two links.
    joints
        The joints that are free, in the order in which they first act on the tip.
    motions
        Their displacements from base to tip; joints that mimic others add motions.
    end
        Pose of the tip's point relative to the frame that the last motion moves, 4×4.
    held
        Names and positions of joints that are held, as if locked.
    """

    robot: str
    base: str
    tip: str
    joints: tuple[ChainJoint, ...]
    motions: tuple[Motion, ...]
    end: Transform
    held: tuple[tuple[str, float], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which of the free joints are prismatic."""
        return tuple(joint.prismatic for joint in self.joints)

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper limits of the free joints."""
        lower = np.array([joint.lower for joint in self.joints])
        return lower, np.array([joint.upper for joint in self.joints])

    @property
    def mid_range(self) -> FloatArray:
        """Every joint midway between its limits; at zero if it has none."""
        lower, upper = self.limits
        both = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(both, lower, 0.0) / 2 + np.where(both, upper, 0.0) / 2
        return np.asarray(np.clip(middle, lower, upper))

    def within_limits(self, configuration: Sequence[float] | FloatArray) -> FloatArray:
        """Return the configuration; InputError if it is outside the joints' limits."""
        point = finite_vector("configuration", configuration, len(self.joints))
        for joint, value in zip(self.joints, point, strict=True):
            check_limits(joint.name, float(value), joint.lower, joint.upper)
        return point

    def jacobian(self, positions: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Jacobian of the tip's point, and the orientation of its link.

        Parameters
        ----------
        positions
            Symbols of the free joints' positions, radians or metres, shape (n, 1).

        Returns
        -------
        casadi.SX
            Columns (v; ω) as in eq. (21), along the axes of the base, shape (6, n): metres
            or radians per radian or metre.
        casadi.SX
            Rotation from the tip's axes to those of the base, shape (3, 3).
        """
        turn, origin = ca.SX.eye(3), ca.SX.zeros(3)
        screws = []
        for motion in self.motions:
            turn, origin = _moved(turn, origin, motion.placement)
            axis = turn @ ca.DM(motion.axis)
            screws.append((motion, axis, origin))
            value = motion.multiplier * positions[motion.variable] + motion.offset
            if motion.translates:
                origin = origin + value * axis
            else:
                turn = turn @ rotation(motion.axis, value)
        turn, origin = _moved(turn, origin, self.end)

        matrix = ca.SX.zeros(6, len(self.joints))
        for motion, axis, start in screws:
            if motion.translates:
                column = ca.vertcat(axis, ca.SX.zeros(3))
            else:
                column = ca.vertcat(ca.cross(axis, origin - start), axis)
            matrix[:, motion.variable] += motion.multiplier * column
        return matrix, turn


def rotation(axis: Sequence[float], angle: ca.SX | float) -> ca.SX:
    """Rotation by an angle in radians about a unit vector, shape (3, 3)."""
    cross = ca.skew(ca.DM(axis))
    return ca.SX.eye(3) + ca.sin(angle) * cross + (1 - ca.cos(angle)) * (cross @ cross)


def check_limits(name: str, value: float, lower: float, upper: float) -> None:
    """Raise InputError unless a joint's position is within its limits."""
    if not lower - LIMIT_TOLERANCE <= value <= upper + LIMIT_TOLERANCE:
        raise InputError(f"joint {name}", f"{value:.7g}", f"within [{lower:.7g}, {upper:.7g}]")


def listed(names: Sequence[str], limit: int = 12) -> str:
    """Return names with commas; the first of them if they are many."""
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown}, … ({len(names)} in all)"


def _moved(turn: ca.SX, origin: ca.SX, placement: Transform) -> tuple[ca.SX, ca.SX]:
    pose = np.array(placement)
    return turn @ ca.DM(pose[:3, :3]), origin + turn @ ca.DM(pose[:3, 3])
