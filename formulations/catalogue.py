"""The formulations and column models by name: where a new one is listed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol, TypeVar

from formulations import isotropy, max_min, residual
from formulations.arm import Arm
from formulations.joints import FreeColumn, Joint, LeverRevolute, UnitRevolute
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.ipopt_options import OptionValue
from nlp.problem import Problem, Sense

_T = TypeVar("_T")


class Formulation(Protocol):
    """What every formulation's module offers."""

    NAME: str
    SENSE: Sense
    OPTIONS: Mapping[str, OptionValue]

    def build(self, arm: Arm) -> Problem:
        """State the problem for an arm."""

    def merit(self, jacobian: FloatArray) -> float:
        """What the statement optimises, from J alone."""


FORMULATIONS: Mapping[str, Formulation] = MappingProxyType(
    {module.NAME: module for module in (residual, max_min, isotropy)}
)

MODELS: Mapping[str, Callable[[int], Joint]] = MappingProxyType(
    {
        "unit-revolute": lambda _: UnitRevolute(),
        "lever-revolute": lambda _: LeverRevolute(),
        "lever-revolute-each": lambda _: LeverRevolute(budget="each"),
        "free": lambda dimension: FreeColumn(dimension),
        "free-mean": lambda dimension: FreeColumn(dimension, budget="mean"),
    }
)


def formulation(name: str) -> Formulation:
    """Return a formulation by name; InputError if there is none."""
    return _named("formulation", name, FORMULATIONS)


def arm(model: str, joints: int, task_dimension: int = 6) -> Arm:
    """Return an arm of equal joints by the name of their column model.

    Raises
    ------
    InputError
        If there is no such model, it has another task dimension, or joints are too few.
    """
    joint = _named("model", model, MODELS)(task_dimension)
    if joint.dimension != task_dimension:
        allowed = f"{joint.dimension} for the model {model}"
        raise InputError("task dimension", task_dimension, allowed)
    return Arm.of(joint, joints)


def models_of(task_dimension: int) -> tuple[str, str]:
    """Return the two models compared by default: columns bounded each, and on the mean."""
    if task_dimension == 6:
        return "unit-revolute", "lever-revolute"
    return "free", "free-mean"


def _named(kind: str, name: str, known: Mapping[str, _T]) -> _T:
    if name not in known:
        raise InputError(kind, name, "one of " + ", ".join(known))
    return known[name]
