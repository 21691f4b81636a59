"""What is run: a formulation on an arm, with its settings and the solver's."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from importlib import import_module
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.formulations.joints.models import model_of
from lockedjoint.formulations.registry import Formulation, check_formulation
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.options import CheckedOptions, check_options
from lockedjoint.nlp.problem import Problem

#: No settings, or no options.
NOTHING: Mapping[str, Any] = MappingProxyType({})
# How many joints lock at once where a formulation has no such setting.
_ONE_FAILURE = 1


@dataclass(frozen=True, eq=False, repr=False)
class Case(Brief):
    """A formulation on an arm, and how it is stated and solved.

    Attributes
    ----------
    formulation
        A module of the library, or any object with the names of `Formulation`.
    arm
        Any column model: joints to be designed, or a robot.
    settings
        Those of the formulation, by name; what is left out has its default.
    variant
        How it departs from the defaults, in words; empty if it does not.
    options
        Solver options, over those of the problem.
    solver
        See `lockedjoint.nlp.solver.Solver`.

    Raises
    ------
    InputError
        If the formulation has no such setting, or refuses its value.
    SolverOptionError
        If the solver refuses an option.
    """

    formulation: Formulation
    arm: ArmModel
    settings: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    solver: str = "ipopt"

    def __post_init__(self) -> None:
        check_formulation(self.formulation)
        known = self.formulation.SETTINGS
        for name, value in self.settings.items():
            if name not in known:
                allowed = f"none for the formulation {self.formulation.NAME}"
                if known:
                    allowed = f"one of its settings: {', '.join(known)}"
                raise InputError(name.replace("_", " "), value, allowed)
        completed = {**known, **self.settings}
        if hasattr(self.formulation, "check"):
            completed = self.formulation.check(self.arm, **completed)
        object.__setattr__(self, "settings", MappingProxyType(dict(completed)))
        object.__setattr__(self, "options", check_options(self.options, self.solver))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle from the parts, settings as a plain mapping, a module of ours as its name."""
        formulation: Any = self.formulation
        name = getattr(formulation, "__name__", "")
        if name.startswith("lockedjoint.") and sys.modules.get(name) is formulation:
            formulation = name
        parts = (formulation, self.arm, dict(self.settings), self.variant)
        return _unpickled, (*parts, self.options, self.solver)

    @property
    def failures(self) -> int:
        """How many joints lock at once."""
        failures = self.settings.get("failures", _ONE_FAILURE)
        return int(getattr(failures, "failures", failures))  # a number, or a FailureModel

    @property
    def model(self) -> str:
        """What the joints are: the name of their kind, or a description."""
        if not isinstance(self.arm, Arm):
            return self.arm.description
        try:
            return model_of(self.arm)
        except InputError:  # of a kind without a name
            return self.arm.description

    @property
    def name(self) -> str:
        """Formulation, joints and variant in words."""
        return " ".join(filter(None, (self.formulation.NAME, self.model, self.variant)))

    @property
    def build(self) -> Callable[[], Problem]:
        """What states the problem, in a form that worker processes can be sent."""
        return partial(self.formulation.build, self.arm, **self.settings)

    @property
    def sample(self) -> Callable[[np.random.Generator], FloatArray]:
        """What draws a start: variables of the arm, shape (size,), from a random generator."""
        sampler = getattr(self.formulation, "sampler", None)
        draw: Callable[[np.random.Generator], FloatArray]
        draw = sampler(self.arm, **self.settings) if sampler else self.arm.sample
        return draw

    def score(self, jacobian: FloatArray) -> float:
        """Return what is optimised, from J alone, shape (m, n)."""
        return self.formulation.score(jacobian, **self.settings)

    @cached_property
    def all_options(self) -> CheckedOptions:
        """The solver's options, those of the problem included."""
        return CheckedOptions({**self.build().options.get(self.solver, {}), **self.options})


def _unpickled(formulation: Formulation | str, *parts: Any) -> Case:
    """Return a case from what `Case.__reduce__` wrote."""
    if isinstance(formulation, str):
        formulation = cast(Formulation, import_module(formulation))
    return Case(formulation, *parts)
