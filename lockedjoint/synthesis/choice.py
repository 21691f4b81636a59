"""Choose one of the manipulators that share a Jacobian: an order and signs of its joints.

What comes in: a `Manipulator`, whose joints may stand in any order, and a criterion. What goes
out: a `Choice`, the arrangement that `ranking` puts first, with its values by all criteria.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import factorial

import numpy as np

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.nlp.arrays import FloatArray, finite_or_none
from lockedjoint.nlp.errors import of_kind
from lockedjoint.synthesis.criteria import BUILT_IN, CRITERIA, Judge, Sampling, criterion_of
from lockedjoint.synthesis.family import count, family, symmetries
from lockedjoint.synthesis.manipulator import Manipulator
from lockedjoint.synthesis.ranking import SHORTLIST, Ranking, rank

# Relative difference of values up to which they are a tie: rounding.
TIE = 1e-9


@dataclass(frozen=True, eq=False)
class Choice:
    """A manipulator and how it was chosen."""

    manipulator: Manipulator
    order: tuple[int, ...]  #: Columns of the Jacobian from base to tip, counted from 0.
    flips: tuple[bool, ...]  #: Whether each joint in this order is flipped.
    criterion: str | None  #: The name of the criterion; None if the order was given.
    method: str  #: Which arrangements were compared, in words.
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


def choose_arrangement(
    manipulator: Manipulator,
    by: str | Judge,
    sampling: Sampling | None = None,
    shortlist: int = SHORTLIST,
    ranking: Ranking | None = None,
) -> Choice:
    """Return the best arrangement of a manipulator's joints by one criterion.

    `rank` says which arrangements are compared. If several are equally good, the one with the
    largest clearance is taken, then the first in lexicographic order.

    Parameters
    ----------
    manipulator, by, sampling, shortlist
        See `rank`.
    ranking
        The result of `rank` for the same arguments, if you have it already.

    Raises
    ------
    InputError
        If there is no such criterion, it is not defined for such a manipulator, or the
        shortlist is not at least 1.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> robot = lj.realise(lj.optimal_jacobian(8))
    >>> lj.choose_arrangement(robot, "total-length").criterion
    'total-length'
    """
    of_kind("ranking", ranking, (Ranking, type(None)), "a Ranking, as `rank` returns it")
    criterion = criterion_of(by)
    ranking = ranking or rank(manipulator, by, sampling, shortlist)
    tied = ranking.arrangements[_tied(criterion.sign * ranking.values)]
    clear = CRITERIA["clearance"].cost(family(manipulator, tied), sampling or Sampling())
    tied = tied[_tied(clear)]
    # The first in lexicographic order of columns, then of flips.
    best = int(np.lexsort(np.hstack([tied.orders, tied.flips]).T[::-1])[0])
    order, flips = tied.orders[best].tolist(), tied.flips[best].tolist()
    choice = given(manipulator, order, flips, sampling)
    values = choice.values
    if criterion.name not in values:
        own = criterion.evaluate(family(choice.manipulator), sampling or Sampling())
        values = values | {criterion.name: float(own[0])}
    return replace(choice, criterion=criterion.name, method=ranking.method, values=values)


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
    n = manipulator.joints
    order = tuple(range(n) if order is None else order)
    flips = (False,) * n if flips is None else tuple(flips)
    chosen = manipulator.arranged(order, flips)
    # Arrangements that a symmetry leads to are the same manipulator.
    group = symmetries(manipulator)
    return Choice(
        manipulator=chosen,
        order=order,
        flips=flips,
        criterion=None,
        method="given",
        arrangements=factorial(n) << n,
        distinct=None if group is None else count(manipulator) // len(group),
        values=evaluate(chosen, sampling or Sampling(), BUILT_IN),
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
    """Return the numbers, shape (k,), of the least of N costs, but for rounding."""
    least = float(np.min(costs))
    slack = TIE * abs(least) if np.isfinite(least) else 0.0
    return np.asarray(np.flatnonzero(costs <= least + slack))
