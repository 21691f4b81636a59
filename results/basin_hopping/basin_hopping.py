"""Entries at which the second search did not settle, searched by basin hopping.

The entries are those of ``results/second_search`` for which its stopping rule did not hold.
Here a start goes on by hops, moves to better optima nearby, until a number of them in a row,
the patience, brings no gain. So starts end at few optima, and the rule needs few starts.

The first patience is small. The next one is larger, with other random numbers. It begins where
the rule would need more than `MOST_STARTS` starts by the optima seen, or did not hold after so
many, as where fewer than five are at the best. An entry ends when the rule holds, or when its
processor time is spent. Where it is spent, and symmetric Jacobians can be drawn, the entry gets
as much time again for starts that begin from the best of many symmetric ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lockedjoint.formulations.atlas.collection import read_atlas
from lockedjoint.formulations.atlas.entry import Entry, EntryPage
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.errors import FileError
from lockedjoint.nlp.executors import LocalExecutor, in_groups
from results.atlas.search import has_symmetric_starts
from results.basin_hopping.symmetric import SymmetricStarts
from results.script import main, study_of
from results.second_search import second_search
from results.second_search.hops import BasinHopping
from results.second_search.second_search import better_page, keep
from results.second_search.smoothed import SmoothedSearch
from results.second_search.tally import Limits, Tally, tally

#: Least number of starts with one patience. The rule itself asks for eight.
LEAST_STARTS = 1
#: Number of starts with one patience, at most.
MOST_STARTS = 70
#: The first patience.
PATIENCE = 20
#: Factor from one patience to the next.
GROWTH = 4
#: Processor time in seconds after which an entry gets no further start.
LIMIT_SECONDS = 1200.0
#: Where starts begin: at the optima of the second search, from its random starts.
RANDOM = "random"
#: Where starts begin: at the best of many optima that are symmetric.
SYMMETRIC = "symmetric"
#: Number of symmetric Jacobians drawn for a start, which begins from the best of their climbs.
DRAWS = 4000
#: The first patience of symmetric starts.
SYMMETRIC_PATIENCE = 80
# The folder of the second search's table.
_SECOND_SEARCH = Path(second_search.__file__).parent
# First number of the seeds, by where starts begin: that of the second search makes other draws.
_STREAMS = {RANDOM: 1997, SYMMETRIC: 1999}


@dataclass(frozen=True)
class BasinHoppingRow:
    """One entry with one patience: a line of ``basin_hopping.csv``.

    `value` is what the atlas has, `best` what the starts with this patience found, `above` is
    best − value. A start `reached` the best known if it is within 1e-6 of it, or of what this
    search found before. The other columns are as in `SecondSearchRow`.
    """

    entry: str
    formulation: str = field(metadata=HIDDEN)
    failures: int = field(metadata=HIDDEN)
    mark: str
    value: float = field(metadata=column("value", ".9f"))
    begins: str
    patience: int
    best: float = field(metadata=column("basin hopping", ".9f"))
    above: float = field(metadata=column("above", ".1e"))
    reached: int
    starts: int
    answers: int
    optima: int
    unseen_percent: float = field(metadata=column("unseen %", ".2f"))
    settled: bool
    cpu_seconds: float = field(metadata=column("CPU (s)", ".1f"))


def compute(effort: Effort, folder: Path) -> Iterator[BasinHoppingRow]:
    """Yield the rows of each entry that is not settled, in the order in which they end.

    FileError if the second search has no table.
    """
    before = second_search.STUDY.read(_SECOND_SEARCH)[second_search.STUDY.name]
    if not before:
        raise FileError("table", str(_SECOND_SEARCH), "a folder with the second search's table")
    unsettled = {row.entry for row in before if not row.settled}
    pages = [page for page in read_atlas() if page.entry.name in unsettled]
    least = effort.starts or LEAST_STARTS
    calls = [(page, least, effort.seed) for page in pages]
    with LocalExecutor(effort.workers) as executor:
        for rows, better in in_groups(searched, calls, executor, effort.progress, "entries"):
            keep(better, folder)
            yield from rows


def searched(
    page: EntryPage, least: int, seed: int
) -> tuple[list[BasinHoppingRow], EntryPage | None]:
    """Return the rows of an entry, and its page if a better Jacobian was found."""
    known, spent = float(page.value), 0.0
    begins, patience = RANDOM, PATIENCE
    rows: list[BasinHoppingRow] = []
    highest: Tally | None = None
    statement = ""
    while True:
        limits = Limits(least, LIMIT_SECONDS - spent, max(MOST_STARTS, least))
        seeds = (_STREAMS[begins], seed, patience)
        done = tally(page.entry, _search(page.entry, begins, patience), seeds, limits, known)
        rows.append(_row(page, begins, patience, done))
        if done.best > known:
            known, highest = done.best, done
            statement = f"second search, with basin hopping, from {begins} starts"
        spent += done.cpu_seconds
        if done.settled:
            break
        if spent <= LIMIT_SECONDS:
            patience *= GROWTH
        elif begins == RANDOM and has_symmetric_starts(page.entry):
            begins, patience, spent = SYMMETRIC, SYMMETRIC_PATIENCE, 0.0
        else:
            break
    if highest is None:
        return rows, None
    # Random starts on record are of other searches: these ones do not count as such.
    return rows, better_page(page, highest.jacobian, statement, page.found.starts, 0)


def _search(asked: Entry, begins: str, patience: int) -> BasinHopping:
    """Return the search of an entry with starts that begin so, with a patience."""
    begin = SymmetricStarts(asked, DRAWS) if begins == SYMMETRIC else None
    return BasinHopping(asked, SmoothedSearch.of(asked), patience, begin)


def _row(page: EntryPage, begins: str, patience: int, done: Tally) -> BasinHoppingRow:
    value = float(page.value)
    return row_from(
        BasinHoppingRow,
        done,
        page.entry,
        page,
        entry=page.entry.name,
        value=value,
        begins=begins,
        patience=patience,
        above=done.best - value,
    )


STUDY = study_of(
    __file__,
    compute,
    BasinHoppingRow,
    title="entries at which the second search did not settle, searched by basin hopping",
    takes="an hour and a quarter",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
