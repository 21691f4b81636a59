"""Two searches for better Jacobians, for entries of which random starts seldom reach the best.

    python results/atlas/search.py ENTRY --from hops --minutes 10 --out atlas

Where several joints lock many local optima are near the best. `hops` moves the best known
Jacobian a little, or draws one to three of its joints anew, and climbs by the last step of the
second search (`results.second_search.smoothed`). It is for every entry that has a Jacobian.
`symmetric` begins with Jacobians that a map of finite order carries into themselves: they have
few variables, and few distinct failures. Where such an optimum comes near the best known, the
symmetry is dropped. It climbs by `lockedjoint.formulations.solving.polish`, and is for max-min
with the models free-mean and unit-revolute.

Their starts say nothing on how many random starts reach a value, so that they do not count as
such. They run in one process.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lockedjoint.commands.bars import progress as show_progress
from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import page_of, write_page
from lockedjoint.formulations.atlas.entry import RESOLUTION, Entry, EntryPage, Found, entry
from lockedjoint.formulations.atlas.improve import (
    STARTS,
    OneSeed,
    SeedResult,
    after_each_seed,
    found_so_far,
)
from lockedjoint.formulations.io.files import prepare_folder
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.measures import trace, worst_case_sigma
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import InputError, LockedJointError, one_of
from results.atlas.symmetric_arm import SymmetricArm
from results.second_search.hops import moved
from results.second_search.smoothed import SmoothedSearch

SEARCHES = ("hops", "symmetric")
_MODELS = ("free-mean", "unit-revolute")
# Share of the best known σ from which a symmetric optimum goes on without its symmetry.
_NEAR_BEST = 0.95
# Standard deviation of the move when the symmetry is dropped: nothing leaves a saddle by
# itself.
_PUSH = 1e-4
# Worst case below which there is nothing to climb from.
_SINGULAR = 1e-6


def search(
    asked: Entry,
    known: EntryPage | None,
    minutes: float,
    kind: str,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[EntryPage]:
    """Search by ``hops`` or from ``symmetric`` starts; yield the page after each seed.

    InputError if the search is not for this entry, or has no time.
    """
    one_of("--from", kind, SEARCHES)
    real_number("--minutes", minutes, "a positive number", least=float(np.finfo(float).tiny))
    if kind == "hops":
        if known is None:
            allowed = "an entry that has a Jacobian, from which --from hops begins"
            raise InputError("entry", asked.name, allowed)
        one_seed: OneSeed = partial(_hops, SmoothedSearch.of(asked))
    else:
        if not has_symmetric_starts(asked):
            allowed = f"an entry of {max_min.NAME} with the model {' or '.join(_MODELS)}"
            raise InputError("entry", asked.name, allowed)
        one_seed = partial(_symmetric, asked)
    pages = after_each_seed(asked, known, minutes, one_seed, progress)
    return (page for page in pages if page is not None)


def _hops(smoothed: SmoothedSearch, page: EntryPage | None, seed: int) -> SeedResult:
    """Climb from the best known Jacobian, and from Jacobians near it."""
    assert page is not None
    asked, columns, best = page.entry, smoothed.columns, page.jacobian
    value = asked.score(best)
    for number in range(STARTS):
        start = columns.point(best)
        if number:  # the first start is the best itself: for its last digits
            start = moved(start, columns, np.random.default_rng((seed, number)))
        jacobian = columns.jacobian(smoothed.polished(start))
        if asked.holds(jacobian) and asked.score(jacobian) > value:
            best, value = jacobian, asked.score(jacobian)
    return SeedResult(best, _found(asked, page, best, "hops from the best"))


def _symmetric(asked: Entry, page: EntryPage | None, seed: int) -> SeedResult:
    """Climb from symmetric Jacobians; near the best go on without the symmetry."""
    best: FloatArray | None = None
    value, words = float(page.value) if page else 0.0, ""
    for number in range(STARTS):
        rng = np.random.default_rng((seed, number))
        climb = symmetric_climb(asked, rng)
        if climb is None:
            continue
        jacobian, order = climb
        if worst_case_sigma(jacobian, asked.failures) < _NEAR_BEST * value:
            continue
        start = asked.arm.variables(jacobian)
        start = start + _PUSH * rng.normal(size=start.size)
        jacobian = climbed(asked, asked.arm, start)
        sigma = worst_case_sigma(jacobian, asked.failures)
        if sigma > value:
            best, value = jacobian, sigma
            words = f"from one symmetric under a map of order {order}"
    return SeedResult(best, _found(asked, page, best, words))


def has_symmetric_starts(asked: Entry) -> bool:
    """Whether `symmetric_climb` is for this entry."""
    return asked.formulation == max_min.NAME and asked.model in _MODELS


def symmetric_climb(asked: Entry, rng: np.random.Generator) -> tuple[FloatArray, int] | None:
    """Climb from a random symmetric Jacobian, among those of its symmetry.

    Returns
    -------
    (jacobian, order) or None
        The Jacobian at the end, shape (m, n), and the order of its map; None if the random one
        has the worst case 0, from which nothing climbs.
    """
    symmetric = SymmetricArm.drawn(asked.arm, rng)
    start = symmetric.sample(rng)
    if worst_case_sigma(symmetric.jacobian(start), asked.failures) < _SINGULAR:
        return None
    return climbed(asked, symmetric, start), symmetric.order


def climbed(asked: Entry, arm: Arm | SymmetricArm, start: FloatArray) -> FloatArray:
    """Return the Jacobian that `polish` reaches from variables of an arm, shape (m, n).

    Free columns are scaled to the largest ‖J‖_F that the model allows.
    """
    scaled = asked.model == "free-mean"
    sets = arm.distinct_sets(asked.failures) if isinstance(arm, SymmetricArm) else None
    point, _ = polish(arm, start, asked.failures, scaled, sets)
    jacobian = arm.jacobian(point)
    size = np.sqrt(asked.arm.largest_trace / trace(jacobian)) if scaled else 1.0
    return np.asarray(size * jacobian)


def _found(
    asked: Entry, page: EntryPage | None, jacobian: FloatArray | None, words: str
) -> Found:
    """Return how the best Jacobian was found: as before, if this one is not better."""
    before = found_so_far(page)
    if jacobian is None:
        return before
    gain = asked.score(jacobian) - (float(page.value) if page else 0.0)
    if gain <= RESOLUTION:
        return before
    reached = before.reached_best if gain <= REACHED_BEST else 0
    statement = f"{asked.formulation}, {words}, polished"
    return replace(before, by="lockedjoint", statement=statement, reached_best=reached)


def main(arguments: Sequence[str] | None = None) -> int:
    """Search for one entry, and write its page after every 20 starts; 1 if there is none."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("entry", metavar="ENTRY", help="a name that `lockedjoint atlas` lists")
    options.add_argument("--from", dest="kind", choices=SEARCHES, default="symmetric")
    options.add_argument("--minutes", type=float, default=10.0, help="of processor time")
    options.add_argument(
        "--out", type=Path, default=Path("atlas"), help="folder; it goes on from there"
    )
    given = options.parse_args(arguments)
    try:
        asked = entry(given.entry)
        page = page_of(asked, given.out) or page_of(asked)
        pages = search(asked, page, given.minutes, given.kind, show_progress)
        prepare_folder(given.out)
        for page in pages:
            write_page(page, given.out)
    except LockedJointError as error:
        options.error(str(error))
    except KeyboardInterrupt:
        print("Ended; what was found before is written.", file=sys.stderr)
        return 130
    if page is None:
        print(f"No start led to a Jacobian of the entry {asked.name}.")
        return 1
    print(f"{asked.name}: {page.value}, {page.found.statement}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
