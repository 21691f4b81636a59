"""Rank the arrangements of a manipulator's joints by one criterion.

What comes in: a `Manipulator` and a criterion. What goes out: a `Ranking`, the best arrangement
first. All different arrangements are tried if there are not too many, else those that a local
search has seen. Of a costly criterion only a shortlist is judged in full.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.nlp.arrays import FloatArray, whole_number
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.nlp.progress import Progress, Step, part_of
from lockedjoint.synthesis.criteria import (
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
    symmetries,
)
from lockedjoint.synthesis.local_search import search
from lockedjoint.synthesis.manipulator import Manipulator

# Largest number of arrangements that are all tried: 8! orders fit, and 6!·2⁶ with flips. With
# more, a local search looks at some of them.
_EXHAUSTIVE = 50_000
#: Number of arrangements that a costly criterion judges, by default.
SHORTLIST = 200
# Number of parts in which arrangements are judged: each is told to `progress`.
_PARTS = 20
# Least number of arrangements of a part: arrays of fewer are slow.
_LEAST_TOGETHER = 10
# Share of the progress of a ranking that is done when there is a shortlist.
_SHORTLISTED = 0.5


@dataclass(frozen=True, eq=False)
class Ranking:
    """Arrangements of one manipulator's joints by one criterion, the best first."""

    criterion: str  #: Its name.
    method: str  #: Which arrangements were compared, in words.
    arrangements: Arrangements  #: Those that were judged in full, N of them, the best first.
    values: FloatArray  #: Their values by the criterion, shape (N,).

    def rows(self) -> list[dict[str, object]]:
        """Return a row for each: its rank, columns from base to tip, signs, and value."""
        arranged = zip(
            self.arrangements.orders.tolist(),
            np.where(self.arrangements.flips, "-", "+"),
            self.values.tolist(),
            strict=True,
        )
        return [
            {
                "rank": k + 1,
                "order": " ".join(map(str, order)),
                "signs": "".join(signs),
                "criterion": self.criterion,
                "value": value,
            }
            for k, (order, signs, value) in enumerate(arranged)
        ]


def rank(
    manipulator: Manipulator,
    by: str | Judge,
    sampling: Sampling | None = None,
    shortlist: int = SHORTLIST,
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
    criterion, sampling = criterion_of(by), sampling or Sampling()
    shortlist = whole_number("shortlist", shortlist, 1, _EXHAUSTIVE)
    if criterion.self_motion:
        if not one_more_joint(manipulator.joints, manipulator.task):
            allowed = (
                "another one: it needs positions, and one joint more than the task has rows"
            )
            raise InputError("criterion", criterion.name, allowed)
        sampling.check(shortlist, manipulator.joints)
    early = part_of(progress, 0.0, _SHORTLISTED)
    late = part_of(progress, _SHORTLISTED, 1.0)
    if count(manipulator) > _EXHAUSTIVE:
        candidates, method = _searched(manipulator, criterion, sampling, shortlist, early)
    else:
        candidates = distinct(every(manipulator), symmetries(manipulator))
        method = f"all {len(candidates)} distinct arrangements"
        if criterion.costly and len(candidates) > shortlist:
            candidates, words = _shortlisted(
                manipulator, criterion, candidates, sampling, shortlist, early
            )
            method = f"the {shortlist} {words} of {method}"
        else:
            late = progress
    costs = _costs(criterion, manipulator, candidates, sampling, late)
    order = np.argsort(costs, kind="stable")
    values = criterion.sign * costs[order]
    return Ranking(criterion.name, method, candidates[order], values)


def _shortlisted(
    manipulator: Manipulator,
    criterion: Criterion,
    candidates: Arrangements,
    sampling: Sampling,
    shortlist: int,
    progress: Progress,
) -> tuple[Arrangements, str]:
    """Return the candidates that a cheap criterion puts first, and what they are."""
    if criterion.self_motion and sampling.samples > COARSE:
        cheap, sampling = criterion, replace(sampling, samples=COARSE)
        words = f"best by a sample of {COARSE}"
    else:
        cheap, words = CRITERIA["total-length"], "shortest"
    costs = _costs(cheap, manipulator, candidates, sampling, progress)
    return candidates[np.argsort(costs, kind="stable")[:shortlist]], words


def _searched(
    manipulator: Manipulator,
    criterion: Criterion,
    sampling: Sampling,
    shortlist: int,
    progress: Progress,
) -> tuple[Arrangements, str]:
    """Return the best arrangements of a local search, and how they were found."""
    searched_by = CRITERIA["total-length"] if criterion.costly else criterion

    def cost(arrangements: Arrangements) -> FloatArray:
        return _costs(searched_by, manipulator, arrangements, sampling)

    candidates = search(manipulator, cost, sampling.seed, shortlist, progress=progress)
    method = f"seeded local search for {searched_by.name}"
    if criterion.costly:
        method = f"the {len(candidates)} shortest of a {method}"
    return candidates, method


def _costs(
    criterion: Criterion,
    manipulator: Manipulator,
    arrangements: Arrangements,
    sampling: Sampling,
    progress: Progress = lambda _: None,
) -> FloatArray:
    """Return the cost of each arrangement, shape (N,): the least is the best."""
    # The number, among the arrangements that are judged, of each arrangement asked for.
    number: IntArray | slice = slice(None)
    if criterion.self_motion and not manipulator.task.free_directions:
        # An arm and its reverse have the same self-motion: one of them is judged.
        orders = arrangements.orders
        back = orders[:, ::-1]
        one_way = np.where(orders[:, :1] < back[:, :1], orders, back)
        orders, number = np.unique(one_way, axis=0, return_inverse=True)
        number = number.ravel()
        arrangements = Arrangements(orders, np.zeros(orders.shape, dtype=bool))
    size = max(_LEAST_TOGETHER, ceil(len(arrangements) / _PARTS))
    costs = []
    for first in range(0, len(arrangements), size):
        what = f"{criterion.name} of {len(arrangements)} arrangements"
        progress(Step(what, first / len(arrangements)))
        part = arrangements[np.arange(first, min(first + size, len(arrangements)))]
        costs.append(criterion.cost(family(manipulator, part), sampling))
    return np.concatenate(costs)[number]
