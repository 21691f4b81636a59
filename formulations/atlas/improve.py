"""The search for an entry's best Jacobian, seed after seed.

Random starts are solved until enough of them reached the best. Hops move the best Jacobian a
little, or draw one to three joints anew. Symmetric starts are Jacobians that a map of finite
order carries into themselves; near the best known the symmetry is dropped. The last two improve
their starts by `polish`, and are not counted among the random starts.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from time import process_time
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations import condition, max_min, registry
from lockedjoint.formulations.atlas.collection import improved, read_atlas
from lockedjoint.formulations.atlas.entry import ENOUGH, RESOLUTION, Entry, EntryPage, Found
from lockedjoint.formulations.io.table import provenance
from lockedjoint.formulations.joints.arm import Arm, SymmetricArm
from lockedjoint.formulations.measures import trace, worst_case_sigma
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import REACHED_BEST, Outcome, Record
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.formulations.solving.solve import run
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, LockedJointError, WorkerError, one_of
from lockedjoint.nlp.progress import Step

SEARCHES = ("random", "hops", "symmetric")
_STARTS = 20
# Seeds of random starts that an executor has at once.
_UNDER_WAY = 200
# A symmetric optimum goes on without its symmetry from this share of the best known.
_NEAR = 0.95
# How far it is then moved: from a saddle nothing comes down by itself.
_PUSH = 1e-4
# Where a failure leaves less there is nothing to climb from.
_SINGULAR = 1e-6
# What a seed led to: a Jacobian or None, what is new of how it was found, and the processor
# time that its starts took in other processes.
_Seed: TypeAlias = tuple[FloatArray | None, Mapping[str, object], float]


def improve(
    asked: Entry,
    known: EntryPage | None,
    minutes: float,
    search: str = "random",
    *,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[EntryPage]:
    """Search from seed after seed, and yield the page as it stands after each.

    It goes on with the first seed that the known page did not use, for `minutes` of processor
    time, or until `ENOUGH` random starts reached the best. An executor of processes, such as
    that of a cluster, is given many seeds of random starts at once; the pages are the same.
    InputError if the search is not for this entry, or not for an executor; WorkerError if the
    executor ends.
    """
    one_of("--search", search, SEARCHES)
    plain = asked.formulation == max_min.NAME and asked.model in ("free-mean", "unit-revolute")
    if search != "random" and not plain:
        allowed = "an entry of max-min with the model free-mean or unit-revolute"
        raise InputError(f"--search {search}", asked.name, allowed)
    if search == "hops" and known is None:
        raise InputError("--search", search, f"symmetric: {asked.name} has no Jacobian yet")
    random = search == "random"
    if executor is not None and not (random and asked.formulation != condition.NAME):
        raise InputError(f"--search {search}", f"of {asked.name} on a cluster", "random there")
    solved = _Solved(case_of(asked), workers, executor)
    one_seed: Callable[[Any, int], _Seed] = partial(_random, solved)
    if not random:
        one_seed = partial(_hops, asked) if search == "hops" else partial(_symmetric, asked)
    elif asked.formulation == condition.NAME:
        one_seed = partial(_random_polished, asked)

    def pages() -> Iterator[EntryPage]:
        with closing(solved):
            page = inherited(asked, known) if random else known
            if page is not None and page is not known:
                yield page
            spent, seed = 0.0, -1
            while spent < 60 * minutes and not (random and _found(page).reached_best >= ENOUGH):
                seed = page.found.seeds if page else seed + 1
                so_far = f", best {page.value}" if page else ""
                progress(Step(f"{asked.name}: seed {seed}{so_far}", spent / (60 * minutes)))
                begun = process_time()
                jacobian, news, used = one_seed(page, seed)
                used = max(used, process_time() - begun)
                spent += used
                found = replace(_continued(_found(page), used), **news)  # type: ignore[arg-type]
                if jacobian is not None:
                    page = improved(asked, jacobian, found, page)
                elif page is not None:
                    page = replace(page, found=found)
                elif random:
                    return
                if page is not None:
                    yield page

    return pages()


def inherited(asked: Entry, known: EntryPage | None) -> EntryPage | None:
    """Return the page with the best Jacobian that another entry of this size has for it.

    Unit revolute columns are lever-revolute and, scaled, free columns as well.
    """
    page = known
    for other in read_atlas():
        if other.entry == asked or replace(other.entry, model=asked.model) != asked:
            continue
        scale = np.sqrt(asked.arm.largest_trace / trace(other.jacobian))
        for jacobian in (other.jacobian, scale * other.jacobian):
            if not asked.holds(jacobian):
                continue
            now, before = provenance(), _found(page)
            by, counts = f"lockedjoint, from {other.entry.name}", (before.seeds, before.starts)
            found = Found(by, now["date"], "", *counts, versions=now["versions"])
            new = improved(asked, jacobian, found, page)
            if page is None or new.value != page.value:
                page = new
    return page


def case_of(asked: Entry) -> Case:
    """Return what is run for an entry: the encoding that finds most where k joints lock."""
    settings: dict[str, object] = {"failures": asked.locked} if asked.locked > 1 else {}
    if asked.formulation == max_min.NAME and asked.locked > 1:
        tight = asked.joints - asked.task_dimension == asked.locked
        settings["encoding"] = "shared-factor" if tight else "principal-minors"
        settings["from_residual_minima"] = tight and asked.task_dimension == 6
    return Case(registry.formulation_of(asked.formulation), asked.arm, settings)


def _found(page: EntryPage | None) -> Found:
    return page.found if page else Found("lockedjoint", "")


def _continued(before: Found, cpu_seconds: float) -> Found:
    """Return how a Jacobian was found, after one more seed, here and now."""
    now, spent = provenance(), round(before.cpu_seconds + cpu_seconds, 1)
    made: dict[str, Any] = {name: now[name] for name in ("date", "versions", "machine")}
    return replace(before, seeds=before.seeds + 1, cpu_seconds=spent, **made)


@dataclass(frozen=True)
class _Solved:
    """A case from the random starts of a seed: here, or of many seeds on an executor."""

    case: Case
    workers: int
    executor: Executor | None
    under_way: dict[int, Future[tuple[Record, ...]]] = field(default_factory=dict)

    def outcome(self, seed: int) -> Outcome:
        if self.executor is None:
            outcome = run(self.case, starts=_STARTS, seed=seed, workers=self.workers)
            if not outcome.complete:
                raise KeyboardInterrupt
            return outcome
        for later in range(seed, seed + _UNDER_WAY):
            if later not in self.under_way:
                self.under_way[later] = self.executor.submit(_records, self.case, later)
        try:
            records = self.under_way.pop(seed).result()
        except LockedJointError:
            raise
        except Exception as reason:  # an executor's own, of workers or a cluster that ended
            why = ": ".join(filter(None, (type(reason).__name__, str(reason))))
            message = f"Seed {seed} did not come back from the executor ({why})."
            raise WorkerError(message) from None
        return Outcome(self.case, records, complete=True)

    def close(self) -> None:
        for future in self.under_way.values():
            future.cancel()


def _records(case: Case, seed: int) -> tuple[Record, ...]:
    outcome = run(case, starts=_STARTS, seed=seed)
    if not outcome.complete:
        raise WorkerError(f"Seed {seed} was interrupted in its worker.")
    return outcome.records


def _random(solved: _Solved, page: EntryPage | None, seed: int) -> _Seed:
    outcome, case = solved.outcome(seed), solved.case
    words = [case.formulation.NAME, str(case.settings.get("encoding", ""))]
    words.append("from residual minima" if case.settings.get("from_residual_minima") else "")
    scores = [record.score for record in outcome.reached]
    news = _counted(page, scores, len(outcome.records), ", ".join(filter(None, words)))
    used = sum(record.cpu_seconds for record in outcome.records)
    return outcome.best.jacobian if max(scores, default=0.0) > 0 else None, news, used


def _random_polished(asked: Entry, page: EntryPage | None, seed: int) -> _Seed:
    arm, rngs = asked.arm, (np.random.default_rng((seed, k)) for k in range(_STARTS))
    jacobians = [_polished(asked, arm, arm.sample(rng)) for rng in rngs]
    scores = [condition.score(jacobian, asked.locked) for jacobian in jacobians]
    news = _counted(page, scores, _STARTS, f"{condition.NAME}, polished")
    return jacobians[int(np.argmax(scores))], news, 0.0


def _counted(
    page: EntryPage | None, scores: Sequence[float], starts: int, statement: str
) -> Mapping[str, object]:
    """Return what is new after random starts, of which those with a score came to an end."""
    before, best = _found(page), max(scores, default=0.0)
    value = float(page.value) if page else 0.0
    count = sum(abs(score - max(best, value)) <= REACHED_BEST for score in scores)
    kept = before.reached_best if value >= best - REACHED_BEST else 0
    return {
        "by": before.by if value > best + RESOLUTION else "lockedjoint",
        # Of a Jacobian that these starts did not reach, how it was found stays on record.
        "statement": before.statement
        if before.statement and value > best + REACHED_BEST
        else statement,
        "starts": before.starts + starts,
        "reached_best": kept + count,
    }


def _hops(asked: Entry, page: EntryPage, seed: int) -> _Seed:
    arm, best = asked.arm, page.jacobian
    value = worst_case_sigma(best, asked.locked)
    for number in range(_STARTS):
        start = arm.variables(best)
        if number:  # the first one is the best itself: its last digits
            start = _moved(start, arm, np.random.default_rng((seed, number)))
        jacobian = _polished(asked, arm, start)
        score = worst_case_sigma(jacobian, asked.locked)
        if score > value:
            best, value = jacobian, score
    return best, _news(asked, page, best, "hops from the best"), 0.0


def _symmetric(asked: Entry, page: EntryPage | None, seed: int) -> _Seed:
    best, value, words = None, float(page.value) if page else 0.0, ""
    for number in range(_STARTS):
        rng = np.random.default_rng((seed, number))
        symmetric = SymmetricArm.drawn(asked.arm, rng)
        start = symmetric.sample(rng)
        if worst_case_sigma(symmetric.jacobian(start), asked.locked) < _SINGULAR:
            continue
        jacobian = _polished(asked, symmetric, start)
        if worst_case_sigma(jacobian, asked.locked) < _NEAR * value:
            continue
        start = asked.arm.variables(jacobian)
        start = start + _PUSH * rng.normal(size=start.size)
        jacobian = _polished(asked, asked.arm, start)
        score = worst_case_sigma(jacobian, asked.locked)
        if score > value:
            best, value = jacobian, score
            words = f"from one symmetric under a map of order {symmetric.order}"
    return best, _news(asked, page, best, words), 0.0


def _polished(asked: Entry, arm: Arm | SymmetricArm, start: FloatArray) -> FloatArray:
    scaled = asked.model == "free-mean"
    sets = arm.distinct_sets(asked.locked) if isinstance(arm, SymmetricArm) else None
    relative = asked.formulation == condition.NAME
    point, _ = polish(arm, start, asked.locked, scaled, sets, relative)
    jacobian = arm.jacobian(point)
    size = np.sqrt(asked.arm.largest_trace / trace(jacobian)) if scaled else 1.0
    return np.asarray(size * jacobian)


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


def _news(
    asked: Entry, page: EntryPage | None, jacobian: FloatArray | None, words: str
) -> Mapping[str, object]:
    """Return what is new of how the best was found, nothing if it is not better."""
    if jacobian is None:
        return {}
    gain = worst_case_sigma(jacobian, asked.locked) - (float(page.value) if page else 0.0)
    if gain <= RESOLUTION:
        return {}
    reached = _found(page).reached_best if gain <= REACHED_BEST else 0
    statement = f"{max_min.NAME}, {words}, polished"
    return {"by": "lockedjoint", "statement": statement, "reached_best": reached}
