"""pink: a task that raises the worst case of an arm, and a barrier that bounds it from below.

Both are of the smooth worst case s(q), at most w log(mn) below σ (eq. 5), whose slope does not
jump where failures tie: `RobotArm.smooth_worst_case`.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.adapters import checked, unknown_joint
from lockedjoint.adapters.compiled import LastValue
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import MissingLibraryError, of_kind

try:
    import pinocchio
    from pink import Configuration
    from pink.barriers import Barrier
    from pink.tasks import Task
except ImportError:
    raise MissingLibraryError("pink", "pin-pink") from None


class _Cost:
    """s, and its slope by the nv velocities of pinocchio's model, at pink's configurations.

    `width` is w, and `compiled` says whether s is computed as machine code.
    """

    def __init__(
        self, arm: RobotArm, model: pinocchio.Model, width: float, compiled: bool
    ) -> None:
        of_kind("model", model, pinocchio.Model, "a Model of pinocchio")
        for name in arm.chain.names:
            if not model.existJointName(name):
                raise unknown_joint(name)
        joints = [model.joints[model.getJointId(name)] for name in arm.chain.names]
        self._last = LastValue(arm, compiled, width, [j.idx_v for j in joints], model.nv)
        self._places = np.array([joint.idx_q for joint in joints])
        # Pinocchio's q of a continuous joint is (cos θ, sin θ).
        self._turning = [k for k, joint in enumerate(joints) if joint.nq == 2]

    def __call__(self, configuration: Configuration) -> tuple[float, FloatArray]:
        """Return s and its slope, shape (1, nv)."""
        positions = configuration.q
        q = positions[self._places]
        for k in self._turning:
            place = self._places[k]
            q[k] = np.arctan2(positions[place + 1], positions[place])
        return self._last.at(q)


class WorstCaseTask(Task):
    """Raise s until it is `target`: e(q) = min(s(q) − target, 0).

    Parameters
    ----------
    robot
        A `Robot`, or what makes one, whose joints have the names that they have in `model`.
    model
        pink's model.
    target
        Value of s that is enough, in the unit of `arm.worst_case`.
    cost, gain, lm_damping
        As of every task of pink.
    width
        w > 0: singular values that are closer count together.
    compiled
        Whether s is computed as machine code, see `lockedjoint.adapters.compiled`.

    Raises
    ------
    InputError
        If a joint of the arm is not in the model, or another argument is not allowed.
    """

    def __init__(
        self,
        robot: object,
        model: pinocchio.Model,
        target: float,
        cost: float = 1.0,
        gain: float = 0.1,
        lm_damping: float = 0.0,
        width: float = 0.01,
        compiled: bool = False,
    ) -> None:
        arm = checked(robot, width, gain, target=target, cost=cost, lm_damping=lm_damping)
        super().__init__(cost=cost, gain=gain, lm_damping=lm_damping)
        self.target = target
        self._cost_of = _Cost(arm, model, width, compiled)

    def compute_error(self, configuration: Configuration) -> FloatArray:
        """Return e, shape (1,)."""
        return np.array([min(self._cost_of(configuration)[0] - self.target, 0.0)])

    def compute_jacobian(self, configuration: Configuration) -> FloatArray:
        """Return ∂s/∂q, shape (1, nv)."""
        return self._cost_of(configuration)[1].copy()

    def __repr__(self) -> str:
        return f"WorstCaseTask(target={self.target}, cost={self.cost}, gain={self.gain})"


class WorstCaseBarrier(Barrier):
    """Keep s(q) ≥ `least`, so that σ ≥ `least` after any one failure: h(q) = s(q) − least.

    Parameters
    ----------
    robot, model, width, compiled
        As of `WorstCaseTask`.
    least
        Least value of s, in the unit of `arm.worst_case`.
    gain
        As of every barrier of pink.

    Raises
    ------
    InputError
        If a joint of the arm is not in the model, or another argument is not allowed.
    """

    def __init__(
        self,
        robot: object,
        model: pinocchio.Model,
        least: float,
        gain: float = 1.0,
        width: float = 0.01,
        compiled: bool = False,
    ) -> None:
        arm = checked(robot, width, least=least)
        real_number("gain", gain, "a finite number of at least 0", 0.0)
        super().__init__(1, gain=gain)
        self.least = least
        self._cost_of = _Cost(arm, model, width, compiled)

    def compute_barrier(self, configuration: Configuration) -> FloatArray:
        """Return h, shape (1,)."""
        return np.array([self._cost_of(configuration)[0] - self.least])

    def compute_jacobian(self, configuration: Configuration) -> FloatArray:
        """Return ∂h/∂q, shape (1, nv)."""
        return self._cost_of(configuration)[1].copy()
