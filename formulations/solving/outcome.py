"""What a setup's starts came to."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from formulations import isotropy
from formulations.bounds.certified import is_excluded
from formulations.catalogue import formulation
from formulations.joints.arm import Arm
from formulations.solving.record import Record
from nlp.solution import INFEASIBLE

if TYPE_CHECKING:
    import pandas as pd

    from formulations.solving.setup import Setup

# An answer within this of the best one has reached the best: defined here, for all tables.
REACHED_BEST = 1e-6
Verdict = Literal["solved", "infeasible", "proved infeasible", "not solved"]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a setup's starts came to, in the order of the starts.

    Attributes
    ----------
    setup
        What was run.
    arm
        The joints.
    records
        One for each start that ended.
    complete
        Whether all did.
    """

    setup: Setup
    arm: Arm
    records: tuple[Record, ...]
    complete: bool

    @cached_property
    def reached(self) -> tuple[Record, ...]:
        """Records that pass the check and are within `REACHED_BEST` of the best of them."""
        valid = [record for record in self.records if record.valid]
        if not valid:
            return ()
        pick = min if formulation(self.setup.formulation).SENSE == "minimise" else max
        best = pick(record.merit for record in valid)
        return tuple(record for record in valid if abs(record.merit - best) <= REACHED_BEST)

    @property
    def best(self) -> Record:
        """The record to show.

        Of those that reached the best, the one with the largest worst case, or with the best
        merit where failures are unequal; if nothing passed the check, the one with the least
        violation.
        """
        if self.reached and self.setup.failures is not None:
            return max(self.reached, key=lambda record: record.merit)
        if self.reached:
            return max(self.reached, key=lambda record: record.worst_case_sigma)
        return min(self.records, key=lambda record: np.nan_to_num(record.violation, nan=np.inf))

    @property
    def verdict(self) -> Verdict:
        """Whether the setup's problem is solved.

        ``solved`` if any answer passed the check; if none did, ``infeasible`` if Ipopt said so
        and nowhere claimed success, ``proved infeasible`` if there is a verified proof
        besides; ``not solved`` otherwise.
        """
        if self.reached:
            return "solved"
        if INFEASIBLE not in self.status_counts or self.succeeded:
            return "not solved"
        proved = self.setup.formulation == isotropy.NAME and is_excluded(self.arm)
        return "proved infeasible" if proved else "infeasible"

    @property
    def succeeded(self) -> int:
        """Number of starts at which the solver said that it succeeded."""
        return sum(record.status.success for record in self.records)

    @property
    def status_counts(self) -> dict[str, int]:
        """The solver's return statuses and how often each came, by name."""
        counts = Counter(record.status.return_status for record in self.records)
        return dict(sorted(counts.items()))

    def to_dict(self) -> dict[str, Any]:
        """Return what was run, the verdict and all records as plain values."""
        return {
            "formulation": self.setup.formulation,
            "model": self.setup.model,
            "variant": self.setup.variant,
            "joints": self.arm.shape[1],
            "task_dimension": self.arm.shape[0],
            "verdict": self.verdict,
            "complete": self.complete,
            "reached_best": len(self.reached),
            "status_counts": self.status_counts,
            "records": [record.to_dict() for record in self.records],
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the records as a table, one line per start, without the Jacobians."""
        import pandas as pd

        lines = [record.to_dict() for record in self.records]
        return pd.DataFrame(lines).drop(columns="jacobian", errors="ignore")

    def __repr__(self) -> str:
        """Say in one line what was run and what came of it."""
        name = f"{self.setup.formulation}, {self.setup.model}, n = {self.arm.shape[1]}"
        said = f"{self.verdict}, {len(self.reached)} of {len(self.records)} starts at the best"
        value = f" {self.best.merit:.9g}" if self.reached else ""
        return f"<Outcome: {name}: {said}{value}>"

    def _repr_html_(self) -> str:
        """Return the line and the first records, for notebooks."""
        from html import escape

        return f"<p>{escape(repr(self))}</p>{self.to_frame().head(10).to_html(border=0)}"
