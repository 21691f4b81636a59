"""The Jacobian of a chain for a task: which directions it has rows for, and in which unit.

A Jacobian mixes metres and radians. Here every length is measured in a characteristic
length ℓ: linear velocities become v/ℓ, and so does the rate of a prismatic joint, whose
column then has |v| = 1 as that of a revolute joint has |ω| = 1. The result has no unit.

Unless a length is given, ℓ is the root mean square of the revolute joints' lever arms,

    ℓ² = Σ|v_i|² / Σ|ω_i|²     over the revolute joints, at that configuration.

Then Σ|v_i|² = Σ|ω_i|², as an isotropic Jacobian of revolute joints must have it; ‖J‖_F² is
2n whatever the robot's size; and a robot is measured on the same scale as `LeverRevolute`
joints, which are designed at mean square lever arm 1.

Letters: m rows of the task, n joints, k motions of the chain (at least n: a joint that others
follow has several), q positions of the joints in radians and metres, (n,). Metric Jacobians are
(v; ω), (6, n), in metres and radians; J, (m, n), is in units of ℓ, each column times the
joint's speed (1 for most, see `ChainJoint`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.objects import takes
from lockedjoint.kinematics.chain import LARGEST, Chain
from lockedjoint.kinematics.forward import motion_columns, of_joints
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.arrays import FloatArray, as_floats, check_length, finite_vector
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import Evaluation

# Lever arms up to this share of the links' lengths are zero, but for rounding: ℓ would be
# rounding, too. If it is larger, arms whose axes nearly meet in the tip are refused.
_LEVER_ROUNDING_SHARE = 1e-9
# The function to the metric Jacobian is kept for so many arms.
_CACHED_ARMS = 64


@dataclass(frozen=True)
class ScaledChain:
    """A chain, its task, and the length ℓ that J is in units of, if one is given."""

    chain: Chain
    task: TaskSpace = field(default_factory=TaskSpace)
    length: float | None = None

    def __hash__(self) -> int:
        """Look at some of it: the whole takes longer than a tenth of an evaluation."""
        chain = self.chain
        return hash((chain.robot, chain.tip, chain.locked_at, len(chain.joints), self.length))

    def __getstate__(self) -> dict[str, object]:
        """Travel to other processes without what was computed."""
        return {k: v for k, v in self.__dict__.items() if not k.startswith("_")}

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n): task dimension and number of joints."""
        return len(self.task.directions), len(self.chain.joints)

    @property
    def size(self) -> int:
        """Number of variables: one per joint."""
        return len(self.chain.joints)

    @property
    def follows_configuration(self) -> bool:
        """Whether ℓ is that of each configuration."""
        return self.length is None and self.task.linear and not all(self.chain.prismatic)

    @property
    def depends_on_length(self) -> bool:
        """Whether ratios of singular values depend on ℓ; if not, ℓ is only a unit of length."""
        both_kinds = len(set(self.chain.prismatic)) == 2
        return self.task.mixed or (self.task.linear and both_kinds)

    def symbols(self) -> ca.SX:
        """Symbols of the joints' positions, radians or metres, shape (n, 1)."""
        return ca.SX.sym("q", self.size)

    @takes("symbols as `symbols` returns them")
    def matrix(self, variables: ca.SX) -> ca.SX:
        """Symbolic Jacobian in units of ℓ, shape (m, n)."""
        return self.matrix_of(self.motion_columns(variables))

    @takes("symbols as `symbols` returns them")
    def motion_columns(self, variables: ca.SX) -> ca.SX:
        """Symbolic (v; ω) of each motion in metres and radians, in the task's frame, (6, k)."""
        columns, _, rotation = motion_columns(self.chain, variables)
        if self.task.frame == "base":
            return columns
        return ca.vertcat(rotation.T @ columns[:3, :], rotation.T @ columns[3:, :])

    @takes("columns as `motion_columns` returns them")
    def matrix_of(self, columns: ca.SX) -> ca.SX:
        """Symbolic Jacobian in units of ℓ, shape (m, n), from the motions' columns, (6, k)."""
        metric, length = of_joints(self.chain, columns), ca.SX(self.length or 1.0)
        if self.follows_configuration:
            # ℓ of the header, from the revolute joints.
            turning = metric[:, self._turning]
            length = ca.sqrt(ca.sumsqr(turning[:3, :]) / ca.sumsqr(turning[3:, :]))
        joints = self.chain.joints
        rates = [joint.speed * (length if joint.prismatic else ca.SX(1)) for joint in joints]
        scaled = ca.vertcat(metric[:3, :] / length, metric[3:, :]) @ ca.diag(ca.vertcat(*rates))
        return scaled[self.task.rows, :]

    def jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return the Jacobian at numeric positions, in units of ℓ, shape (m, n)."""
        metric = self.metric_jacobian(variables)
        return self.in_units_of(metric, self.length_of(metric))

    def jacobian_at_length(self, variables: npt.ArrayLike, length: float) -> FloatArray:
        """Return the Jacobian at numeric positions, in units of another length (metres)."""
        check_length("length", length)
        return self.in_units_of(self.metric_jacobian(variables), length)

    def metric_jacobian(self, variables: npt.ArrayLike) -> FloatArray:
        """Return all six rows (v; ω) in metres and radians, in the task's frame, (6, n)."""
        point = finite_vector("configuration", variables, self.size)
        return _metric_evaluation(self)(point)[0]

    def length_at(self, variables: npt.ArrayLike) -> float:
        """Characteristic length ℓ at numeric positions, in metres.

        Raises
        ------
        InputError
            If it is not given, and the axes of all revolute joints meet at the tip.
        """
        return self.length_of(self.metric_jacobian(variables))

    def length_of(self, metric: FloatArray) -> float:
        """Characteristic length ℓ in metres, from the Jacobian in metres; see `length_at`."""
        if not self.follows_configuration:
            return self.length or 1.0
        columns = self._checked(metric)[:, self._turning]
        square = float(np.sum(columns[:3] ** 2) / np.sum(columns[3:] ** 2))
        if square <= self._no_lever**2:
            allowed = "a given length, where the axes of all revolute joints meet in the tip"
            raise InputError("characteristic length", "0", allowed)
        return float(np.sqrt(square))

    @cached_property
    def _no_lever(self) -> float:
        """The lever arm in metres up to which it is rounding.

        It is a share of the links' lengths; what is before the first joint is no link.
        """
        poses = [np.array(motion.placement) for motion in self.chain.motions[1:]]
        shifts = [np.linalg.norm(pose[:3, 3]) for pose in (*poses, np.array(self.chain.end))]
        return max(_LEVER_ROUNDING_SHARE * float(np.sum(shifts)), 1 / LARGEST)

    @property
    def _turning(self) -> list[int]:
        """Which joints are revolute."""
        return [k for k, slides in enumerate(self.chain.prismatic) if not slides]

    def _checked(self, metric: FloatArray) -> FloatArray:
        """Return a metric Jacobian; InputError unless it has shape (6, n)."""
        metric = as_floats("jacobian", metric)
        if metric.shape != (6, self.size):
            raise InputError("jacobian", f"of shape {metric.shape}", f"shape (6, {self.size})")
        return metric

    def in_units_of(self, metric: FloatArray, length: float) -> FloatArray:
        """Return the task's rows in units of a length, of the Jacobian in metres, (6, n)."""
        metric = self._checked(metric).copy()
        check_length("length", length)
        metric[:3] /= length
        metric[:, list(self.chain.prismatic)] *= length
        metric *= self.chain.speeds
        return metric[self.task.rows]


@lru_cache(maxsize=_CACHED_ARMS)
def _metric_evaluation(arm: ScaledChain) -> Evaluation:
    """Return the function from q, (n,), to the metric Jacobian, (6, n), of an arm."""
    q = arm.symbols()
    return Evaluation(q, [of_joints(arm.chain, arm.motion_columns(q))])
