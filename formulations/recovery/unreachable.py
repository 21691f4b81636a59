"""Proofs that no configuration within the limits takes the tool to a goal.

Points of the tool have to be where the goal has them. Boxes of the joints' positions are
bisected until in each of them one point is seen to stay away, in one of two ways:

* *ball*: from the tip to the base a ball is kept that holds the point for all positions in the
  box. A revolute joint that turns by at most r < π/2 from a middle takes the ball's centre, at
  distance ρ from the axis, along an arc, which a ball of radius ρ sin r holds around the middle
  of the arc at distance ρ cos r; radii add.
* *slope*: along the direction u from the goal to the point at the middle of the box, the point
  is at least u·y − Σ|u·∂y/∂q_i| r_i − ½ Σ_ij M_max(i,j) r_i r_j away. M_j is the largest
  distance of the point from joint j's axis in the box: |∂²y/∂q_i∂q_j| for i ≤ j is at most it.

The first revolute joint turns the goal instead, backwards: an arc, whose distance from the ball
and whose largest u· are known. What is recorded of a proof is only where boxes are bisected;
`check_proof` computes the rest anew, in ball arithmetic. Here rounding is
covered by a margin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from formulations.io.objects import Brief
from formulations.kinematics.chain import Chain, Motion
from formulations.kinematics.link_chain import BoolArray, rotation
from formulations.recovery.goal import REACHED, ToolGoal
from nlp.arrays import FloatArray

# Rounding, in metres, for arms of some metres: some thousand times what it can be.
_MARGIN = 1e-9
# Distance of the tool's points from each other, as a share of the arm's length.
_SPREAD = 0.3


@dataclass(frozen=True, eq=False)
class ToolPoint:
    """A point of the tool, in the frame of the last motion, where it has to be, how nearly."""

    start: FloatArray
    target: FloatArray
    tolerance: float


@dataclass(frozen=True, eq=False, repr=False)
class ReachProof(Brief):
    """A proof that a goal is out of reach: where boxes are bisected.

    Attributes
    ----------
    chain
        What can move.
    points
        Points of the tool, one of which misses its target in every box.
    lower, upper
        The box of all positions, one for each joint, in radians or metres.
    splits
        For each box, level by level, the joint at whose middle it is bisected, or -1 where it
        needs no more.
    """

    chain: Chain
    points: tuple[ToolPoint, ...]
    lower: FloatArray
    upper: FloatArray
    splits: tuple[int, ...]

    @property
    def boxes(self) -> int:
        """Boxes that are left in the end, in each of which a point misses its target."""
        return sum(split < 0 for split in self.splits)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: all that the checker needs."""
        return {
            "claim": "no position of the joints in the box takes all points to their targets",
            "robot": self.chain.robot,
            "joints": list(self.chain.names),
            "locked": dict(self.chain.locked_at),
            "lower": self.lower.tolist(),
            "upper": self.upper.tolist(),
            "motions": [
                {
                    "placement": [list(row) for row in motion.placement],
                    "axis": list(motion.axis),
                    "prismatic": motion.prismatic,
                    "joint": motion.variable,
                    "multiplier": motion.multiplier,
                    "offset": motion.offset,
                }
                for motion in self.chain.motions
            ],
            "points": [
                {
                    "start": point.start.tolist(),
                    "target": point.target.tolist(),
                    "tolerance": point.tolerance,
                }
                for point in self.points
            ],
            "splits": list(self.splits),
        }


def tool_points(chain: Chain, goal: ToolGoal) -> tuple[ToolPoint, ...]:
    """Return points of the tool that a goal fixes; none if its position is not all fixed.

    With an orientation three of them, two on the last joint's axis, which does not move them.
    """
    if goal.linear != [0, 1, 2]:
        return ()
    end = np.array(chain.end)
    offsets = [np.zeros(3)]
    if goal.angular == [0, 1, 2]:
        offsets = _offsets(chain)
    points = []
    for offset in offsets:
        near = goal.pose.tolerance + 2 * np.sin(goal.pose.angle / 2) * np.linalg.norm(offset)
        start = end[:3, :3] @ offset + end[:3, 3]
        target = goal.position + goal.pose.rotation @ offset
        points.append(ToolPoint(start, target, float(near) + REACHED))
    return tuple(points)


def prove_unreachable(
    chain: Chain, points: tuple[ToolPoint, ...], most: int
) -> ReachProof | None:
    """Return a proof that no configuration takes all points to their targets.

    None if there is none with so many boxes, or a joint has no limits that it needs.
    """
    lower, upper = _ranges(chain)
    if not points or not np.all(np.isfinite(upper - lower)):
        return None
    low, high, splits = lower[:, None], upper[:, None], [np.zeros(0, dtype=int)]
    count = 0
    while low.size:
        count += low.shape[1]
        if count + 2 * low.shape[1] > most:
            return None
        excluded, weights = _looked_at(chain, points, low, high)
        split = np.where(excluded, -1, np.argmax(weights, axis=0))
        splits.append(split)
        open_boxes = np.flatnonzero(~excluded)
        low, high = np.repeat(low[:, open_boxes], 2, axis=1), high[:, open_boxes]
        high = np.repeat(high, 2, axis=1)
        joint, first = split[open_boxes], np.arange(0, low.shape[1], 2)
        middle = (low[joint, first] + high[joint, first]) / 2
        high[joint, first] = middle
        low[joint, first + 1] = middle
    return ReachProof(
        chain, points, lower, upper, tuple(np.concatenate(splits).astype(int).tolist())
    )


def _looked_at(
    chain: Chain, points: tuple[ToolPoint, ...], low: FloatArray, high: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return in which boxes a point stays away, (B,), and the joints' weights, (n, B)."""
    weights = np.zeros(low.shape)
    excluded = np.zeros(low.shape[1], dtype=bool)
    for point in points:
        away, own = _stays_away(chain, point, low, high)
        excluded |= away
        weights = np.maximum(weights, own)
    return excluded, weights


def _stays_away(
    chain: Chain, point: ToolPoint, low: FloatArray, high: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Whether a point misses its target in boxes (n, B), and the joints' weights, (n, B)."""
    first, weights = chain.motions[0], np.zeros(low.shape)
    turns = not first.prismatic
    cloud = _Cloud.at_end(point, low.shape[1])
    for motion in reversed(chain.motions[1:] if turns else chain.motions):
        middle, half = _interval(motion, low, high)
        cloud.move(motion, middle, half)
        weights[motion.variable] += cloud.far[-1] * half
    if turns:
        goal = np.linalg.inv(np.array(first.placement)) @ [*point.target, 1.0]
        middle, half = _interval(first, low, high)
        arc = _Arc.of(goal[:3], np.array(first.axis), -middle, half)
        weights[first.variable] += arc.radius * half
    else:
        still = np.zeros(low.shape[1])
        arc = _Arc.of(point.target, np.array([0.0, 0.0, 1.0]), still, still)
    enough = point.tolerance + _MARGIN
    outside = arc.distance(cloud.ball) - cloud.radius > enough
    direction = cloud.at - arc.nearest(cloud.at)
    direction /= np.maximum(np.linalg.norm(direction, axis=0), 1e-300)
    least = np.sum(direction * cloud.at, axis=0) - cloud.loss(direction)
    return outside | (least - arc.largest(direction) > enough), weights


def _interval(
    motion: Motion, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return middle and half width of a motion's values in boxes, (B,) each."""
    ends = [motion.multiplier * side[motion.variable] for side in (low, high)]
    return (ends[0] + ends[1]) / 2 + motion.offset, np.abs(ends[1] - ends[0]) / 2


@dataclass(eq=False)
class _Cloud:
    """Where a point of the tool can be in B boxes: a ball, and the point at the middle.

    Moved from the tip to the base; `slopes` are derivatives of the point by the motions so far,
    `far` their M, `halves` the half widths of their values.
    """

    ball: FloatArray
    radius: FloatArray
    at: FloatArray
    slopes: list[FloatArray]
    far: list[FloatArray]
    halves: list[FloatArray]

    @classmethod
    def at_end(cls, point: ToolPoint, count: int) -> Self:
        start = np.repeat(point.start[:, None], count, axis=1)
        return cls(start, np.zeros(count), start, [], [], [])

    def move(self, motion: Motion, middle: FloatArray, half: FloatArray) -> None:
        """Move by a motion, and into the frame that it is placed in."""
        axis, placement = np.array(motion.axis), np.array(motion.placement)
        if motion.prismatic:
            self.far.append(np.ones_like(half))
            self.ball, self.at = (x + axis[:, None] * middle for x in (self.ball, self.at))
            self.radius = self.radius + half
            self.slopes.append(np.repeat(axis[:, None], len(half), axis=1))
        else:
            along = axis[:, None] * (axis @ self.ball)
            rho = np.linalg.norm(self.ball - along, axis=0)
            self.far.append(rho + self.radius)
            narrow = np.minimum(half, np.pi / 2)
            turned = rotation(axis, middle)
            across = np.einsum("bij,jb->ib", turned, self.ball - along)
            self.ball = along + np.cos(narrow) * across
            self.radius = self.radius + rho * np.sin(narrow)
            self.at = np.einsum("bij,jb->ib", turned, self.at)
            self.slopes = [np.einsum("bij,jb->ib", turned, each) for each in self.slopes]
            self.slopes.append(np.cross(axis, self.at.T).T)
        self.halves.append(half)
        turn, shift = placement[:3, :3], placement[:3, 3:]
        self.ball, self.at = turn @ self.ball + shift, turn @ self.at + shift
        self.slopes = [turn @ each for each in self.slopes]

    def loss(self, direction: FloatArray) -> FloatArray:
        """Return by how much the point can be less along a direction than at the middle."""
        total, nearer_base = np.zeros_like(self.radius), np.zeros_like(self.radius)
        for slope, far, half in zip(
            *(reversed(each) for each in (self.slopes, self.far, self.halves)), strict=True
        ):
            total += np.abs(np.sum(direction * slope, axis=0)) * half
            total += far * half * (half / 2 + nearer_base)
            nearer_base = nearer_base + half
        return total


@dataclass(frozen=True, eq=False)
class _Arc:
    """Points that turn about an axis: of B boxes, about a middle by at most a half width."""

    frame: FloatArray  # rows: two directions across the axis, and the axis
    height: float
    radius: float
    angle: FloatArray
    half: FloatArray

    @classmethod
    def of(
        cls, point: FloatArray, axis: FloatArray, middle: FloatArray, half: FloatArray
    ) -> Self:
        across = np.linalg.svd(axis[None])[2][1:]
        frame = np.stack([across[0], np.cross(axis, across[0]), axis])
        x, y, z = frame @ point
        return cls(frame, z, float(np.hypot(x, y)), np.arctan2(y, x) + middle, half)

    def _off(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return vectors in the frame, and their angles off the middle, -π to π."""
        own = self.frame @ vectors
        off = np.arctan2(own[1], own[0]) - self.angle
        return own, off - 2 * np.pi * np.round(off / (2 * np.pi))

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the points of the arcs nearest to others, (3, B)."""
        _, off = self._off(points)
        angle = self.angle + np.clip(off, -self.half, self.half)
        own = np.stack(
            [self.radius * np.cos(angle), self.radius * np.sin(angle), 0 * angle + self.height]
        )
        return np.asarray(self.frame.T @ own)

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance of points from the arcs, (B,)."""
        return np.asarray(np.linalg.norm(points - self.nearest(points), axis=0))

    def largest(self, directions: FloatArray) -> FloatArray:
        """Return the largest extent of the arcs along directions, (B,)."""
        own, off = self._off(directions)
        beyond = np.maximum(np.abs(off) - self.half, 0.0)
        across = self.radius * np.hypot(own[0], own[1]) * np.cos(beyond)
        return np.asarray(own[2] * self.height + across)


def _offsets(chain: Chain) -> list[FloatArray]:
    """Return points in the tip's frame: two on the last joint's axis, and one beside."""
    end = np.linalg.inv(np.array(chain.end))
    last = chain.motions[-1]
    axis = np.array(last.axis)
    length = sum(np.linalg.norm(np.array(m.placement)[:3, 3]) for m in chain.motions)
    spread = _SPREAD * float(length + np.linalg.norm(np.array(chain.end)[:3, 3]))
    foot = np.zeros(3)
    if len(chain.motions) > 1:  # the point of the axis nearest to the one before
        before = chain.motions[-2]
        placement = np.linalg.inv(np.array(last.placement))
        origin, other = placement[:3, 3], placement[:3, :3] @ np.array(before.axis)
        across = np.cross(axis, other)
        square = float(across @ across)
        if not (last.prismatic or before.prismatic) and square > 1e-9:
            foot = axis * float(np.cross(origin, other) @ across / square)
    beside = np.linalg.svd(axis[None])[2][1]
    ends = [foot, foot + spread * axis, foot + spread * beside]
    return [end[:3, :3] @ point + end[:3, 3] for point in ends]


def _ranges(chain: Chain) -> tuple[FloatArray, FloatArray]:
    """Return the box of all positions that matter: of joints that turn fully, one turn."""
    lower, upper = (side.copy() for side in chain.limits)
    for k in range(len(lower)):
        own = [motion for motion in chain.motions if motion.variable == k]
        fully = all(not m.prismatic and m.multiplier % 1 == 0 for m in own)
        if fully and upper[k] - lower[k] >= 2 * np.pi:
            lower[k], upper[k] = -np.pi, np.pi
    return lower, upper
