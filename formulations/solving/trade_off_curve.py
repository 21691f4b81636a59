"""The trade-off between isotropy and worst case as a curve, from `isotropy` to `max_min`.

Each point is the best of several starts and of the optima of its neighbours on the curve.
A Jacobian counts if it passes the gate `Record.trusted` and its isotropy defect is within the
limit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from formulations import isotropy, max_min, measures, residual, trade_off
from formulations.joints.arm import Arm
from formulations.solving.record import judge
from nlp.arrays import FloatArray, whole_number
from nlp.multistart import Run
from nlp.solver import Solver
from nlp.task import generator

# By how much of the limit a defect may pass it.
_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class Point:
    """One point of the curve.

    Attributes
    ----------
    statement
        Name of the statement whose optimum it is.
    limit
        The largest isotropy defect that was allowed; infinity at the end without a limit.
    isotropy_defect, worst_case_sigma
        Measured from J alone.
    jacobian
        Shape (m, n).
    """

    statement: str
    limit: float
    isotropy_defect: float
    worst_case_sigma: float
    jacobian: FloatArray

    def to_dict(self) -> dict[str, object]:
        """Return plain values; None for no limit."""
        limit = self.limit if np.isfinite(self.limit) else None
        return {**vars(self), "limit": limit, "jacobian": self.jacobian.tolist()}


def curve(
    arm: Arm,
    points: int = 10,
    starts: int = 5,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Point, ...]:
    """Return the curve, from the most isotropic Jacobian of the arm to the best worst case.

    The first point is the best isotropic Jacobian or, where the arm has none, the residual
    minimum; the last one is the max-min optimum. Limits between them are ε₀ + (ε₁ − ε₀)s²,
    s equally spaced: the curve leaves its first point as a root does.

    Parameters
    ----------
    arm
        The joints.
    points
        How many points, ends included, at least 2.
    starts
        How many random starts for each, at least 1.
    seed
        Of the starts.
    progress
        Is called with what is being solved, in a few words.
    """
    count = whole_number("points", points, 2)
    drawn = [arm.sample(generator(seed, k)) for k in range(whole_number("starts", starts, 1))]
    progress("isotropy")
    scale = arm.largest_trace / arm.shape[0]
    solver = Solver(isotropy.build(arm), isotropy.OPTIONS)
    first = _solved(arm, isotropy.NAME, isotropy.TOLERANCE * scale**2, solver, drawn)
    if not first:
        solver = Solver(residual.build(arm), residual.OPTIONS)
        minima = _solved(arm, residual.NAME, np.inf, solver, drawn)
        first = sorted(minima, key=lambda one: one.isotropy_defect)[:1]
    progress("max-min")
    solver = Solver(max_min.build(arm), max_min.OPTIONS)
    last = _solved(arm, max_min.NAME, np.inf, solver, drawn)
    ends = [_better(*points) for points in (first, last) if points]
    if len(ends) < 2 or not ends[0].isotropy_defect < ends[1].isotropy_defect:
        return tuple(ends)
    low, high = (one.isotropy_defect for one in ends)
    limits = low + (high - low) * np.linspace(0, 1, count)[1:-1] ** 2
    return (ends[0], *_between(arm, limits, drawn, ends[0], ends[1], progress), ends[1])


def _between(
    arm: Arm,
    limits: FloatArray,
    drawn: list[FloatArray],
    first: Point,
    last: Point,
    progress: Callable[[str], None],
) -> list[Point]:
    """Solve from left to right, then once more from the right neighbours' optima."""
    solvers, found = [], []
    left, right = first, last
    for k, limit in enumerate(map(float, limits)):
        progress(f"trade-off {k + 1} of {len(limits)}")
        solvers.append(Solver(trade_off.build(arm, limit), trade_off.OPTIONS))
        starts = [arm.variables(left.jacobian), *drawn]
        new = _solved(arm, trade_off.NAME, limit, solvers[k], starts)
        left = _better(*new, replace(left, limit=limit))
        found.append(left)
    for k in reversed(range(len(found))):
        start = [arm.variables(right.jacobian)]
        new = _solved(arm, trade_off.NAME, found[k].limit, solvers[k], start)
        right = found[k] = _better(found[k], *new)
    # What a smaller limit allows is allowed by a larger one.
    for k in range(1, len(found)):
        found[k] = _better(found[k], replace(found[k - 1], limit=found[k].limit))
    return found


def _solved(
    arm: Arm, statement: str, limit: float, solver: Solver, starts: list[FloatArray]
) -> list[Point]:
    """Return what starts lead to, as far as it passes the gate and is within the limit."""
    points = []
    for k, start in enumerate(starts):
        run = Run(index=k, seed=0, solution=solver.solve(start), cpu_seconds=0.0)
        found = judge(run, arm, measures.worst_case_sigma)
        defect = found.isotropy_defect
        if found.trusted and defect <= limit * (1 + _SLACK):
            points.append(Point(statement, limit, defect, found.merit, found.jacobian))
    return points


def _better(*points: Point) -> Point:
    return max(points, key=lambda one: one.worst_case_sigma)
