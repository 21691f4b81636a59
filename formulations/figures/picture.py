"""What a figure is made from, and what is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from formulations.solving.outcome import Outcome
from formulations.solving.record import Record
from formulations.solving.setup import Setup
from formulations.solving.solve import run
from nlp.arrays import FloatArray
from nlp.errors import LockedJointError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Request:
    """What a figure is asked for with.

    Attributes
    ----------
    starts
        Random starts of each problem.
    seed
        Of the starts.
    workers
        Processes, where many starts are made.
    jacobian
        Shape (m, n), to be shown instead of one that is solved for.
    store
        Of a campaign, to be shown instead of starts made here.
    progress
        Is told what is being done.
    """

    starts: int
    seed: int = 0
    workers: int = 1
    jacobian: FloatArray | None = None
    store: Path | None = None
    progress: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure, and the numbers that it shows."""

    figure: Figure
    table: pd.DataFrame

    def rows(self) -> list[dict[str, object]]:
        """Return the table's rows as plain values; None for missing ones."""
        names = [str(name) for name in self.table.columns]
        columns = [self.table[name].tolist() for name in names]
        return [
            {k: None if v != v else v for k, v in zip(names, row, strict=True)}  # NaN
            for row in zip(*columns, strict=True)
        ]


class NothingFoundError(LockedJointError):
    """No start led to a Jacobian that passes the check."""

    exit_status = 1


def solved(setup: Setup, request: Request, joints: int = 7, task_dimension: int = 6) -> Outcome:
    """Solve from all starts asked for; an interrupted study ends here, as no figure is of it.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted.
    """
    request.progress(f"{setup.formulation}, {setup.model}")
    outcome = run(
        setup,
        joints=joints,
        task_dimension=task_dimension,
        starts=request.starts,
        seed=request.seed,
        workers=request.workers,
    )
    if not outcome.complete:
        raise KeyboardInterrupt
    return outcome


def best(outcome: Outcome) -> Record:
    """Return the best record that passes the check.

    Raises
    ------
    NothingFoundError
        If there is none.
    """
    valid = [record for record in outcome.records if record.valid]
    if not valid:
        who = f"{outcome.setup.formulation} on {outcome.setup.model}"
        raise NothingFoundError(f"No start of {who} passes the check; ask for more starts.")
    largest = outcome.setup.formulation != "residual"
    return (max if largest else min)(valid, key=lambda record: record.merit)
