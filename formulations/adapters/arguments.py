"""Checks of the arguments that the adapters share, before a host sees them."""

from __future__ import annotations

from formulations.robots.robot_arm import RobotArm
from nlp.arrays import real_number
from nlp.errors import of_kind


def check_arm(arm: object) -> None:
    """Raise InputError unless this is an arm."""
    of_kind("arm", arm, RobotArm, "a RobotArm")


def check_width(width: object) -> None:
    """Raise InputError unless this is a width of the smooth worst case."""
    real_number("width", width, "a number from 1e-6 to 1e6", 1e-6, 1e6)


def check_numbers(**numbers: object) -> None:
    """Raise InputError for the first that is no finite number of at least 0."""
    for name, value in numbers.items():
        real_number(name, value, "a finite number of at least 0", 0.0)


def check_gain(gain: object) -> None:
    """Raise InputError unless this is the gain of a task."""
    real_number("gain", gain, "a number from 0 to 1", 0.0, 1.0)
