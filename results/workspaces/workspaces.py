"""What failures leave of the workspaces of some arms, the best limits, and the best robots.

A workspace is where the tool can be. Artificial limits, which the controller keeps before a
failure, decide how much of it can be reached after any one joint locks: this is "kept". The
page has two tables:

- ``workspaces.csv``, a `WorkspaceRow` for each of some arms and choices of artificial limits,
  and of link lengths; a figure of the best limits. Functions `_planar`, `_spatial`, `row_of`.
- ``orders.csv``, an `OrderRow` for each of some Jacobians of seven unit revolute joints, shape
  (6, 7), from the most isotropic one to that of the best worst case. A Jacobian leaves the
  order of the joints open: 7! = 5040 robots have it, which keep different volumes;
  ``orders.svg``. Functions `orders`, `drawn`, `ranked`, `_figure`.

Angles are in radians. Lengths are in metres, or in lever arms of the Jacobian for the orders.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lockedjoint.figures.robots import draw_workspace
from lockedjoint.figures.style import BLUE, INK, PALE, VERMILION, styled
from lockedjoint.formulations import measures
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.models import arm as arm_of
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.trade_off_curve import TradeOffPoint, trade_off_curve
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    link_lengths,
    physical_ranges,
    planar_chain,
    serial_chain,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.starts import generator
from lockedjoint.synthesis.criteria import COARSE, CRITERIA, Sampling, kept_ball
from lockedjoint.synthesis.family import every, family
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.ranking import rank
from lockedjoint.workspaces.best_limits import STARTS, best_limits
from lockedjoint.workspaces.workspace import Workspace, measured, workspace
from results.robots.survey import SurveyArm
from results.script import main, save, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Artificial limits of the planar 3R arm whose area is known, 0.355811.
_KNOWN: Ranges = tuple((-end, end) for end in np.deg2rad([20.0, 90.0, 90.0]).tolist())
# Names of the choices of limits and lengths in the table.
_AS_GIVEN = "as given"
_PHYSICAL = "physical limits"
_LIMITS = "best limits"
_LENGTHS = "best limits and lengths"
# Arms in space whose link lengths are chosen, too.
_LENGTHENED = ("UR5",)
#: The arms in space: name, file within its package, link of the tool, task.
ROBOTS = (
    SurveyArm(
        "Franka Panda", "panda_description/urdf/panda.urdf", "panda_hand_tcp", "position"
    ),
    SurveyArm("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", "position"),
)
# The edge of a voxel in metres, by arm. Half the edge makes a spatial workspace take eight
# times the memory, and is more exact.
_VOXELS = {"planar": 0.01, "Franka Panda": 0.02, "UR5": 0.03}

#: Half the range between the artificial limits of all joints of a Jacobian's robots, in
#: radians: 20 degrees to both sides of where it is designed. With more, more is kept of every
#: robot.
HALF = np.deg2rad(20.0)
#: Number of Jacobians, from end to end, of the trade-off curve whose robots are ranked.
JACOBIANS = 7
#: Number of random starts of each of these Jacobians.
CURVE_STARTS = 5
# Number of random Jacobians, of which the one with the largest worst case is ranked, too.
_DRAWN = 40
# Number of orders of each Jacobian that are judged first, and of the points for each.
_SHORTLIST = 30
_POINTS = 100
# Number of those orders that are judged again, and of the other points for each.
_FINALISTS = 3
FINAL_POINTS = 3000
# Number of orders drawn at random, to compare with, and of the points for each.
_TYPICAL = 40
_TYPICAL_POINTS = 60
# The random starts for planar arms are so many times those for spatial ones: they are cheap.
_PLANAR_STARTS_FACTOR = 4
# An error is this number of standard errors.
_STANDARD_ERRORS = 2
# The vertical bars of the figure reach from this quantile of the random orders to the next.
_LOW_QUANTILE = 0.05
_HIGH_QUANTILE = 0.95


@dataclass(frozen=True)
class WorkspaceRow:
    """One arm with one choice of artificial limits: the columns of ``workspaces.csv``.

    Sizes are in m² or m³, by `dimension`: of the failure-tolerant workspace, with its error;
    of all its voxels, which is too large; of what is reached within the artificial and within
    the physical limits, the whole of `percent_kept`. A `fatal` joint's failures leave nothing.
    `passed_by_depth` is the share of sampled points that pass inverse kinematics, by layers
    below the surface. Artificial limits and link lengths are by joint.
    """

    arm: str
    choice: str
    dimension: int = field(metadata=HIDDEN)
    method: str
    size: float = field(metadata=column("kept", ".4g"))
    error: float = field(metadata=column("error", ".2g"))
    raw: float = field(metadata=column("raw voxels", ".4g"))
    without_failure: float = field(metadata=column("no failure", ".4g"))
    physical: float = field(metadata=column("physical limits", ".4g"))
    percent_kept: float = field(metadata=column("% kept", ".3g"))
    fatal: str = field(metadata=column("keeps nothing if it locks", empty="–"))
    voxel: float = field(metadata=HIDDEN)
    passed_by_depth: Mapping[str, float] = field(metadata=HIDDEN)
    limits: Mapping[str, list[float]] = field(metadata=HIDDEN)
    links: Mapping[str, float] = field(metadata=HIDDEN)
    figure: str = field(metadata=HIDDEN)


@dataclass(frozen=True)
class OrderRow:
    """One 7R Jacobian and its 5040 robots: the columns of ``orders.csv``.

    `statement` is whose optimum it is, or `random`. The worst case, at the configuration for
    which it is designed, is the same for all its robots. `kept` is the volume that the best
    order found keeps, in cubes of the lever arm, with an error of two standard errors; `middle`
    and `least` are of a random sample of orders. In the `front` are those beside which no other
    Jacobian of the table has a larger worst case and keeps as much.
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


def compute(effort: Effort, folder: Path) -> Iterator[WorkspaceRow | OrderRow]:
    """Yield a row for each workspace, which is drawn, and for each Jacobian of seven joints."""
    for arm, choice, result in chain(_planar(effort), _spatial(effort)):
        row = row_of(arm, choice, result)
        if row.figure:
            save(draw_workspace(result), folder / row.figure)
        yield row
    yield from orders(effort, folder)


# The name of an arm, the choice of its limits, and what is kept.
Judged = tuple[str, str, Workspace]


def _planar(effort: Effort) -> Iterator[Judged]:
    """Yield the workspaces of planar arms of equal links, of length 1 m in all."""
    starts = effort.starts or STARTS
    for count in (3, 4):
        given = planar_chain((1 / count,) * count)
        name = f"planar {count}R"
        for choice in (_AS_GIVEN, _LIMITS, _LENGTHS):
            effort.progress(f"{name}, {choice}")
            arm, limits = given, _KNOWN if count == 3 else (*_KNOWN, _KNOWN[-1])
            if choice != _AS_GIVEN:
                arm, limits = best_limits(
                    given,
                    _VOXELS["planar"],
                    lengths=choice == _LENGTHS,
                    starts=_PLANAR_STARTS_FACTOR * starts,
                    seed=effort.seed,
                    progress=effort.progress,
                )
            yield name, choice, workspace(arm, limits, _VOXELS["planar"])


def _spatial(effort: Effort) -> Iterator[Judged]:
    """Yield the workspaces of arms in space, for one choice of limits after the other."""
    starts = effort.starts or STARTS
    for robot in ROBOTS:
        name, voxel = robot.name, _VOXELS[robot.name]
        arm = serial_chain(chain_between(read_robot(robot.path), robot.tip))
        effort.progress(f"{name}, {_PHYSICAL}")
        physical = workspace(arm, physical_ranges(arm), voxel, progress=effort.progress)
        yield name, _PHYSICAL, physical
        search = partial(
            best_limits, voxel=voxel, starts=starts, seed=effort.seed, progress=effort.progress
        )
        _, limits = search(arm)
        yield name, _LIMITS, measured(physical.sets, limits, effort.progress)
        if name in _LENGTHENED:
            effort.progress(f"{name}, {_LENGTHS}")
            arm, limits = search(arm, lengths=True)
            yield name, _LENGTHS, workspace(arm, limits, voxel, progress=effort.progress)


def row_of(arm: str, choice: str, result: Workspace) -> WorkspaceRow:
    """Return a workspace as a row."""
    names = [joint.name for joint in result.arm.joints]
    return row_from(
        WorkspaceRow,
        result,
        arm=arm,
        choice=choice,
        without_failure=result.before,
        percent_kept=100 * result.size / result.physical,
        fatal=", ".join(result.critical),
        voxel=result.sets.voxel,
        passed_by_depth={str(k): p for k, p in enumerate(result.passed) if p == p},
        limits={k: [*map(float, ends)] for k, ends in zip(names, result.limits, strict=True)},
        links=dict(zip(names, link_lengths(result.arm).tolist(), strict=True)),
        figure=f"{arm.replace(' ', '-').lower()}.svg" if choice == _LIMITS else "",
    )


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
    save(_figure(rows, spread), folder / "orders.svg")
    yield from rows


def drawn(arm: Arm, seed: int, count: int = _DRAWN) -> TradeOffPoint:
    """Return the random Jacobian with the largest worst case, of so many."""
    jacobians = [arm.jacobian(arm.sample(generator(seed, k))) for k in range(count)]
    best = max(jacobians, key=measures.worst_case_sigma)
    defect, sigma = measures.isotropy_defect(best), measures.worst_case_sigma(best)
    return TradeOffPoint("random", float("inf"), float(defect), float(sigma), best)


def _not_dominated(row: OrderRow, rows: Sequence[OrderRow]) -> bool:
    """Whether no row has a larger worst case and keeps as much.

    Values count as they were found: they may differ by less than their errors.
    """
    sigma = row.worst_case_sigma
    return not any(each.worst_case_sigma > sigma and each.kept >= row.kept for each in rows)


def ranked(point: TradeOffPoint, effort: Effort) -> tuple[OrderRow, FloatArray]:
    """Return the robots of one Jacobian as a row, and what random ones of them keep.

    The second part has the volumes of `_TYPICAL` random orders, shape (_TYPICAL,).
    """
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
    # One success and one failure more keep the error from 0 where all points are kept, or none.
    guarded = (share * FINAL_POINTS + 1) / (FINAL_POINTS + 2)
    orders = every(arm)
    some = np.random.default_rng(effort.seed).choice(len(orders), _TYPICAL, replace=False)
    how = Sampling(effort.seed + 1, _TYPICAL_POINTS, HALF)
    typical = criterion.evaluate(family(arm, orders[some]), how)
    row = row_from(
        OrderRow,
        point,
        kept=float(values[best]),
        error=_STANDARD_ERRORS * ball * float(np.sqrt(guarded * (1 - guarded) / FINAL_POINTS)),
        middle=float(np.median(typical)),
        least=float(np.min(typical)),
        front="",
        order=" ".join(map(str, finalists.orders[best].tolist())),
        jacobian={str(k): row for k, row in enumerate(point.jacobian.tolist())},
    )
    return row, typical


def _figure(rows: Sequence[OrderRow], spread: Sequence[FloatArray]) -> Figure:
    """Draw the volume that robots keep against their worst case where they are designed.

    `spread` has an array of volumes, shape (_TYPICAL,), for each row.
    """
    with styled(7.4, 4.2) as figure:
        axes = figure.subplots()
        axes.set_title("Robots of seven joints: 5040 orders of each Jacobian")
        sigmas = [row.worst_case_sigma for row in rows]
        low, high = np.quantile(spread, [_LOW_QUANTILE, _HIGH_QUANTILE], axis=1)
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


STUDY = study_of(
    __file__,
    compute,
    title="what failures leave of workspaces, and the best limits",
    tables={"workspaces": WorkspaceRow, "orders": OrderRow},
    takes="four minutes, matplotlib and packages of robots",
    # What the page says of the ranking.
    settings={
        "coarse": COARSE,
        "shortlist": _SHORTLIST,
        "points": _POINTS,
        "finalists": _FINALISTS,
        "final_points": FINAL_POINTS,
        "ball": 4 * HALF,
        "drawn": _DRAWN,
    },
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
