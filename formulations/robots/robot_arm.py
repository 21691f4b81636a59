"""The column model *robot*: joint positions as variables, J(q) from the kinematic chain.

A Jacobian mixes metres and radians. Here every length is measured in a characteristic
length ℓ: linear velocities become v/ℓ, and so does the rate of a prismatic joint, whose
column then has |v| = 1 as that of a revolute joint has |ω| = 1. The result has no unit.

Unless a length is given, ℓ is the root mean square of the revolute joints' lever arms,

    ℓ² = Σ|v_i|² / Σ|ω_i|²     over the revolute joints, at that configuration.

Then Σ|v_i|² = Σ|ω_i|², as an isotropic Jacobian of revolute joints must have it; ‖J‖_F² is
2n whatever the robot's size; and a robot is measured on the same scale as `LeverRevolute`
joints, which are designed at mean square lever arm 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import NoneType

import casadi as ca
import numpy as np
import numpy.typing as npt

from formulations.joints.joint import check_length
from formulations.kinematics.chain import LARGEST, Chain
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.forward import tip_kinematics
from formulations.kinematics.read_robot import read_robot
from formulations.robots.task import TaskSpace
from formulations.robots.worst_cases import ScaledChain, smooth_worst_cases, worst_cases
from nlp.arrays import FloatArray, as_floats, finite_vector, whole_number
from nlp.errors import InputError, of_kind, printable, takes
from nlp.problem import Constraint

# A joint without limits, or with wider ones, is drawn from twice this: one turn, two metres.
_HALF_TURN, _HALF_TRAVEL = np.pi, 1.0


@dataclass(frozen=True)
class RobotArm(ScaledChain):
    """A chain of a robot, the task and the characteristic length: a `ColumnModel`.

    Parameters
    ----------
    chain
        The joints.
    task
        The directions of motion that J has rows for.
    length
        Characteristic length ℓ in metres; by default that of each configuration, see above.

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
            names += "".join(f"; {name} cannot move" for name, _ in self.chain.immobile)
            raise InputError(
                f"free joints between {self.chain.base} and {self.chain.tip}",
                f"{n} ({names})",
                f"more than the {m} task directions: only a redundant arm tolerates a failure",
            )
        if self.length is not None:
            check_length("length", self.length)
            if not 1 / LARGEST <= self.length <= LARGEST:
                raise InputError(
                    "length", self.length, f"{1 / LARGEST:g} to {LARGEST:g} metres"
                )

    @classmethod
    def read(
        cls,
        source: object,
        tip: str | None = None,
        base: str | None = None,
        task: TaskSpace | str = "all",
        length: float | None = None,
        locked_at: Mapping[str, float] | None = None,
        point: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> RobotArm:
        """Return an arm of a robot that a file or a model describes.

        Parameters
        ----------
        source
            A path or a model; see `formulations.kinematics.read_robot`.
        tip, base, locked_at, point
            Links, joints that have locked and the tip's point, see `chain_between`; by
            default the only last link, the root, none and the origin.
        task
            A task, or its directions as `TaskSpace.parse` reads them.
        length
            Characteristic length ℓ in metres; by default that of each configuration.

        Raises
        ------
        InputError
            If the robot cannot be read, a name is unknown, or the joints are too few.
        """
        of_kind("tip", tip, (str, NoneType), "the name of a link")
        of_kind("base", base, (str, NoneType), "the name of a link")
        of_kind("task", task, (str, TaskSpace), "a TaskSpace, or its directions as text")
        of_kind(
            "locked_at", locked_at, (Mapping, NoneType), "a mapping from joints to positions"
        )
        tree = read_robot(source)
        tip = tree.last_link() if tip is None else tip
        chain = chain_between(tree, tip, base, locked_at, point)
        return cls(chain, TaskSpace.parse(task) if isinstance(task, str) else task, length)

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

    def __repr__(self) -> str:
        """Say in one line which robot it is, and the task."""
        task = ", ".join(self.task.directions)
        return f"<{type(self).__name__}: {printable(self.description)}, task {task}>"

    def symbols(self) -> ca.SX:
        """Symbols of the joints' positions, radians or metres, shape (n, 1)."""
        return ca.SX.sym("q", self.size)

    @takes("symbols as `symbols` returns them")
    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian in units of ℓ, shape (m, n)."""
        metric = self._symbolic_metric(variables)
        length = self._symbolic_length(metric)
        joints = self.chain.joints
        rates = [joint.speed * (length if joint.prismatic else ca.SX(1)) for joint in joints]
        scaled = ca.vertcat(metric[:3, :] / length, metric[3:, :]) @ ca.diag(ca.vertcat(*rates))
        return scaled[self.task.rows, :]

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

    def jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return the Jacobian at numeric positions, in units of ℓ, shape (m, n)."""
        metric = self.metric_jacobian(variables)
        return self._scaled(metric, self._length(metric))

    def jacobian_at_length(self, variables: npt.ArrayLike, length: float) -> FloatArray:
        """Return the Jacobian at numeric positions, in units of another length."""
        check_length("length", length)
        return self._scaled(self.metric_jacobian(variables), length)

    def metric_jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return all six rows (v; ω) in metres and radians, in the task's frame, (6, n)."""
        point = finite_vector("configuration", variables, self.size)
        return np.array(_metric_function(self)(point), dtype=float)

    def length_at(self, variables: npt.ArrayLike) -> float:
        """Characteristic length ℓ at numeric positions, in metres.

        Raises
        ------
        InputError
            If it is not given, and the axes of all revolute joints meet at the tip.
        """
        return self._length(self.metric_jacobian(variables))

    def _length(self, metric: FloatArray) -> float:
        if not self.follows_configuration:
            return 1.0 if self.length is None else self.length
        columns = metric[:, ~np.array(self.chain.prismatic)]
        square = float(np.sum(columns[:3] ** 2) / np.sum(columns[3:] ** 2))
        if square < 1e-18:
            allowed = "a given length, where the axes of all revolute joints meet in the tip"
            raise InputError("characteristic length", "0", allowed)
        return float(np.sqrt(square))

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
        points = as_floats("configurations", configurations)
        n = self.size
        if points.ndim not in (1, 2) or points.shape[-1] != n:
            allowed = f"shape (N, {n}) or ({n},)"
            raise InputError("configurations", f"an array of shape {points.shape}", allowed)
        return points

    @property
    def depends_on_length(self) -> bool:
        """Whether ratios of singular values depend on ℓ; if not, ℓ is only a unit of length."""
        both_kinds = len(set(self.chain.prismatic)) == 2
        return self.task.mixed or (self.task.linear and both_kinds)

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw positions uniformly within the limits; within one turn if they leave more."""
        return np.asarray(self.samples(rng, 1)[0])

    def samples(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw so many configurations, shape (count, n), as `sample` one after another."""
        of_kind("rng", rng, np.random.Generator, "a NumPy Generator")
        whole_number("count", count, 0)
        spans = np.where(self.chain.prismatic, _HALF_TRAVEL, _HALF_TURN)
        lower, upper = self.bounds
        wide = upper / 2 - lower / 2 > spans  # the difference itself may overflow
        centre = np.clip(0.0, lower + spans, upper - spans)
        least = np.where(wide, centre - spans, lower)
        largest = np.where(wide, centre + spans, upper)
        return np.asarray(rng.uniform(least, largest, (count, self.size)))

    def _scaled(self, metric: FloatArray, length: float) -> FloatArray:
        metric[:3] /= length
        metric[:, list(self.chain.prismatic)] *= length
        metric *= self.chain.speeds
        return metric[self.task.rows]

    def _symbolic_metric(self, variables: ca.SX) -> ca.SX:
        full, _, rotation = tip_kinematics(self.chain, variables)
        if self.task.frame == "base":
            return full
        return ca.vertcat(rotation.T @ full[:3, :], rotation.T @ full[3:, :])

    def _symbolic_length(self, metric: ca.SX) -> ca.SX:
        if not self.follows_configuration:
            return ca.SX(1.0 if self.length is None else self.length)
        revolute = [k for k, joint in enumerate(self.chain.joints) if not joint.prismatic]
        columns = metric[:, revolute]
        return ca.sqrt(ca.sumsqr(columns[:3, :]) / ca.sumsqr(columns[3:, :]))


@lru_cache(maxsize=64)
def _metric_function(arm: RobotArm) -> ca.Function:
    q = arm.symbols()
    return ca.Function("metric", [q], [arm._symbolic_metric(q)])
