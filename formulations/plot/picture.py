"""What a figure is made from, and what is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from formulations.solving.case import Case
from formulations.solving.outcome import Outcome
from formulations.solving.solve import run
from formulations.synthesis.from_jacobian import MOST_JOINTS
from nlp.arrays import FloatArray
from nlp.errors import InputError, LockedJointError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Request:
    """What a figure is made from.

    Attributes
    ----------
    starts
        Random starts of each problem.
    seed
        Of the starts.
    workers
        Number of processes.
    jacobian
        Shape (m, n), to be shown instead of one that is solved for.
    store
        Of a campaign, to be shown instead of starts made here.
    progress
        Called with what is being done, in words.
    """

    starts: int
    seed: int = 0
    workers: int = 1
    jacobian: FloatArray | None = None
    store: Path | None = None
    progress: Callable[[str], None] = lambda _: None

    def __post_init__(self) -> None:
        if self.jacobian is not None and self.jacobian.shape[1] > MOST_JOINTS:
            allowed = f"at most {MOST_JOINTS} columns (joints)"
            raise InputError("jacobian", f"of shape {self.jacobian.shape}", allowed)


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure, and the numbers that it shows."""

    figure: Figure
    table: pd.DataFrame

    def rows(self) -> list[dict[Any, Any]]:
        """Return the table's rows as plain values; None for missing ones."""
        plain = self.table.astype(object)
        return plain.where(plain.notna(), None).to_dict("records")


class NothingFoundError(LockedJointError):
    """No start led to a Jacobian that passes the gate."""

    exit_status = 1


def solved(case: Case, request: Request) -> Outcome:
    """Solve a case from all starts asked for.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted: there is no figure of an unfinished study.
    """
    request.progress(case.name)
    outcome = run(case, starts=request.starts, seed=request.seed, workers=request.workers)
    if not outcome.complete:
        raise KeyboardInterrupt
    return outcome


def reached(case: Case, request: Request) -> Outcome:
    """Solve a case, see `solved`; NothingFoundError if no start passes the gate."""
    outcome = solved(case, request)
    if not outcome.reached:
        message = f"No start of {case.name} passes the check; ask for more starts."
        raise NothingFoundError(message)
    return outcome
