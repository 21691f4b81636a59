"""What a formulation needs to know of an arm: the columns of J as functions of variables.

`formulations.joints.arm.Arm` is one such model: joints to be designed, each with parameters of
its own. `formulations.robots.robot_arm.RobotArm` is another: a robot that exists, with joint
angles as variables. The formulations are stated for any of them.
"""

from __future__ import annotations

from typing import Protocol

import casadi as ca
import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray
from nlp.problem import Constraint


class ColumnModel(Protocol):
    """Columns of a Jacobian as functions of variables; frozen and hashable."""

    def __hash__(self) -> int: ...

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""

    @property
    def size(self) -> int:
        """Number of variables."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest values of the variables, each of shape (size,)."""

    @property
    def fixed_trace(self) -> float | None:
        """‖J‖_F² where every Jacobian of the model has the same; None otherwise."""

    @property
    def description(self) -> str:
        """What the joints are, in a few words, for messages."""

    def symbols(self) -> ca.SX:
        """Symbols of the variables, shape (size, 1)."""

    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian, shape (m, n)."""

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:
        """Return what must hold of the variables besides their bounds."""

    def jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return the Jacobian at numeric variables, shape (m, n)."""

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw variables at random."""
