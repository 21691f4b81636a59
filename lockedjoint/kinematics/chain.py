"""The joints between two links of a robot, as one chain of motions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.in_degrees import FromDegrees
from lockedjoint.kinematics.motion import Motion, Transform
from lockedjoint.kinematics.normal_form import NormalForm
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import InputError

# A configuration may be outside its limits by this, in radians or metres: rounded files.
LIMIT_TOLERANCE = 1e-6
# No position, length, angle or multiplier may be larger, and no characteristic length or
# multiplier other than 0 smaller than its inverse. An entry of J, which is a length times a
# multiplier over a length, then neither overflows nor underflows, and neither does its fourth
# power, which the residual has.
LARGEST = 1e20
#: These are all rows of a Jacobian (v; ω).
ALL_ROWS = (0, 1, 2, 3, 4, 5)
# A range that is less than a turn by no more than this is a turn.
_TURN_ROUNDING_RAD = 1e-9
#: Limits and positions of a revolute joint beyond two turns may be in degrees.
TWO_TURNS = 4 * np.pi
# A sentence lists at most so many names, and counts the others.
_MOST_LISTED = 12


@dataclass(frozen=True)
class ChainJoint:
    """A joint that moves the tip by itself: one variable, one column of J.

    Positions are radians, or metres of prismatic joints. Limits and the largest speed are
    narrowed by those of joints on the chain that mimic it.
    """

    name: str
    prismatic: bool
    lower: float
    upper: float
    velocity: float = np.inf
    speed: float = 1.0  #: The factor of its column of J, see `TreeJoint`.

    @property
    def unit(self) -> str:
        """Unit of its positions and limits."""
        return "m" if self.prismatic else "rad"

    @property
    def continuous(self) -> bool:
        """Whether it can make a full turn, so that its angles have no ends."""
        return not self.prismatic and self.upper - self.lower >= 2 * np.pi - _TURN_ROUNDING_RAD


@dataclass(frozen=True, repr=False)
class Chain(Brief):
    """What moves a tip relative to a base: links of a robot, by their names.

    In NumPy it is moved to many configurations at once, which come last: q has shape (n, B), a
    Jacobian shape (rows, n, B).
    """

    robot: str
    base: str
    tip: str
    joints: tuple[ChainJoint, ...]  #: Those that are free, as they first act on the tip.
    #: Motions displace the links from base to tip; joints that mimic others add some.
    motions: tuple[Motion, ...]
    end: Transform  #: The tip's point in the frame that the last motion moves.
    locked_at: tuple[tuple[str, float], ...] = ()  #: Joints that have locked, and where.
    #: Joints cannot move if their limits are missing, or not farther apart than
    #: `LIMIT_TOLERANCE`. These are given with their
    #: positions: they have no column, and are no redundancy.
    immobile: tuple[tuple[str, float], ...] = ()
    #: These joints have limits that the user can hardly mean in radians.
    hardly_meant: tuple[str, ...] = ()
    #: Each sentence says what else the user should check in the robot's file.
    remarks: tuple[str, ...] = ()

    def __hash__(self) -> int:
        """Look at some of it: the whole takes longer than a tenth of an evaluation."""
        return hash((self.robot, self.tip, self.locked_at, len(self.joints)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which of the free joints are prismatic."""
        return tuple(joint.prismatic for joint in self.joints)

    @property
    def speeds(self) -> FloatArray:
        """By what the columns of the free joints are multiplied, shape (n,)."""
        return np.array([joint.speed for joint in self.joints])

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper limits of the free joints, shape (n,) each, radians or metres."""
        lower = np.array([joint.lower for joint in self.joints])
        return lower, np.array([joint.upper for joint in self.joints])

    @property
    def turning(self) -> npt.NDArray[np.bool_]:
        """Which free joints have all as it was after a full turn, shape (n,)."""
        turning = np.ones(len(self.joints), dtype=bool)
        for motion in self.motions:
            turning[motion.variable] &= not (motion.prismatic or motion.multiplier % 1)
        return turning

    @property
    def mid_range(self) -> FloatArray:
        """Every joint midway between its limits, shape (n,); at zero if it has none."""
        lower, upper = self.limits
        both = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(both, lower, 0.0) / 2 + np.where(both, upper, 0.0) / 2
        return np.asarray(np.clip(middle, lower, upper))

    @cached_property
    def lower(self) -> FloatArray:
        """Lower limits of the free joints, shape (n, 1)."""
        return fixed(self.limits[0][:, None])

    @cached_property
    def upper(self) -> FloatArray:
        """Upper limits of the free joints, shape (n, 1)."""
        return fixed(self.limits[1][:, None])

    @property
    def ranges(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest positions to try, (n, 1) each: the limits, or two turns."""
        least = np.where(np.isfinite(self.lower), self.lower, -np.pi)
        largest = np.where(np.isfinite(self.upper), self.upper, np.pi)
        return np.maximum(least, -2 * np.pi), np.minimum(largest, 2 * np.pi)

    @cached_property
    def whole_turns(self) -> BoolArray:
        """Joints of which a position is within the limits some turns away, too; (n, 1)."""
        return self.turning[:, None] & (self.upper - self.lower >= 4 * np.pi)

    def turned(self, q: FloatArray) -> FloatArray:
        """Return configurations or differences (n, B) less the whole turns in them."""
        return q - 2 * np.pi * np.round(q / (2 * np.pi)) * self.whole_turns

    @cached_property
    def normal_form(self) -> NormalForm:
        """What moves the chain in NumPy."""
        return NormalForm.of(self.motions, self.end)

    def frames(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return where the joints and the tip are at configurations (n, B).

        Axes of the k motions and their origins, shape (k, 3, B) each; the tip's position,
        (3, B), and orientation, (3, 3, B).
        """
        return self.normal_form.frames(q)

    def tip_at(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the tip's position, (3, B), and orientation, (3, 3, B)."""
        return self.frames(q)[2:]

    def forward(
        self, q: FloatArray, rows: Sequence[int] = ALL_ROWS
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the tip's position and orientation, and J along the axes of the base.

        J has those rows of (v; ω) that are asked for, shape (rows, n, B).
        """
        form = self.normal_form
        axes, origins, position, orientation = form.frames(q)
        columns = form.columns(axes, origins, position, 6 if max(rows) > 2 else 3)
        return position, orientation, form.by_joint(columns, len(self.joints))[list(rows)]

    def motion_columns(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (v; ω) of the tip for each motion, (k, 6, B), and its orientation, (3, 3, B).

        They are along the axes of the base, in metres and radians.
        """
        form = self.normal_form
        axes, origins, position, orientation = form.frames(q)
        columns = form.columns(axes, origins, position, 6)
        return np.ascontiguousarray(columns.swapaxes(0, 1)), orientation

    @property
    def notes(self) -> tuple[str, ...]:
        """What to check in the robot's file, one sentence each."""
        turning = [joint for joint in self.joints if not joint.prismatic]
        wide = [
            joint.name
            for joint in turning
            if any(TWO_TURNS < abs(end) < np.inf for end in (joint.lower, joint.upper))
        ]
        named = {
            "Joints whose limits are missing, or at most"
            f" {LIMIT_TOLERANCE:g} rad or m apart, cannot move and have no column": [
                f"{name} at {value:g}" for name, value in self.immobile
            ],
            "Limits beyond two turns (±4π) were taken for radians, and may be degrees": wide,
            "Limits that were given are beyond a turn (±2π rad) and the robot's own, and may be"
            " degrees": self.hardly_meant,
            "The file multiplies columns of J": [
                f"{joint.name} by {joint.speed:.6g}"
                for joint in self.joints
                if joint.speed != 1
            ],
        }
        own = [f"{what}: {listed(names)}." for what, names in named.items() if names]
        return (*own, *self.remarks)

    def within_limits(
        self, configuration: Sequence[float] | FloatArray, in_degrees: bool = False
    ) -> FloatArray:
        """Return the configuration; InputError if it is outside the joints' limits.

        `in_degrees` says that it was stated in degrees: the error has the limits in degrees,
        too, and does not ask.
        """
        point = finite_vector("configuration", configuration, len(self.joints))
        for joint, value in zip(self.joints, point, strict=True):
            ends = joint.lower, joint.upper
            check_limits(joint.name, float(value), *ends, joint.prismatic, in_degrees)
        return point


def fixed(values: FloatArray) -> FloatArray:
    """Return an array that is shared, which nobody can change."""
    values.flags.writeable = False
    return values


def narrowed(
    chain: Chain, limits: Mapping[str, tuple[float, float]], name: str = "--limits"
) -> Chain:
    """Return the chain with narrower limits of some joints; the name is for errors.

    Raises
    ------
    InputError
        If a joint is unknown, or its limits contradict each other or those of the robot.
    """
    joints = {joint.name: joint for joint in chain.joints}
    hardly_meant = list(chain.hardly_meant)
    for each, (lower, upper) in limits.items():
        check_named(f"joint of {name}", each, chain.names)
        joint, in_degrees = joints[each], isinstance(lower, FromDegrees)
        least, most = max(lower, joint.lower), min(upper, joint.upper)
        if not least < most:
            own = range_text(joint.lower, joint.upper, joint.prismatic, in_degrees)
            given = range_text(lower, upper, joint.prismatic)
            allowed = f"lower < upper, with room in the robot's {own}"
            raise InputError(f"{name} of {each}", given, allowed)
        beyond = lower < joint.lower or upper > joint.upper
        hardly = not (joint.prismatic or in_degrees)
        if beyond and hardly and 2 * np.pi < max(-lower, upper) < np.inf:
            hardly_meant.append(each)
        joints[each] = replace(joint, lower=least, upper=most)
    return replace(
        chain, joints=tuple(joints.values()), hardly_meant=tuple(dict.fromkeys(hardly_meant))
    )


def check_limits(
    name: str,
    value: float,
    lower: float,
    upper: float,
    prismatic: bool = False,
    in_degrees: bool = False,
) -> None:
    """Raise InputError, which says the unit, unless a position is within a joint's limits.

    An angle beyond two turns may be meant in degrees: the error asks. If it was stated so, also
    as `FromDegrees`, the error has the limits in degrees, too.
    """
    if not lower - LIMIT_TOLERANCE <= value <= upper + LIMIT_TOLERANCE:
        in_degrees = in_degrees or isinstance(value, FromDegrees)
        unit = "m" if prismatic else "rad"
        allowed = f"within {range_text(lower, upper, prismatic, in_degrees)}"
        if abs(value) > TWO_TURNS and not (prismatic or in_degrees):
            allowed += '; in degrees? --angles deg, or "angles": "deg" in a file'
        raise InputError(f"joint {name}", f"{value:.7g} {unit}", allowed)
    check_size(f"joint {name}", value)


def range_text(
    lower: float, upper: float, prismatic: bool = False, in_degrees: bool = False
) -> str:
    """Return limits with their unit, radians or metres, and perhaps in degrees, too."""
    text = f"[{lower:.7g}, {upper:.7g}] {'m' if prismatic else 'rad'}"
    if prismatic or not in_degrees:
        return text
    return f"{text}, which is [{math.degrees(lower):.7g}, {math.degrees(upper):.7g}]°"


def check_named(argument: str, name: str, names: Sequence[str], still: str = "") -> None:
    """Raise InputError, with the nearest names, unless a name is one of some."""
    if name not in names:
        allowed = f"one of {listed(names)}{nearest(name, names)}"
        raise InputError(argument, f"{name}{still}", allowed)


def check_size(name: str, *values: float) -> None:
    """Raise InputError unless values are so small that J neither overflows nor underflows."""
    for value in values:
        if not abs(value) <= LARGEST:
            raise InputError(name, f"{value:.7g}", f"numbers of size at most {LARGEST:g}")


def listed(names: Sequence[str]) -> str:
    """Return names with commas; the first of them if they are many."""
    first = (text if len(text) < 80 else f"{text[:79]}…" for text in names[:_MOST_LISTED])
    return ", ".join(first) + (
        f", … ({len(names)} in all)" if len(names) > _MOST_LISTED else ""
    )


def nearest(name: str, names: Sequence[str]) -> str:
    """Return the names most like a wrong one as the end of a sentence; empty if none is."""
    # Comparing takes long for long names and for many.
    similar = sorted(
        (text for text in names if len(text) < 100), key=lambda text: abs(len(text) - len(name))
    )
    folded = {text.lower(): text for text in reversed(similar[:5000])}
    matches = get_close_matches(name.lower()[:100], folded, n=3)
    return f"; nearest: {', '.join(folded[text] for text in matches)}" if matches else ""
