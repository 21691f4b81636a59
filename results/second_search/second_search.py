"""Entries of the atlas searched again, by a second method from other starts.

Entries that are proved optimal are left out. Each other one gets random starts until the
rule of `stopping` holds, or its processor time is spent. A Jacobian that is better than the one
on record is written to ``better/``, as a page of the atlas: ``lockedjoint atlas --entries
better verify`` proves its value.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from lockedjoint.formulations.atlas.collection import improved, read_atlas, write_page
from lockedjoint.formulations.atlas.entry import RESOLUTION, EntryPage, Found
from lockedjoint.formulations.io.files import prepare_folder
from lockedjoint.formulations.io.table import HIDDEN, column, provenance, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.executors import LocalExecutor, in_groups
from results.script import main, study_of
from results.second_search.smoothed import SmoothedSearch
from results.second_search.tally import Limits, tally

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
    asked, value = page.entry, float(page.value)
    search = SmoothedSearch.of(asked)
    done = tally(asked, search, (_STREAM, seed), Limits(least, LIMIT_SECONDS), value)
    row = row_from(
        SecondSearchRow,
        done,
        asked,
        page,
        entry=asked.name,
        value=value,
        above=done.best - value,
        first=page.found.reached_best,
        first_starts=page.found.starts,
    )
    statement = "second search: smoothed by L-BFGS, polished by SLSQP"
    return row, better_page(page, done.jacobian, statement, done.starts, done.reached)


def better_page(
    page: EntryPage, jacobian: FloatArray | None, statement: str, starts: int, reached: int
) -> EntryPage | None:
    """Return the page of a better Jacobian, (m, n); None if its value is no improvement."""
    if jacobian is None or page.entry.score(jacobian) < float(page.value) + RESOLUTION:
        return None
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
    better = improved(page.entry, jacobian, found, page)
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
