"""Check a proof that a goal is out of reach: ``python -m formulations.recovery.check_proof``.

Of a file, alone with it and python-flint, in ball arithmetic; `unreachable` has the
mathematics. Bisection covers the box of all positions by construction, so the leaves are all
that is checked. Placements in the file are taken for rotations; what rounding they have is
within `SURPLUS`.
"""

import json
import sys
from collections import deque
from pathlib import Path
from typing import Any

from flint import arb, arb_mat

SURPLUS = 1e-10


def check(proof: dict[str, Any]) -> int:
    """Return the number of leaves; ValueError if in one of them no point misses its target."""
    boxes, leaves = deque([(proof["lower"], proof["upper"])]), 0
    for split in proof["splits"]:
        low, high = boxes.popleft()
        if split < 0:
            if not any(misses(proof["motions"], each, low, high) for each in proof["points"]):
                raise ValueError(f"no point misses its target from {low} to {high}")
            leaves += 1
            continue
        middle = (low[split] + high[split]) / 2
        boxes.append((low, [*high[:split], middle, *high[split + 1 :]]))
        boxes.append(([*low[:split], middle, *low[split + 1 :]], high))
    if boxes:
        raise ValueError(f"{len(boxes)} boxes are left over")
    return leaves


def misses(motions: Any, point: Any, low: list[float], high: list[float]) -> bool:
    """Whether a point misses its target everywhere in a box."""
    ball = at = column(point["start"])
    radius = arb(0)
    moved: list[tuple[Any, ...]] = []  # slope, M and half width, the tip's first
    turning = not motions[0]["prismatic"]
    for motion in reversed(motions[1:] if turning else motions):
        middle, half = interval(motion, low, high)
        axis, frame = unit(motion["axis"]), arb_mat(motion["placement"])
        if motion["prismatic"]:
            ball, at, radius = ball + axis * middle, at + axis * middle, radius + half
            slope, far = axis, arb(1)
        else:
            turn, along = rotation(axis, middle), axis * dot(axis, ball)
            far = size(ball - along)
            narrow = half.min(arb.pi() / 2)
            ball = along + turn * (ball - along) * narrow.cos()
            radius, far = radius + far * narrow.sin(), far + radius
            at = turn * at
            slope = cross(axis) * at
            moved = [(turn * other, *rest) for other, *rest in moved]
        moved.append((slope, far, half))
        shift = column([frame[k, 3] for k in range(3)])
        turn = arb_mat(3, 3, [frame[i, j] for i in range(3) for j in range(3)])
        ball, at = turn * ball + shift, turn * at + shift
        moved = [(turn * other, *rest) for other, *rest in moved]
    target, frame, half, middle = column(point["target"]), column([0, 0, 1]), arb(0), arb(0)
    if turning:
        place = arb_mat(motions[0]["placement"])
        turn = arb_mat(3, 3, [place[i, j] for i in range(3) for j in range(3)])
        target = turn.transpose() * (target - column([place[k, 3] for k in range(3)]))
        frame = unit(motions[0]["axis"])
        middle, half = interval(motions[0], low, high)
    arc = rotation(frame, -middle) * target
    enough = arb(point["tolerance"]) + arb(SURPLUS)
    height = dot(frame, arc)
    across, off = arc - frame * height, ball - frame * dot(frame, ball)
    share = cosine(frame, across, off, half)
    gap = (dot(frame, ball) - height) ** 2 + size(off) ** 2 + size(across) ** 2
    gap -= 2 * size(off) * size(across) * share
    if gap.lower() > 0 and (gap.sqrt() - radius).lower() > enough.upper():
        return True
    # Any direction will do: towards the target's nearest place, by plain numbers.
    off = at - frame * dot(frame, at)
    turned = angle(frame, across, off).mid()
    turned = turned.max(-half.mid()).min(half.mid()) if turned.is_finite() else arb(0)
    nearest = rotation(frame, turned) * arc
    wanted = [float((at - nearest)[k, 0].mid()) for k in range(3)]
    if not any(wanted):
        return False
    direction = unit(wanted)
    least, before = dot(direction, at), arb(0)
    for slope, far, half_width in reversed(moved):
        least -= abs(dot(direction, slope)) * half_width
        least -= far * half_width * (half_width / 2 + before)
        before += half_width
    own = direction - frame * dot(frame, direction)
    most = dot(frame, direction) * height
    most += size(own) * size(across) * cosine(frame, across, own, half)
    return bool((least - most).lower() > enough.upper())


def interval(motion: Any, low: list[float], high: list[float]) -> tuple[arb, arb]:
    """Return middle and half width of a motion's values."""
    a, b = (arb(motion["multiplier"]) * arb(side[motion["joint"]]) for side in (low, high))
    return (a + b) / 2 + arb(motion["offset"]), abs(b - a) / 2


def cosine(axis: arb_mat, first: arb_mat, second: arb_mat, half: arb) -> arb:
    """Return the largest cosine of a vector and another, which turns by up to a half width."""
    off = abs(angle(axis, first, second))
    largest = (off.min(2 * arb.pi() - off) - half).max(arb(0)).cos()
    return largest if largest.is_finite() else arb(1)  # a vector along the axis has no angle


def angle(axis: arb_mat, first: arb_mat, second: arb_mat) -> arb:
    """Return the angle about an axis from a vector across it to another, -π to π."""
    return arb.atan2(dot(cross(axis) * first, second), dot(first, second))


def column(entries: Any) -> arb_mat:
    """Return a vector."""
    return arb_mat(3, 1, [arb(entry) for entry in entries])


def dot(a: arb_mat, b: arb_mat) -> arb:
    """Return a product of vectors."""
    return (a.transpose() * b)[0, 0]


def size(vector: arb_mat) -> arb:
    """Return the length of a vector."""
    square = dot(vector, vector)
    return square.sqrt() if square.lower() > 0 else arb(0).union(square.abs_upper().sqrt())


def unit(entries: Any) -> arb_mat:
    """Return a vector of length 1."""
    return column(entries) / size(column(entries))


def cross(axis: arb_mat) -> arb_mat:
    """Return the matrix of the vector product with an axis."""
    x, y, z = (axis[k, 0] for k in range(3))
    return arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rotation(axis: arb_mat, angle: arb) -> arb_mat:
    """Return a rotation about a unit axis, by Rodrigues' formula."""
    turn = cross(axis)
    return arb_mat(3, 3, [int(i == j) for i in range(3) for j in range(3)]) + (
        turn * angle.sin() + turn * turn * (1 - angle.cos())
    )


if __name__ == "__main__":
    print(f"proved: {check(json.loads(Path(sys.argv[1]).read_text('utf-8')))} leaves")
