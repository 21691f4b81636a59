"""Column models: what one joint can contribute to a Jacobian (Section 4, eq. 21).

A joint kind maps a few parameters to a column j of J, shape (m,). Angles are in radians,
parameters of length in the unit of the linear velocity rows. Columns of spatial joints are (v;
ω), linear velocity above rotational velocity, as in eq. (21). There the angles α, β of the axis
ω = (cosα cosβ, sinα cosβ, sinβ) make two unit vectors e₁, e₂ normal to it, and v = cosγ e₁ +
sinγ e₂.

Each class says for its kind what `Joint` asks for: a symbolic column, the equations and the
bound on its extent, conditions for the relaxation, random parameters, and the parameters of a
numeric column.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from typing import Any, ClassVar, get_args

import casadi as ca
import numpy as np

from lockedjoint.formulations.joints.gram_conditions import (
    LINEAR,
    ROTATIONAL,
    GramCondition,
    trace_condition,
)
from lockedjoint.formulations.joints.joint import (
    MOST_VARIABLES,
    TOLERANCE,
    Budget,
    Joint,
    check_revolute,
    outside,
)
from lockedjoint.nlp.arrays import (
    FloatArray,
    check_length,
    finite_vector,
    real_number,
    whole_number,
)
from lockedjoint.nlp.errors import one_of


def _products(value: float) -> GramCondition:
    """Return the condition v·ω = `value` of a spatial column (v; ω)."""
    matrix = tuple(tuple(0.5 * (abs(i - k) == 3) for k in range(6)) for i in range(6))
    return GramCondition("v·ω", matrix, value)


@dataclass(frozen=True)
class UnitRevolute(Joint):
    """Revolute joint with |v| = |ω| = 1, v·ω = 0: eq. (21), a point of SO(3).

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Arm.of(lj.UnitRevolute(), 7).shape
    (6, 7)
    """

    parameters: ClassVar[tuple[str, ...]] = ("alpha", "beta", "gamma")
    dimension: ClassVar[int] = 6
    largest_norm_squared: ClassVar[float] = 2.0
    gram_conditions: ClassVar[tuple[GramCondition, ...]] = (
        trace_condition("|v| = 1", 6, LINEAR, 1.0),
        trace_condition("|ω| = 1", 6, ROTATIONAL, 1.0),
        _products(0.0),
    )

    def column(self, parameters: ca.SX) -> ca.SX:
        """Eq. (21)."""
        alpha, beta, gamma = ca.vertsplit(parameters)
        first, second, axis = (ca.vertcat(*vector) for vector in _frame(ca, alpha, beta))
        column: ca.SX = ca.vertcat(ca.cos(gamma) * first + ca.sin(gamma) * second, axis)
        return column

    def sample(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Uniform on SO(3)."""
        alpha, beta = _uniform_direction(rng, count)
        return np.column_stack([alpha, beta, rng.uniform(-np.pi, np.pi, count)])

    def invert(self, column: FloatArray) -> FloatArray:
        """Return the angles α, β, γ of the column, in (−π, π] × [−π/2, π/2] × (−π, π]."""
        column = finite_vector("column", column, 6)
        check_revolute(column)
        x, y, z, *axis = column.tolist()  # v and ω
        if abs(hypot(x, y, z) - 1) > TOLERANCE:
            raise outside(column, "linear velocity of norm 1 (unit revolute joint)")
        alpha, beta = _direction_angles(axis)
        sin_a, cos_a, sin_b, cos_b = sin(alpha), cos(alpha), sin(beta), cos(beta)
        along_first = sin_b * (cos_a * x + sin_a * y) - cos_b * z  # e₁·v = cosγ
        along_second = sin_a * x - cos_a * y  # e₂·v = sinγ
        return np.array([alpha, beta, atan2(along_second, along_first)])


@dataclass(frozen=True)
class LeverRevolute(Joint):
    """Revolute joint with a free lever arm: |ω| = 1, v·ω = 0 and |v| bounded.

    With a pitch c it is a screw joint, with the column (v + cω; ω). With its two halves
    exchanged, this column is the wrench of a thruster: ω is its force, v + cω the moment, and c
    the ratio of drag to thrust of a rotor.

    The parameters are v and ω themselves, under the two equations |ω| = 1 and v·ω = 0. Twice as
    many random starts reach the best isotropic 7R as with the angles of eq. (21) and two
    components of v.

    Parameters
    ----------
    length
        The characteristic length ℓ, in the unit of v, above 0.
    budget
        ``"mean"``: the mean of |v|² over such joints is at most ℓ². ``"each"``: |v| ≤ ℓ.
    pitch
        The pitch c, in the unit of v; negative if left-handed.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Arm.of(lj.LeverRevolute(length=0.3), 7).shape
    (6, 7)
    """

    length: float = 1.0
    budget: Budget = "mean"
    pitch: float = 0.0
    parameters: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz", "wx", "wy", "wz")
    dimension: ClassVar[int] = 6

    def __post_init__(self) -> None:
        check_length("length", self.length)
        one_of("budget", self.budget, get_args(Budget))
        if self.pitch:
            check_length("size of the pitch", abs(real_number("pitch", self.pitch, "a number")))

    @property
    def largest_norm_squared(self) -> float:
        """1 + ℓ² + c²."""
        return 1.0 + self.length**2 + self.pitch**2

    @property
    def extent_bound(self) -> float:
        """The characteristic length ℓ."""
        return self.length

    @property
    def gram_conditions(self) -> tuple[GramCondition, ...]:
        """|v + cω|² ≤ ℓ² + c², |ω| = 1 and (v + cω)·ω = c."""
        square, shared = self.length**2 + self.pitch**2, self.budget == "mean"
        return (
            trace_condition("lever arm", 6, LINEAR, square, equal=False, shared=shared),
            trace_condition("|ω| = 1", 6, ROTATIONAL, 1.0),
            _products(self.pitch),
        )

    def column(self, parameters: ca.SX) -> ca.SX:
        """Return v + cω and ω."""
        return ca.vertcat(parameters[:3] + self.pitch * parameters[3:], parameters[3:])

    def equations(self, parameters: ca.SX) -> ca.SX:
        """|ω|² − 1 and v·ω."""
        velocity, axis = parameters[:3], parameters[3:]
        return ca.vertcat(ca.sumsqr(axis) - 1, ca.dot(velocity, axis))

    def extent_squared(self, parameters: ca.SX) -> ca.SX:
        """|v|²."""
        return ca.sumsqr(parameters[:3])

    def sample(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Directions uniform; lever arms uniform in the ball that the bound describes."""
        alpha, beta = _uniform_direction(rng, count)
        levers = self.length * _in_ball(rng, count, 2, self.budget)
        first, second, axis = map(np.column_stack, _frame(np, alpha, beta))
        return np.column_stack([levers[:, :1] * first + levers[:, 1:] * second, axis])

    def invert(self, column: FloatArray) -> FloatArray:
        """Return v and ω."""
        column = finite_vector("column", column, 6).copy()
        column[:3] -= self.pitch * column[3:]
        check_revolute(column)
        if self.budget == "each" and np.linalg.norm(column[:3]) > self.length + TOLERANCE:
            raise outside(column, f"a lever arm of at most {self.length:g}")
        return column


@dataclass(frozen=True)
class Prismatic(Joint):
    """Prismatic joint: the column (v; 0) with |v| = `speed`.

    Parameters
    ----------
    speed
        |v|, in the unit of v per unit of the joint's own rate; above 0.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Arm((lj.LeverRevolute(),) * 6 + (lj.Prismatic(speed=0.5),)).shape
    (6, 7)
    """

    speed: float = 1.0
    parameters: ClassVar[tuple[str, ...]] = ("alpha", "beta")
    dimension: ClassVar[int] = 6

    def __post_init__(self) -> None:
        check_length("speed", self.speed)

    @property
    def largest_norm_squared(self) -> float:
        """|v|²."""
        return self.speed**2

    @property
    def gram_conditions(self) -> tuple[GramCondition, ...]:
        """|v| = `speed` and ω = 0."""
        return (
            trace_condition("speed", 6, LINEAR, self.speed**2),
            trace_condition("ω = 0", 6, ROTATIONAL, 0.0),
        )

    def column(self, parameters: ca.SX) -> ca.SX:
        """Column (v; 0), the direction of v as that of ω in eq. (21)."""
        alpha, beta = ca.vertsplit(parameters)
        axis = ca.vertcat(*_frame(ca, alpha, beta)[2])
        return ca.vertcat(self.speed * axis, ca.SX.zeros(3))

    def sample(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Uniform on the sphere of directions."""
        return np.column_stack(_uniform_direction(rng, count))

    def invert(self, column: FloatArray) -> FloatArray:
        """Angles of the direction."""
        column = finite_vector("column", column, 6)
        if np.linalg.norm(column[3:]) > TOLERANCE:
            raise outside(column, "no rotational velocity (prismatic joint)")
        if abs(np.linalg.norm(column[:3]) - self.speed) > TOLERANCE:
            raise outside(column, f"linear velocity of norm {self.speed:g} (prismatic joint)")
        return np.array(_direction_angles(column[:3]))


@dataclass(frozen=True)
class FreeColumn(Joint):
    """Any column of m entries: planar and positional arms, general screws.

    Parameters
    ----------
    dimension
        Number of task dimensions m, at least 1.
    norm
        What ‖j‖ is (budget ``"each"``), or the root mean square of ‖j‖ over such joints
        (budget ``"mean"``); above 0.
    budget
        ``"each"`` or ``"mean"``.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Arm.of(lj.FreeColumn(dimension=2), 3).shape
    (2, 3)
    """

    dimension: int = 6
    norm: float = 1.0
    budget: Budget = "each"
    exact: ClassVar[bool] = True

    def __post_init__(self) -> None:
        whole_number("dimension", self.dimension, 1, MOST_VARIABLES)
        check_length("norm", self.norm)
        one_of("budget", self.budget, get_args(Budget))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the entries."""
        return tuple(f"j{k + 1}" for k in range(self.dimension))

    @property
    def largest_norm_squared(self) -> float:
        """The square of the norm."""
        return self.norm**2

    @property
    def extent_bound(self) -> float:
        """The norm."""
        return self.norm

    @property
    def gram_conditions(self) -> tuple[GramCondition, ...]:
        """‖j‖ = `norm`."""
        shared = self.budget == "mean"
        m, square = self.dimension, self.norm**2
        return (trace_condition("norm", m, slice(None), square, shared=shared),)

    def column(self, parameters: ca.SX) -> ca.SX:
        """Return the parameters themselves."""
        return parameters

    def extent_squared(self, parameters: ca.SX) -> ca.SX:
        """‖j‖²."""
        return ca.sumsqr(parameters)

    def sample(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Uniform on the sphere(s) of the given norm."""
        whole_number("count", count, 0)
        if not count:
            return np.zeros((0, self.dimension))
        entries = rng.standard_normal((count, self.dimension))
        if self.budget == "each":
            norms = np.linalg.norm(entries, axis=1, keepdims=True)
        else:
            norms = np.linalg.norm(entries) / np.sqrt(count)
        return np.asarray(self.norm * entries / norms)

    def invert(self, column: FloatArray) -> FloatArray:
        """Return the entries themselves."""
        column = finite_vector("column", column, self.dimension)
        if self.budget == "each" and abs(np.linalg.norm(column) - self.norm) > TOLERANCE:
            raise outside(column, f"a norm of {self.norm:g}")
        return column.copy()


def _frame(functions: Any, alpha: Any, beta: Any) -> tuple[tuple[Any, ...], ...]:
    """Return the left-handed frame (e₁, e₂, ω) of eq. (21), three entries each.

    `functions` is CasADi or NumPy, whose sine and cosine take the angles.
    """
    sin_a, cos_a = functions.sin(alpha), functions.cos(alpha)
    sin_b, cos_b = functions.sin(beta), functions.cos(beta)
    first = (cos_a * sin_b, sin_a * sin_b, -cos_b)
    return first, (sin_a, -cos_a, 0 * alpha), (cos_a * cos_b, sin_a * cos_b, sin_b)


def _uniform_direction(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """Return angles α and β, radians, of `count` directions, uniform on the sphere."""
    whole_number("count", count, 0)
    alpha = rng.uniform(-np.pi, np.pi, count)
    return alpha, np.arcsin(rng.uniform(-1.0, 1.0, count))


def _in_ball(rng: np.random.Generator, count: int, size: int, budget: Budget) -> FloatArray:
    """Return uniform points of a ball, shape (count, size).

    With the budget ``each`` every row is one of the unit ball in `size` dimensions; with
    ``mean`` all rows together are one of the ball of radius √count, in count · size dimensions.
    """
    if not count:
        return np.zeros((0, size))
    points = rng.standard_normal((count, size))
    if budget == "each":
        radii = rng.uniform(size=(count, 1)) ** (1 / size)
        return np.asarray(radii * points / np.linalg.norm(points, axis=1, keepdims=True))
    radius = np.sqrt(count) * rng.uniform() ** (1 / (count * size))
    return np.asarray(radius * points / np.linalg.norm(points))


def _direction_angles(direction: Sequence[float] | FloatArray) -> tuple[float, float]:
    """Return the angles α, β of a direction (cosα cosβ, sinα cosβ, sinβ), of any length."""
    x, y, z = direction
    return atan2(y, x), atan2(z, hypot(x, y))
