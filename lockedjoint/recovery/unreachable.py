"""Proofs that no configuration within the limits takes the tool to a goal.

Points of the tool have to be where the goal has them. The box of the joints' positions is
bisected until in each part one point is seen to stay away from its target by the bounds that
`check_proof` states. It reads afterwards what was found: where boxes are bisected.

n is the number of joints that can move, and their positions are in rad or m. A box is a lower
and an upper position for each. Several boxes have the shape (n, boxes).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray, homogeneous, screw
from lockedjoint.kinematics.normal_form import turn_to
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.recovery.check_proof import SURPLUS, check, distances
from lockedjoint.recovery.goal import REACHED, ToolGoal

# Distance between points of the tool, as a share of the arm's length. If it is larger, a wrong
# orientation moves the points more, but the bounds on where they go are wider.
_SPREAD_SHARE = 0.3
# Number of boxes that are evaluated together: more need more memory.
_BOXES_AT_ONCE = 10_000
# Largest number of leaves (boxes that are not bisected) of a proof that is checked right away.
# A larger proof counts as numerical, since the check takes long.
_MOST_CHECKED_LEAVES = 500_000
# Width of a joint's range above which it is not bisected sooner for being wider.
_WIDE_M_OR_RAD = 1.0
# Distance in metres by which a point has to miss its tolerance here. The checker wants half of
# it: the rest keeps a proof valid if its sums are rounded in another way there.
_SEARCH_SURPLUS_M = 2 * SURPLUS
# Square of the sine of the angle between two axes below which they count as parallel. Any value
# leaves proofs valid: it only chooses the points of the tool.
_PARALLEL_SINE_SQUARED = 1e-9
# Joints move about the z axis of their frames, or along it.
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False, repr=False)
class ReachProof(Brief):
    """A proof that a goal is out of reach: where boxes are bisected."""

    content: dict[str, Any]  #: Plain values for JSON, which `check_proof` reads.
    boxes: int  #: Left in the end, in each of which a point misses its target.
    grade: str  #: ``"proved"`` if `check_proof` says so, or ``"numerical"``.


def prove_unreachable(chain: Chain, goal: ToolGoal, most_boxes: int) -> ReachProof | None:
    """Return a proof that no configuration takes the tool to a goal.

    None if there is none with at most `most_boxes` boxes, a joint has no limits that it needs,
    or the goal's position is not all fixed.
    """
    lower, upper = chain.limits
    # One turn is all that matters of a joint that turns fully.
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
    splits = _splits(content, lower[:, None], upper[:, None], most_boxes)
    if splits is None:
        return None
    content["splits"] = splits.tolist()
    leaves = int(np.sum(splits < 0))
    try:
        checked = leaves <= _MOST_CHECKED_LEAVES and check(content) == leaves
    except ValueError:  # lengths are too large for the rounding that it allows for
        checked = False
    return ReachProof(content, leaves, "proved" if checked else "numerical")


def upright_motions(chain: Chain, goal: ToolGoal) -> dict[str, Any]:
    """Return motions along z, and points of the tool and where they have to be, for a proof.

    The frame of each motion is turned so that its axis is z. Plain values for JSON, by name:

    placements
        The frame of each motion in that before, in its zero position: (motions, 3, 4), each a
        rotation and in the last column a translation in metres.
    multipliers
        How far each joint takes each motion, (motions, n).
    slides
        Whether a motion is along z, (motions,); otherwise it is about z.
    starts, targets, tolerances
        The points of the tool, see `_tool_points`.
    """
    # `turn` takes z to the axis of a motion, `begun` is that and what the motion has at the
    # zero of its joint, and `before` takes the turn of the motion before back.
    placements, before = [], np.eye(4)
    multipliers = np.zeros((len(chain.motions), len(chain.joints)))
    for k, motion in enumerate(chain.motions):
        turn = homogeneous(turn_to(np.array(motion.axis)))
        angle, travel = np.array([motion.offset, 0.0])[:: -1 if motion.prismatic else 1]
        begun = turn @ screw(_Z, angle, travel)
        placements.append(before @ np.array(motion.placement) @ begun)
        before = turn.T
        multipliers[k, motion.variable] = motion.multiplier
    return {
        "placements": [place[:3].tolist() for place in placements],
        "multipliers": multipliers.tolist(),
        "slides": [motion.prismatic for motion in chain.motions],
        **_tool_points(placements, before @ np.array(chain.end), goal),
    }


def _splits(
    proof: dict[str, Any], low: FloatArray, high: FloatArray, most_boxes: int
) -> IntArray | None:
    """Return for each box, level by level, the joint at whose middle it is bisected.

    It is −1 for a box in which a point misses its target. The result has the shape (boxes,),
    of all levels together. `low` and `high` are the ends of the first box, (n, 1); in the loop
    they are those of the boxes of a level, (n, boxes of the level). None if there would be more
    than `most_boxes`.
    """
    weights = _weights(proof)
    splits, count = [np.zeros(0, dtype=int)], 0
    while low.size:
        count += low.shape[1]
        if count + 2 * low.shape[1] > most_boxes:
            return None
        split = np.full(low.shape[1], -1)
        for together in np.split(
            np.arange(len(split)), range(_BOXES_AT_ONCE, len(split), _BOXES_AT_ONCE)
        ):
            left = _left(proof, low, high, together)
            # The joint is bisected whose range may move the points most.
            split[left] = np.argmax(
                weights * np.minimum((high - low)[:, left], _WIDE_M_OR_RAD), axis=0
            )
        splits.append(split)
        parts = np.flatnonzero(split >= 0)
        # Each box that is bisected becomes two neighbours: the lower half first.
        joint, first = split[parts], np.arange(0, 2 * len(parts), 2)
        low, high = (np.repeat(side[:, parts], 2, axis=1) for side in (low, high))
        middle = (low[joint, first] + high[joint, first]) / 2
        high[joint, first] = low[joint, first + 1] = middle
    return np.concatenate(splits)


def _weights(proof: dict[str, Any]) -> FloatArray:
    """Return about how far a joint moves the tool's points at most, in m per rad or m, (n, 1).

    A motion that slides moves them as far as it goes. One that turns moves them by at most its
    angle times the lever: the sum of the lengths of all translations after it, and the greatest
    distance of a point from the last frame's origin. What joints slide is left out, since this
    only chooses which joint is bisected: no proof depends on it.
    """
    starts, shifts = np.array(proof["starts"]), np.array(proof["placements"])[:, :, 3]
    after = [np.linalg.norm(starts, axis=1).max(), *np.linalg.norm(shifts[:0:-1], axis=1)]
    levers = np.where(proof["slides"], 1.0, np.cumsum(after)[::-1])
    return np.asarray(np.abs(proof["multipliers"]).T @ levers[:, None])


def _left(
    proof: dict[str, Any], low: FloatArray, high: FloatArray, boxes: IntArray
) -> IntArray:
    """Return the numbers of those of some boxes in which no point is seen to miss its target.

    `low` and `high` are the ends of all boxes of a level, (n, boxes of the level).
    """
    for point in range(len(proof["starts"])):
        away = distances(proof, point, low[:, boxes], high[:, boxes])
        boxes = boxes[away <= _SEARCH_SURPLUS_M]
    return boxes


def _tool_points(
    placements: list[FloatArray], end: FloatArray, goal: ToolGoal
) -> dict[str, list[Any]]:
    """Return points of the tool, and where they have to be, by name.

    starts
        The points in the frame of the last motion, (points, 3), metres.
    targets
        Where they have to be, in the base's axes, (points, 3), metres.
    tolerances
        How nearly, (points,), metres.

    A goal without an orientation needs one point, the tool's origin. One with an orientation
    needs four: two are on the last joint's axis, which does not move them. The other two are
    beside one of these, one along x and one along y.
    """
    starts = end[:3, 3:]
    if goal.angular == [0, 1, 2]:
        length = sum(np.linalg.norm(place[:3, 3]) for place in [*placements[1:], end])
        # A column for each point: the foot, and it moved along z, x and y.
        around = _SPREAD_SHARE * length * np.array([[0, 0, 1.0, 0], [0, 0, 0, 1], [0, 1, 0, 0]])
        starts = _foot(placements[-1])[:, None] + around
    offsets = end[:3, :3].T @ (starts - end[:3, 3:])
    targets = goal.pose.rotation @ offsets + goal.position[:, None]
    # A rotation by an angle moves a point at a distance r by at most 2 r sin(angle/2).
    spread = 2 * np.sin(goal.pose.angle / 2) * np.linalg.norm(offsets, axis=0)
    near = goal.pose.tolerance + spread + REACHED
    columns = {"starts": starts.T, "targets": targets.T, "tolerances": near}
    return {name: column.tolist() for name, column in columns.items()}


def _foot(last: FloatArray) -> FloatArray:
    """Return the point of the last motion's axis, z, that is nearest to the axis before, (3,).

    `last` is the frame of the last motion in that of the motion before, (4, 4). The axis before
    passes `origin` in the direction `axis`, a unit vector, in the frame of the last motion. Of
    the points (0, 0, h) of z the nearest minimises |p − (p·axis) axis|² of
    p = (0, 0, h) − origin. Its derivative in h is 0 at `height`. Parallel axes have no nearest
    point: the frame's origin stands for it.
    """
    before = np.linalg.inv(last)
    origin, axis = before[:3, 3], before[:3, 2]
    square = axis[0] ** 2 + axis[1] ** 2
    height = (
        origin[2] - axis[2] * (origin[:2] @ axis[:2]) / square
        if square > _PARALLEL_SINE_SQUARED
        else 0.0
    )
    return np.array([0.0, 0.0, height])
