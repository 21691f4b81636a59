"""Failure-tolerant workspace of planar 3R arms, in closed form.

For the definition see `reachable_sets`. Here the joints can make a full turn once the
artificial limits are released.

Notation: l1, l2, l3 are the link lengths; ρ is the distance of the tool's position p from the
base and φ its bearing from the middle of the range of joint 1, whose half width is h; r12 is
the distance of joint 3 from the base, r23 that of the tip from joint 2.

- Joint 2 or 3 locks: two links remain, one of length r12 or r23. Its p form a ring.
- Joint 1 locks: p is within the ring of l2 and l3 around joint 2, wherever that is on its arc.
- No failure: for a given ρ, the angle ψ between link 1 and p depends on r23 alone. The values
  of ψ are intervals, whose ends are where a joint is at a limit or two links are aligned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.serial_chain import Ranges, at_zero, is_planar
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.workspaces.planar_geometry import (
    TURN_RAD,
    angle_between_links,
    covered_length,
    end_distances,
    gauss_nodes,
    within_a_turn,
)

#: The number of values of ρ in a quadrature, and where `shortfall` looks. More is more exact
#: and takes longer.
RINGS = 60
#: The number of values of ρ for an area that is told, and in the last steps of a search.
FINE_RINGS = 480
# A distance that is not 0, in metres, by which it is safe to divide.
_TINY_M = 1e-300
# A link below this length in metres counts as none: such an arm is not of this form.
_SHORTEST_LINK_M = 1e-6
# The score of an arm whose rings are in wrong order begins here: above all others, which are
# differences of angles.
_NO_RINGS_SCORE = 10


@dataclass(frozen=True)
class Planar3R:
    """A planar arm of three links and its artificial limits.

    Parameters
    ----------
    lengths
        Lengths of the links l1, l2, l3, above 0, in metres.
    limits
        Lower and upper artificial limit of each joint, in radians. Angle 0 of joints 2 and 3
        stretches the arm. A range of a full turn or more is no limit.
    """

    lengths: tuple[float, float, float]
    limits: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]

    @property
    def rings(self) -> tuple[float, float]:
        """Least and largest ρ, in metres, that failures of joints 2 and 3 leave.

        If the least is not below the largest, nothing is left.
        """
        first, second, third = self.lengths
        low, high = [], []
        # The locked joint makes one link of the two that are `bent`; the third is `alone`.
        for bent, alone, limits in (
            ((first, second), third, self.limits[1]),
            ((second, third), first, self.limits[2]),
        ):
            near, far = end_distances(*bent, limits)
            low.append(max(abs(near - alone), abs(far - alone)))
            high.append(near + alone)
        return max(low), min(high)

    def area(self, rings: int = RINGS) -> float:
        """Area of the workspace in m²: a quadrature of ∫ ρ angles(ρ) dρ over so many ρ."""
        low, high = self.rings
        if low >= high:
            return 0.0
        # Roots at the ends of the range of ρ are smooth in this variable.
        nodes, weights = gauss_nodes(rings)
        angle = np.pi * (nodes + 1) / 2
        rho = (low + high) / 2 - (high - low) / 2 * np.cos(angle)
        d_rho = np.pi / 2 * weights * (high - low) / 2 * np.sin(angle)
        return float(np.sum(d_rho * rho * self.angles(rho)))

    def area_with_error(self) -> tuple[float, float]:
        """Area, and how much it differs from that of a quarter as many rings, both in m².

        Where rings are left but no node of the quadrature has an arc, the error is the largest
        area between two nodes: a sliver there is not seen.
        """
        fine = self.area(FINE_RINGS)
        rounding = float(np.finfo(float).eps * sum(self.lengths) ** 2)
        low, high = self.rings
        if fine == 0.0 and low < high:
            gap = np.pi**2 * (high - low) / (4 * FINE_RINGS)
            return 0.0, float(TURN_RAD * high * gap)
        return fine, max(abs(fine - self.area(FINE_RINGS // 4)), rounding)

    def angles(self, rho: FloatArray) -> FloatArray:
        """Total range of the bearing at each ρ, in radians; 0 to 2π."""
        least, largest = self._bearings(rho)
        starts, ends = self._intervals(rho)
        positive = (np.maximum(starts, least), np.minimum(ends, largest))
        negative = (np.maximum(starts, -largest), np.minimum(ends, -least))
        both = np.concatenate([positive, negative], axis=1)
        return covered_length(both[0], both[1])

    @property
    def shortfall(self) -> float:
        """How far the failures of joints 2 and 3, and then of joint 1, are from leaving a ring.

        A score where the area is 0, which is flat: it is 0 or below where a ring is left.
        """
        low, high = self.rings
        total = sum(self.lengths)
        if low >= high:
            return float(_NO_RINGS_SCORE + (low - high) / total)
        least, largest = self._bearings(np.linspace(low, high, RINGS))
        return float(np.min(least - largest))

    @property
    def _half_width(self) -> float:
        """Return h, half the range of joint 1 in radians, π at most."""
        low, high = self.limits[0]
        return min((high - low) / 2, np.pi)

    def _bearings(self, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Least and largest |φ| after a failure of joint 1, wherever it locks, in radians.

        Both have the shape of ρ. p has to be within l2 + l3 and |l2 − l3| of joint 2,
        wherever that is on its arc. Where no bearing has this, the largest is −1.
        """
        first, second, third = self.lengths
        reach, hole = second + third, abs(second - third)
        far = self._psi(rho, reach**2) - self._half_width
        near = self._psi(rho, hole**2) + self._half_width
        largest = np.where(rho + first <= reach, np.pi, far)
        least = np.where(np.abs(rho - first) >= hole, 0.0, near)
        outside = (np.abs(rho - first) > reach) | (rho + first < hole)
        return least, np.where(outside, -1.0, largest)

    def _intervals(self, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Starts and ends of intervals of φ that are reached before a failure, in radians.

        Both have the shape (intervals, rings). Between two neighbours of `borders`, values of
        joint 3 at which a limit is met or two links are aligned, ψ is monotonic.

        Those beyond ±π are also there turned back; empty ones have NaN ends.
        """
        first, second, third = self.lengths
        (low2, high2), (low3, high3) = (within_a_turn(*limits) for limits in self.limits[1:])
        ends = [np.full_like(rho, angle) for angle in (low3, high3, 0.0, np.pi)]
        for distance in (np.abs(rho - first), rho + first):  # links 1 and 23 are aligned
            angle = angle_between_links(second, third, distance)
            ends += [angle, -angle]
        for limit in (low2, high2):
            x, y = first + second * np.cos(limit), second * np.sin(limit)
            bearing = np.arctan2(y, x) - limit  # of the line to joint 3, from link 2
            angle = angle_between_links(np.hypot(x, y), third, rho)
            ends += [bearing + angle, bearing - angle]
        borders = np.clip(low3 + (np.array(ends) - low3) % TURN_RAD, low3, high3)
        borders[0], borders[1] = low3, high3
        borders.sort(axis=0)
        middle = (borders[:-1] + borders[1:]) / 2
        psi = self._psi(rho, second**2 + third**2 + 2 * second * third * np.cos(borders))
        x, y = second + third * np.cos(middle), third * np.sin(middle)
        length, bearing = np.hypot(x, y), np.arctan2(y, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = (rho**2 - first**2 - length**2) / (2 * first * length)
        bend = np.arccos(np.clip(cosine, -1, 1))
        possible = (np.abs(cosine) <= 1) & (borders[1:] >= borders[:-1])
        starts, stops = [], []
        for sign in (1, -1):
            within = low2 + (sign * bend - bearing - low2) % TURN_RAD <= high2
            sides = np.sort([sign * psi[:-1], sign * psi[1:]], axis=0)
            sides = np.where(possible & within, sides, np.nan)
            for shift in (-TURN_RAD, 0.0, TURN_RAD):
                starts.append(sides[0] - self._half_width + shift)
                stops.append(sides[1] + self._half_width + shift)
        return np.concatenate(starts), np.concatenate(stops)

    def _psi(self, rho: FloatArray, square: FloatArray | float) -> FloatArray:
        """Angle ψ in radians at the base between link 1 and p, √square from joint 2."""
        first = self.lengths[0]
        cosine = (first**2 + rho**2 - square) / (2 * first * np.maximum(rho, _TINY_M))
        return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


def closed_form(arm: Chain, limits: Ranges) -> Planar3R | None:
    """Return an arm and its artificial limits as a `Planar3R`; None if it is not of this form.

    It is if it is planar, and has three joints and no physical limits.
    """
    free = all(joint.continuous for joint in arm.joints)
    if not (is_planar(arm) and len(arm.joints) == 3 and free):
        return None
    lengths, bent, signs = links_at_zero(arm)
    if min(lengths) < _SHORTEST_LINK_M:
        return None
    ranges = [
        tuple(sorted((sign * low + angle, sign * high + angle)))
        for sign, angle, (low, high) in zip(signs, bent, limits, strict=True)
    ]
    return Planar3R(tuple(lengths.tolist()), tuple(ranges))  # type: ignore[arg-type]


def links_at_zero(arm: Chain) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of a planar arm at zero: link lengths, angles from link to link, signs of the axes."""
    links = np.diff([*at_zero(arm).points[0, :, :2], at_zero(arm).end_effector[:2]], axis=0)
    bent = np.diff(np.arctan2(links[:, 1], links[:, 0]), prepend=0.0)
    lengths = np.hypot(links[:, 0], links[:, 1])
    return lengths, bent, np.sign(at_zero(arm).directions[0, :, 2])
