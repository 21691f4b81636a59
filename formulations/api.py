"""The library's entry points in one place; each is imported when it is first used.

::

    from formulations.api import solve, assess
    outcome = solve("max-min", "unit-revolute", joints=7)
    assess(outcome.best.jacobian)

What is listed here keeps its name and meaning as docs/versions.md promises.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from formulations import measures as measures
    from formulations.bounds.so3_moments.max_min_bound import max_min_bound as max_min_bound
    from formulations.bounds.so3_moments.residual_bound import residual_bound as residual_bound
    from formulations.bounds.so3_moments.rigorous_residual import (
        rigorous_residual_bound as rigorous_residual_bound,
    )
    from formulations.catalogue import arm as arm
    from formulations.catalogue import certified_bound as certified_bound
    from formulations.catalogue import numerical_bound as numerical_bound
    from formulations.existence.derive import derive as derive_certificate  # noqa: F401
    from formulations.existence.verify import verify as verify_certificate  # noqa: F401
    from formulations.files.jacobians import read_jacobians as read_jacobians
    from formulations.joints.arm import Arm as Arm
    from formulations.joints.kinds import FreeColumn as FreeColumn
    from formulations.joints.kinds import LeverRevolute as LeverRevolute
    from formulations.joints.kinds import Prismatic as Prismatic
    from formulations.joints.kinds import UnitRevolute as UnitRevolute
    from formulations.measures.assessment import assess as assess
    from formulations.measures.canonical import distinct as distinct
    from formulations.measures.failure_model import FailureModel as FailureModel
    from formulations.realise.choice import choose as choose
    from formulations.realise.from_jacobian import realise as realise
    from formulations.realise.write_urdf import urdf as urdf
    from formulations.robots.chain_between import chain_between as chain_between
    from formulations.robots.posture import best_posture as best_posture
    from formulations.robots.read_urdf import read_urdf as read_urdf
    from formulations.robots.robot_arm import RobotArm as RobotArm
    from formulations.robots.robot_assessment import assess as assess_robot  # noqa: F401
    from formulations.solving.solve import solve as solve
    from nlp.multistart import multistart as multistart

# Name → where it lives, and what it is called there if not the same; "" for a whole module.
_HOMES = {
    "Arm": ("formulations.joints.arm", "Arm"),
    "FailureModel": ("formulations.measures.failure_model", "FailureModel"),
    "FreeColumn": ("formulations.joints.kinds", "FreeColumn"),
    "LeverRevolute": ("formulations.joints.kinds", "LeverRevolute"),
    "Prismatic": ("formulations.joints.kinds", "Prismatic"),
    "RobotArm": ("formulations.robots.robot_arm", "RobotArm"),
    "UnitRevolute": ("formulations.joints.kinds", "UnitRevolute"),
    "arm": ("formulations.catalogue", "arm"),
    "assess": ("formulations.measures.assessment", "assess"),
    "assess_robot": ("formulations.robots.robot_assessment", "assess"),
    "best_posture": ("formulations.robots.posture", "best_posture"),
    "certified_bound": ("formulations.catalogue", "certified_bound"),
    "chain_between": ("formulations.robots.chain_between", "chain_between"),
    "choose": ("formulations.realise.choice", "choose"),
    "derive_certificate": ("formulations.existence.derive", "derive"),
    "distinct": ("formulations.measures.canonical", "distinct"),
    "max_min_bound": ("formulations.bounds.so3_moments.max_min_bound", "max_min_bound"),
    "measures": ("formulations.measures.jacobian", ""),
    "multistart": ("nlp.multistart", "multistart"),
    "numerical_bound": ("formulations.catalogue", "numerical_bound"),
    "read_jacobians": ("formulations.files.jacobians", "read_jacobians"),
    "read_urdf": ("formulations.robots.read_urdf", "read_urdf"),
    "realise": ("formulations.realise.from_jacobian", "realise"),
    "residual_bound": ("formulations.bounds.so3_moments.residual_bound", "residual_bound"),
    "rigorous_residual_bound": (
        "formulations.bounds.so3_moments.rigorous_residual",
        "rigorous_residual_bound",
    ),
    "solve": ("formulations.solving.solve", "solve"),
    "urdf": ("formulations.realise.write_urdf", "urdf"),
    "verify_certificate": ("formulations.existence.verify", "verify"),
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home, inside = _HOMES[name]
    module = import_module(home)
    return getattr(module, inside) if inside else module


def __dir__() -> list[str]:
    return __all__
