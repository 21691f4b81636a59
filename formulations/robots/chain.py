"""The joints between two links of a robot, as one chain of motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from formulations.robots.tree import Transform
from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError

# A configuration may be outside its limits by this, in radians or metres: rounded files.
LIMIT_TOLERANCE = 1e-6


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
        Pose of the moving joint relative to where the motion before it leads, 4×4.
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
        Pose of the tip's point relative to where the last motion leads, 4×4.
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


def check_limits(name: str, value: float, lower: float, upper: float) -> None:
    """Raise InputError unless a joint's position is within its limits."""
    if not lower - LIMIT_TOLERANCE <= value <= upper + LIMIT_TOLERANCE:
        raise InputError(f"joint {name}", f"{value:.7g}", f"within [{lower:.7g}, {upper:.7g}]")


def listed(names: Sequence[str], limit: int = 12) -> str:
    """Return names with commas; the first of them if they are many."""
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown}, … ({len(names)} in all)"
