"""Entries at which the second search did not settle, searched by basin hopping.

The entries are those of ``results/second_search`` for which its stopping rule did not hold.
Here a start goes on by hops, moves to better optima nearby, until a number of them in a row,
the patience, brings no gain. So starts end at few optima, and the rule needs few starts.

The first patience is small. Where the optima seen ask for more than `MOST_STARTS` starts, the
entry begins anew with a larger one, until its processor time is spent.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lockedjoint.formulations.atlas.collection import read_atlas
from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.executors import LocalExecutor, in_groups
from results.script import main, study_of
from results.second_search import second_search
from results.second_search.hops import BasinHopping
from results.second_search.second_search import from_starts, keep
from results.second_search.smoothed import SmoothedSearch

#: Least number of starts with one patience. The rule itself asks for eight.
LEAST_STARTS = 1
#: Number of starts with one patience, at most.
MOST_STARTS = 70
#: The first patience, and its factor from one to the next.
PATIENCE = 20
GROWTH = 4
#: Processor time in seconds after which an entry gets no further start.
LIMIT_SECONDS = 1200.0
# The folder of the second search's table.
_SECOND_SEARCH = Path(second_search.__file__).parent


@dataclass(frozen=True)
class BasinHoppingRow:
    """One entry: the columns of ``basin_hopping.csv``.

    The columns are those of the second search, with the `patience` of these starts. The
    processor time is that of the smaller patiences, too.
    """

    entry: str
    formulation: str = field(metadata=HIDDEN)
    failures: int = field(metadata=HIDDEN)
    mark: str
    value: float = field(metadata=column("value", ".9f"))
    best: float = field(metadata=column("basin hopping", ".9f"))
    above: float = field(metadata=column("above", ".1e"))
    patience: int
    reached: int
    starts: int
    optima: int
    unseen_percent: float = field(metadata=column("unseen %", ".2f"))
    settled: bool
    cpu_seconds: float = field(metadata=column("CPU (s)", ".1f"))


def compute(effort: Effort, folder: Path) -> Iterator[BasinHoppingRow]:
    """Yield a row for each entry that is not settled, in the order in which they end."""
    before = second_search.STUDY.read(_SECOND_SEARCH)[second_search.STUDY.name]
    unsettled = {row.entry for row in before if not row.settled}
    pages = [page for page in read_atlas() if page.entry.name in unsettled]
    least = effort.starts or LEAST_STARTS
    calls = [(page, least, effort.seed) for page in pages]
    with LocalExecutor(effort.workers) as executor:
        for row, better in in_groups(searched, calls, executor, effort.progress, "entries"):
            for page in better:
                keep(page, folder)
            yield row


def searched(page: EntryPage, least: int, seed: int) -> tuple[BasinHoppingRow, list[EntryPage]]:
    """Return the row of an entry, and a page for each patience that found a better Jacobian."""
    smoothed = SmoothedSearch.of(page.entry)
    patience, spent = PATIENCE, 0.0
    highest = float("nan")
    known, better = page, []
    while True:
        search = BasinHopping(page.entry, smoothed, patience)
        left = LIMIT_SECONDS - spent
        row, found = from_starts(known, search, least, seed, left, MOST_STARTS)
        spent += row.cpu_seconds
        highest = float(np.fmax(highest, row.best))
        if found is not None:
            better.append(found)
            known = found
        if row.settled or spent > LIMIT_SECONDS:
            break
        patience *= GROWTH
    value = float(page.value)
    of_all = {"best": highest, "above": highest - value, "cpu_seconds": spent}
    whole = row_from(BasinHoppingRow, row, value=value, patience=patience, **of_all)
    return whole, better


STUDY = study_of(
    __file__,
    compute,
    BasinHoppingRow,
    title="entries at which the second search did not settle, by basin hopping",
    takes="an hour",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
