"""Check a proof that a goal is out of reach: ``python -m formulations.recovery.check_proof``.

Of a file, alone with it and NumPy. The box of all positions of the joints is bisected as the
file says; the parts that are left cover it. In each of them a point y of the tool has to stay
away from its target t. Motions are about or along z of their frames; the first one turns, and
t is in its frame. In a part let c be the middle, and r_k half the range of motion k:

* *ball*: a ball holds y whatever the last motions do. About an axis its centre goes to the
  axis, and its radius grows by the distance, to R_k: y is at most R_k from axis k.
* *slope*: let the motions go from c to where they are one by one, the last one first. Along a
  direction u motion k takes y by at most the lesser of its chord, 2 M_k sin(r_k/2), and
  r_k (|u·∂y/∂q_k| + chords + M_k r_k/2), with the slope at c and the chords of motions after k.
  M_k is the most that y is from axis k: the lesser of R_k and of what it is at c and those
  chords. The first motion turns t instead, backwards, along an arc about z.

Rounding: with W the most that all positions can add up to, and L all lengths, no number is
more than (L + W)(1 + W)². A motion takes fewer than 100 operations, each wrong by less than
2⁻⁵¹ of that; so 20 motions are wrong by less than 10⁻¹² of it. `SURPLUS` pays for that.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
#: Metres by which a point has to be farther away than its tolerance.
SURPLUS = 1e-7
# Boxes that are looked at together.
_TOGETHER = 20_000


def check(proof: dict[str, Any]) -> int:
    """Return the number of leaves; ValueError if in one of them no point misses its target."""
    if not 1e-12 * largest_number(proof) < SURPLUS:
        raise ValueError("the first motion slides, or rounding is not bounded")
    low, high = (np.array(proof[side], dtype=float)[:, None] for side in ("lower", "upper"))
    splits, leaves = np.array(proof["splits"], dtype=int), 0
    while low.size:
        split, splits = splits[: low.shape[1]], splits[low.shape[1] :]
        ends, parts = np.flatnonzero(split < 0), np.flatnonzero(split >= 0)
        for own in np.split(ends, range(_TOGETHER, len(ends), _TOGETHER)):
            away = [
                distances(proof["motions"], point, low[:, own], high[:, own])[0]
                - point["tolerance"]
                for point in proof["points"]
            ]
            if not np.all(np.max(away, axis=0) > SURPLUS):
                raise ValueError("no point misses its target from one of the boxes")
        if len(split) < low.shape[1]:
            raise ValueError("boxes are left over")
        leaves += len(ends)
        joint, one = split[parts], np.arange(0, 2 * len(parts), 2)
        low, high = (np.repeat(side[:, parts], 2, axis=1) for side in (low, high))
        high[joint, one] = low[joint, one + 1] = (low[joint, one] + high[joint, one]) / 2
    return leaves


def largest_number(proof: dict[str, Any]) -> float:
    """Return what no number is larger than; infinite where that says nothing of rounding."""
    motions, points = proof["motions"], proof["points"]
    placements = np.array([motion["placement"] for motion in motions])
    frames, shifts = placements[:, :3, :3], placements[:, :3, 3]
    skew = np.abs(frames.swapaxes(1, 2) @ frames - np.eye(3)).max()
    if motions[0]["prismatic"] or len(motions) > 20 or skew > 1e-14:
        return np.inf
    farthest = np.maximum(np.abs(proof["lower"]), np.abs(proof["upper"]))
    travel = sum(
        abs(m["multiplier"]) * farthest[m["variable"]] + abs(m["offset"]) for m in motions
    )
    ends = sum(np.linalg.norm(point[end]) for point in points for end in ("start", "target"))
    lengths = ends + np.sum(np.linalg.norm(shifts, axis=1))
    return float((lengths + travel) * (1 + travel) ** 2)


def distances(
    motions: Any, point: Any, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, list[FloatArray]]:
    """Return how far a point is at least from its target in boxes (n, B), metres, (B,).

    And the most that each motion moves it, against the target, (B,) each.
    """
    here, frame, moved = np.zeros((3, low.shape[1])), np.eye(3)[:, :, None], []
    for motion in motions:
        place, slides = np.array(motion["placement"]), motion["prismatic"]
        low_end, high_end = (
            motion["multiplier"] * side[motion["variable"]] for side in (low, high)
        )
        middle, half = (low_end + high_end) / 2, np.abs(high_end - low_end) / 2
        middle = middle + motion["offset"]
        here = here + np.tensordot(place[:3, 3], frame, 1)
        x, y, z = np.tensordot(place[:3, :3].T, frame, 1)
        moved.append((place, slides, middle, half, here, z))
        if slides:
            here = here + middle * z
        else:
            cosine, sine = np.cos(middle), np.sin(middle)
            x, y = cosine * x + sine * y, cosine * y - sine * x
        frame = np.stack(np.broadcast_arrays(x, y, z))
    tip = here + np.tensordot(point["start"], frame, 1)

    # The nearest place of the target on its arc about z; the direction u from there, and along
    # it the farthest place.
    target, arc = np.array(point["target"]), moved[0][3]
    start, radius = target[0] + 1j * target[1], np.hypot(target[0], target[1])
    turn = np.clip(np.angle((tip[0] + 1j * tip[1]) * np.conj(start)), -arc, arc)
    nearest = start * np.exp(1j * turn)
    u = tip - [nearest.real, nearest.imag, np.full_like(arc, target[2])]
    u = u / np.maximum(np.linalg.norm(u, axis=0), 1e-300)
    beside = np.maximum(np.abs(np.angle((u[0] + 1j * u[1]) * np.conj(start))) - arc, 0.0)
    farthest = u[2] * target[2] + radius * np.hypot(u[0], u[1]) * np.cos(beside)

    slope, ball, spread = np.sum(u * tip, axis=0) - farthest, np.array([point["start"]]).T, 0.0
    chords, moves = 0.0, []
    for place, slides, middle, half, origin, z in reversed(moved[1:]):
        (a, b, c), (x, y, w) = z, tip - origin
        rate = z if slides else np.array([b * w - c * y, c * x - a * w, a * y - b * x])
        if slides:
            ball, spread = ball + np.outer([0, 0, 1], middle), spread + half
            most, chord = 1.0, half
        else:
            ball, spread = ball * [[0], [0], [1]], spread + np.hypot(ball[0], ball[1])
            most = np.minimum(spread, np.linalg.norm(rate, axis=0) + chords)
            chord = 2 * most * np.sin(np.minimum(half, np.pi) / 2)
        along = half * (np.abs(np.sum(u * rate, axis=0)) + chords + most * half / 2)
        slope, chords = slope - np.minimum(chord, along), chords + chord
        moves.append(most * half)
        ball = place[:3, :3] @ ball + place[:3, 3:]
    ring = np.hypot(np.hypot(ball[0], ball[1]) - radius, ball[2] - target[2]) - spread
    return np.maximum(slope, ring), [radius * arc, *reversed(moves)]


if __name__ == "__main__":
    print(f"proved: {check(json.loads(Path(sys.argv[1]).read_text('utf-8')))} leaves")
