"""The column model *robot*: joint positions as variables, J(q) from the kinematic chain.

A Jacobian mixes metres and radians. Here every length is measured in a characteristic
length ℓ: linear velocities become v/ℓ, and so does the rate of a prismatic joint, whose
column then has |v| = 1 as a revolute joint's has |ω| = 1. What comes out has no unit.

Unless a length is given, ℓ is the root mean square of the revolute joints' lever arms,

    ℓ² = Σ|v_i|² / Σ|ω_i|²     over the revolute joints, at that configuration.

Then Σ|v_i|² = Σ|ω_i|², as an isotropic Jacobian of revolute joints must have it; ‖J‖_F² is
2n whatever the robot's size; and a robot is held to the same scale as `LeverRevolute`
joints, which are designed at mean square lever arm 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from formulations.joint import check_length
from formulations.robots import kinematics
from formulations.robots.chain import Chain
from formulations.robots.task import Task
from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError
from nlp.problem import Constraint

# Where a joint has no limits, or more than a turn between them, one turn is drawn from.
_HALF_TURN = np.pi
# A prismatic joint without limits, in metres.
_REACH = 1.0


@dataclass(frozen=True)
class RobotArm:
    """A chain of a robot, the task and the characteristic length: a `ColumnModel`.

    Parameters
    ----------
    chain
        The joints.
    task
        The directions that count.
    length
        Characteristic length ℓ in metres; by default that of each configuration, see above.

    Raises
    ------
    InputError
        If there are not more joints than directions, or the length is not above 0.
    """

    chain: Chain
    task: Task = Task()
    length: float | None = None

    def __post_init__(self) -> None:
        m, n = self.shape
        if n <= m:
            names = ", ".join(self.chain.names)
            raise InputError(
                f"free joints between {self.chain.base} and {self.chain.tip}",
                f"{n} ({names})",
                f"more than the {m} task directions: only a redundant arm outlives a failure",
            )
        if self.length is not None:
            check_length("length", self.length)

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""
        return len(self.task.directions), len(self.chain.joints)

    @property
    def size(self) -> int:
        """Number of variables: one per joint."""
        return len(self.chain.joints)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """The joints' limits."""
        return self.chain.limits

    @property
    def fixed_trace(self) -> float | None:
        """None: ‖J‖_F² depends on the configuration in general."""
        return None

    @property
    def description(self) -> str:
        """Return the robot and its chain in a few words."""
        chain = self.chain
        return f"{self.size} joints of {chain.robot} from {chain.base} to {chain.tip}"

    def symbols(self) -> ca.SX:
        """Symbols of the joints' positions, radians or metres, shape (n, 1)."""
        return ca.SX.sym("q", self.size)

    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian in units of ℓ, shape (m, n)."""
        full, rotation = kinematics.jacobian(self.chain, variables)
        if self.task.frame == "tip":
            full = ca.vertcat(rotation.T @ full[:3, :], rotation.T @ full[3:, :])
        length = self._symbolic_length(full)
        rates = [length if joint.prismatic else ca.SX(1) for joint in self.chain.joints]
        scaled = ca.vertcat(full[:3, :] / length, full[3:, :]) @ ca.diag(ca.vertcat(*rates))
        return scaled[list(self.task.rows), :]

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:  # noqa: ARG002
        """Return none: limits are bounds."""
        return ()

    def jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return the Jacobian at numeric positions, in units of ℓ, shape (m, n)."""
        point = finite_vector("configuration", variables, self.size)
        return np.array(_functions(self)[0](point), dtype=float)

    def metric_jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return all six rows in metres and radians, along the base's axes, shape (6, n)."""
        point = finite_vector("configuration", variables, self.size)
        return np.array(_functions(self)[1](point), dtype=float)

    def length_at(self, variables: npt.ArrayLike) -> float:
        """Characteristic length ℓ at numeric positions, in metres."""
        point = finite_vector("configuration", variables, self.size)
        return float(_functions(self)[2](point))

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw positions uniformly within the limits; within one turn if they leave more."""
        spans = [
            _REACH if joint.prismatic else _HALF_TURN for joint in self.chain.joints
        ]  # half of what is drawn from at most
        lower, upper = self.bounds
        centre = np.clip(0.0, lower + spans, upper - spans)
        wide = upper - lower > 2 * np.array(spans)
        least = np.where(wide, centre - spans, lower)
        largest = np.where(wide, centre + spans, upper)
        return np.asarray(rng.uniform(least, largest))

    def _symbolic_length(self, full: ca.SX) -> ca.SX:
        revolute = [k for k, joint in enumerate(self.chain.joints) if not joint.prismatic]
        linear = any(name.startswith("v") for name in self.task.directions)
        if self.length is not None or not revolute or not linear:
            return ca.SX(1.0 if self.length is None else self.length)
        columns = full[:, revolute]
        return ca.sqrt(ca.sumsqr(columns[:3, :]) / ca.sumsqr(columns[3:, :]))


@lru_cache(maxsize=64)
def _functions(arm: RobotArm) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Numeric J, full J in metres, and ℓ."""
    q = arm.symbols()
    full, _ = kinematics.jacobian(arm.chain, q)
    expressions = (arm.matrix(q), full, arm._symbolic_length(full))
    first, second, third = (ca.Function("value", [q], [one]) for one in expressions)
    return first, second, third
