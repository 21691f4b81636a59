"""The artificial limits and link lengths that keep the largest failure-tolerant workspace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice, permutations

import numpy as np
from numpy.random import Generator

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    link_lengths,
    physical_ranges,
    with_links,
)
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces.best_planar_limits import GENERATIONS, best_planar_limits
from lockedjoint.workspaces.cylinder_grid import check_grid
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets
from lockedjoint.workspaces.planar import closed_form
from lockedjoint.workspaces.pose_sets import PoseSets
from lockedjoint.workspaces.reachable_sets import ReachableSets
from lockedjoint.workspaces.workspace import Progress

#: Artificial limits that are chosen are at least this far apart, in radians: a joint that does
#: not move is no joint.
_LEAST_WIDTH_RAD = np.deg2rad(10.0)
#: The number of starts of the search on a grid.
STARTS = 4
# The grid on which limits are compared is coarser than that of the answer by this factor.
_COARSER = 2.0
# The number of random limits that a start compares.
_DRAWS = 100
# The largest number of tries to draw them.
_MOST_TRIES = 2000
# Ends of an interval move by these steps, as multiples of the coarse slice.
_MOVES = (4, 2, 1)
# The two ends of an interval move so: apart, one of them, together, both the same way.
_ENDS = ((-1, 1), (-1, 0), (0, 1), (1, 0), (0, -1), (1, -1), (-1, -1), (1, 1))
# Lengths of links change by these shares of their sum.
_LENGTH_SHARES = (0.1, 0.05, 0.025)


def best_limits(
    arm: Chain,
    voxel: float,
    *,
    lengths: bool = False,
    least_width: float = _LEAST_WIDTH_RAD,
    starts: int = STARTS,
    generations: int = GENERATIONS,
    seed: int = 0,
    progress: Progress = lambda _: None,
    sets: PoseSets | None = None,
) -> tuple[Chain, Ranges]:
    """Search for the limits that leave the largest workspace; return the arm, and them.

    Planar arms that have the closed form: differential evolution, then Nelder–Mead, made
    anew until it gains nothing: the area has kinks at its best. Others: a pattern search on a
    grid twice as coarse as that of voxels on which the arm will be measured. A start climbs
    twice: from the best of random intervals, and from the best of those about postures whose
    tip stays in reach whatever joint locks. Where the workspace is empty, the score is what is
    missing of it. The best found is not proved to be the best.

    With `lengths` the link lengths are chosen, too, with the same sum. The least width is that
    of a revolute joint's limits, in radians. `generations` are those of the differential
    evolution; each Nelder–Mead makes ten times as many steps. With the sets of an arm with a
    fixed orientation the search is on their grid, and lengths are as given.
    """
    if not 0 < least_width <= np.pi:
        raise InputError("least width", least_width, "above 0 and at most half a turn")
    if sets is None:
        check_grid(arm, voxel, SLICE_RAD)
        if planar := closed_form(arm, physical_ranges(arm)):
            given = planar.lengths
            return best_planar_limits(
                arm, given, lengths, least_width, generations, seed, progress
            )
    grid = sets or ReachableSets(arm, _COARSER * voxel, 2 * SLICE_RAD)
    search, rng = _Pattern(grid, least_width), np.random.default_rng(seed)
    draws = (search.anywhere, search.about_posture)
    ends = []
    for number, draw in enumerate(draw for draw in draws for _ in range(starts)):
        progress(Step("limits of the joints", number / (len(draws) * starts)))
        ends.append(search.run(draw, rng))
    limits = max(ends, key=search.score)
    for share in _LENGTH_SHARES if lengths and sets is None else ():
        while better := search.with_other_links(limits, share):
            search, limits = better, better.climbed(limits, _MOVES[1:])
            links = np.round(link_lengths(search.sets.arm), 3)
            progress(f"links {links}: {search.score(limits):.4g}")
    return search.sets.arm, limits


class _Pattern:
    """A pattern search over the ends of the artificial limits, on one grid."""

    def __init__(self, sets: FailureSets, least_width: float) -> None:
        self.sets = sets
        self._least_width = least_width
        self._scores: dict[Ranges, float] = {}

    def score(self, limits: Ranges) -> float:
        """Size of the workspace; where it is empty, minus the failures against a voxel."""
        if limits not in self._scores:
            voxels = self.sets.after(limits)
            if voxels.any():
                voxels &= self.sets.before(limits)
            size = self.sets.unit * float(voxels.sum())
            self._scores[limits] = size or -float(self.sets.missing(limits)) - 1
        return self._scores[limits]

    def run(self, draw: Callable[[Generator], Ranges | None], rng: Generator) -> Ranges:
        """Climb from the best of what is drawn; the physical limits if that is nothing."""
        drawn = islice(filter(None, (draw(rng) for _ in range(_MOST_TRIES))), _DRAWS)
        best = max(drawn, key=self.score, default=physical_ranges(self.sets.arm))
        return self.climbed(best, _MOVES)

    def anywhere(self, rng: Generator) -> Ranges:
        """Draw intervals; joints that do not move the tip keep their physical limits."""
        limits = list(physical_ranges(self.sets.arm))
        for joint in self.sets.slices:
            low, high = limits[joint]
            half = max(rng.uniform(0, (high - low) / 2), self._least_width / 2)
            middle = rng.uniform(low, high)
            limits[joint] = (max(middle - half, low), min(middle + half, high))
        return tuple(limits)

    def about_posture(self, rng: Generator) -> Ranges | None:
        """Draw limits about a posture whose tip stays in reach; None if they are too narrow."""
        drawn = self.sets.draw(rng)
        widest = self.sets.around(*drawn) if drawn else None
        if drawn is None or widest is None:
            return None
        limits, share = list(physical_ranges(self.sets.arm)), rng.uniform()
        for joint in self.sets.slices:
            at, (low, high) = float(drawn[0][joint]), widest[joint]
            if high - low < self._least(joint):
                return None
            width = max(share, self._least(joint) / (high - low))
            limits[joint] = (at - width * (at - low), at + width * (high - at))
        return tuple(limits)

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

    def with_other_links(self, limits: Ranges, share: float) -> _Pattern | None:
        """Return the search for an arm that keeps more, with a share of its links' sum moved.

        From one link to another; None if none of these arms keeps more within the limits.
        """
        links = link_lengths(self.sets.arm)
        by = share * float(np.sum(links))
        for shorter, longer in permutations(np.flatnonzero(links > 1e-6), 2):
            if links[shorter] > 1.5 * by:
                moved = links.copy()
                moved[shorter] -= by
                moved[longer] += by
                arm = with_links(self.sets.arm, moved)
                grid = ReachableSets(arm, self.sets.voxel, 2 * SLICE_RAD)
                search = _Pattern(grid, self._least_width)
                if search.score(limits) > self.score(limits):
                    return search
        return None

    def _moved(self, limits: Ranges, joint: int, low: float, high: float) -> Ranges | None:
        own = self.sets.arm.joints[joint]
        first, last = limits[joint][0] + low, limits[joint][1] + high
        if own.continuous:
            last = min(last, first + 2 * np.pi)
        else:
            first, last = max(first, own.lower), min(last, own.upper)
        if last - first < self._least(joint) - 1e-9:
            return None
        return (*limits[:joint], (first, last), *limits[joint + 1 :])

    def _least(self, joint: int) -> float:
        """Least width of a joint's limits."""
        own = self.sets.arm.joints[joint]
        width = self._unit(joint) if own.prismatic else self._least_width
        return min(width, own.upper - own.lower)

    def _unit(self, joint: int) -> float:
        prismatic = self.sets.arm.joints[joint].prismatic
        return 2 * self.sets.voxel if prismatic else self.sets.step
