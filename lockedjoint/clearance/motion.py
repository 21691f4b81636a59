"""Whether links stay apart on the way from one configuration to another.

A *way* is straight in the positions of the joints. A joint that moves by dq brings two links
nearer by at most L·|dq|. L is the *rate* in the code: the most that a point of one link can be
from the joint's axis, in metres, or 1 for a prismatic joint; 0 where both links move with the
joint. On a way along which a pair comes nearer by at most s in all, its distance is never less
than (d + d' − s)/2, where d and d' are its distances at the ends: where the pair has come
nearer by a, its distance is at least d − a and at least d' − (s − a), and so at least the mean
of both. A way for which this decides nothing is halved.

Letters: n joints, B ways, P pairs of links. Configurations are columns, shape (n, B), radians
or (prismatic joints) metres; distances are metres, shape (P, B).
"""

from __future__ import annotations

from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np

from lockedjoint.clearance.known_gaps import KnownGaps
from lockedjoint.clearance.link_clearance import Closest, Link, LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.nlp.arrays import FloatArray

# Number of halvings after which an undecided way counts as too near: with more, ways that come
# very near are told apart better.
_HALVES = 12
# Length by which no other links can be nearer when the nearest two on a way are known.
_CLOSE_ENOUGH_M = 1e-3
# Largest number of distances that are measured to know them; then a weaker bound is stated.
_MOST_LOOKS = 5000
# Length by which a distance may be missed, which is rounding.
_ROUNDING_M = 1e-6


class _Part(NamedTuple):
    """A part of a way, and a pair of links that could be near on it."""

    bound: float  #: Lower bound of their distance on the part, metres.
    number: int  #: Different for each part.
    pair: int  #: Number in `LinkClearance.pairs`.
    start: FloatArray  #: Configuration, shape (n,).
    end: FloatArray  #: Configuration, shape (n,).


class ClearMotion:
    """Checks ways of a chain's joints, along which each joint moves evenly.

    Parameters
    ----------
    clearance
        The links, their pairs and the distance that pairs keep.
    chain
        The joints that move.
    kept
        Whether links have to keep that distance everywhere; if not, they may not touch.
    """

    def __init__(self, clearance: LinkClearance, chain: Chain, kept: bool = False) -> None:
        self.clearance, self._known = clearance, KnownGaps(clearance)
        least = clearance.leasts if kept else np.zeros(len(clearance.pairs))
        # What each pair keeps, metres, (P, 1); the farthest position of each joint from 0,
        # (n,); and the rates, (P, n).
        self._least = np.maximum(least - _ROUNDING_M, 0.0)[:, None]
        low, high = chain.limits
        self._far = np.maximum(np.abs(low), np.abs(high))
        rates = [self._rates(*(clearance.links[i] for i in pair)) for pair in clearance.pairs]
        self._rate = np.array(rates)

    def clear(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """Whether links are apart on ways between configurations (n, B) each, shape (B,)."""
        nearer = self._rate @ np.abs(ends - starts)  # s, (P, B)
        # A joint without limits that does not move gives ∞·0.
        nearer[np.isnan(nearer)] = 0.0
        # By how much pairs are farther apart than they have to be, at both ends.
        both = np.hstack([starts, ends])
        gaps = np.hsplit(self._known.capsules(both) - self._least, 2)
        unsure = gaps[0] + gaps[1] <= nearer
        gaps = np.hsplit(self._known.exact(both, np.tile(unsure, 2)) - self._least, 2)
        clear = np.asarray(np.all(np.minimum(*gaps) > 0, axis=0, where=unsure))
        ways = np.arange(starts.shape[1])  # the way that each part is of
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
        """Return by how much pairs are farther apart than they have to be at q, (P, B).

        Where `unsure`, (P, B), by their geometry; elsewhere as `known`, by their capsules.
        """
        return self.clearance.gaps(q, unsure, known + self._least) - self._least

    def closest(self, configurations: FloatArray) -> Closest:
        """Return the nearest two links at some configurations, shape (N, n), by coal."""
        pairs = np.array(self.clearance.pairs)
        bounds = self.clearance.distances(configurations.T)  # by capsules, (P, N)
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

        `at_least` of the result is what no two links are nearer than anywhere. The parts of the
        way on which a pair could be nearer than the nearest known, by more than
        `_CLOSE_ENOUGH_M`, are halved, that with the least bound first.
        """
        nearest = self.closest(way)
        bounds = self.clearance.distances(way.T)  # by capsules, (P, N)
        nearer = self._rate @ np.abs(np.diff(way, axis=0)).T  # s, (P, N − 1)
        nearer[np.isnan(nearer)] = 0.0
        below = (bounds[:, :-1] + bounds[:, 1:] - nearer) / 2
        found: dict[tuple[int, bytes], Closest] = {}

        def at(pair: int, q: FloatArray) -> float:
            key = pair, q.tobytes()
            if key not in found:
                found[key] = self.clearance.closest(q, [self.clearance.pairs[pair]])
            return found[key].distance

        # A heap, the least bound first; the number decides between equal bounds.
        parts: list[_Part] = []
        near = np.argwhere(below < nearest.distance - _CLOSE_ENOUGH_M)
        for number, (pair, k) in enumerate(near.tolist()):
            parts.append(_Part(float(below[pair, k]), number, pair, way[k], way[k + 1]))
        heapify(parts)
        count = len(parts)
        while parts and len(found) < _MOST_LOOKS:
            part = heappop(parts)
            pair, start, end = part.pair, part.start, part.end
            if part.bound >= nearest.distance - _CLOSE_ENOUGH_M:
                heappush(parts, part)
                break
            comes = float(np.nansum(self._rate[pair] * np.abs(end - start)))
            bound = (at(pair, start) + at(pair, end) - comes) / 2
            if bound > part.bound:  # capsules were a worse bound
                heappush(parts, part._replace(bound=bound))
                continue
            middle = (start + end) / 2
            gap = at(pair, middle)
            if gap < nearest.distance:
                nearest = found[pair, middle.tobytes()]
            for one, other in ((start, middle), (middle, end)):
                count += 1
                bound = (at(pair, one) + at(pair, other) - comes / 2) / 2
                heappush(parts, _Part(bound, count, pair, one, other))
        floor = parts[0].bound if parts else nearest.distance - _CLOSE_ENOUGH_M
        return replace(nearest, at_least=min(floor, nearest.distance))

    def _rates(self, first: Link, second: Link) -> FloatArray:
        """Return the rates L of two links, shape (n,), in metres per radian, or 1.

        From each link the way goes to the root, up to the first body that both links move with.
        `reach` is the most that a point of the link can be from the origin of the body, and so
        from the joint's axis through it; every link and every slide on the way makes it longer.
        """
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
