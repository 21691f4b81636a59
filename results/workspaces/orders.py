"""The 5040 robots of each of some 7R Jacobians: what the best order of the joints keeps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from formulations import measures
from formulations.io.files import write_bytes
from formulations.io.study import Effort
from formulations.io.table import HIDDEN, column
from formulations.joints.arm import Arm
from formulations.joints.models import arm as arm_of
from formulations.plot.style import BLUE, INK, PALE, VERMILION, content, styled
from formulations.solving.trade_off_curve import TradeOffPoint, trade_off_curve
from formulations.synthesis.choice import rank
from formulations.synthesis.criteria import COARSE, CRITERIA, Sampling, kept_ball
from formulations.synthesis.family import every, family
from formulations.synthesis.from_jacobian import realise
from nlp.arrays import FloatArray
from nlp.starts import generator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Half-width of the artificial limits of all joints of a Jacobian's robots, in radians.
HALF = np.deg2rad(20.0)
#: Jacobians of the trade-off curve whose robots are ranked, and random starts of each.
JACOBIANS, CURVE_STARTS = 7, 5
# Random Jacobians, of which the one with the largest worst case is ranked, too.
_DRAWN = 40
# Of each Jacobian: orders that are judged with so many points, and of those, with other points.
_SHORTLIST, _POINTS = 30, 100
_FINALISTS, FINAL_POINTS = 3, 3000
# Orders drawn at random, to compare with, and points for each.
_TYPICAL, _TYPICAL_POINTS = 40, 60


@dataclass(frozen=True)
class OrderRow:
    """One 7R Jacobian and its 5040 robots: the columns of ``orders.csv``.

    Attributes
    ----------
    statement
        Whose optimum it is, or `random`.
    isotropy_defect
        Of the Jacobian.
    worst_case_sigma
        At the configuration for which it is designed: the same for all its robots.
    kept, error
        Volume that the best order found keeps, in cubes of the lever arm, and two standard
        errors.
    middle, least
        What the median of a random sample of orders keeps, and the least of them.
    front
        Whether no other Jacobian of the table has a larger worst case and keeps as much.
    order
        Columns from base to tip.
    jacobian
        The columns, six rows.
    """

    statement: str = field(metadata=column("Jacobian"))
    isotropy_defect: float = field(metadata=column("isotropy defect", ".4f"))
    worst_case_sigma: float = field(metadata=column("σ where designed", ".5f"))
    kept: float = field(metadata=column("best order keeps", ".3f"))
    error: float = field(metadata=column("error", ".2g"))
    middle: float = field(metadata=column("median of 40 orders", ".2f"))
    least: float = field(metadata=column("least of 40", ".2f"))
    front: str = field(metadata=column("not dominated"))
    order: str = field(metadata=column("best order, base to tip"))
    jacobian: Mapping[str, list[float]] = field(metadata=HIDDEN)


def orders(effort: Effort, folder: Path) -> Iterator[OrderRow]:
    """Rank the robots of Jacobians between the most isotropic one and the best worst case."""
    seven = arm_of("unit-revolute", 7)
    starts = effort.starts or CURVE_STARTS
    points = trade_off_curve(seven, JACOBIANS, starts, effort.seed, effort.progress)
    rows: list[OrderRow] = []
    spread = []
    for point in (drawn(seven, effort.seed), *points):
        effort.progress(f"orders of {point.statement}, σ = {point.worst_case_sigma:.4f}")
        row, typical = ranked(point, effort)
        rows.append(row)
        spread.append(typical)
    rows = [replace(row, front="yes" if _not_dominated(row, rows) else "no") for row in rows]
    write_bytes(folder / "orders.svg", content(_figure(rows, spread), "svg"))
    yield from rows


def drawn(arm: Arm, seed: int, count: int = _DRAWN) -> TradeOffPoint:
    """Return the random Jacobian with the largest worst case, of so many."""
    jacobians = [arm.jacobian(arm.sample(generator(seed, k))) for k in range(count)]
    best = max(jacobians, key=measures.worst_case_sigma)
    defect, sigma = measures.isotropy_defect(best), measures.worst_case_sigma(best)
    return TradeOffPoint("random", float("inf"), float(defect), float(sigma), best)


def _not_dominated(row: OrderRow, rows: Sequence[OrderRow]) -> bool:
    """Whether no other Jacobian has a larger worst case here and keeps as much elsewhere.

    By the values as they were found: what two Jacobians keep may differ by less than its error.
    """
    return not any(
        other.worst_case_sigma > row.worst_case_sigma and other.kept >= row.kept
        for other in rows
    )


def ranked(point: TradeOffPoint, effort: Effort) -> tuple[OrderRow, FloatArray]:
    """Return the robots of one Jacobian as a row, and what random ones of them keep."""
    arm, criterion = realise(point.jacobian), CRITERIA["kept"]
    first = Sampling(effort.seed, _POINTS, HALF)
    ranking = rank(arm, criterion.name, first, _SHORTLIST, effort.progress)
    finalists = ranking.arrangements[:_FINALISTS]
    # Other points than those by which they were chosen, or the largest would be too large.
    final = Sampling(effort.seed + 1, FINAL_POINTS, HALF)
    values = criterion.evaluate(family(arm, finalists), final)
    best = int(np.argmax(values))
    ball = kept_ball(first, family(arm, finalists[[best]]))
    share = values[best] / ball
    guarded = (share * FINAL_POINTS + 1) / (FINAL_POINTS + 2)
    typical = _typical_values(point, effort)
    row = OrderRow(
        statement=point.statement,
        isotropy_defect=point.isotropy_defect,
        worst_case_sigma=point.worst_case_sigma,
        kept=float(values[best]),
        error=2 * ball * float(np.sqrt(guarded * (1 - guarded) / FINAL_POINTS)),
        middle=float(np.median(typical)),
        least=float(np.min(typical)),
        front="",
        order=" ".join(map(str, finalists.orders[best].tolist())),
        jacobian={str(k): row for k, row in enumerate(point.jacobian.tolist())},
    )
    return row, typical


def _typical_values(point: TradeOffPoint, effort: Effort) -> FloatArray:
    """What random orders of a Jacobian keep, shape (40,)."""
    arm = realise(point.jacobian)
    orders = every(arm)
    drawn = np.random.default_rng(effort.seed).choice(len(orders), _TYPICAL, replace=False)
    how = Sampling(effort.seed + 1, _TYPICAL_POINTS, HALF)
    return CRITERIA["kept"].evaluate(family(arm, orders[drawn]), how)


#: What the page says of the ranking.
SETTINGS = {
    "coarse": COARSE,
    "shortlist": _SHORTLIST,
    "points": _POINTS,
    "finalists": _FINALISTS,
    "final_points": FINAL_POINTS,
    "ball": 4 * HALF,
    "drawn": _DRAWN,
}


def _figure(rows: Sequence[OrderRow], spread: Sequence[FloatArray]) -> Figure:
    """Draw what robots keep over a workspace against their worst case where it is designed."""
    with styled(7.4, 4.2) as figure:
        axes = figure.subplots()
        axes.set_title("Robots of seven joints: 5040 orders of each Jacobian")
        sigmas = [row.worst_case_sigma for row in rows]
        low, high = np.quantile(spread, [0.05, 0.95], axis=1)
        axes.vlines(sigmas, low, high, color=PALE, lw=7)
        axes.scatter([], [], color=PALE, marker="s", label="nine of ten random orders")
        middles = [row.middle for row in rows]
        axes.scatter(
            sigmas, middles, color=INK, marker="_", s=60, label="median order", zorder=3
        )
        for front, colour, label in (
            ("no", BLUE, "best order found"),
            ("yes", VERMILION, "the same, not dominated"),
        ):
            some = [row for row in rows if row.front == front]
            x, y = [row.worst_case_sigma for row in some], [row.kept for row in some]
            errors = [row.error for row in some]
            axes.errorbar(x, y, errors, color=colour, fmt="o", ms=4, label=label)
        axes.set_xlabel("worst-case σ where the Jacobian is designed")
        axes.set_ylabel("volume kept, limits ±20° (lever arms³)")
        axes.set_ylim(bottom=0)
        figure.legend(loc="outside lower center", ncols=2)
    return figure
