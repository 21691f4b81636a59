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

#: Least number of random starts of an entry.
LEAST_STARTS = 20
#: Processor time in seconds after which an entry gets no further start.
LIMIT_SECONDS = 75.0
#: Number of starts that must reach the best before the rule can hold.
OFTEN = 5
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


def settled(starts: int, optima: int, reached: int) -> bool:
    """Whether enough starts were made: Boender and Rinnooy Kan's rule, and `OFTEN` at the best.

    With w optima seen in N starts the expected number of optima is w(N − 1)/(N − w − 2); the
    rule holds when that is below w + ½.
    """
    if reached < OFTEN or starts - optima <= 2:
        return False
    return optima * (starts - 1) / (starts - optima - 2) < optima + 0.5


def unseen_share(starts: int, optima: int) -> float:
    """Return the expected share of starts that end at an optimum not yet seen.

    With w optima seen in N starts it is w(w + 1)/(N(N − 1)), under the same prior; it is 1
    where nothing is known, as where every start ended at another optimum.
    """
    if starts < 2 or optima == 0:
        return 1.0
    return min(1.0, optima * (optima + 1) / (starts * (starts - 1)))


def compute(effort: Effort, folder: Path) -> Iterator[SecondSearchRow]:
    """Yield a row for each entry that is not proved optimal, in the order in which they end."""
    pages = [page for page in read_atlas() if page.mark != "optimal"]
    least = effort.starts or LEAST_STARTS
    calls = [(page, least, effort.seed) for page in pages]
    with LocalExecutor(effort.workers) as executor:
        for row, better in in_groups(searched, calls, executor, effort.progress, "entries"):
            if better is not None:
                prepare_folder(folder / _BETTER)
                write_page(better, folder / _BETTER)
            yield row


def searched(
    page: EntryPage, least: int, seed: int
) -> tuple[SecondSearchRow, EntryPage | None]:
    """Return the row of an entry, and its page if a better Jacobian was found."""
    asked, value = page.entry, float(page.value)
    search = SmoothedSearch.of(asked)
    scores: list[float] = []
    best: FloatArray | None = None
    starts, begun = 0, process_time()
    while True:
        number = sum(score > max([value, *scores]) - REACHED_BEST for score in scores)
        different = _different(scores)
        held = starts >= least and settled(len(scores), different, number)
        spent = process_time() - begun
        if held or (starts >= least and spent > LIMIT_SECONDS):
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
        optima=different,
        unseen_percent=100 * unseen_share(len(scores), different),
        settled=held,
        first=page.found.reached_best,
        first_starts=page.found.starts,
        cpu_seconds=spent,
    )
    if best is None or highest < value + RESOLUTION:
        return row, None
    return row, _better_page(page, best, starts, number)


def _better_page(
    page: EntryPage, best: FloatArray, starts: int, reached: int
) -> EntryPage | None:
    """Return the page of a better Jacobian; None if its proved value is no improvement."""
    versions = provenance()
    found = Found(
        by="lockedjoint",
        date=date.today().isoformat(),
        statement="second search: smoothed by L-BFGS, polished by SLSQP",
        seeds=page.found.seeds,
        starts=starts,
        reached_best=reached,
        versions=versions["versions"],
        machine=versions["machine"],
    )
    better = improved(page.entry, best, found, page)
    return better if better.value != page.value else None


def _different(scores: list[float]) -> int:
    """Return the number of different scores, to `REACHED_BEST`."""
    ordered = np.sort(scores)
    return int(np.sum(np.diff(ordered) > REACHED_BEST)) + bool(scores)


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
