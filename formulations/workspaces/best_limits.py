"""The artificial limits and link lengths that keep the largest failure-tolerant workspace."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from scipy import optimize

from formulations.kinematics.serial_arm import Ranges, SerialArm
from formulations.workspaces.failure_sets import SLICE, FailureSets
from formulations.workspaces.planar import Planar3R, closed_form
from formulations.workspaces.pose_sets import PoseSets
from formulations.workspaces.reachable_sets import ReachableSets, check_grid
from formulations.workspaces.workspace import Progress
from nlp.arrays import FloatArray
from nlp.errors import InputError

#: A joint's artificial limits are at least this far apart, in radians, when they are chosen: a
#: joint that does not move is no joint.
LEAST_WIDTH = np.deg2rad(10.0)
#: Starts of the search on a grid.
STARTS = 4
#: Generations of the search in closed form.
GENERATIONS = 60
# The grid on which limits are compared is coarser, by this, than that of the answer.
_COARSER = 2.0
_DRAWS = 100
# Ends of intervals move by these, as multiples of the coarse slice, and link lengths by these
# shares of their sum.
_MOVES = (4, 2, 1)
# How the two ends of an interval move: apart, one of them, together, both the same way.
_ENDS = ((-1, 1), (-1, 0), (0, 1), (1, 0), (0, -1), (1, -1), (-1, -1), (1, 1))
_SHIFTS = (0.1, 0.05, 0.025)


def best_limits(
    arm: SerialArm,
    voxel: float,
    *,
    lengths: bool = False,
    least_width: float = LEAST_WIDTH,
    starts: int = STARTS,
    generations: int = GENERATIONS,
    seed: int = 0,
    progress: Progress = lambda _: None,
    sets: PoseSets | None = None,
) -> tuple[SerialArm, Ranges]:
    """Search for the artificial limits that leave the largest workspace.

    Planar arms that have the closed form: differential evolution, then Nelder–Mead. Others:
    a pattern search on a grid twice as coarse, from the best of random intervals. Where the
    workspace is empty, the score is what is missing of it. The best found is not proved to be
    the best.

    Parameters
    ----------
    arm, voxel
        The arm, and the voxel that it will be measured with.
    lengths
        Whether the link lengths are chosen too, with the same sum.
    least_width
        Least width of the limits of a revolute joint, in radians.
    starts
        Of the pattern search.
    generations
        Of the differential evolution; Nelder–Mead makes ten times as many steps.
    seed
        Of what is random.
    progress
        Is called with what is being done.
    sets
        Of the arm with a fixed orientation: the search is on their grid. Link lengths are then
        as given.

    Returns
    -------
    SerialArm
        The arm, with its new links.
    tuple
        The limits.
    """
    if not 0 < least_width <= np.pi:
        raise InputError("least width", least_width, "above 0 and at most half a turn")
    rng = np.random.default_rng(seed)
    if sets is not None:
        if lengths:
            allowed = "limits: link lengths are chosen only if the orientation is free"
            raise InputError("what is optimised", "lengths", allowed)
        search = _Pattern(sets, least_width, progress)
    else:
        check_grid(arm, voxel, SLICE)
        if closed_form(arm, arm.physical) is not None:
            return _best_planar(arm, lengths, least_width, generations, seed, progress)
        coarse = ReachableSets(arm, _COARSER * voxel, 2 * SLICE)
        search = _Pattern(coarse, least_width, progress)
    found = [search.run(rng, k) for k in range(starts)]
    limits = max(found, key=search.score)
    if not lengths:
        return arm, limits
    best = search.score(limits)
    for share in _SHIFTS:
        better = True
        while better:
            better = False
            for shifted in _shifted_links(search.sets.arm, share):
                grid = ReachableSets(shifted, search.sets.voxel, 2 * SLICE)
                other = _Pattern(grid, least_width, progress)
                if other.score(limits) > best:
                    search, better = other, True
                    limits = search.climbed(limits, _MOVES[1:])
                    best = search.score(limits)
                    progress(f"links {np.round(shifted.links, 3)}: {best:.4g}")
                    break
    return search.sets.arm, limits


def _shifted_links(arm: SerialArm, share: float) -> list[SerialArm]:
    """Return arms with a share of the links' sum moved from one link to another."""
    links = arm.links
    by = share * float(np.sum(links))
    pairs = permutations(np.flatnonzero(links > 1e-6), 2)
    found = []
    for one, other in pairs:
        if links[one] > 1.5 * by:
            moved = links.copy()
            moved[one] -= by
            moved[other] += by
            found.append(arm.with_links(moved))
    return found


class _Pattern:
    """A pattern search over the ends of the artificial limits, on one grid."""

    def __init__(self, sets: FailureSets, least_width: float, progress: Progress) -> None:
        self.sets = sets
        self._least, self._progress = least_width, progress
        self._known: dict[Ranges, float] = {}

    def score(self, limits: Ranges) -> float:
        """Size of the workspace; where it is empty, minus the failures against a voxel."""
        if limits not in self._known:
            kept = self.sets.after(limits)
            if kept.any():
                kept &= self.sets.before(limits)
            size = self.sets.unit * float(kept.sum())
            self._known[limits] = size or -float(self.sets.missing(limits)) - 1
        return self._known[limits]

    def run(self, rng: np.random.Generator, start: int) -> Ranges:
        """Climb from the best of random intervals."""
        drawn = [self._drawn(rng) for _ in range(_DRAWS)]
        limits = self.climbed(max(drawn, key=self.score), _MOVES)
        self._progress(f"start {start}: {self.score(limits):.4g}")
        return limits

    def climbed(self, limits: Ranges, moves: Sequence[int]) -> Ranges:
        """Move ends of the limits, or both, for as long as the workspace grows."""
        for move in moves:
            better = True
            while better:
                better = False
                for joint in self.sets.slices:
                    for low, high in _ENDS:
                        by = move * self._unit(joint)
                        other = self._moved(limits, joint, low * by, high * by)
                        if other and self.score(other) > self.score(limits):
                            limits, better = other, True
        return limits

    def _moved(self, limits: Ranges, joint: int, low: float, high: float) -> Ranges | None:
        one = self.sets.arm.steps[joint]
        first, last = limits[joint][0] + low, limits[joint][1] + high
        if one.continuous:
            last = min(last, first + 2 * np.pi)
        else:
            first, last = max(first, one.lower), min(last, one.upper)
        width = self._unit(joint) if one.prismatic else self._least
        if last - first < min(width, one.upper - one.lower) - 1e-9:
            return None
        return (*limits[:joint], (first, last), *limits[joint + 1 :])

    def _drawn(self, rng: np.random.Generator) -> Ranges:
        """Draw intervals; joints that do not move the tip keep their physical limits."""
        limits = self.sets.arm.physical
        for joint in self.sets.slices:
            low, high = limits[joint]
            half = max(rng.uniform(0, (high - low) / 2), self._least / 2)
            middle = rng.uniform(low, high)
            ends = (max(middle - half, low), min(middle + half, high))
            limits = (*limits[:joint], ends, *limits[joint + 1 :])
        return limits

    def _unit(self, joint: int) -> float:
        prismatic = self.sets.arm.steps[joint].prismatic
        return 2 * self.sets.voxel if prismatic else self.sets.step


def _best_planar(
    arm: SerialArm,
    lengths: bool,
    least_width: float,
    generations: int,
    seed: int,
    progress: Progress,
) -> tuple[SerialArm, Ranges]:
    """Choose the limits, and the lengths if asked for, of a planar 3R arm."""
    total, reference = float(np.sum(arm.links)), closed_form(arm, arm.physical)
    assert reference is not None
    least = least_width / 2

    def stated(x: FloatArray) -> Planar3R:
        half, second, wide2, third, wide3 = (float(one) for one in x[:5])
        links = reference.lengths
        if lengths:  # of two cuts of the sum, in any order
            low, high = sorted(float(one) for one in x[5:7])
            links = (low * total, (high - low) * total, (1 - high) * total)
            links = tuple(max(one, 1e-3 * total) for one in links)  # type: ignore[assignment]
        ranges = (
            (-half, half),
            (second - wide2, second + wide2),
            (third - wide3, third + wide3),
        )
        return Planar3R(links, ranges)

    def score(x: FloatArray) -> float:
        one = stated(x)
        area = one.area()
        return -area if area > 0 else max(one.shortfall, 0.0) * total**2

    half_turn = (least, np.pi)
    # An arm and its mirror image keep the same: the middle of joint 2 is not below 0.
    bounds = [half_turn, (0.0, np.pi), half_turn, (-np.pi, np.pi), half_turn]
    bounds += [(0.0, 1.0)] * (2 if lengths else 0)
    progress("differential evolution")
    # A fair choice for most arms: narrow limits of joint 1, half a turn of the others.
    first = np.array([np.pi / 9, 0.0, np.pi / 2, 0.0, np.pi / 2, 1 / 3, 2 / 3][: len(bounds)])
    fair = np.clip(first, *np.transpose(bounds))
    # Two populations, with it and without: it attracts the first to its own optimum.
    found = min(
        (
            optimize.differential_evolution(
                score,
                bounds,
                x0=x0,
                rng=seed + k,
                maxiter=generations,
                popsize=12,
                tol=1e-6,
                polish=False,
            )
            for k, x0 in enumerate((fair, None))
        ),
        key=lambda one: one.fun,
    )
    progress("Nelder–Mead")
    options = {"xatol": 1e-5, "fatol": 1e-8 * total**2, "maxiter": 10 * generations}
    found = optimize.minimize(
        score, found.x, method="Nelder-Mead", bounds=bounds, options=options
    )
    best = stated(found.x)
    chosen = arm.with_links(best.lengths) if lengths else arm
    return chosen, _in_joints(chosen, best)


def _in_joints(arm: SerialArm, best: Planar3R) -> Ranges:
    """Return limits of the closed form as those of the arm's own joints."""
    zero = closed_form(arm, ((0.0, 0.0),) * 3)
    unit = closed_form(arm, ((0.0, 1e-3),) * 3)
    assert zero is not None
    assert unit is not None
    found = []
    for joint, (low, high) in enumerate(best.limits):
        offset = zero.limits[joint][0]
        sign = 1 if unit.limits[joint][1] > offset else -1
        middle, half = sign * ((low + high) / 2 - offset), (high - low) / 2
        least, most = arm.physical[joint]
        middle = middle if joint else 0.0
        middle = (middle + np.pi) % (2 * np.pi) - np.pi
        # Limits of a joint without physical ones may pass ±π.
        found.append((middle - half, middle + half) if half < np.pi else (least, most))
    return tuple(found)
