"""A campaign run: every start that has no record yet, kept as it arrives."""

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass

from tqdm.auto import tqdm

from formulations.campaign.declaration import Declaration
from formulations.campaign.records import cell_of, task_of
from formulations.solving.case import Case
from nlp.executors import dispatch
from nlp.starts import Chunk, packed
from nlp.store import Store

# Starts of a chunk: enough that sending it costs little, few enough to run again.
CHUNK = 20


@dataclass(frozen=True)
class CampaignReport:
    """How many records were asked for, were added by a run, and are still missing.

    Failed are case, start and reason of those that raised an exception, ended their process
    or exceeded the time limit.
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

    A chunk is what a worker is sent, and what one transaction keeps. For executor, time limit
    and capacity see `nlp.executors.dispatch`. If the user interrupts with Ctrl-C, what is
    missing of the report says how much is left.

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
                case, cell = cases[result.label], cells[result.label]
                failed += [(case, start.index, start.reason) for start in result.failed]
                if result.finished:
                    records = list(result.finished.items())
                    made = records[0][1]["environment"]  # one chunk, one process
                    added += store.add(cell, records, made)
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
