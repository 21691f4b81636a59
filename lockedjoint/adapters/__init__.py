"""Failure tolerance inside other tools: one module for each, which imports that tool.

`pink`, `mink` and `placo` solve inverse kinematics as quadratic programs; here are the tasks
and constraints that raise the smooth worst case s(q) of an arm in them. `jax` has it as a
function, and `compiled` as machine code.

σ(q) is the worst case: the least singular value that a failure leaves of the arm's Jacobian, m
task rows by n joints (eq. 5). s(q) is below σ(q) by at most w log(mn), and has no kinks; w is
its *width*: see `RobotArm.smooth_worst_case`. q has one position per joint of the arm, radians
or (prismatic joints) metres; a *host* is the other tool, whose q may have more joints.
"""

from __future__ import annotations

from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import real_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.robot import Robot

# Smallest width w that is allowed: with smaller ones s has a kink for all purposes.
_LEAST_WIDTH = 1e-6
# Largest width w that is allowed: with larger ones s says nothing of σ.
_LARGEST_WIDTH = 1e6


def checked(
    robot: object, width: object = 1.0, gain: object = 0.0, **numbers: object
) -> RobotArm:
    """Return the arm of a robot, or of what makes one, for a task of a host.

    InputError unless the width is allowed, the gain is from 0 to 1, and the other numbers, by
    their names, are at least 0.
    """
    arm = Robot.of(robot).arm
    real_number("width", width, "a number from 1e-6 to 1e6", _LEAST_WIDTH, _LARGEST_WIDTH)
    real_number("gain", gain, "a number from 0 to 1", 0.0, 1.0)
    for name, value in numbers.items():
        real_number(name, value, "a finite number of at least 0", 0.0)
    return arm


def unknown_joint(name: str) -> InputError:
    """Return the error of an arm with a joint that the host's model does not have."""
    return InputError("robot", f"one with the joint {name}", "joints of the model")
