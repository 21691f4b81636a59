"""Search for an entry's best Jacobian from random starts, seed after seed.

A *seed* is a number, 0, 1, 2, …, and with it a group of `STARTS` random starts: the same on
every machine. Each seed is solved by one call of a `OneSeed`, whose result changes the entry's
page (`EntryPage`): a better Jacobian, or only the numbers of starts. Entries on the condition
number are solved by `polish`, all others as any case is, by Ipopt.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from time import process_time
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations import condition, max_min, registry
from lockedjoint.formulations.atlas.collection import improved, read_atlas
from lockedjoint.formulations.atlas.entry import ENOUGH, RESOLUTION, Entry, EntryPage, Found
from lockedjoint.formulations.io.table import provenance
from lockedjoint.formulations.measures import trace
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import REACHED_BEST, Outcome, Record
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.formulations.solving.solve import run
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, LockedJointError, WorkerError
from lockedjoint.nlp.progress import Step

#: Number of starts of a seed. If you change it, seeds that are on record have other starts.
STARTS = 20
# Number of seeds that an executor has at once. More keep a larger cluster busy; those that are
# not needed at the end are lost.
_SEEDS_AHEAD = 200
# A budget is given in minutes.
_SECONDS_PER_MINUTE = 60


@dataclass(frozen=True, eq=False)
class SeedResult:
    """What the starts of one seed led to.

    Attributes
    ----------
    jacobian
        The best one, shape (m, n); None if no start had an answer.
    found
        How the best Jacobian was found, with what is new after this seed.
    cpu_seconds
        Processor time of the starts in other processes; 0 if they were solved in this one.
    """

    jacobian: FloatArray | None
    found: Found
    cpu_seconds: float = 0.0


#: A function that solves the starts of a seed, from the page as it stands and the seed.
OneSeed: TypeAlias = Callable[[EntryPage | None, int], SeedResult]


def improve(
    asked: Entry,
    known: EntryPage | None,
    minutes: float,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[EntryPage]:
    """Search from seed after seed of random starts, and yield the page as it stands after each.

    The search goes on with the first seed that the known page did not use. It ends after
    `minutes` of processor time, or when `ENOUGH` starts have reached the best.

    Parameters
    ----------
    asked
        The entry.
    known
        Its page, None if there is none.
    minutes
        Processor time after which no further seed begins.
    workers
        Number of processes here.
    executor
        An executor of processes, such as that of a cluster. It is given many seeds at once; the
        pages are the same.
    progress
        Told which seed begins.

    Raises
    ------
    InputError
        If there is an executor, and the entry is one on the condition number.
    WorkerError
        If the executor ends.
    """
    polished_only = asked.formulation == condition.NAME
    if executor is not None and polished_only:
        raise InputError("--scheduler", f"for {asked.name}", f"none for {condition.NAME}")
    starts = _RandomStarts(case_of(asked), workers, executor)
    one_seed: OneSeed = partial(_solved, starts)
    if polished_only:
        one_seed = partial(_polished, asked)

    def pages() -> Iterator[EntryPage]:
        """Yield the page after each seed; what is wrong was refused before."""
        with closing(starts):
            page = inherited(asked, known)
            if page is not None and page is not known:
                yield page
            if found_so_far(page).reached_best >= ENOUGH:
                return
            for after in after_each_seed(asked, page, minutes, one_seed, progress):
                if after is None:
                    return
                yield after
                if after.found.reached_best >= ENOUGH:
                    return

    return pages()


def after_each_seed(
    asked: Entry,
    page: EntryPage | None,
    minutes: float,
    one_seed: OneSeed,
    progress: Callable[[str], None],
) -> Iterator[EntryPage | None]:
    """Yield the page as it stands after each seed, None as long as there is no Jacobian.

    Seeds begin after those of the page, until `minutes` of processor time are over.
    """
    budget = _SECONDS_PER_MINUTE * minutes
    spent = 0.0
    seed = -1
    while spent < budget:
        seed = page.found.seeds if page else seed + 1
        best = f", best {page.value}" if page else ""
        progress(Step(f"{asked.name}: seed {seed}{best}", spent / budget))
        begun = process_time()
        result = one_seed(page, seed)
        used = max(result.cpu_seconds, process_time() - begun)
        spent += used
        found = _after_one_more_seed(result.found, used)
        better = None
        if result.jacobian is not None:
            # A Jacobian that satisfies the model to the solver's tolerance alone, too far off
            # for a proof of its value, is refused; the search goes on.
            with suppress(InputError):
                better = improved(asked, result.jacobian, found, page)
        if better is None and page is not None:
            better = replace(page, found=found)
        page = better
        yield page


def inherited(asked: Entry, known: EntryPage | None) -> EntryPage | None:
    """Return the page with the best Jacobian that another entry of this size has for it.

    Unit revolute columns are lever-revolute and, scaled, free columns as well. Where no other
    entry has a better one it is the page `known`.
    """
    page = known
    for other in read_atlas():
        if other.entry == asked or replace(other.entry, model=asked.model) != asked:
            continue
        scale = np.sqrt(asked.arm.largest_trace / trace(other.jacobian))
        for jacobian in (other.jacobian, scale * other.jacobian):
            if not asked.holds(jacobian):
                continue
            now, before = provenance(), found_so_far(page)
            by, counts = f"lockedjoint, from {other.entry.name}", (before.seeds, before.starts)
            found = Found(by, now["date"], "", *counts, versions=now["versions"])
            new = improved(asked, jacobian, found, page)
            if page is None or new.value != page.value:
                page = new
    return page


def case_of(asked: Entry) -> Case:
    """Return what is run for an entry: the encoding that finds most where k joints lock."""
    settings: dict[str, object] = {"failures": asked.failures} if asked.failures > 1 else {}
    if asked.formulation == max_min.NAME and asked.failures > 1:
        tight = asked.joints - asked.task_dimension == asked.failures
        settings["encoding"] = "shared-factor" if tight else "principal-minors"
        settings["from_residual_minima"] = tight and asked.task_dimension == 6
    return Case(registry.formulation_of(asked.formulation), asked.arm, settings)


def found_so_far(page: EntryPage | None) -> Found:
    """Return how a page's Jacobian was found; no starts if there is no page."""
    return page.found if page else Found("lockedjoint", "")


def _after_one_more_seed(found: Found, cpu_seconds: float) -> Found:
    """Return how a Jacobian was found, with one more seed, the date and the machine."""
    now = provenance()
    made: dict[str, Any] = {name: now[name] for name in ("date", "versions", "machine")}
    total = round(found.cpu_seconds + cpu_seconds, 1)
    return replace(found, seeds=found.seeds + 1, cpu_seconds=total, **made)


@dataclass(frozen=True)
class _RandomStarts:
    """Solves a case from the random starts of a seed: here, or of many seeds on an executor."""

    case: Case
    workers: int
    executor: Executor | None
    # What the executor has been given and not yet been asked for, by seed; filled by `outcome`.
    futures: dict[int, Future[tuple[Record, ...]]] = field(default_factory=dict)

    def outcome(self, seed: int) -> Outcome:
        """Return the outcome of a seed; on an executor, submit those that follow it as well."""
        if self.executor is None:
            outcome = run(self.case, starts=STARTS, seed=seed, workers=self.workers)
            if not outcome.complete:
                raise KeyboardInterrupt
            return outcome
        for later in range(seed, seed + _SEEDS_AHEAD):
            if later not in self.futures:
                self.futures[later] = self.executor.submit(_records, self.case, later)
        try:
            records = self.futures.pop(seed).result()
        except LockedJointError:
            raise
        except Exception as reason:  # an executor's own, of workers or a cluster that ended
            why = ": ".join(filter(None, (type(reason).__name__, str(reason))))
            message = f"Seed {seed} did not come back from the executor ({why})."
            raise WorkerError(message) from None
        return Outcome(self.case, records, complete=True)

    def close(self) -> None:
        """Cancel what the executor has not begun."""
        for future in self.futures.values():
            future.cancel()


def _records(case: Case, seed: int) -> tuple[Record, ...]:
    """Return the records of a seed's starts, in a worker process."""
    outcome = run(case, starts=STARTS, seed=seed)
    if not outcome.complete:
        raise WorkerError(f"Seed {seed} was interrupted in its worker.")
    return outcome.records


def _solved(starts: _RandomStarts, page: EntryPage | None, seed: int) -> SeedResult:
    """Solve a seed's starts as a case."""
    outcome, case = starts.outcome(seed), starts.case
    words = [case.formulation.NAME, str(case.settings.get("encoding", ""))]
    if case.settings.get("from_residual_minima"):
        words.append("from residual minima")
    scores = [record.score for record in outcome.reached]
    statement = ", ".join(filter(None, words))
    found = _after_random_starts(page, scores, len(outcome.records), statement)
    jacobian = outcome.best.jacobian if max(scores, default=0.0) > 0 else None
    return SeedResult(jacobian, found, sum(record.cpu_seconds for record in outcome.records))


def _polished(asked: Entry, page: EntryPage | None, seed: int) -> SeedResult:
    """Polish a seed's starts, of an entry on the condition number."""
    arm = asked.arm
    jacobians = []
    for number in range(STARTS):
        start = arm.sample(np.random.default_rng((seed, number)))
        jacobians.append(_polished_jacobian(asked, start))
    scores = [condition.score(jacobian, asked.failures) for jacobian in jacobians]
    found = _after_random_starts(page, scores, STARTS, f"{condition.NAME}, polished")
    return SeedResult(jacobians[int(np.argmax(scores))], found)


def _polished_jacobian(asked: Entry, start: FloatArray) -> FloatArray:
    """Return the polished Jacobian, as long as the model allows where only ‖J‖_F is limited."""
    scaled = asked.model == "free-mean"
    point, _ = polish(asked.arm, start, asked.failures, scaled, relative=True)
    jacobian = asked.arm.jacobian(point)
    size = np.sqrt(asked.arm.largest_trace / trace(jacobian)) if scaled else 1.0
    return np.asarray(size * jacobian)


def _after_random_starts(
    page: EntryPage | None, scores: Sequence[float], starts: int, statement: str
) -> Found:
    """Return how the best Jacobian was found, after random starts with these scores.

    Starts without an answer have no score. A Jacobian that these starts did not reach keeps its
    finder and its statement. Only starts within `REACHED_BEST` of the best of all count as
    having reached it; earlier ones no longer do if this seed is better.
    """
    before, best = found_so_far(page), max(scores, default=0.0)
    value = float(page.value) if page else 0.0
    count = sum(abs(score - max(best, value)) <= REACHED_BEST for score in scores)
    reached_before = before.reached_best if value >= best - REACHED_BEST else 0
    keeps_statement = before.statement and value > best + REACHED_BEST
    return replace(
        before,
        by=before.by if value > best + RESOLUTION else "lockedjoint",
        statement=before.statement if keeps_statement else statement,
        starts=before.starts + starts,
        reached_best=reached_before + count,
    )
