"""Proofs that no configuration within the limits takes the tool to a goal.

Points of the tool have to be where the goal has them. The box of the joints' positions is
bisected until in each part one point is seen to stay away from its target by the bounds that
`check_proof` states. It reads afterwards what was found: where boxes are bisected.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from formulations.io.objects import Brief
from formulations.kinematics.chain import Chain, Motion, frozen
from formulations.kinematics.forward import turn_to
from formulations.kinematics.link_chain import IntArray, homogeneous
from formulations.recovery.check_proof import SURPLUS, check, distances
from formulations.recovery.goal import REACHED, ToolGoal
from nlp.arrays import FloatArray

# Distance of the tool's points from each other, as a share of the arm's length.
_SPREAD = 0.3
# Boxes that are looked at together; proofs of more leaves are not checked at once.
_TOGETHER, _CHECKED = 10_000, 500_000
_Z = (0.0, 0.0, 1.0)


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
    base, upright = upright_chain(chain)
    points = tool_points(base, upright, goal)
    motions = [asdict(motion) for motion in upright.motions]
    splits = _splits(motions, points, lower[:, None], upper[:, None], most)
    if splits is None:
        return None
    content = {
        "claim": "no position of the joints in the box takes all points to their targets",
        "robot": chain.robot,
        "joints": list(chain.names),
        "locked": dict(chain.locked_at),
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "motions": motions,
        "points": points,
        "splits": splits.tolist(),
    }
    leaves = int(np.sum(splits < 0))
    try:
        checked = leaves <= _CHECKED and check(content) == leaves
    except ValueError:  # lengths are too large for the rounding that it allows for
        checked = False
    return ReachProof(content, leaves, "proved" if checked else "numerical")


def upright_chain(chain: Chain) -> tuple[FloatArray, Chain]:
    """Return the frame of a chain's first motion, and the chain from there: motions along z.

    The first one turns, if only by nothing.
    """
    motions, before = [], np.eye(4)
    still = Motion(frozen(np.eye(4)), _Z, False, 0, 0.0, 0.0)
    for motion in (still, *chain.motions) if chain.motions[0].prismatic else chain.motions:
        turn = homogeneous(turn_to(np.array(motion.axis)))
        placement = frozen(before @ np.array(motion.placement) @ turn)
        motions.append(replace(motion, placement=placement, axis=_Z))
        before = turn.T
    base = np.array(motions[0].placement)
    motions[0] = replace(motions[0], placement=frozen(np.eye(4)))
    end = frozen(before @ np.array(chain.end))
    return base, replace(chain, motions=tuple(motions), end=end)


def _splits(
    motions: list[dict[str, Any]],
    points: list[dict[str, Any]],
    low: FloatArray,
    high: FloatArray,
    most: int,
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
        for left in np.split(np.arange(len(split)), range(_TOGETHER, len(split), _TOGETHER)):
            weights = np.zeros((len(low), len(left)))
            for point in points:
                away, moves = distances(motions, point, low[:, left], high[:, left])
                own = np.zeros_like(weights)
                for motion, move in zip(motions, moves, strict=True):
                    own[motion["variable"]] += move
                near = away <= point["tolerance"] + 2 * SURPLUS
                left, weights = left[near], np.maximum(weights, own)[:, near]
            split[left] = np.argmax(weights, axis=0)
        splits.append(split)
        parts = np.flatnonzero(split >= 0)
        joint, first = split[parts], np.arange(0, 2 * len(parts), 2)
        low, high = (np.repeat(side[:, parts], 2, axis=1) for side in (low, high))
        middle = (low[joint, first] + high[joint, first]) / 2
        high[joint, first] = low[joint, first + 1] = middle
    return np.concatenate(splits)


def tool_points(base: FloatArray, chain: Chain, goal: ToolGoal) -> list[dict[str, Any]]:
    """Return points of the tool, in the frame of the last motion, and where they have to be.

    In a frame at the base, and how nearly. With an orientation four of them, two on the last
    joint's axis, which does not move them.
    """
    end, motions = np.array(chain.end), [np.array(each.placement) for each in chain.motions]
    wanted = np.linalg.inv(base) @ homogeneous(goal.pose.rotation, goal.position)
    starts = end[:3, 3:]
    if goal.angular == [0, 1, 2]:
        length = sum(np.linalg.norm(place[:3, 3]) for place in [*motions, end])
        around = _SPREAD * length * np.array([[0, 0, 1.0, 0], [0, 0, 0, 1], [0, 1, 0, 0]])
        starts = _foot(motions[-1])[:, None] + around
    offsets = end[:3, :3].T @ (starts - end[:3, 3:])
    targets = wanted[:3, :3] @ offsets + wanted[:3, 3:]
    spread = 2 * np.sin(goal.pose.angle / 2) * np.linalg.norm(offsets, axis=0)
    near = goal.pose.tolerance + spread + REACHED
    each = zip(starts.T.tolist(), targets.T.tolist(), near.tolist(), strict=True)
    return [dict(zip(("start", "target", "tolerance"), point, strict=True)) for point in each]


def _foot(last: FloatArray) -> FloatArray:
    """Return the point of the last motion's axis, z, that is nearest to the axis before."""
    before = np.linalg.inv(last)
    origin, axis = before[:3, 3], before[:3, 2]
    square = axis[0] ** 2 + axis[1] ** 2
    height = origin[2] - axis[2] * (origin[:2] @ axis[:2]) / square if square > 1e-9 else 0.0
    return np.array([0.0, 0.0, height])
