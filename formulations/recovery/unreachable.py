"""Proofs that no configuration within the limits takes the tool to a goal.

Points of the tool have to be where the goal has them. The box of the joints' positions is
bisected until in each part one point is seen to stay away from its target by the bounds that
`check_proof` states. It reads afterwards what was found: where boxes are bisected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from formulations.io.objects import Brief
from formulations.kinematics.chain import Chain
from formulations.kinematics.forward import turn_to
from formulations.kinematics.link_chain import IntArray, homogeneous, screw
from formulations.recovery.check_proof import SURPLUS, check, distances
from formulations.recovery.goal import REACHED, ToolGoal
from nlp.arrays import FloatArray

# Distance of the tool's points from each other, as a share of the arm's length.
_SPREAD = 0.3
# Boxes that are looked at together; proofs of more leaves are not checked at once.
_TOGETHER, _CHECKED = 10_000, 500_000
_Z = np.array([0.0, 0.0, 1.0])


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
        ``"proved"`` if `check_proof` says so, or ``"numerical"``.
    """

    content: dict[str, Any]
    boxes: int
    grade: str


def prove_unreachable(chain: Chain, goal: ToolGoal, most: int) -> ReachProof | None:
    """Return a proof that no configuration takes the tool to a goal.

    None if there is none with so many boxes, a joint has no limits that it needs, or the
    goal's position is not all fixed.
    """
    lower, upper = chain.limits
    # Of joints that turn fully one turn is all that matters.
    fully = chain.turning & (upper - lower >= 2 * np.pi)
    lower, upper = np.where(fully, -np.pi, lower), np.where(fully, np.pi, upper)
    if goal.linear != [0, 1, 2] or not np.all(np.isfinite(upper - lower)):
        return None
    content = {
        "claim": "no position of the joints in the box takes all points to their targets",
        "robot": chain.robot,
        "joints": list(chain.names),
        "locked": dict(chain.locked_at),
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        **upright_motions(chain, goal),
    }
    splits = _splits(content, lower[:, None], upper[:, None], most)
    if splits is None:
        return None
    content["splits"] = [split.tolist() for split in splits]
    leaves = sum(int(np.sum(split < 0)) for split in splits)
    checked = leaves <= _CHECKED and check(content)
    return ReachProof(content, leaves, "proved" if checked else "numerical")


def upright_motions(chain: Chain, goal: ToolGoal) -> dict[str, Any]:
    """Return motions along z, and points of the tool and where they have to be, for a proof."""
    placements, before = [], np.eye(4)
    for motion in chain.motions:
        turn = homogeneous(turn_to(np.array(motion.axis)))
        still = screw(_Z, *((0.0, motion.offset) if motion.prismatic else (motion.offset, 0.0)))
        placements.append(before @ np.array(motion.placement) @ turn @ still)
        before = turn.T
    multipliers = np.zeros((len(placements), len(chain.joints)))
    for k, motion in enumerate(chain.motions):
        multipliers[k, motion.variable] = motion.multiplier
    return {
        "placements": [place[:3].tolist() for place in placements],
        "multipliers": multipliers.tolist(),
        "slides": [motion.prismatic for motion in chain.motions],
        **tool_points(placements, before @ np.array(chain.end), goal),
    }


def _splits(
    proof: dict[str, Any], low: FloatArray, high: FloatArray, most: int
) -> list[IntArray] | None:
    """Return of each box, by levels, the joint at whose middle it is bisected.

    Or, from -1 downwards, the point that misses its target; None if there would be more boxes.
    """
    splits, count = list[IntArray](), 0
    multipliers = np.abs(proof["multipliers"][::-1]).T
    while low.size:
        count += low.shape[1]
        if count + 2 * low.shape[1] > most:
            return None
        split = np.zeros(low.shape[1], dtype=int)
        for left in np.split(np.arange(len(split)), range(_TOGETHER, len(split), _TOGETHER)):
            weights = np.zeros((len(low), len(left)))
            for point in range(len(proof["starts"])):
                far, *taken = distances(proof, point, low[:, left], high[:, left])
                near = far + sum(taken) <= 2 * SURPLUS
                split[left[~near]] = -1 - point
                weights = np.maximum(weights, -multipliers @ taken)[:, near]
                left = left[near]
            split[left] = np.argmax(weights, axis=0)
        splits.append(split)
        joint, first = split[split >= 0], np.arange(0, 2 * np.sum(split >= 0), 2)
        low, high = (np.repeat(side[:, split >= 0], 2, axis=1) for side in (low, high))
        middle = (low[joint, first] + high[joint, first]) / 2
        high[joint, first] = low[joint, first + 1] = middle
    return splits


def tool_points(
    placements: list[FloatArray], end: FloatArray, goal: ToolGoal
) -> dict[str, list[Any]]:
    """Return points of the tool, in the frame of the last motion, and where they have to be.

    And how nearly. With an orientation four of them, two on the last joint's axis, which does
    not move them.
    """
    starts = end[:3, 3:]
    if goal.angular == [0, 1, 2]:
        length = sum(np.linalg.norm(place[:3, 3]) for place in [*placements[1:], end])
        around = _SPREAD * length * np.array([[0, 0, 1.0, 0], [0, 0, 0, 1], [0, 1, 0, 0]])
        starts = _foot(placements[-1])[:, None] + around
    offsets = end[:3, :3].T @ (starts - end[:3, 3:])
    targets = goal.pose.rotation @ offsets + goal.position[:, None]
    spread = 2 * np.sin(goal.pose.angle / 2) * np.linalg.norm(offsets, axis=0)
    near = goal.pose.tolerance + spread + REACHED
    columns = {"starts": starts.T, "targets": targets.T, "tolerances": near}
    return {name: column.tolist() for name, column in columns.items()}


def _foot(last: FloatArray) -> FloatArray:
    """Return the point of the last motion's axis, z, that is nearest to the axis before."""
    before = np.linalg.inv(last)
    origin, axis = before[:3, 3], before[:3, 2]
    square = axis[0] ** 2 + axis[1] ** 2
    height = origin[2] - axis[2] * (origin[:2] @ axis[:2]) / square if square > 1e-9 else 0.0
    return np.array([0.0, 0.0, height])
