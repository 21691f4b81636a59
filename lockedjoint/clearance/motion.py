"""Whether links stay apart on the way from one configuration to another.

A joint that moves by dq brings two links nearer by at most L·|dq|, L being the most that a
point of one can be from its axis, or 1 for a prismatic joint; 0 where both move with it. On a
way along which a pair comes nearer by at most s in all, its distance is never less than
(d + d' - s)/2, with d and d' that at its ends. A way of which that does not tell is halved.
"""

from __future__ import annotations

from dataclasses import replace
from heapq import heapify, heappop, heappush

import numpy as np

from lockedjoint.clearance.link_clearance import Closest, Link, LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.nlp.arrays import FloatArray

# A way that was halved so often counts as too near.
_HALVES = 12
# The nearest two links on a way are known when no others can be nearer by more than this.
_CLOSE_ENOUGH_M = 1e-3
# So many distances are measured for that at most.
_MOST_LOOKS = 5000
# Distances are kept but for rounding, in metres.
_ROUNDING = 1e-6


class ClearMotion:
    """Checks ways of a chain's joints, along which each joint moves evenly.

    That links touch nowhere; or, if the distance is to be kept, that they keep it everywhere.
    """

    def __init__(self, clearance: LinkClearance, chain: Chain, kept: bool = False) -> None:
        self.clearance = clearance
        least = clearance.leasts if kept else np.zeros(len(clearance.pairs))
        self._least = np.maximum(least - _ROUNDING, 0.0)[:, None]
        low, high = chain.limits
        self._far = np.maximum(np.abs(low), np.abs(high))
        rates = [self._rates(*(clearance.links[i] for i in pair)) for pair in clearance.pairs]
        self._rate = np.array(rates)

    def clear(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """Whether links are apart on ways between configurations (n, B) each, shape (B,)."""
        nearer = self._rate @ np.abs(ends - starts)
        # Not a number where a joint without limits does not move.
        nearer[np.isnan(nearer)] = 0.0
        gaps = [self.clearance.distances(side) - self._least for side in (starts, ends)]
        unsure = gaps[0] + gaps[1] <= nearer
        gaps = [
            self._beyond(side, unsure, known)
            for side, known in zip((starts, ends), gaps, strict=True)
        ]
        clear = np.asarray(np.all(np.minimum(*gaps) > 0, axis=0, where=unsure))
        ways = np.arange(starts.shape[1])
        for halves in range(_HALVES):
            again = np.any(gaps[0] + gaps[1] <= nearer, axis=0) & clear[ways]
            ways = ways[again]
            if halves == _HALVES - 1 or not len(ways):
                break
            starts, ends, nearer = starts[:, again], ends[:, again], nearer[:, again] / 2
            first, last = (side[:, again] for side in gaps)
            middle = (starts + ends) / 2
            between = self.clearance.distances(middle) - self._least
            unsure = np.minimum(first, last) + between <= nearer
            between = self._beyond(middle, unsure, between)
            touching = np.any(between <= 0, axis=0, where=unsure)
            clear[ways[touching]] = False
            ways, nearer = np.tile(ways, 2), np.tile(nearer, 2)
            starts, ends = np.hstack([starts, middle]), np.hstack([middle, ends])
            gaps = [np.hstack([first, between]), np.hstack([between, last])]
        clear[ways] = False
        return clear

    def _beyond(self, q: FloatArray, unsure: BoolArray, known: FloatArray) -> FloatArray:
        """Return by how much pairs are farther apart than they have to be, (pairs, B)."""
        return self.clearance.gaps(q, unsure, known + self._least) - self._least

    def closest(self, configurations: FloatArray) -> Closest:
        """Return the nearest two links at some configurations, shape (N, n), by coal."""
        pairs = np.array(self.clearance.pairs)
        bounds = self.clearance.distances(configurations.T)
        least, nearest = np.min(bounds, axis=0), Closest(np.inf, ("", ""))
        # Capsules say which pairs can be nearer than what was found, and where.
        for k in np.argsort(least, kind="stable"):
            if least[k] >= nearest.distance:
                break
            near = pairs[bounds[:, k] < nearest.distance].tolist()
            found = self.clearance.closest(configurations[k], [(i, j) for i, j in near])
            nearest = min(nearest, found, key=lambda pair: pair.distance)
        return nearest

    def closest_along(self, way: FloatArray) -> Closest:
        """Return the nearest two links anywhere on straight ways between points, (N, n).

        The parts of the way on which a pair could be nearer than the nearest known, by more
        than a millimetre, are halved, the likeliest first.
        """
        nearest = self.closest(way)
        bounds = self.clearance.distances(way.T)
        nearer = self._rate @ np.abs(np.diff(way, axis=0)).T
        nearer[np.isnan(nearer)] = 0.0
        below = (bounds[:, :-1] + bounds[:, 1:] - nearer) / 2
        found: dict[tuple[int, bytes], Closest] = {}

        def at(pair: int, q: FloatArray) -> float:
            key = pair, q.tobytes()
            if key not in found:
                found[key] = self.clearance.closest(q, [self.clearance.pairs[pair]])
            return found[key].distance

        parts: list[tuple[float, int, int, FloatArray, FloatArray]] = []
        near = np.argwhere(below < nearest.distance - _CLOSE_ENOUGH_M)
        for number, (pair, k) in enumerate(near.tolist()):
            parts.append((float(below[pair, k]), number, pair, way[k], way[k + 1]))
        heapify(parts)
        count = len(parts)
        while parts and len(found) < _MOST_LOOKS:
            least, number, pair, start, end = heappop(parts)
            if least >= nearest.distance - _CLOSE_ENOUGH_M:
                heappush(parts, (least, number, pair, start, end))
                break
            comes = float(np.nansum(self._rate[pair] * np.abs(end - start)))
            surely = (at(pair, start) + at(pair, end) - comes) / 2
            if surely > least:  # capsules were a worse bound
                heappush(parts, (surely, number, pair, start, end))
                continue
            middle = (start + end) / 2
            gap = at(pair, middle)
            if gap < nearest.distance:
                nearest = found[pair, middle.tobytes()]
            for one, other in ((start, middle), (middle, end)):
                count += 1
                surely = (at(pair, one) + at(pair, other) - comes / 2) / 2
                heappush(parts, (surely, count, pair, one, other))
        floor = parts[0][0] if parts else nearest.distance - _CLOSE_ENOUGH_M
        return replace(nearest, at_least=min(floor, nearest.distance))

    def _rates(self, first: Link, second: Link) -> FloatArray:
        """Return by how much two links come nearer at most, by each joint's motion, (n,)."""
        rates = np.zeros(len(self._far))
        ways = [_to_root(self.clearance, link.body) for link in (first, second)]
        for link, way, other in zip((first, second), ways, reversed(ways), strict=True):
            capsule = link.capsule
            ends = (np.linalg.norm(end) for end in (capsule.start, capsule.end))
            reach = max(ends) + capsule.radius
            for body in way:
                if body in other:
                    break
                motion = self.clearance.bodies[body - 1][1]
                size = abs(motion.multiplier)
                rates[motion.variable] += size * (1.0 if motion.prismatic else reach)
                reach += np.linalg.norm(np.array(motion.placement)[:3, 3])
                if motion.prismatic:
                    reach += size * self._far[motion.variable] + abs(motion.offset)
        return rates


def _to_root(clearance: LinkClearance, body: int) -> list[int]:
    """Return the numbers of the bodies from one to the root, which is not among them."""
    way = []
    while body:
        way.append(body)
        body = clearance.bodies[body - 1][0]
    return way
