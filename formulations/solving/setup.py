"""Who takes part in a comparison: a formulation on a column model, and how it is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from formulations import isotropy, max_min, residual, unequal_max_min
from formulations.catalogue import arm, formulation, models_of
from formulations.joints.arm import Arm
from formulations.measures.failure_model import FailureModel
from formulations.solving.outcome import Outcome
from formulations.solving.record import judge
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.multistart import multistart
from nlp.problem import Problem


@dataclass(frozen=True)
class Setup:
    """One row of the comparison.

    Attributes
    ----------
    formulation, model
        Names in `formulations.catalogue`.
    variant
        How it departs from the formulation's defaults, in words; empty if it does not.
    encoding
        Encoding of the eigenvalue constraints, for max-min.
    from_residual_minima
        Whether random starts are first brought to a residual minimum, for max-min.
    locked
        How many joints lock at once, for max-min.
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
    encoding: str = "shared-factor"
    from_residual_minima: bool = False
    locked: int = 1
    failures: FailureModel | None = None
    goal: unequal_max_min.Goal = "worst"

    def __post_init__(self) -> None:
        formulation(self.formulation)
        if self.formulation == max_min.NAME:
            self._check_failures()
            return
        if self.failures is not None:
            allowed = f"left out for the formulation {self.formulation}"
            raise InputError("failure model", "given", allowed)
        for name in ("encoding", "from_residual_minima", "locked", "goal"):
            default, value = type(self).__dataclass_fields__[name].default, getattr(self, name)
            if value != default:
                allowed = f"{default} for the formulation {self.formulation}"
                raise InputError(name, value, allowed)

    def build(self, joints: int, task_dimension: int) -> Callable[[], Problem]:
        """Return what builds the problem, in a form that worker processes can be sent."""
        built = arm(self.model, joints, task_dimension)
        if self.failures is not None:
            build = unequal_max_min.build
            return partial(build, built, self.failures, self.goal, self.encoding)
        if self.formulation == max_min.NAME:
            return partial(max_min.build, built, self.locked, self.encoding)
        return partial(formulation(self.formulation).build, built)

    def merit(self) -> Callable[[FloatArray], float] | None:
        """Return what is maximised, from J alone, where it is not the formulation's own."""
        if self.failures is None:
            return None
        return partial(unequal_max_min.merit, failures=self.failures, goal=self.goal)

    def _check_failures(self) -> None:
        unequal_max_min.checked_goal(self.goal)
        if self.failures is None:
            if self.goal != "worst":
                raise InputError("objective", self.goal, "'worst' where all joints are alike")
        elif self.failures.locked != self.locked:
            allowed = f"{self.failures.locked}, as in the failure model"
            raise InputError("locked joints", self.locked, allowed)

    def sample(self, arm: Arm) -> Callable[[np.random.Generator], FloatArray]:
        """Return what draws a start."""
        return max_min.ResidualMinimum(arm) if self.from_residual_minima else arm.sample


def setups(task_dimension: int) -> tuple[Setup, ...]:
    """List the rows: each formulation on both models, and the variants of max-min on one."""
    first, second = models_of(task_dimension)
    return (
        Setup(residual.NAME, first),
        Setup(max_min.NAME, first),
        Setup(max_min.NAME, first, "from residual minima", from_residual_minima=True),
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
    name: str, solver: str, options: Mapping[str, object]
) -> Mapping[str, object]:
    """Return the options over the formulation's own for this solver."""
    own: Mapping[str, object] = {}
    if solver == "ipopt":
        own = formulation(name).OPTIONS
    elif solver == "fatrop" and name == residual.NAME:
        own = residual.FATROP_OPTIONS
    return {**own, **options}


def run(
    setup: Setup,
    *,
    joints: int,
    task_dimension: int,
    starts: int,
    seed: int,
    workers: int,
    options: Mapping[str, object] | None = None,
    solver: str = "ipopt",
    compiled: bool = False,
    progress: bool = False,
) -> Outcome:
    """Solve from all starts and judge what comes out.

    Start k is the same for all setups on one model. Parameters are those of
    `nlp.multistart.multistart`; `options` go over the formulation's own.
    """
    built = arm(setup.model, joints, task_dimension)
    label = " ".join(filter(None, (setup.formulation, setup.model, setup.variant)))
    study = multistart(
        setup.build(joints, task_dimension),
        setup.sample(built),
        starts=starts,
        seed=seed,
        workers=workers,
        options=solver_options(setup.formulation, solver, options or {}),
        solver=solver,
        compiled=compiled,
        label=label if progress else None,
        judge=partial(
            judge,
            arm=built,
            formulation=setup.formulation,
            locked=setup.locked,
            merit=setup.merit(),
        ),
        figure=lambda record: record.merit,
    )
    return Outcome(setup, built, study.results, study.complete)
