"""Every numbered example and claim of the paper: its table and its page.

Out comes ``reproduction.csv``, a `ReproductionRow` for each: what the paper says, and what this
library computes. `lockedjoint.formulations.reproduction` has the claims, and computes them.
"""

from collections.abc import Iterator
from pathlib import Path

from lockedjoint.formulations.reproduction import ReproductionRow, complaint, iterate
from lockedjoint.formulations.solving.effort import Effort
from results.script import main, study_of

#: The number of random starts of each optimum, unless `--starts` says otherwise. With fewer of
#: them the best one may be missed.
STARTS = 100


def compute(effort: Effort, _: Path) -> Iterator[ReproductionRow]:
    """Compute the rows in the paper's order."""
    for row in iterate(effort.seed, effort.starts or STARTS):
        effort.progress(f"{row.equation} {row.quantity}")
        yield row


STUDY = study_of(
    __file__,
    compute,
    ReproductionRow,
    title="every numbered example and claim of the paper, computed anew",
    takes="ten seconds",
    complain=complaint,
)

if __name__ == "__main__":
    main(STUDY, __file__)
