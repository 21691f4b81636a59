"""Runs a declared campaign: every start that has no record in the store yet."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass

from tqdm import tqdm

from formulations.campaign.declaration import Cell, Declaration
from nlp.spread import Pool, spread
from nlp.store import Store
from nlp.task import Chunk, packed

# Starts of a chunk: enough that sending it costs little, few enough to run again at little
# cost.
CHUNK = 20


@dataclass(frozen=True)
class Report:
    """How a campaign stands.

    Attributes
    ----------
    asked, added, missing
        Records that were asked for, that this run added, and that are still missing.
    lost
        Cell, start and reason of those that raised an exception, ended their process or
        exceeded the time limit.
    """

    asked: int
    added: int
    missing: int
    lost: tuple[tuple[Cell, int, str], ...]


def run(
    declared: Declaration,
    store: Store,
    pool: Pool,
    time_limit: float | None = None,
    chunk: int = CHUNK,
    progress: bool = False,
) -> Report:
    """Solve every start that has no record yet, and keep the records as they arrive.

    Parameters
    ----------
    declared
        The campaign.
    store
        Where its records are, open for writing.
    pool
        The workers.
    time_limit
        Seconds that a chunk may take; if it takes longer, its worker is killed.
    chunk
        Starts that a worker is sent, and that one transaction keeps, at once.
    progress
        Whether to show a bar, where standard error is a terminal.

    Returns
    -------
    Report
        If the user interrupted with Ctrl-C, `missing` says how much is left.
    """
    cells = {store.cell(cell.settings()): cell for cell in declared.cells}
    added, lost = 0, list[tuple[Cell, int, str]]()
    chunks = _chunks(store, cells, declared.starts, chunk)
    before = _missing(store, cells, declared.starts)
    hidden = not (progress and os.isatty(2))
    with (
        closing(spread(chunks, pool, time_limit)) as arrivals,
        tqdm(total=before, desc="campaign", disable=hidden, dynamic_ncols=True) as bar,
    ):
        try:
            for arrival in arrivals:
                label = arrival.chunk.label
                lost += [(cells[label], one.index, one.why) for one in arrival.lost]
                if arrival.results:
                    made = arrival.results[0].result.environment  # one chunk, one process
                    records = [(one.index, one.result.values) for one in arrival.results]
                    store.add(label, records, made)
                    added += len(records)
                bar.update(len(arrival.results) + len(arrival.lost))
        except KeyboardInterrupt:
            pass  # what is kept is kept, and the report says that it is not all
    missing = _missing(store, cells, declared.starts)
    return Report(len(cells) * declared.starts, added, missing, tuple(lost))


def _chunks(store: Store, cells: Mapping[int, Cell], starts: int, size: int) -> Iterator[Chunk]:
    for number, cell in cells.items():
        payload = packed(cell.task())
        for gap in store.missing(number, starts):
            for first in range(gap.start, gap.stop, size):
                indices = range(first, min(first + size, gap.stop))
                yield Chunk(payload, cell.seed, indices, number)


def _missing(store: Store, cells: Mapping[int, Cell], starts: int) -> int:
    return sum(len(gap) for number in cells for gap in store.missing(number, starts))
