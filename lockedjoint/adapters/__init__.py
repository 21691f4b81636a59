"""Failure tolerance inside other tools: one module for each, which imports that tool.

`pink`, `mink` and `placo` solve inverse kinematics as quadratic programs; here are the tasks
and constraints that raise the smooth worst case s(q) of an arm in them. `jax` has it as a
function, and `compiled` as machine code.
"""

from __future__ import annotations

from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import real_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.robot import Robot


def checked(
    robot: object, width: object = 1.0, gain: object = 0.0, **numbers: object
) -> RobotArm:
    """Return the arm of a robot; InputError unless it, a width of s and numbers are allowed."""
    arm = Robot.of(robot).arm
    real_number("width", width, "a number from 1e-6 to 1e6", 1e-6, 1e6)
    real_number("gain", gain, "a number from 0 to 1", 0.0, 1.0)
    for name, value in numbers.items():
        real_number(name, value, "a finite number of at least 0", 0.0)
    return arm


def unknown_joint(name: str) -> InputError:
    """Return the error of an arm with a joint that the host's model does not have."""
    return InputError("robot", f"one with the joint {name}", "joints of the model")
