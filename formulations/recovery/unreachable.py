"""Proofs that no configuration within the limits takes the tool to a goal.

Points of the tool have to be where the goal has them. Boxes of the joints' positions are
bisected, in floating point, until in each of them one point is seen to stay away by a margin;
`check_proof` has the mathematics. What is recorded is only where boxes are bisected. The leaves
are then looked at again in interval arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from formulations.io.objects import Brief
from formulations.kinematics.chain import Chain
from formulations.kinematics.link_chain import IntArray
from formulations.recovery.check_proof import bisected, check, stays_away
from formulations.recovery.goal import REACHED, ToolGoal
from nlp.arrays import FloatArray

# Metres that leave room for rounding, of arms of some metres.
_MARGIN = 1e-9
# Distance of the tool's points from each other, as a share of the arm's length.
_SPREAD = 0.3
# Proofs of more boxes are left to `check_proof`: a quarter of a minute.
_CHECKED = 500_000


@dataclass(frozen=True, eq=False, repr=False)
class ReachProof(Brief):
    """A proof that a goal is out of reach: where boxes are bisected.

    Attributes
    ----------
    content
        What `check_proof` reads, plain values for JSON.
    boxes
        Boxes that are left in the end, in each of which a point misses its target.
    grade
        ``"proved"`` if all rounding errors are bounded, by `check_proof`; or ``"numerical"``.
    """

    content: dict[str, Any]
    boxes: int
    grade: str


def prove_unreachable(chain: Chain, goal: ToolGoal, most: int) -> ReachProof | None:
    """Return a proof that no configuration takes the tool to a goal.

    None if there is none with so many boxes, a joint has no limits that it needs, or the
    goal's position is not all fixed.
    """
    lower, upper = _ranges(chain)
    points = tool_points(chain, goal)
    if not points or not np.all(np.isfinite(upper - lower)):
        return None
    content = {
        "claim": "no position of the joints in the box takes all points to their targets",
        "robot": chain.robot,
        "joints": list(chain.names),
        "locked": dict(chain.locked_at),
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "motions": plain_motions(chain),
        "points": points,
    }
    splits = _splits(content["motions"], points, lower[:, None], upper[:, None], most)
    if splits is None:
        return None
    content["splits"] = splits.tolist()
    leaves = int(np.sum(splits < 0))
    try:
        rigorous = leaves <= _CHECKED and check(content) == leaves
    except ValueError:  # the margin was less than rounding
        rigorous = False
    return ReachProof(content, leaves, "proved" if rigorous else "numerical")


def plain_motions(chain: Chain) -> list[dict[str, Any]]:
    """Return a chain's motions as `check_proof` reads them."""
    return [
        {
            "placement": [list(row) for row in motion.placement],
            "axis": list(motion.axis),
            "prismatic": motion.prismatic,
            "joint": motion.variable,
            "multiplier": motion.multiplier,
            "offset": motion.offset,
        }
        for motion in chain.motions
    ]


def _splits(
    motions: Any, points: list[dict[str, Any]], low: FloatArray, high: FloatArray, most: int
) -> IntArray | None:
    """Return of each box, level by level, the joint at whose middle it is bisected.

    Or -1 where it needs no more; None if there would be more than so many.
    """
    splits, count = [np.zeros(0, dtype=int)], 0
    while low.size:
        count += low.shape[1]
        if count + 2 * low.shape[1] > most:
            return None
        split = np.full(low.shape[1], -1)
        left, weights = np.arange(low.shape[1]), np.zeros(low.shape)
        for point in points:
            sides = low[:, left], high[:, left]
            away, own = stays_away(motions, point, *sides, _MARGIN, False)
            weights = np.maximum(weights, own)[:, ~away]
            left = left[~away]
        split[left] = np.argmax(weights, axis=0)
        splits.append(split)
        low, high = bisected(low, high, split)
    return np.concatenate(splits)


def tool_points(chain: Chain, goal: ToolGoal) -> list[dict[str, Any]]:
    """Return points of the tool, in the frame of the last motion, and where they have to be.

    And how nearly. None if the goal's position is not all fixed. With an orientation three of
    them, two on the last joint's axis, which does not move them.
    """
    if goal.linear != [0, 1, 2]:
        return []
    end = np.array(chain.end)
    offsets = _offsets(chain) if goal.angular == [0, 1, 2] else [np.zeros(3)]
    points = []
    for offset in offsets:
        near = goal.pose.tolerance + 2 * np.sin(goal.pose.angle / 2) * np.linalg.norm(offset)
        points.append(
            {
                "start": (end[:3, :3] @ offset + end[:3, 3]).tolist(),
                "target": (goal.position + goal.pose.rotation @ offset).tolist(),
                "tolerance": float(near) + REACHED,
            }
        )
    return points


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
