"""mink: a task that raises the smooth worst case s(q) of an arm.

s and its width w are `RobotArm.smooth_worst_case`. A configuration of mink has nq positions and
nv velocities, those of the arm's n joints among them.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.adapters import checked, unknown_joint
from lockedjoint.adapters.compiled import LastValue
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import MissingLibraryError, of_kind

try:
    import mink
    import mujoco
except ImportError:
    raise MissingLibraryError("mink") from None


class MinkWorstCaseTask(mink.Task):
    """Raise s until it is `target`: e(q) = min(s(q) − target, 0).

    Parameters
    ----------
    robot
        A `Robot`, or what makes one, whose joints have the names that they have in `model`.
    model
        mink's model.
    target
        Value of s that is enough, in the unit of `arm.worst_case`.
    cost, gain, lm_damping
        As of every task of mink.
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
        model: mujoco.MjModel,
        target: float,
        cost: float = 1.0,
        gain: float = 0.1,
        lm_damping: float = 0.0,
        width: float = 0.01,
        compiled: bool = False,
    ) -> None:
        arm = checked(robot, width, gain, target=target, cost=cost, lm_damping=lm_damping)
        of_kind("model", model, mujoco.MjModel, "an MjModel of mujoco")
        super().__init__(cost=np.array([cost]), gain=gain, lm_damping=lm_damping)
        numbers = []  # of the arm's joints in the model
        for name in arm.chain.names:
            number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if number < 0:
                raise unknown_joint(name)
            numbers.append(number)
        self.target, self.width, self.arm = target, width, arm
        velocities = model.jnt_dofadr[numbers]
        self._last = LastValue(arm, compiled, width, velocities, model.nv)
        self._positions = model.jnt_qposadr[numbers]

    def compute_error(self, configuration: mink.Configuration) -> FloatArray:
        """Return e, shape (1,)."""
        return np.array([min(self._at(configuration)[0] - self.target, 0.0)])

    def compute_jacobian(self, configuration: mink.Configuration) -> FloatArray:
        """Return ∂s/∂q, shape (1, nv)."""
        return self._at(configuration)[1].copy()

    def _at(self, configuration: mink.Configuration) -> tuple[float, FloatArray]:
        """Return s and ∂s/∂q, shape (1, nv)."""
        return self._last.at(configuration.q[self._positions])
