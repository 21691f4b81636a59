"""placo: a soft or hard constraint that raises the smooth worst case s(q) of an arm.

placo's tasks cannot be written in Python; a half space in joint space can: what a step Δq must
gain, ∇s·Δq ≥ gain·max(target − s, 0), is linear in the joints q + Δq after it. placo takes it
as A (q + Δq) ≤ b with A = −∇s and b = −∇s·q − gain·max(target − s, 0). s is
`RobotArm.smooth_worst_case`.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.adapters import checked
from lockedjoint.adapters.compiled import smooth_of
from lockedjoint.nlp.errors import InputError, MissingLibraryError, of_kind

try:
    import placo
except ImportError:
    raise MissingLibraryError("placo") from None


class WorstCaseConstraint:
    """Raise s until it is `target`; call `update` before each `solver.solve`.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one, whose joints have the names that they have in the solver's
        robot.
    solver
        placo's solver, to which the constraint is added.
    target
        Value of s that is enough, in the unit of `arm.worst_case`.
    weight
        Weight of the constraint, which is soft; None makes it hard: then s never falls, and
        where the other tasks and limits leave no such step, placo finds none.
    gain
        Share of what s lacks that a step must gain.
    width
        w > 0: singular values that are closer count together.
    compiled
        Whether s is computed as machine code, see `lockedjoint.adapters.compiled`.

    Raises
    ------
    InputError
        If a joint of the arm is not in the robot, or continuous: placo's half spaces are in
        its positions, which for a continuous joint are (cos θ, sin θ). Or if another argument
        is not allowed.
    """

    def __init__(
        self,
        robot: object,
        solver: placo.KinematicsSolver,
        target: float,
        weight: float | None = 1.0,
        gain: float = 0.1,
        width: float = 0.01,
        compiled: bool = False,
    ) -> None:
        arm = checked(
            robot, width, gain, target=target, weight=0.0 if weight is None else weight
        )
        of_kind("solver", solver, placo.KinematicsSolver, "a KinematicsSolver of placo")
        known = set(solver.robot.joint_names())
        for name in arm.chain.names:
            if name not in known or solver.robot.get_joint_size(name) != 1:
                allowed = "joints of the robot that have one position in placo"
                raise InputError("robot", f"one with the joint {name}", allowed)
        self.arm, self.target, self.gain, self.width = arm, target, gain, width
        of_kind("compiled", compiled, bool, "True or False")
        self._smooth, self._robot = smooth_of(arm, compiled), solver.robot
        self._columns = [solver.robot.get_joint_offset(name) for name in arm.chain.names]
        self._row = np.zeros((1, len(solver.robot.state.q)))  # A, in placo's positions
        self.constraint = solver.add_joint_space_half_spaces_constraint(self._row, np.zeros(1))
        kind = "hard" if weight is None else "soft"
        self.constraint.configure("worst case", kind, weight or 0.0)

    def update(self) -> float:
        """Set the constraint for the robot's present state; return s."""
        positions = np.array([self._robot.get_joint(name) for name in self.arm.chain.names])
        value, slope = self._smooth(positions, self.width)
        self._row[0, self._columns] = -slope
        wanted = self.gain * max(self.target - value, 0.0)
        self.constraint.A = self._row
        self.constraint.b = np.array([-slope @ positions - wanted])
        return value
