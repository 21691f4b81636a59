"""The search for an entry's best Jacobian: seeds of random starts, until enough agree."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from time import process_time

import numpy as np

from formulations import max_min, registry
from formulations.atlas.collection import improved, pages
from formulations.atlas.entry import ENOUGH, RESOLUTION, Entry, EntryPage, Found
from formulations.io.provenance import provenance
from formulations.measures import trace
from formulations.solving.case import Case
from formulations.solving.outcome import REACHED_BEST, Outcome
from formulations.solving.solve import run

_STARTS = 20


def improve(
    asked: Entry,
    known: EntryPage | None,
    minutes: float,
    *,
    workers: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[EntryPage]:
    """Search from seed after seed, and return the page as it stands after each.

    Parameters
    ----------
    asked
        The entry.
    known
        Its page so far: the search goes on with the first seed that it did not use.
    minutes
        Processor time after which no further seed is begun. The search also ends when
        `ENOUGH` starts reached the best.
    workers
        Processes.
    progress
        Is called with what is being done.
    """
    case, page = _case_of(asked), inherited(asked, known)
    if page is not None and page is not known:
        yield page
    spent = 0.0
    while spent < 60 * minutes and not (page and page.found.reached_best >= ENOUGH):
        seed = page.found.seeds if page else 0
        so_far = f", best {page.value}" if page else ""
        progress(f"{asked.name}: seed {seed}{so_far}")
        begun = process_time()
        outcome = run(case, starts=_STARTS, seed=seed, workers=workers)
        used = sum(record.cpu_seconds for record in outcome.records)
        spent += max(used, process_time() - begun)
        if not outcome.complete:
            raise KeyboardInterrupt
        page = _joined(asked, page, outcome, used)
        if page is None:
            return
        yield page


def inherited(asked: Entry, known: EntryPage | None) -> EntryPage | None:
    """Return the page with the best Jacobian that another entry of this size has for it.

    Unit revolute columns are lever-revolute and, scaled, free columns as well.
    """
    page = known
    for other in pages():
        alike = (other.entry.locked, other.entry.formulation)
        if other.entry == asked or alike != (asked.locked, asked.formulation):
            continue
        if other.jacobian.shape != (asked.task_dimension, asked.joints):
            continue
        scale = np.sqrt(asked.arm.largest_trace / trace(other.jacobian))
        for jacobian in (other.jacobian, scale * other.jacobian):
            if not asked.holds(jacobian):
                continue
            now, before = provenance(), page.found if page else Found("", "")
            found = Found(
                f"lockedjoint, from {other.entry.name}",
                now["date"],
                seeds=before.seeds,
                starts=before.starts,
                versions=now["versions"],
            )
            new = improved(asked, jacobian, found, page)
            if page is None or new.value != page.value:
                page = new
    return page


def _case_of(asked: Entry) -> Case:
    """Return what is run for an entry: the encoding that finds most where k joints lock."""
    settings: dict[str, object] = {"locked": asked.locked} if asked.locked > 1 else {}
    if asked.formulation == max_min.NAME and asked.locked > 1:
        tight = asked.joints - asked.task_dimension == asked.locked
        settings["encoding"] = "shared-factor" if tight else "principal-minors"
        settings["from_residual_minima"] = tight and asked.task_dimension == 6
    return Case(registry.formulation(asked.formulation), asked.arm, settings)


def continued(before: Found, cpu_seconds: float) -> Found:
    """Return how a Jacobian was found, after one more seed, here and now."""
    now = provenance()
    return replace(
        before,
        date=now["date"],
        seeds=before.seeds + 1,
        cpu_seconds=round(before.cpu_seconds + cpu_seconds, 1),
        versions=now["versions"],
        machine=now["machine"],
    )


def _joined(
    asked: Entry, page: EntryPage | None, outcome: Outcome, cpu_seconds: float
) -> EntryPage | None:
    """Return the page with the starts of one more seed; None if nothing was ever found."""
    before = page.found if page else Found("lockedjoint", "")
    reached = outcome.reached
    best = max((record.score for record in reached), default=0.0)
    value = float(page.value) if page else 0.0
    count = sum(abs(one.score - max(best, value)) <= REACHED_BEST for one in reached)
    kept = before.reached_best if value >= best - REACHED_BEST else 0
    found = replace(
        continued(before, cpu_seconds),
        by=before.by if value > best + RESOLUTION else "lockedjoint",
        # Of a Jacobian that these starts did not reach, how it was found stays on record.
        statement=before.statement
        if before.statement and value > best + REACHED_BEST
        else _statement(outcome.case),
        starts=before.starts + len(outcome.records),
        reached_best=kept + count,
    )
    if reached and best > 0:
        return improved(asked, outcome.best.jacobian, found, page)
    return replace(page, found=found) if page else None


def _statement(case: Case) -> str:
    words = [case.formulation.NAME, str(case.settings.get("encoding", ""))]
    words.append("from residual minima" if case.settings.get("from_residual_minima") else "")
    return ", ".join(filter(None, words))
