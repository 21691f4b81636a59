"""Limits, and lengths, with which a planar 3R arm keeps most, by its area in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import optimize

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    link_lengths,
    physical_ranges,
    with_links,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces.planar import FINE_RINGS, RINGS, Planar3R, links_at_zero
from lockedjoint.workspaces.workspace import Progress

#: The number of generations of the search in closed form.
GENERATIONS = 60
# The largest number of simplices of Nelder and Mead after it.
_MOST_SIMPLICES = 12
# The size of these simplices, in radians.
_SIMPLEX_RAD = 0.03


def best_planar_limits(
    arm: Chain,
    given: tuple[float, float, float],
    lengths: bool,
    least_width: float,
    generations: int,
    seed: int,
    progress: Progress,
) -> tuple[Chain, Ranges]:
    """Choose the limits of a planar 3R arm of given lengths, or the lengths, too.

    Parameters
    ----------
    arm
        A planar arm of three joints without physical limits.
    given
        The lengths of its links, in metres.
    lengths
        Whether the lengths are chosen, too, with the same sum.
    least_width
        The least width of the limits of a joint, in radians.
    generations
        The number of generations of the differential evolution.
    seed
        The random seed.
    progress
        A function that is told what is being done.
    """
    total = float(np.sum(link_lengths(arm)))

    def stated(x: FloatArray) -> Planar3R:
        half, second, wide2, third, wide3 = x[:5].tolist()
        links = given
        if lengths:  # of two cuts of the sum, in any order
            low, high = sorted(x[5:7].tolist())
            links = (low * total, (high - low) * total, (1 - high) * total)
            links = tuple(max(link, 1e-3 * total) for link in links)  # type: ignore[assignment]
        middles, halves = (0.0, second, third), (half, wide2, wide3)
        ranges = tuple((m - h, m + h) for m, h in zip(middles, halves, strict=True))
        return Planar3R(links, ranges)  # type: ignore[arg-type]

    def loss(x: FloatArray, rings: int = RINGS) -> float:
        planar = stated(x)
        area = planar.area(rings)
        return -area if area > 0 else max(planar.shortfall, 0.0) * total**2

    half_turn = (least_width / 2, np.pi)
    # An arm and its mirror image keep the same: the middle of joint 2 is not below 0.
    bounds = [half_turn, (0.0, np.pi), half_turn, (-np.pi, np.pi), half_turn]
    bounds += [(0.0, 1.0)] * (2 if lengths else 0)
    progress(Step("differential evolution", 0.0))
    # A fair choice for most arms: narrow limits of joint 1, half a turn of the others.
    first = np.array([np.pi / 9, 0.0, np.pi / 2, 0.0, np.pi / 2, 1 / 3, 2 / 3][: len(bounds)])
    fair = np.clip(first, *np.transpose(bounds))
    how: dict[str, Any] = {"maxiter": generations, "popsize": 12, "tol": 1e-6, "polish": False}
    # Two populations, with it and without: it attracts the first to its own optimum.
    populations = [
        optimize.differential_evolution(loss, bounds, x0=x0, rng=seed + k, **how)
        for k, x0 in enumerate((fair, None))
    ]
    best = min(populations, key=lambda result: result.fun).x
    progress(Step("Nelder–Mead", 0.5))
    rng, scale = np.random.default_rng(seed), total**2
    options = {"xatol": 1e-6, "fatol": 1e-9 * scale, "maxiter": 10 * generations}
    low, high = np.transpose(bounds)
    idle = 0
    for _ in range(_MOST_SIMPLICES):
        corners = best + _SIMPLEX_RAD * rng.standard_normal((len(best), len(best)))
        options["initial_simplex"] = np.clip(np.vstack([best, corners]), low, high)
        how = {"method": "Nelder-Mead", "bounds": bounds, "options": options}
        step = optimize.minimize(loss, best, (FINE_RINGS,), **how)
        gain, best = loss(best, FINE_RINGS) - step.fun, step.x
        idle = idle + 1 if gain < 1e-7 * scale else 0
        if idle == 2:
            break
    planar = stated(best)
    chosen = with_links(arm, planar.lengths) if lengths else arm
    return chosen, in_joints(chosen, planar)


def in_joints(arm: Chain, planar: Planar3R) -> Ranges:
    """Return limits of the closed form as those of the arm's own joints."""
    _, bent, signs = links_at_zero(arm)
    ranges: list[tuple[float, float]] = []
    for joint, (low, high) in enumerate(planar.limits):
        half = (high - low) / 2
        middle = float(signs[joint] * ((low + high) / 2 - bent[joint])) if joint else 0.0
        middle = (middle + np.pi) % (2 * np.pi) - np.pi
        # Limits of a joint without physical ones may pass ±π.
        own = (middle - half, middle + half)
        ranges.append(own if half < np.pi else physical_ranges(arm)[joint])
    return tuple(ranges)
