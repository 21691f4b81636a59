"""A campaign run: every start that has no record yet, kept as it arrives."""

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass

from tqdm.auto import tqdm

from formulations.campaign.declaration import Declaration
from formulations.campaign.records import cell_of, task_of
from formulations.solving.case import Case
from nlp.dispatch import dispatch
from nlp.starts import Chunk, packed
from nlp.store import Store

# Starts of a chunk: enough that sending it costs little, few enough to run again.
CHUNK = 20


@dataclass(frozen=True)
class CampaignReport:
    """How a campaign stands.

    Attributes
    ----------
    asked, added, missing
        Records that were asked for, that this run added, and that are still missing.
    failed
        Case, start and reason of those that raised an exception, ended their process or
        exceeded the time limit.
    """

    asked: int
    added: int
    missing: int
    failed: tuple[tuple[Case, int, str], ...]


def run(
    declared: Declaration,
    store: Store,
    executor: Executor,
    time_limit: float | None = None,
    chunk: int = CHUNK,
    capacity: int | None = None,
    progress: bool = False,
) -> CampaignReport:
    """Solve every start that has no record yet, and keep the records as they arrive.

    Parameters
    ----------
    declared
        The campaign.
    store
        Where its records are, open for writing.
    executor
        Where to run; see `nlp.dispatch.dispatch`.
    time_limit
        Seconds that a start may take, from when it begins.
    chunk
        Starts that a worker is sent, and that one transaction keeps, at once.
    capacity
        How many chunks are under way at most; by default what the executor says of itself.
    progress
        Whether to show a bar, on a terminal or in a notebook.

    Returns
    -------
    CampaignReport
        If the user interrupted with Ctrl-C, `missing` says how much is left.

    Raises
    ------
    StoreError
        If the store was removed or replaced meanwhile.
    """
    cases = list(declared.cases)
    cells = [cell_of(case, declared.seed) for case in cases]
    added, failed = 0, list[tuple[Case, int, str]]()
    before = _missing(store, cells, declared.starts)
    chunks = _chunks(store, dict(zip(cells, cases, strict=True)), declared, chunk)
    with (
        closing(dispatch(chunks, executor, time_limit, capacity)) as results,
        tqdm(total=before, desc="campaign", disable=None if progress else True) as bar,
    ):
        try:
            for result in results:
                label = result.chunk.label
                failed += [(cases[label], start.index, start.reason) for start in result.failed]
                if result.finished:
                    made = result.finished[0].result["environment"]  # one chunk, one process
                    records = [(start.index, start.result) for start in result.finished]
                    added += store.add(cells[label], records, made)
                bar.update(len(result.finished) + len(result.failed))
        except KeyboardInterrupt:
            pass  # what is kept is kept, and the report says that it is not all
    store.check_in_place()
    missing = _missing(store, cells, declared.starts)
    return CampaignReport(len(cells) * declared.starts, added, missing, tuple(failed))


def _chunks(
    store: Store, cases: Mapping[str, Case], declared: Declaration, size: int
) -> Iterator[Chunk]:
    for label, (cell, case) in enumerate(cases.items()):
        payload = packed(task_of(case))
        for gap in store.missing(cell, declared.starts):
            for first in range(0, len(gap), size):
                yield Chunk(payload, declared.seed, gap[first : first + size], label)


def _missing(store: Store, cells: list[str], starts: int) -> int:
    return sum(len(gap) for cell in cells for gap in store.missing(cell, starts))
