"""The search for an entry's best Jacobian: seeds of random starts, until enough agree."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from time import process_time

import numpy as np

from formulations.atlas.collection import improved, pages
from formulations.atlas.entry import ENOUGH, RESOLUTION, Entry, Found, Page
from formulations.files.provenance import provenance
from formulations.joints.arm import Arm
from formulations.max_min import NAME as MAX_MIN
from formulations.max_min import Polish
from formulations.measures import trace, worst_case_sigma
from formulations.solving.outcome import REACHED_BEST, Outcome
from formulations.solving.setup import Setup
from formulations.solving.solve import run
from nlp.arrays import FloatArray
from nlp.errors import InputError

_STARTS = 20


def improve(
    asked: Entry,
    known: Page | None,
    minutes: float,
    *,
    workers: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[Page]:
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
    setup, page = setup_of(asked), inherited(asked, known)
    if page is not None and page is not known:
        yield page
    spent = 0.0
    while spent < 60 * minutes and not (page and page.found.reached_best >= ENOUGH):
        seed = page.found.seeds if page else 0
        so_far = f", best {page.value}" if page else ""
        progress(f"{asked.name}: seed {seed}{so_far}")
        begun = process_time()
        outcome = run(
            setup,
            joints=asked.joints,
            task_dimension=asked.task_dimension,
            starts=_STARTS,
            seed=seed,
            workers=workers,
        )
        used = sum(record.cpu_seconds for record in outcome.records)
        spent += max(used, process_time() - begun)
        if not outcome.complete:
            raise KeyboardInterrupt
        page = _joined(asked, page, outcome, used)
        if page is None:
            return
        yield page


def improve_from_best(
    asked: Entry,
    known: Page | None,
    minutes: float,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[Page]:
    """Search around the best Jacobian, in one process; return the page after each seed.

    A hop moves all variables a little, or draws one to three joints anew, and goes to the local
    maximum there with `formulations.max_min.Polish`. From a better one the search goes on. The
    first of 20 begins at the best itself. Hops
    are no random starts: they are not counted among these, and say nothing about their share.

    Parameters
    ----------
    asked, known, minutes, progress
        As of `improve`.

    Raises
    ------
    InputError
        If the entry is not of max-min, its joints have more than bounds, or no Jacobian is on
        record to begin from.
    """
    check_hops(asked)
    arm, scaled = asked.arm, asked.model == "free-mean"
    if known is None:
        raise InputError("--from-best", asked.name, "an entry with a Jacobian on record")
    polish, page, spent = Polish(arm, asked.locked, scaled), known, 0.0
    while spent < 60 * minutes:
        progress(f"{asked.name}: seed {page.found.seeds}, best {page.value}")
        begun = process_time()
        best = arm.variables(page.jacobian)
        value = worst_case_sigma(page.jacobian, asked.locked)
        for number in range(_STARTS):
            rng = np.random.default_rng((page.found.seeds, number))
            # The first one is the best itself: its last digits.
            point, _ = polish(_moved(best, arm, rng) if number else best)
            if scaled:
                point = point * np.sqrt(arm.largest_trace / trace(arm.jacobian(point)))
            merit = worst_case_sigma(arm.jacobian(point), asked.locked)
            if merit > value:
                best, value = point, merit
        used = process_time() - begun
        spent += used
        page = _hopped(asked, page, arm.jacobian(best), used)
        yield page


def check_hops(asked: Entry) -> None:
    """Refuse an entry that `improve_from_best` cannot search: InputError."""
    if asked.formulation != MAX_MIN or asked.model not in ("free-mean", "unit-revolute"):
        allowed = "an entry of max-min with the model free-mean or unit-revolute"
        raise InputError("--from-best", asked.name, allowed)


def _moved(best: FloatArray, arm: Arm, rng: np.random.Generator) -> FloatArray:
    """Return variables near the best, or with some joints drawn anew."""
    if rng.random() < 0.6:
        size = 10.0 ** rng.uniform(-2.0, -0.3)
        moved = best + size * rng.normal(size=best.size)
    else:
        moved = best.reshape(arm.shape[1], -1).copy()
        which = rng.choice(arm.shape[1], rng.integers(1, 4), replace=False)
        moved[which] = arm.sample(rng).reshape(moved.shape)[which]
    return np.asarray(np.clip(moved.ravel(), *arm.bounds))


def _hopped(asked: Entry, page: Page, jacobian: FloatArray, cpu_seconds: float) -> Page:
    facts, before = provenance(), page.found
    gain = worst_case_sigma(jacobian, asked.locked) - float(page.value)
    found = replace(
        before,
        date=facts["date"],
        seeds=before.seeds + 1,
        cpu_seconds=round(before.cpu_seconds + cpu_seconds, 1),
        versions=facts["versions"],
        machine=facts["machine"],
    )
    if gain > RESOLUTION:
        found = replace(
            found,
            by="lockedjoint",
            statement=f"{MAX_MIN}, hops from the best, polished",
            reached_best=before.reached_best if gain <= REACHED_BEST else 0,
        )
    return improved(asked, jacobian, found, page)


def inherited(asked: Entry, known: Page | None) -> Page | None:
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
            found = Found(
                f"lockedjoint, from {other.entry.name}",
                provenance()["date"],
                versions=provenance()["versions"],
            )
            before = page.found if page else Found("", "")
            found = replace(found, seeds=before.seeds, starts=before.starts)
            new = improved(asked, jacobian, found, page)
            if page is None or new.value != page.value:
                page = new
    return page


def setup_of(asked: Entry) -> Setup:
    """Return what is run for an entry: the encoding that finds most where k joints lock."""
    if asked.formulation != MAX_MIN or asked.locked == 1:
        return Setup(asked.formulation, asked.model, locked=asked.locked)
    tight = asked.joints - asked.task_dimension == asked.locked
    six = asked.task_dimension == 6
    return Setup(
        MAX_MIN,
        asked.model,
        encoding="shared-factor" if tight else "principal-minors",
        from_residual_minima=tight and six,
        locked=asked.locked,
    )


def _joined(
    asked: Entry, page: Page | None, outcome: Outcome, cpu_seconds: float
) -> Page | None:
    """Return the page with the starts of one more seed; None if nothing was ever found."""
    before = page.found if page else Found("lockedjoint", "")
    reached = outcome.reached
    best = max((record.merit for record in reached), default=0.0)
    value = float(page.value) if page else 0.0
    count = sum(abs(one.merit - max(best, value)) <= REACHED_BEST for one in reached)
    kept = before.reached_best if value >= best - REACHED_BEST else 0
    facts = provenance()
    found = replace(
        before,
        by=before.by if value > best + RESOLUTION else "lockedjoint",
        date=facts["date"],
        # Of a Jacobian that these starts did not reach, how it was found stays on record.
        statement=before.statement
        if before.statement and value > best + REACHED_BEST
        else _statement(outcome.setup),
        seeds=before.seeds + 1,
        starts=before.starts + len(outcome.records),
        reached_best=kept + count,
        cpu_seconds=round(before.cpu_seconds + cpu_seconds, 1),
        versions=facts["versions"],
        machine=facts["machine"],
    )
    if reached and best > 0:
        return improved(asked, outcome.best.jacobian, found, page)
    return replace(page, found=found) if page else None


def _statement(setup: Setup) -> str:
    words = [setup.formulation, setup.encoding]
    words.append("from residual minima" if setup.from_residual_minima else "")
    return ", ".join(filter(None, words))
