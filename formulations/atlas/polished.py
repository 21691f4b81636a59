"""The search for an entry's best Jacobian from starts that are not random, by `Polish`.

Hops
    move all variables of the best Jacobian a little, or draw one to three joints anew. From a
    better one the search goes on. The first of 20 begins at the best itself.
Symmetric
    starts are Jacobians that a map of finite order carries into themselves: few variables, and
    most of the best Jacobians known where several joints lock are near one. Where the best of
    them is not far below the best known, the symmetry is dropped for the last steps.

Neither are random starts: they are not counted among these, and say nothing about their share.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from time import process_time

import numpy as np

from formulations.atlas.collection import improved
from formulations.atlas.entry import RESOLUTION, Entry, EntryPage, Found
from formulations.atlas.improve import continued
from formulations.joints.arm import Arm
from formulations.joints.symmetric import SymmetricArm
from formulations.max_min import NAME as MAX_MIN
from formulations.measures import trace, worst_case_sigma
from formulations.solving.outcome import REACHED_BEST
from formulations.solving.polish import Polish
from nlp.arrays import FloatArray
from nlp.errors import InputError

SEARCHES = ("hops", "symmetric")
_STARTS = 20
# A symmetric optimum goes on without its symmetry from this share of the best known.
_NEAR = 0.95
# How far it is then moved: from a saddle nothing comes down by itself.
_PUSH = 1e-4
# Where a failure leaves less there is nothing to climb from.
_SINGULAR = 1e-6


def improve_polished(
    asked: Entry,
    known: EntryPage | None,
    minutes: float,
    search: str,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[EntryPage]:
    """Search for a better Jacobian, in one process; return the page after each seed.

    Parameters
    ----------
    asked, known, minutes, progress
        As of `improve`.
    search
        One of `SEARCHES`.

    Raises
    ------
    InputError
        If the search is unknown, the entry is not of max-min, its joints have more than bounds,
        or there is no Jacobian on record to hop from.
    """
    check_polished(asked, search)
    one_seed = _hops if search == "hops" else _symmetric
    page, spent, seed = known, 0.0, -1
    while spent < 60 * minutes:
        seed = page.found.seeds if page else seed + 1
        so_far = f", best {page.value}" if page else ""
        progress(f"{asked.name}: seed {seed}{so_far}")
        begun = process_time()
        jacobian, words = one_seed(asked, page, seed)
        used = process_time() - begun
        spent += used
        page = _joined(asked, page, jacobian, words, used)
        if page is not None:
            yield page


def check_polished(asked: Entry, search: str) -> None:
    """Refuse an entry or a search that `improve_polished` does not know: InputError."""
    if search not in SEARCHES:
        raise InputError("--search", search, "random, " + " or ".join(SEARCHES))
    if asked.formulation != MAX_MIN or asked.model not in ("free-mean", "unit-revolute"):
        allowed = "an entry of max-min with the model free-mean or unit-revolute"
        raise InputError(f"--search {search}", asked.name, allowed)


def _hops(asked: Entry, page: EntryPage | None, seed: int) -> tuple[FloatArray, str]:
    if page is None:
        raise InputError("--search", "hops", f"symmetric: {asked.name} has no Jacobian yet")
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
    return best, "hops from the best"


def _symmetric(
    asked: Entry, page: EntryPage | None, seed: int
) -> tuple[FloatArray | None, str]:
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
    return best, words


def _polished(asked: Entry, arm: Arm | SymmetricArm, start: FloatArray) -> FloatArray:
    scaled = asked.model == "free-mean"
    sets = arm.distinct_sets(asked.locked) if isinstance(arm, SymmetricArm) else None
    point, _ = Polish(arm, asked.locked, scaled, sets)(start)
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


def _joined(
    asked: Entry,
    page: EntryPage | None,
    jacobian: FloatArray | None,
    words: str,
    cpu_seconds: float,
) -> EntryPage | None:
    """Return the page with one more seed; None if nothing was ever found."""
    before = page.found if page else Found("lockedjoint", "")
    found = continued(before, cpu_seconds)
    if jacobian is None:
        return replace(page, found=found) if page else None
    gain = worst_case_sigma(jacobian, asked.locked) - (float(page.value) if page else 0.0)
    if gain > RESOLUTION:
        found = replace(
            found,
            by="lockedjoint",
            statement=f"{MAX_MIN}, {words}, polished",
            reached_best=before.reached_best if gain <= REACHED_BEST else 0,
        )
    return improved(asked, jacobian, found, page)
