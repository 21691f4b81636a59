"""A cell of a campaign: one formulation on one arm, with all that decides its records."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

from formulations import max_min
from formulations.campaign.columns import Kept, keep
from formulations.catalogue import arm
from formulations.solving.setup import Setup, solver_options
from nlp.store_schema import Value
from nlp.task import Task


@dataclass(frozen=True)
class Cell:
    """One problem and how it is solved.

    Attributes
    ----------
    setup
        The formulation on its column model.
    joints, task_dimension
        n and m.
    seed
        Seed of the starts.
    options
        Solver options, over the formulation's own.
    solver, compiled
        See `nlp.solver.Solver`.
    """

    setup: Setup
    joints: int
    task_dimension: int
    seed: int = 0
    options: Mapping[str, object] = field(default_factory=dict)
    solver: str = "ipopt"
    compiled: bool = False

    def task(self) -> Task[Kept]:
        """Return what workers do at each start.

        Raises
        ------
        InputError
            If the arm, a setting or an option is not allowed.
        """
        one = self.setup
        built = arm(one.model, self.joints, self.task_dimension)
        return Task(
            one.build(self.joints, self.task_dimension),
            one.sample(built),
            self._all_options(),
            partial(keep, arm=built, formulation=one.formulation, locked=one.locked),
            self.solver,
            self.compiled,
        )

    def settings(self) -> dict[str, Value]:
        """Return what tells this cell apart in a store."""
        one = self.setup
        return {
            "formulation": one.formulation,
            "model": one.model,
            "joints": self.joints,
            "task_dimension": self.task_dimension,
            "locked": one.locked,
            "encoding": one.encoding if one.formulation == max_min.NAME else "",
            "from_residual_minima": int(one.from_residual_minima),
            "solver": self.solver,
            "compiled": int(self.compiled),
            "options": json.dumps(self._all_options(), sort_keys=True),
            "seed": self.seed,
        }

    def _all_options(self) -> Mapping[str, object]:
        return solver_options(self.setup.formulation, self.solver, self.options)
