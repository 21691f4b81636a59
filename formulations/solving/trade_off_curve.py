"""The trade-off between isotropy and worst case as a curve, from `isotropy` to `max_min`.

J is the Jacobian, shape (m, n), T = ‖J‖_F². Its isotropy defect is ½‖JJᵀ − (T/m)I‖_F², its
worst case σ the smallest singular value after the worst failure. A point of the curve is the
largest worst case with a defect of at most ε, the *limit*: from ε₀, that of the most isotropic
J, to ε₁, that of the best worst case.

Each point is the best of several starts and of the optima of its neighbours on the curve.
A Jacobian counts if it passes the gate `Record.trusted`; its isotropy defect is judged from J
alone, as all else.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lockedjoint.formulations import isotropy, max_min, residual
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.registry import Formulation
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.solve import run
from lockedjoint.nlp.arrays import FloatArray, Rng, whole_number
from lockedjoint.nlp.progress import Step
from lockedjoint.nlp.starts import generator, seed_of

# Shares of the whole, for progress: when the first end is there, and when both are.
_FIRST_END = 0.1
_BOTH_ENDS = 0.2


@dataclass(frozen=True, eq=False)
class TradeOffPoint:
    """The optimum of a statement within a limit of the isotropy defect, measured from J alone.

    Attributes
    ----------
    statement
        ``isotropy``, ``residual``, ``trade-off`` or ``max-min``.
    limit
        ε, the largest isotropy defect that was allowed; infinity without a limit.
    isotropy_defect, worst_case_sigma
        Those of the Jacobian.
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


def trade_off_curve(
    arm: Arm,
    points: int = 10,
    starts: int = 5,
    seed: Rng | None = None,
    progress: Callable[[str], None] = lambda _: None,
    *,
    rng: Rng | None = None,
) -> tuple[TradeOffPoint, ...]:
    """Return the curve, from the most isotropic Jacobian of the arm to the best worst case.

    The first point is the best isotropic Jacobian or, where the arm has none, the residual
    minimum; the last one is the max-min optimum. Limits between them are ε₀ + (ε₁ − ε₀)s², s
    equally spaced: the curve leaves its first point as a root does. There are at least two
    points, ends included, each with so many random starts of a seed, at least one. If an end
    has no Jacobian, or both are one, the curve is what there is of the ends.
    """
    count = whole_number("points", points, 2)
    number = seed_of(seed, rng)
    many = whole_number("starts", starts, 1)
    drawn = np.array([arm.sample(generator(number, k)) for k in range(many)])
    progress(Step("isotropy", 0.0))
    scale = arm.largest_trace / arm.shape[0]
    first = _solved(isotropy, arm, drawn, isotropy.TOLERANCE * scale**2)
    if not first:
        minima = _solved(residual, arm, drawn)
        first = sorted(minima, key=lambda point: point.isotropy_defect)[:1]
    progress(Step("max-min", _FIRST_END))
    last = _solved(max_min, arm, drawn)
    ends = [_better(*points) for points in (first, last) if points]
    if len(ends) < 2 or not ends[0].isotropy_defect < ends[1].isotropy_defect:
        return tuple(ends)
    low, high = (point.isotropy_defect for point in ends)
    limits = low + (high - low) * np.linspace(0, 1, count)[1:-1] ** 2
    return (ends[0], *_between(arm, limits, drawn, ends[0], ends[1], progress), ends[1])


def _between(
    arm: Arm,
    limits: FloatArray,
    drawn: FloatArray,
    first: TradeOffPoint,
    last: TradeOffPoint,
    progress: Callable[[str], None],
) -> list[TradeOffPoint]:
    """Return the points of these limits, between two ends.

    They are solved from the first limit on, from random starts (`drawn`, shape (starts, size))
    and the optimum of the point before, then once more back, from the next points' optima.
    """
    curve: list[TradeOffPoint] = []
    before, after = first, last
    for k, limit in enumerate(map(float, limits)):
        share = _BOTH_ENDS + (1 - _BOTH_ENDS) * k / len(limits)
        progress(Step(f"trade-off {k + 1} of {len(limits)}", share))
        starts = np.vstack([arm.variables(before.jacobian), drawn])
        before = _better(*_solved(max_min, arm, starts, limit), replace(before, limit=limit))
        curve.append(before)
    for k in reversed(range(len(curve))):
        start = arm.variables(after.jacobian)[None]
        after = curve[k] = _better(curve[k], *_solved(max_min, arm, start, curve[k].limit))
    # What a smaller limit allows is allowed by a larger one.
    for k in range(1, len(curve)):
        curve[k] = _better(curve[k], replace(curve[k - 1], limit=curve[k].limit))
    return curve


def _solved(
    formulation: Formulation, arm: Arm, starts: FloatArray, limit: float = np.inf
) -> list[TradeOffPoint]:
    """Return what starts, shape (starts, size), lead to, as far as it passes the gate."""
    settings = {"largest_defect": limit} if formulation is max_min else {}
    name = "trade-off" if settings and limit < np.inf else formulation.NAME
    outcome = run(Case(formulation, arm, settings), sample=starts)
    return [
        TradeOffPoint(name, limit, r.isotropy_defect, r.worst_case_sigma, r.jacobian)
        for r in outcome.records
        if r.trusted
    ]


def _better(*points: TradeOffPoint) -> TradeOffPoint:
    """Return the point with the largest worst case."""
    return max(points, key=lambda point: point.worst_case_sigma)
