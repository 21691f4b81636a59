"""What failures leave of the workspaces of some arms, and the best limits, as a study."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from formulations import measures
from formulations.io.table import HIDDEN, column
from formulations.joints.arm import Arm
from formulations.joints.models import arm as arm_of
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.read_urdf import read_urdf
from formulations.kinematics.serial_arm import Ranges, SerialArm
from formulations.plot.style import content, figure_class
from formulations.plot.workspace import draw, draw_orders
from formulations.realise.choice import rank
from formulations.realise.criteria import CRITERIA, Sampling, kept_ball
from formulations.realise.family import every, family
from formulations.realise.from_jacobian import realise
from formulations.solving.trade_off_curve import TradeOffPoint, trade_off_curve
from formulations.studies.robots import SurveyArm
from formulations.studies.study import Effort, Part, Study
from formulations.workspaces.best_limits import STARTS, best_limits
from formulations.workspaces.workspace import Workspace, measured
from formulations.workspaces.workspace import workspace as found_workspace
from nlp.arrays import FloatArray
from nlp.starts import generator

#: Artificial limits of the planar 3R arm whose area is known, 0.355811.
KNOWN: Ranges = tuple((-one, one) for one in np.deg2rad([20.0, 90.0, 90.0]).tolist())
_AS_GIVEN, _PHYSICAL = "as given", "physical limits"
_LIMITS, _LENGTHS = "best limits", "best limits and lengths"
# Arms in space whose link lengths are chosen, too.
_LENGTHENED = ("UR5",)
_VOXELS = {"planar": 0.01, "Franka Panda": 0.02, "UR5": 0.03}
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
class WorkspaceRow:
    """One arm with one choice of artificial limits: the columns of ``workspaces.csv``.

    Attributes
    ----------
    arm, choice
        The arm, and how its limits, and its links if it says so, were chosen.
    dimension
        2 for areas in m², 3 for volumes in m³.
    method
        Closed form or grid.
    size, error
        Of the failure-tolerant workspace.
    raw
        Of all voxels, which over-estimate.
    without_failure, physical
        What is reached within the artificial and within the physical limits.
    percent_kept
        Of what is reached within the physical limits.
    fatal
        Joints whose failures alone leave nothing.
    voxel
        Edge of a voxel in metres.
    passed_by_depth
        Share of sampled points that pass inverse kinematics, by layers below the surface.
    limits, links
        Artificial limits and link lengths by joint.
    figure
        File of the drawing, if there is one.
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


def study() -> Study:
    """Return the study."""
    return Study(
        name="workspaces",
        title="what failures leave of workspaces, and the best limits",
        page="workspaces.md",
        template="workspaces.md.j2",
        tables={"workspaces": WorkspaceRow, "orders": OrderRow},
        command="lockedjoint report --only workspaces --out results",
        takes="a quarter of an hour, matplotlib and packages of robots",
        compute=_compute,
        settings={
            "coarse": CRITERIA["kept"].coarse,
            "shortlist": _SHORTLIST,
            "points": _POINTS,
            "finalists": _FINALISTS,
            "final_points": FINAL_POINTS,
            "ball": 4 * HALF,
            "drawn": _DRAWN,
        },
        long=True,
        check=_check,
    )


def _check() -> None:
    figure_class()
    for one in _robots():
        assert one.path


def _robots() -> tuple[SurveyArm, ...]:
    folder = "panda_description/urdf/panda.urdf"
    return (
        SurveyArm("Franka Panda", folder, "panda_hand_tcp", "position"),
        SurveyArm("UR5", "ur_description/urdf/ur5_robot.urdf", "tool0", "position"),
    )


def _compute(effort: Effort, _: Path) -> Iterator[Part]:
    starts = effort.starts or STARTS
    for count in (3, 4):
        arm = SerialArm.planar((1 / count,) * count)
        name = f"planar {count}R"
        for choice in (_AS_GIVEN, _LIMITS, _LENGTHS):
            effort.progress(f"{name}, {choice}")
            chosen, limits = arm, KNOWN if count == 3 else (*KNOWN, KNOWN[-1])
            if choice != _AS_GIVEN:
                chosen, limits = best_limits(
                    arm,
                    _VOXELS["planar"],
                    lengths=choice == _LENGTHS,
                    starts=4 * starts,
                    seed=effort.seed,
                    progress=effort.progress,
                )
            yield _part(name, choice, found_workspace(chosen, limits, _VOXELS["planar"]))
    for one in _robots():
        arm = SerialArm.from_chain(chain_between(read_urdf(one.path), one.tip))
        voxel = _VOXELS[one.name]
        effort.progress(f"{one.name}, {_PHYSICAL}")
        found = found_workspace(arm, arm.physical, voxel, progress=effort.progress)
        yield _part(one.name, _PHYSICAL, found)
        limits = best_limits(
            arm, voxel, starts=starts, seed=effort.seed, progress=effort.progress
        )[1]
        yield _part(one.name, _LIMITS, measured(found.sets, limits, effort.progress))
        if one.name not in _LENGTHENED:
            continue
        effort.progress(f"{one.name}, {_LENGTHS}")
        arm, limits = best_limits(
            *(arm, voxel),
            lengths=True,
            starts=starts,
            seed=effort.seed,
            progress=effort.progress,
        )
        found = found_workspace(arm, limits, voxel, progress=effort.progress)
        yield _part(one.name, _LENGTHS, found)
    yield from _orders(effort)


def _orders(effort: Effort) -> Iterator[Part]:
    """The robots of Jacobians between the most isotropic one and the best worst case."""
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
        yield Part(rows=[row])
    rows = [replace(row, front="yes" if not_dominated(row, rows) else "no") for row in rows]
    yield Part(
        rows=rows,
        files={"orders.svg": content(draw_orders(rows, spread), "svg")},
        replaces=len(rows),
    )


def drawn(arm: Arm, seed: int, count: int = _DRAWN) -> TradeOffPoint:
    """Return the random Jacobian with the largest worst case, of so many."""
    jacobians = [arm.jacobian(arm.sample(generator(seed, k))) for k in range(count)]
    best = max(jacobians, key=measures.worst_case_sigma)
    defect, sigma = measures.isotropy_defect(best), measures.worst_case_sigma(best)
    return TradeOffPoint("random", float("inf"), float(defect), float(sigma), best)


def not_dominated(row: OrderRow, rows: Sequence[OrderRow]) -> bool:
    """Whether no other Jacobian has a larger worst case here and keeps as much elsewhere.

    By the values as they were found: what two Jacobians keep may differ by less than its error.
    """
    return not any(
        other.worst_case_sigma > row.worst_case_sigma and other.kept >= row.kept
        for other in rows
    )


def ranked(point: TradeOffPoint, effort: Effort) -> tuple[OrderRow, FloatArray]:
    """Return the robots of one Jacobian as a row, and what random ones of them keep."""
    arm, kept = realise(point.jacobian), CRITERIA["kept"]
    first = Sampling(effort.seed, _POINTS, HALF)
    found = rank(arm, kept.name, first, _SHORTLIST, effort.progress)
    finalists = found.arrangements[:_FINALISTS]
    # Other points than those by which they were chosen, or the largest would be too large.
    final = Sampling(effort.seed + 1, FINAL_POINTS, HALF)
    values = kept.evaluate(family(arm, finalists), final)
    best = int(np.argmax(values))
    ball = kept_ball(first, family(arm, finalists[[best]]))
    share = values[best] / ball
    guarded = (share * FINAL_POINTS + 1) / (FINAL_POINTS + 2)
    typical = typical_values(point, effort)
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
        jacobian={str(k): one for k, one in enumerate(point.jacobian.tolist())},
    )
    return row, typical


def typical_values(point: TradeOffPoint, effort: Effort) -> FloatArray:
    """What random orders of a Jacobian keep, shape (40,)."""
    arm = realise(point.jacobian)
    orders = every(arm)
    drawn = np.random.default_rng(effort.seed).choice(len(orders), _TYPICAL, replace=False)
    how = Sampling(effort.seed + 1, _TYPICAL_POINTS, HALF)
    return CRITERIA["kept"].evaluate(family(arm, orders[drawn]), how)


def _part(arm: str, choice: str, found: Workspace) -> Part:
    row = row_of(arm, choice, found)
    files = {row.figure: content(draw(found), "svg")} if row.figure else {}
    return Part(rows=[row], files=files)


def row_of(arm: str, choice: str, found: Workspace) -> WorkspaceRow:
    """Return a workspace as a row."""
    names = [one.name for one in found.arm.steps]
    depths = {str(k): one for k, one in enumerate(found.passed) if one == one}
    drawn = choice == _LIMITS
    return WorkspaceRow(
        arm=arm,
        choice=choice,
        dimension=found.dimension,
        method=str(found.to_dict()["method"]),
        size=found.size,
        error=found.error,
        raw=found.raw,
        without_failure=found.before,
        physical=found.physical,
        percent_kept=100 * found.size / found.physical,
        fatal=", ".join(found.critical),
        voxel=found.sets.voxel,
        passed_by_depth=depths,
        limits={k: [float(x) for x in one] for k, one in zip(names, found.limits, strict=True)},
        links=dict(zip(names, found.arm.links.tolist(), strict=True)),
        figure=f"{arm.replace(' ', '-').lower()}.svg" if drawn else "",
    )
