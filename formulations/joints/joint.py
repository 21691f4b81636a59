"""What a formulation needs to know of an arm, and an arm of a joint, to state columns of J.

`lockedjoint.formulations.joints.arm.Arm` is one `ArmModel`: joints to be designed, each with
parameters of its own. `lockedjoint.kinematics.robot_arm.RobotArm` is another: a robot that
exists, with joint angles as variables. The formulations are stated for any of them.

J is a Jacobian, shape (m, n), and j one of its columns, shape (m,). With six rows j = (v; ω).
SX are symbolic expressions of CasADi.
"""

import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from typing import ClassVar, Literal, Protocol

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.joints.gram_conditions import GramCondition, trace_condition
from lockedjoint.formulations.measures.jacobian import check_locked
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Constraint

#: What is bounded: each joint's own extent, or the mean of the squared extents of all such
#: joints.
Budget = Literal["each", "mean"]
#: What a column may be off from what its joint can contribute, in its own units: Ipopt meets
#: its equations to about 1e-8. A larger tolerance accepts answers that are none.
TOLERANCE = 1e-6
#: The largest number of joints of an arm that a formulation is stated for: 100 unit revolute
#: joints have 300 variables, and the derivatives alone take 5 s.
MOST_JOINTS = 100
#: The largest number of variables of such an arm.
MOST_VARIABLES = 1000


class NotInModelError(InputError):
    """A Jacobian with a column that its joint cannot have.

    Examples
    --------
    >>> import numpy as np
    >>> import lockedjoint as lj
    >>> arm = lj.arm("unit-revolute", joints=7)
    >>> try:
    ...     arm.variables(np.ones((6, 7)))
    ... except lj.NotInModelError as error:
    ...     print(type(error).__name__)
    NotInModelError
    """


class ArmModel(Protocol):
    """Columns of a Jacobian as functions of variables; frozen and hashable.

    What inherits from it has variables without bounds unless it says otherwise.
    """

    def __hash__(self) -> int:
        return object.__hash__(self)

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""

    @property
    def size(self) -> int:
        """Number of variables."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest values of the variables, each of shape (size,)."""
        return np.full(self.size, -np.inf), np.full(self.size, np.inf)

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
        point = finite_vector("variables", variables, self.size)
        return np.array(_jacobian_function(self)(point), dtype=float)

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw variables at random, shape (size,)."""

    def within_bounds(self, variables: FloatArray) -> FloatArray:
        """Return the nearest variables within the bounds, which a solver may pass a little."""
        return variables

    def admits(self, jacobian: FloatArray, variables: FloatArray) -> bool:
        """Whether this is a Jacobian of the model, at these variables: the check of answers.

        Computed from the numbers alone, without the symbols that a solver was given.
        """


@lru_cache(maxsize=64)
def _jacobian_function(model: ArmModel) -> ca.Function:
    """Return the numeric function from variables to J, made once for each model."""
    variables = model.symbols()
    return ca.Function("jacobian", [variables], [model.matrix(variables)])


class Joint(ABC):
    """One kind of joint.

    Attributes
    ----------
    budget
        ``"each"`` if the joint's extent is bounded by itself; ``"mean"`` if it shares a
        bound on the mean square with the other joints of its kind in an arm.
    exact
        Whether the extent must equal its bound instead of staying below.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> isinstance(lj.UnitRevolute(), lj.Joint)
    True
    """

    budget: Budget = "each"
    exact: ClassVar[bool] = False

    @property
    @abstractmethod
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of one joint."""

    @property
    @abstractmethod
    def dimension(self) -> int:
        """Number of task dimensions m: rows of the column."""

    @property
    @abstractmethod
    def largest_norm_squared(self) -> float:
        """Largest ‖j‖², or largest mean of ‖j‖² where the bound is on the mean."""

    @abstractmethod
    def column(self, parameters: ca.SX) -> ca.SX:
        """Symbolic column, shape (dimension, 1)."""

    def equations(self, parameters: ca.SX) -> ca.SX:  # noqa: ARG002
        """Symbolic column of what must be zero besides; empty unless the kind says more."""
        return ca.SX(0, 1)

    def extent_squared(self, parameters: ca.SX) -> ca.SX | None:  # noqa: ARG002
        """Symbolic square of what the kind's bound limits; None if nothing is left to it."""
        return None

    @property
    def extent_bound(self) -> float:
        """Bound on the extent."""
        return float("inf")

    @property
    def gram_conditions(self) -> tuple[GramCondition, ...]:
        """What jjᵀ of every column satisfies: by default ‖j‖² ≤ `largest_norm_squared`.

        The relaxation (`lockedjoint.formulations.relaxation`) knows no more of a joint. Some
        combination of the conditions must bound ‖j‖².
        """
        m, norm, shared = self.dimension, self.largest_norm_squared, self.budget == "mean"
        return (trace_condition("norm", m, slice(None), norm, equal=False, shared=shared),)

    @abstractmethod
    def sample(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw parameters of `count` joints, shape (count, len(parameters))."""

    @abstractmethod
    def invert(self, column: FloatArray) -> FloatArray:
        """Parameters that give this column; NotInModelError if there are none."""


def check_revolute(column: FloatArray) -> None:
    """Raise NotInModelError unless |ω| = 1 and v·ω = 0 for a column (v; ω), shape (6,)."""
    # Plain floats: every answer of every solver is checked, and arrays of three are slow.
    velocity, axis = column[:3].tolist(), column[3:].tolist()
    if abs(math.hypot(*axis) - 1) > TOLERANCE:
        raise outside(column, "rotational velocity of norm 1 (revolute joint)")
    if abs(sum(map(operator.mul, velocity, axis))) > TOLERANCE * max(
        1.0, math.hypot(*velocity)
    ):
        raise outside(column, "linear velocity orthogonal to the rotational (revolute joint)")


def outside(column: FloatArray, allowed: str) -> NotInModelError:
    """Return the error for a column that a joint cannot contribute."""
    shown = "(" + ", ".join(f"{entry:.6g}" for entry in column) + ")"
    return NotInModelError("column", shown, allowed)


def check(arm: ArmModel, failures: int | FailureModel = 1) -> Mapping[str, object]:
    """Return the settings of a formulation that has no setting but `failures`.

    Raises
    ------
    InputError
        If so many joints of the arm cannot lock at once, or it is no number of joints.
    """
    if isinstance(failures, FailureModel):
        allowed = "a number of joints; only max-min knows probabilities"
        raise InputError("failures", "with probabilities", allowed)
    m, n = arm.shape
    check_locked(n - m, n, failures)
    return {"failures": failures}
