"""What is run: a formulation on a column model, with its settings and the failures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from formulations import isotropy, max_min, residual, unequal_max_min
from formulations.catalogue import arm, formulation, models_of
from formulations.joints.arm import Arm
from formulations.measures.unequal_failures import FailureModel
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.problem import Problem


@dataclass(frozen=True)
class Setup:
    """A formulation on a column model, and how it is stated.

    Attributes
    ----------
    formulation, model
        Names in `formulations.catalogue`.
    variant
        How it departs from the formulation's defaults, in words; empty if it does not.
    encoding
        Encoding of the eigenvalue constraints, for max-min; by default the one that suits the
        failures, see `max_min.default_encoding` and `unequal_max_min.default_encoding`.
    from_residual_minima
        Whether random starts are first brought to a residual minimum, for max-min.
    locked
        How many joints lock at once, for max-min and manipulability.
    failures
        Which joints may fail and how likely, for max-min; None where all are alike.
    goal
        What is maximised then; see `unequal_max_min`.

    Raises
    ------
    InputError
        If a name is unknown, or a setting of max-min is given to another formulation.
    """

    formulation: str
    model: str
    variant: str = ""
    encoding: str = ""
    from_residual_minima: bool = False
    locked: int = 1
    failures: FailureModel | None = None
    goal: unequal_max_min.Goal = "worst"

    def __post_init__(self) -> None:
        taken = formulation(self.formulation).SETTINGS
        for name in ("encoding", "from_residual_minima", "locked", "failures", "goal"):
            default, value = type(self).__dataclass_fields__[name].default, getattr(self, name)
            if value != default and name not in taken:
                allowed = f"{default or 'none'} for the formulation {self.formulation}"
                raise InputError(name.replace("_", " "), value, allowed)
        unequal_max_min.checked_goal(self.goal)
        if self.failures is None:
            if self.goal != "worst":
                raise InputError("goal", self.goal, "'worst' where all joints are alike")
        elif self.failures.locked != self.locked:
            allowed = f"{self.failures.locked}, as in the failure model"
            raise InputError("locked joints", self.locked, allowed)
        if "encoding" in taken:
            self._choose_encoding()

    def _choose_encoding(self) -> None:
        if not self.encoding and self.failures is not None:
            chosen = unequal_max_min.default_encoding(self.failures, self.goal)
            object.__setattr__(self, "encoding", chosen)
        elif not self.encoding:
            object.__setattr__(self, "encoding", max_min.default_encoding(self.locked))
        max_min.check_encoding(self.encoding, self.locked, self.failures is None)

    def build(self, joints: int, task_dimension: int) -> Callable[[], Problem]:
        """Return what builds the problem, in a form that worker processes can be sent."""
        built = arm(self.model, joints, task_dimension)
        if "locked" in formulation(self.formulation).SETTINGS:
            # Here, not in the workers that build it: they take seconds to start.
            fallible = joints if self.failures is None else len(self.failures.fallible)
            unequal_max_min.check_locked(joints - task_dimension, fallible, self.locked)
        if self.failures is not None:
            build = unequal_max_min.build
            return partial(build, built, self.failures, self.goal, self.encoding)
        stated = formulation(self.formulation)
        taken = {n: getattr(self, n) for n in ("locked", "encoding") if n in stated.SETTINGS}
        return partial(stated.build, built, **taken)

    def merit(self) -> Callable[[FloatArray], float]:
        """Return what is optimised, from J alone."""
        if self.failures is not None:
            return partial(unequal_max_min.merit, failures=self.failures, goal=self.goal)
        return partial(formulation(self.formulation).merit, locked=self.locked)

    def sample(self, arm: Arm) -> Callable[[np.random.Generator], FloatArray]:
        """Return what draws a start."""
        return max_min.ResidualMinimum(arm) if self.from_residual_minima else arm.sample


def setups(task_dimension: int) -> tuple[Setup, ...]:
    """List the rows: each formulation on both models, and the variants of max-min on one."""
    first, second = models_of(task_dimension)
    return (
        Setup(residual.NAME, first),
        Setup(max_min.NAME, first),
        Setup(
            max_min.NAME,
            first,
            "from residual minima",
            "shared-factor",
            from_residual_minima=True,
        ),
        Setup(max_min.NAME, first, "one factor per failure", "factor-per-deletion"),
        Setup(
            max_min.NAME,
            first,
            "one positive factor per failure",
            "positive-factor-per-deletion",
        ),
        Setup(isotropy.NAME, first),
        Setup(residual.NAME, second),
        Setup(max_min.NAME, second),
        Setup(isotropy.NAME, second),
    )


def solver_options(
    name: str, solver: str, options: Mapping[str, object], encoding: str = ""
) -> Mapping[str, object]:
    """Return the options over the formulation's and the encoding's own for this solver."""
    stated = formulation(name)
    if solver != "ipopt":
        return {**getattr(stated, f"{solver.upper()}_OPTIONS", {}), **options}
    own = getattr(stated, "ENCODING_OPTIONS", {}).get(encoding, {})
    return {**own, **stated.OPTIONS, **options}
