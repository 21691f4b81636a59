"""Entries of the atlas searched again, by a second method from other starts.

Entries that are proved optimal are left out. Each other one gets random starts until the
stopping rule of `settled` holds, or its processor time is spent. A Jacobian that is better than
the one on record is written to ``better/``, as a page of the atlas; ``lockedjoint atlas
--entries better verify`` proves its value.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from time import process_time
from typing import Protocol

import numpy as np

from lockedjoint.formulations.atlas.collection import improved, read_atlas, write_page
from lockedjoint.formulations.atlas.entry import RESOLUTION, EntryPage, Found
from lockedjoint.formulations.io.files import prepare_folder
from lockedjoint.formulations.io.table import HIDDEN, column, provenance
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.executors import LocalExecutor, in_groups
from results.script import main, study_of
from results.second_search.smoothed import SmoothedSearch
from results.second_search.stopping import different, least_starts, settled, unseen_share

#: Least number of random starts of an entry.
LEAST_STARTS = 20
#: Processor time in seconds after which an entry gets no further start.
LIMIT_SECONDS = 75.0
# The folder of pages that are better than those on record.
_BETTER = "better"
# First number of the seeds of this search: the atlas's own are 0, 1, …, and make other draws.
_STREAM = 1995


@dataclass(frozen=True)
class SecondSearchRow:
    """One entry: the columns of ``second_search.csv``.

    `value` is what the atlas has, `best` what this search found, `above` is best − value; a
    start `reached` the better of the two if it is within 1e-6 of it. Of all `starts` some may
    have no answer: only `answers` count for the rule. `optima` counts their different values,
    to 1e-6, and `unseen_percent` is how often a further answer is expected to have another one.
    The rule held for entries that are `settled`. `first` and `first_starts` are the numbers of
    random starts that the atlas has on record for its value.
    """

    entry: str
    formulation: str = field(metadata=HIDDEN)
    failures: int = field(metadata=HIDDEN)
    mark: str
    value: float = field(metadata=column("value", ".9f"))
    best: float = field(metadata=column("second search", ".9f"))
    above: float = field(metadata=column("above", ".1e"))
    reached: int
    starts: int
    answers: int
    optima: int
    unseen_percent: float = field(metadata=column("unseen %", ".2f"))
    settled: bool
    first: int = field(metadata=column("first: reached"))
    first_starts: int = field(metadata=column("of"))
    cpu_seconds: float = field(metadata=column("CPU (s)", ".1f"))


class Search(Protocol):
    """A search that leads from random numbers to a Jacobian."""

    @property
    def statement(self) -> str:
        """What the page of a Jacobian says of how it was found."""

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the Jacobian that one start leads to, (m, n)."""


def compute(effort: Effort, folder: Path) -> Iterator[SecondSearchRow]:
    """Yield a row for each entry that is not proved optimal, in the order in which they end."""
    pages = [page for page in read_atlas() if page.mark != "optimal"]
    least = effort.starts or LEAST_STARTS
    calls = [(page, least, effort.seed) for page in pages]
    with LocalExecutor(effort.workers) as executor:
        for row, better in in_groups(searched, calls, executor, effort.progress, "entries"):
            keep(better, folder)
            yield row


def keep(better: EntryPage | None, folder: Path) -> None:
    """Write the page of a better Jacobian, if there is one, to ``better/`` in a folder."""
    if better is not None:
        prepare_folder(folder / _BETTER)
        write_page(better, folder / _BETTER)


def searched(
    page: EntryPage, least: int, seed: int
) -> tuple[SecondSearchRow, EntryPage | None]:
    """Return the row of an entry, and its page if a better Jacobian was found."""
    return from_starts(page, SmoothedSearch.of(page.entry), least, seed, LIMIT_SECONDS)


def from_starts(
    page: EntryPage,
    search: Search,
    least: int,
    seed: int,
    limit_seconds: float,
    most: int | None = None,
) -> tuple[SecondSearchRow, EntryPage | None]:
    """Start a search again and again until the rule holds; return the row, and a better page.

    There are at least `least` starts. After them it ends if the processor time is spent, and
    as soon as the optima seen ask for more than `most` starts.
    """
    asked, value = page.entry, float(page.value)
    scores: list[float] = []
    best: FloatArray | None = None
    starts, begun = 0, process_time()
    while True:
        number = sum(score > max([value, *scores]) - REACHED_BEST for score in scores)
        optima = different(scores)
        held = starts >= least and settled(len(scores), optima, number)
        spent = process_time() - begun
        if held or (starts >= least and spent > limit_seconds):
            break
        if most is not None and max(starts, least_starts(optima)) > most:
            break
        jacobian = search.answer(np.random.default_rng((_STREAM, seed, starts)))
        starts += 1
        if not asked.holds(jacobian):
            continue
        score = asked.score(jacobian)
        if score > max(scores, default=0.0):
            best = jacobian
        scores.append(score)
    highest = max(scores, default=np.nan)
    row = SecondSearchRow(
        entry=asked.name,
        formulation=asked.formulation,
        failures=asked.failures,
        mark=page.mark,
        value=value,
        best=highest,
        above=highest - value,
        reached=number,
        starts=starts,
        answers=len(scores),
        optima=optima,
        unseen_percent=100 * unseen_share(len(scores), optima),
        settled=held,
        first=page.found.reached_best,
        first_starts=page.found.starts,
        cpu_seconds=spent,
    )
    if best is None or highest < value + RESOLUTION:
        return row, None
    return row, _better_page(page, best, search.statement, starts, number)


def _better_page(
    page: EntryPage, best: FloatArray, statement: str, starts: int, reached: int
) -> EntryPage | None:
    """Return the page of a better Jacobian; None if its proved value is no improvement."""
    versions = provenance()
    found = Found(
        by="lockedjoint",
        date=date.today().isoformat(),
        statement=statement,
        seeds=page.found.seeds,
        starts=starts,
        reached_best=reached,
        versions=versions["versions"],
        machine=versions["machine"],
    )
    better = improved(page.entry, best, found, page)
    return better if better.value != page.value else None


STUDY = study_of(
    __file__,
    compute,
    SecondSearchRow,
    title="open and conjectured entries, searched by a second method",
    takes="an hour",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
