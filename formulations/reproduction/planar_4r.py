"""Section 3, planar 4R: the family (16), its worst case (17), and two failures at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from formulations import max_min, measures
from formulations.joints.arm import Arm
from formulations.joints.kinds import FreeColumn
from formulations.measures.canonical import distinct
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown, shown_error
from formulations.reproduction.searches import jacobians, search
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray

Family = Callable[[float], FloatArray]
_ROUNDING = 1e-12
# Ipopt's own tolerance is 1e-8 on log t.
_SOLVER = 1e-7
# Offset, so that no point of the grid is a multiple of π/4.
_GRID = 0.01 + 2 * np.pi * np.arange(360) / 360
_BRACKET = 2 * np.pi / 360
_ODD = "odd multiples of π/4"


def rows(
    seed: int = 0, starts: int = 20, family: Family = reference.planar_4r
) -> Iterator[Row]:
    """Rows of eqs. (16) and (17), and of the claim on double failures after them."""
    members = [family(alpha)[:2] for alpha in _GRID]
    errors = [np.max(np.abs(v.T @ v - np.eye(4))) for v in map(family, _GRID)]
    error = float(max(errors))
    yield Row(
        "(16)",
        "VᵀV = I for every α",
        "orthogonal",
        shown_error(error, _ROUNDING),
        holds(error <= _ROUNDING),
        f"{len(_GRID)} values of α",
    )
    classes = len(distinct(members[:45], tolerance=1e-3))
    verdict = holds(classes == 45)
    note = (
        "modulo frame, order and signs; α over one eighth of a turn, beyond which they repeat"
    )
    quantity = "distinct Jacobians among 45 values of α"
    yield Row("(16)", quantity, "a family", str(classes), verdict, note)
    sigmas = np.concatenate([measures.locked_singular_values(matrix) for matrix in members])
    farthest = sigmas[np.argmax(np.abs(sigmas - reference.PLANAR_4R_SIGMA))]
    paper = f"√(1/2) = {shown(reference.PLANAR_4R_SIGMA)}"
    verdict = equal(reference.PLANAR_4R_SIGMA, sigmas, _ROUNDING)
    note = "the value farthest from the paper's"
    yield Row("(17)", "fσ_2 for all f and α", paper, shown(farthest), verdict, note)
    yield from _double_failure_rows(seed, starts, family)


def _double_failure_rows(seed: int, starts: int, family: Family) -> Iterator[Row]:
    def worst(alpha: float) -> float:
        return measures.worst_case_sigma(family(alpha)[:2], locked=2)

    optima = best_parameters(worst)
    expected = reference.PLANAR_4R_DOUBLE_FAILURE
    same = len(optima) == len(expected)
    verdict = equal(expected, optima, 1e-6) if same else holds(False)
    note = "search over α in [0, 2π) for the best worst case of two failures, in units of π/4"
    ours = f"{shown(optima / (np.pi / 4))}, times π/4"
    yield Row("after (17)", "α optimal for double failures", _ODD, ours, verdict, note)

    at_best, at_zero = worst(float(expected[0])), worst(0.0)
    arm = Arm.of(FreeColumn(2, norm=np.sqrt(1 / 2), budget="mean"), 4)
    found = search(
        lambda: max_min.build(arm, locked=2),
        arm.sample,
        starts=starts,
        seed=seed,
        options=max_min.OPTIONS,
    )
    answers = jacobians(found)
    attained = max(measures.worst_case_sigma(matrix, 2) for matrix in answers)
    note = (
        "sin(π/8) at α = π/4; the best of max-min with two locked joints over all planar 4R "
        f"with tr JJᵀ = 2, {starts} starts, is {shown(attained)}"
    )
    quantity = "worst case of two failures at α = kπ/4, k odd"
    verdict = equal(at_best, attained, _SOLVER)
    yield Row("after (17)", quantity, "optimal", shown(at_best), verdict, note)
    best = [a for a in answers if measures.worst_case_sigma(a, 2) >= attained - _SOLVER]
    same = len(distinct([family(np.pi / 4)[:2], *best])) == 1
    quantity = "optimum for two failures, found over all planar 4R by max-min"
    ours = f"(16) at α = π/4 from {len(best)} of {starts} starts" if same else "another J"
    note = "canonical forms agree modulo frame, order and signs"
    yield Row("after (17)", quantity, _ODD, ours, holds(same), note)
    quantity = "worst case of two failures at α = 0"
    verdict = holds(abs(at_zero) <= _ROUNDING < at_best)
    ours = shown(max(at_zero, 0.0) if at_zero > _ROUNDING else 0.0)
    note = "single failures do not tell α = 0 from the optimum, double failures do"
    yield Row("after (17)", quantity, "not optimal", ours, verdict, note)


def best_parameters(objective: Callable[[float], float]) -> FloatArray:
    """Return all α in [0, 2π) that maximise a periodic function, ascending.

    None where the function has no peaks.
    """
    values = np.array([objective(alpha) for alpha in _GRID])
    peaks = (values >= np.roll(values, 1)) & (values > np.roll(values, -1))
    refined = [_golden_section(objective, alpha) for alpha in _GRID[peaks]]
    best = max((objective(alpha) for alpha in refined), default=np.nan)
    kept = [alpha for alpha in refined if objective(alpha) >= best - 1e-6]
    return np.sort(np.mod(kept, 2 * np.pi))


def _golden_section(objective: Callable[[float], float], center: float) -> float:
    ratio = (np.sqrt(5) - 1) / 2
    low, high = center - _BRACKET, center + _BRACKET
    while high - low > 1e-10:
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        if objective(left) < objective(right):
            low = left
        else:
            high = right
    return float((low + high) / 2)
