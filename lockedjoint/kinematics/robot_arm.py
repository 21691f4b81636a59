"""The column model *robot*: joint positions as variables, J(q) from the kinematic chain."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.kinematics.chain import LARGEST, LIMIT_TOLERANCE, Chain
from lockedjoint.kinematics.scaled_chain import ScaledChain
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.kinematics.worst_cases import smooth_worst_cases, worst_cases
from lockedjoint.nlp.arrays import FloatArray, as_floats, check_length, whole_number
from lockedjoint.nlp.errors import InputError, of_kind, printable
from lockedjoint.nlp.problem import Constraint

# A revolute joint without limits, or with wider ones, is drawn from twice this: one turn.
_HALF_TURN_RAD = np.pi
# A prismatic joint without limits, or with wider ones, is drawn from twice this: two metres.
_HALF_TRAVEL_M = 1.0


@dataclass(frozen=True)
class RobotArm(ScaledChain):
    """A chain of a robot, the task and the characteristic length: a `ArmModel`.

    Parameters
    ----------
    chain
        The joints.
    task
        The directions of motion that J has rows for.
    length
        Characteristic length ℓ in metres; by default that of each configuration, see
        `lockedjoint.kinematics.scaled_chain`.

    Raises
    ------
    InputError
        If there are not more joints than directions, or the length is not above 0.
    """

    __hash__ = ScaledChain.__hash__

    def __post_init__(self) -> None:
        of_kind("chain", self.chain, Chain, "a Chain, as `chain_between` returns it")
        of_kind("task", self.task, TaskSpace, "a TaskSpace")
        m, n = self.shape
        if n <= m:
            names = ", ".join(self.chain.names)
            apart = f"limits missing, or at most {LIMIT_TOLERANCE:g} rad or m apart"
            still = [f"{name} cannot move: {apart}" for name, _ in self.chain.immobile]
            names = "; ".join([names, *still])
            raise InputError(
                f"free joints between {self.chain.base} and {self.chain.tip}",
                f"{n} ({names})",
                f"more than the {m} task directions: only a redundant arm tolerates a failure",
            )
        if self.length is not None:
            check_length("length", self.length)
            if not 1 / LARGEST <= self.length <= LARGEST:
                allowed = f"{1 / LARGEST:g} to {LARGEST:g} metres"
                raise InputError("length", self.length, allowed)

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

    def __repr__(self) -> str:
        """Say in one line which robot it is, and the task."""
        task = ", ".join(self.task.directions)
        return f"<{type(self).__name__}: {printable(self.description)}, task {task}>"

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:  # noqa: ARG002
        """Return none: limits are bounds."""
        return ()

    def within_bounds(self, variables: FloatArray) -> FloatArray:
        """Return the nearest positions within the limits; without limits, within one turn."""
        variables = as_floats("variables", variables)
        if variables.shape[-1:] != (self.size,):
            allowed = f"{self.size} positions"
            raise InputError("variables", f"of shape {variables.shape}", allowed)
        lower, upper = self.bounds
        continuous = ~np.isfinite(lower) & ~np.isfinite(upper) & ~np.array(self.chain.prismatic)
        one_turn = (variables + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(np.clip(np.where(continuous, one_turn, variables), lower, upper))

    def admits(self, jacobian: FloatArray, variables: FloatArray) -> bool:  # noqa: ARG002
        """Whether the positions are ones that can be computed with; limits are kept already."""
        return bool(np.all(np.abs(as_floats("variables", variables)) <= LARGEST))

    def worst_case(self, configurations: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Worst-case σ (eq. 5) and its gradient at many configurations, as a cost.

        The Jacobian is that of `jacobian`, in units of ℓ; the gradient takes into account that
        ℓ follows the configuration. Where failures tie it is that of one of them, a
        generalised gradient; see `measures.WorstCases`. Limits are not looked at.

        Parameters
        ----------
        configurations
            Positions of the free joints, radians or metres, shape (N, n); or one, (n,).

        Returns
        -------
        numpy.ndarray
            σ, shape (N,) or ().
        numpy.ndarray
            ∂σ/∂q, shape (N, n) or (n,).

        Raises
        ------
        InputError
            If the shape is another, a number is not finite, or J is not.
        """
        return worst_cases(self, self._points(configurations))

    def smooth_worst_case(
        self, configurations: npt.ArrayLike, width: float = 0.01
    ) -> tuple[FloatArray, FloatArray]:
        """Smooth lower bound of the worst case and its gradient, as `worst_case` gives them.

        For solvers and control loops: at a maximum of σ failures tie, and its gradient
        jumps. This one's does not, and it is at most w log(mn) below σ; see
        `measures.smooth_worst_case_batch`.

        Parameters
        ----------
        configurations
            Positions of the free joints, radians or metres, shape (N, n); or one, (n,).
        width
            w > 0, in units of ℓ: singular values that are closer count together.

        Returns
        -------
        numpy.ndarray
            The value, shape (N,) or ().
        numpy.ndarray
            Its gradient, shape (N, n) or (n,).

        Raises
        ------
        InputError
            As `worst_case`, or if the width is not above 0.
        """
        return smooth_worst_cases(self, self._points(configurations), width)

    def _points(self, configurations: npt.ArrayLike) -> FloatArray:
        """Return configurations as floats; InputError unless the shape is (N, n) or (n,)."""
        points = as_floats("configurations", configurations)
        n = self.size
        if points.ndim not in (1, 2) or points.shape[-1] != n:
            allowed = f"shape (N, {n}) or ({n},)"
            raise InputError("configurations", f"an array of shape {points.shape}", allowed)
        return points

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw positions uniformly within the limits; within one turn if they leave more."""
        return np.asarray(self.samples(rng, 1)[0])

    def samples(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw so many configurations, shape (count, n), as `sample` one after another."""
        of_kind("rng", rng, np.random.Generator, "a NumPy Generator")
        whole_number("count", count, 0)
        spans = np.where(self.chain.prismatic, _HALF_TRAVEL_M, _HALF_TURN_RAD)
        lower, upper = self.bounds
        wide = upper / 2 - lower / 2 > spans  # the difference itself may overflow
        centre = np.clip(0.0, lower + spans, upper - spans)
        least = np.where(wide, centre - spans, lower)
        largest = np.where(wide, centre + spans, upper)
        return np.asarray(rng.uniform(least, largest, (count, self.size)))
