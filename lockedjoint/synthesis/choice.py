"""Choose one of the manipulators that share a Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import ceil, factorial
from typing import TYPE_CHECKING

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray, finite_or_none, whole_number
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.nlp.progress import Progress, Step, part_of
from lockedjoint.synthesis.criteria import (
    BUILT_IN,
    COARSE,
    CRITERIA,
    Criterion,
    Judge,
    Sampling,
    criterion_of,
    one_more_joint,
)
from lockedjoint.synthesis.family import (
    Arrangements,
    count,
    distinct,
    every,
    family,
    flippable,
    symmetries,
)
from lockedjoint.synthesis.manipulator import Manipulator

if TYPE_CHECKING:
    import pandas as pd

# All arrangements are tried up to this number: 8! orders fit, and 6!·2⁶ with flips.
_EXHAUSTIVE = 50_000
_SHORTLIST = 200
# Number of parts in which arrangements are judged: each is told to `progress`.
_PARTS = 20
# Number of arrangements of a part, at least.
_LEAST_TOGETHER = 10
# Share of a ranking that is done when there is a shortlist.
_SHORTLISTED = 0.5
# Random arrangements that the local search starts from.
STARTS = 32
# Values closer than this, relative, are a tie.
TIE = 1e-9


@dataclass(frozen=True, eq=False)
class Choice:
    """A manipulator and how it was chosen.

    Its order and flips are counted from 0, see `Manipulator.arranged`.
    """

    manipulator: Manipulator
    order: tuple[int, ...]
    flips: tuple[bool, ...]
    criterion: str | None  #: The name of the criterion; None if the order was given.
    method: str  #: Which arrangements were compared.
    arrangements: int  #: All orders and signs, n!·2ⁿ.
    #: How many of them are different manipulators, see `symmetries`; None if not counted.
    distinct: int | None
    values: dict[str, float]  #: The values of the arm, by the names of all criteria.

    def __repr__(self) -> str:
        """Say in one line what was chosen, and by what."""
        by = f"by {self.criterion}, {self.method}" if self.criterion else "as given"
        return f"<Choice: columns {' '.join(map(str, self.order))} from base to tip, {by}>"

    def to_dict(self) -> dict[str, object]:
        """Return everything but the manipulator, as plain values; None for infinite ones."""
        own = {k: v for k, v in vars(self).items() if k not in ("manipulator", "values")}
        values = {name: finite_or_none(value) for name, value in self.values.items()}
        lists = {"order": list(self.order), "flips": list(self.flips)}
        return own | lists | {"criteria": values}


@dataclass(frozen=True, eq=False)
class Ranking:
    """Arrangements of one manipulator's joints by one criterion, the best first."""

    criterion: str
    method: str  #: Which arrangements were compared.
    arrangements: Arrangements  #: Those that were judged in full.
    values: FloatArray  #: Theirs, shape (N,).

    def table(self) -> pd.DataFrame:
        """Return a row for each: its rank, columns from base to tip, signs, and value."""
        import pandas as pd

        orders, flips = self.arrangements.orders.tolist(), self.arrangements.flips
        columns = {
            "rank": range(1, len(orders) + 1),
            "order": [" ".join(map(str, order)) for order in orders],
            "signs": ["".join(row) for row in np.where(flips, "-", "+")],
            "criterion": self.criterion,
            "value": self.values,
        }
        return pd.DataFrame(columns)


def rank(
    manipulator: Manipulator,
    by: str | Judge,
    sampling: Sampling | None = None,
    shortlist: int = _SHORTLIST,
    progress: Progress = lambda _: None,
) -> Ranking:
    """Return arrangements of a manipulator's joints by one criterion, the best first.

    Up to 50 000 arrangements (n ≤ 8 where flips move nothing) all distinct ones are tried;
    beyond that a seeded local search is made. `kept` and criteria of your own are evaluated
    only for a `shortlist`, where there are more: those of least total length, or, by `kept`,
    the best of a coarse sample.

    Parameters
    ----------
    manipulator
        The joints, in any order.
    by
        Name of a criterion, or a function of a manipulator, of which the least value is best.
    sampling
        Which positions `kept` samples.
    shortlist
        How many arrangements are judged where a criterion is costly.
    progress
        A function that is told what is being done.

    Raises
    ------
    InputError
        If there is no such criterion, it is not defined for such a manipulator, or the
        shortlist is not at least 1.
    """
    of_kind("manipulator", manipulator, Manipulator, "a Manipulator, as `realise` returns it")
    of_kind("sampling", sampling, (Sampling, type(None)), "a Sampling")
    wanted, sampling = criterion_of(by), sampling or Sampling()
    shortlist = whole_number("shortlist", shortlist, 1, _EXHAUSTIVE)
    if wanted.self_motion and not one_more_joint(manipulator.joints, manipulator.task):
        allowed = "another one: it needs positions, and one joint more than the task has rows"
        raise InputError("criterion", wanted.name, allowed)
    if wanted.self_motion:
        sampling.check(shortlist, manipulator.joints)

    by_itself = wanted.self_motion and sampling.samples > COARSE
    if count(manipulator) <= _EXHAUSTIVE:
        candidates = distinct(every(manipulator), symmetries(manipulator))
        method = f"all {len(candidates)} distinct arrangements"
        if wanted.costly and len(candidates) > shortlist:
            first = wanted if by_itself else CRITERIA["total-length"]
            few = replace(sampling, samples=COARSE) if by_itself else sampling
            early, progress = (
                part_of(progress, 0.0, _SHORTLISTED),
                part_of(progress, _SHORTLISTED, 1.0),
            )
            costs = _costs(first, manipulator, candidates, few, early)
            candidates = candidates[np.argsort(costs, kind="stable")[:shortlist]]
            words = f"best by a sample of {COARSE}" if by_itself else "shortest"
            method = f"the {shortlist} {words} of {method}"
    else:
        first = CRITERIA["total-length"] if wanted.costly else wanted

        def cost(these: Arrangements) -> FloatArray:
            return _costs(first, manipulator, these, sampling)

        early, progress = (
            part_of(progress, 0.0, _SHORTLISTED),
            part_of(progress, _SHORTLISTED, 1.0),
        )
        candidates = search(manipulator, cost, sampling.seed, shortlist, progress=early)
        method = f"seeded local search for {first.name}"
        if wanted.costly:
            method = f"the {len(candidates)} shortest of a {method}"
    costs = _costs(wanted, manipulator, candidates, sampling, progress)
    order = np.argsort(costs, kind="stable")
    return Ranking(wanted.name, method, candidates[order], wanted.sign * costs[order])


def _costs(
    by: Criterion,
    manipulator: Manipulator,
    these: Arrangements,
    sampling: Sampling,
    progress: Progress = lambda _: None,
) -> FloatArray:
    """Values with the sign for which the least is the best; of an arm and its reverse once."""
    places: IntArray | slice = slice(None)
    if by.self_motion and not manipulator.task.free_directions:
        back = these.orders[:, ::-1]
        one_way = np.where(these.orders[:, :1] < back[:, :1], these.orders, back)
        orders, places = np.unique(one_way, axis=0, return_inverse=True)
        these = Arrangements(orders, np.zeros(orders.shape, dtype=bool))
        places = places.ravel()
    size, costs = max(_LEAST_TOGETHER, ceil(len(these) / _PARTS)), []
    for first in range(0, len(these), size):
        progress(Step(f"{by.name} of {len(these)} arrangements", first / len(these)))
        part = these[np.arange(first, min(first + size, len(these)))]
        costs.append(by.cost(family(manipulator, part), sampling))
    return np.concatenate(costs)[places]


def choose_arrangement(
    manipulator: Manipulator,
    by: str | Judge,
    sampling: Sampling | None = None,
    shortlist: int = _SHORTLIST,
    ranking: Ranking | None = None,
) -> Choice:
    """Return the best arrangement of a manipulator's joints by one criterion.

    See `rank` for which are compared, and for the arguments. Of arrangements that tie, the one
    with the largest clearance is taken, then the first in lexicographic order.

    Parameters
    ----------
    manipulator, by, sampling, shortlist
        See `rank`.
    ranking
        Of the same, if it is there already.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> robot = lj.realise(lj.optimal_jacobian(8))
    >>> lj.choose_arrangement(robot, "total-length").criterion
    'total-length'
    """
    of_kind("ranking", ranking, (Ranking, type(None)), "a Ranking, as `rank` returns it")
    wanted = criterion_of(by)
    ranking = ranking or rank(manipulator, by, sampling, shortlist)
    tied = ranking.arrangements[_tied(wanted.sign * ranking.values)]
    clear = CRITERIA["clearance"].cost(family(manipulator, tied), sampling or Sampling())
    tied = tied[_tied(clear)]
    best = int(np.lexsort(np.hstack([tied.orders, tied.flips]).T[::-1])[0])
    order, flips = tied.orders[best].tolist(), tied.flips[best].tolist()
    choice = given(manipulator, order, flips, sampling)
    values = choice.values
    if wanted.name not in values:
        own = wanted.evaluate(family(choice.manipulator), sampling or Sampling())
        values = values | {wanted.name: float(own[0])}
    return replace(choice, criterion=wanted.name, method=ranking.method, values=values)


def given(
    manipulator: Manipulator,
    order: Sequence[int] | None = None,
    flips: Sequence[bool] | None = None,
    sampling: Sampling | None = None,
) -> Choice:
    """Return the arrangement asked for; columns in their own order if left out.

    Raises
    ------
    InputError
        If it is none; see `Manipulator.arranged`.
    """
    n, sampling = manipulator.joints, sampling or Sampling()
    order = tuple(range(n) if order is None else order)
    flips = (False,) * n if flips is None else tuple(flips)
    chosen, group = manipulator.arranged(order, flips), symmetries(manipulator)
    return Choice(
        manipulator=chosen,
        order=order,
        flips=flips,
        criterion=None,
        method="given",
        arrangements=factorial(n) << n,
        distinct=None if group is None else count(manipulator) // len(group),
        values=evaluate(chosen, sampling, BUILT_IN),
    )


def evaluate(
    manipulator: Manipulator,
    sampling: Sampling | None = None,
    names: Sequence[str] | None = None,
) -> dict[str, float]:
    """Return a manipulator's values by criteria of some names, by default all of them."""
    how = sampling or Sampling()
    how.check(1, manipulator.joints)
    own = family(manipulator)
    chosen = tuple(CRITERIA) if names is None else names
    return {name: float(CRITERIA[name].evaluate(own, how)[0]) for name in chosen}


def _tied(costs: FloatArray) -> IntArray:
    least = float(np.min(costs))
    slack = TIE * abs(least) if np.isfinite(least) else 0.0
    return np.asarray(np.flatnonzero(costs <= least + slack))


def search(
    manipulator: Manipulator,
    cost: Callable[[Arrangements], FloatArray],
    seed: int,
    keep: int,
    starts: int = STARTS,
    progress: Progress = lambda _: None,
) -> Arrangements:
    """Return the `keep` cheapest arrangements seen, the cheapest first.

    Steepest descent from random arrangements: each step tries every exchange of two joints,
    every move of one joint to another place and every flip, and takes the best, until none is
    better. A heuristic: the best arrangement of all need not be among those seen.
    """
    free, rng = flippable(manipulator), np.random.default_rng(seed)
    rows, costs = [], []
    for number in range(starts):
        progress(Step(f"local search {number + 1} of {starts}", number / starts))
        order = rng.permutation(manipulator.joints)
        flips = (rng.integers(2, size=len(order)) == 1) & free[order]
        here = Arrangements(order[None], flips[None])
        while True:
            near = _neighbours(here, free)
            values = cost(near)
            rows.append(np.hstack([near.orders, near.flips]))
            costs.append(values)
            best, own = int(np.argmin(values)), float(values[0])
            if values[best] >= own - 1e-12 * abs(own):
                break
            here = near[[best]]
    seen, places = np.unique(np.vstack(rows)[::-1], axis=0, return_index=True)
    cheapest = np.argsort(np.concatenate(costs)[::-1][places], kind="stable")[:keep]
    orders, flipped = np.hsplit(seen[cheapest], 2)
    return Arrangements(orders, flipped.astype(bool))


def _neighbours(here: Arrangements, free: BoolArray) -> Arrangements:
    """Return an arrangement itself, and then all that one step leads to."""
    order, flip = here.orders[0], here.flips[0]
    n = len(order)
    places = [np.arange(n)]
    for i, j in combinations(range(n), 2):
        exchanged = np.arange(n)
        exchanged[[i, j]] = j, i
        moves = (np.insert(np.delete(np.arange(n), a), b, a) for a, b in ((i, j), (j, i)))
        places += [exchanged, *moves]
    moved = np.array(places)
    flipped = flip ^ np.eye(n, dtype=bool)[free[order]]
    same = np.tile(order, (len(flipped), 1))
    return Arrangements(np.vstack([order[moved], same]), np.vstack([flip[moved], flipped]))
