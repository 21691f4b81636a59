"""The formulations and column models by name: where a new one is listed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Protocol, TypeVar

from formulations import isotropy, max_min, residual
from formulations.joints.arm import Arm
from formulations.joints.column_model import ColumnModel
from formulations.joints.kinds import FreeColumn, Joint, LeverRevolute, Prismatic, UnitRevolute
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

    def build(self, arm: ColumnModel) -> Problem:
        """State the problem for an arm."""

    def merit(self, jacobian: FloatArray, locked: int = 1) -> float:
        """What the statement optimises, from J alone."""


FORMULATIONS: Mapping[str, Formulation] = MappingProxyType(
    {module.NAME: module for module in (residual, max_min, isotropy)}
)

MODELS: Mapping[str, Callable[[int], Joint]] = MappingProxyType(
    {
        "unit-revolute": lambda _: UnitRevolute(),
        "lever-revolute": lambda _: LeverRevolute(),
        "lever-revolute-each": lambda _: LeverRevolute(budget="each"),
        "prismatic": lambda _: Prismatic(),
        "free": lambda dimension: FreeColumn(dimension),
        "free-mean": lambda dimension: FreeColumn(dimension, budget="mean"),
    }
)


def formulation(name: str) -> Formulation:
    """Return a formulation by name; InputError if there is none."""
    return _named("formulation", name, FORMULATIONS)


def arm(model: str, joints: int, task_dimension: int = 6) -> Arm:
    """Return an arm by the name of its joints' column model.

    Parameters
    ----------
    model
        A name in `MODELS`, or a mix such as ``lever-revolute:6,prismatic:2``.
    joints
        Number of joints n; of a mix, the sum of its parts.
    task_dimension
        Number of task dimensions m.

    Raises
    ------
    InputError
        If there is no such model, it has another task dimension, or joints are too few.
    """
    parts = [_part(part, joints) for part in model.split(",")]
    if sum(count for _, count in parts) != joints:
        raise InputError("joints", joints, f"{sum(count for _, count in parts)} for {model}")
    row = []
    for name, count in parts:
        joint = _named("model", name, MODELS)(task_dimension)
        if joint.dimension != task_dimension:
            allowed = f"{joint.dimension} for the model {name}"
            raise InputError("task dimension", task_dimension, allowed)
        row += [joint] * count
    return Arm(tuple(row))


def _part(text: str, joints: int) -> tuple[str, int]:
    name, colon, count = text.partition(":")
    if not colon:
        return name, joints
    if not count.isdigit() or int(count) < 1:
        raise InputError("model", text, "NAME:COUNT with a count of at least 1")
    return name, int(count)


def models_of(task_dimension: int) -> tuple[str, str]:
    """Return the two models compared by default: columns bounded each, and on the mean."""
    if task_dimension == 6:
        return "unit-revolute", "lever-revolute"
    return "free", "free-mean"


def _named(kind: str, name: str, known: Mapping[str, _T]) -> _T:
    if name not in known:
        raise InputError(kind, name, "one of " + ", ".join(known))
    return known[name]
