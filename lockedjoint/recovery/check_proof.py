"""Check a proof that a goal is out of reach: ``python -m lockedjoint.recovery.check_proof``.

Of a file, alone with it and NumPy. The box of all positions of the joints is bisected as the
file says; the parts that are left cover it. In each of them one point of the tool has to stay
away from its target t. Motions are about or along z of their frames, by the middle of the part
and at most r to both sides. After each motion, from the last to the first, the point is at

    c + Σ g_k ε_k + e,    |ε_k| ≤ 1,  |e| ≤ R,

* *a turn by r ≤ 1*: what c is off the axis, c', becomes a new g, at right angles and of length
  r|c'|. Beside it are less than r²|c'|/2, and r|g_k'| for each g_k: they are added to R.
* *a turn by more*: c and all g_k go to the axis, and R grows by the lengths |c'| and |g_k'|.
* *a slide* is a new g along the axis.

Along the direction u from t to c the point is at least |c − t| − Σ |u·g_k| − R away from t.

Rounding: with 20 motions, and lengths and angles of at most 20, no sum is above 10⁶, of terms
each wrong by less than 100 units of 2⁻⁵³, or 10⁻¹⁴ for a frame that is not quite orthogonal;
in all less than 3·10⁻⁷. `SURPLUS` pays for that.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: A point has to be so many metres farther away than its tolerance.
SURPLUS = 1e-6
# The rounding stated above is bounded up to these: so many motions, numbers in metres or
# radians, and entries of RᵀR − 1 of a frame's rotation R. If one is larger, `SURPLUS` may be
# too small.
_MOST_MOTIONS = 20
_LARGEST_NUMBER = 20
_LARGEST_SKEW = 1e-14
# About so many boxes are evaluated together: more need more memory.
_BOXES_AT_ONCE = 20_000
# A distance in metres that is not 0, by which it is safe to divide.
_TINY_M = 1e-300


def check(proof: dict[str, Any]) -> int:
    """Return the number of leaves; ValueError if in one of them no point misses its target.

    The keys of a proof are those of `unreachable.upright_motions`, the limits `lower` and
    `upper`, (n,), in rad or m, and `splits`, (boxes,): for each box, level by level, the joint
    at whose middle it is bisected, or −1 for a leaf. Of two halves the lower one comes first.
    """
    require_claim(proof)
    require_bounded_rounding(proof)
    low, high = (np.array(proof[side], dtype=float)[:, None] for side in ("lower", "upper"))
    splits, leaves = np.array(proof["splits"], dtype=int), 0
    while low.size:
        split, splits = splits[: low.shape[1]], splits[low.shape[1] :]
        ends, parts = np.flatnonzero(split < 0), np.flatnonzero(split >= 0)
        points = range(len(proof["starts"]))
        for own in np.array_split(ends, 1 + len(ends) // _BOXES_AT_ONCE):
            away = [distances(proof, point, low[:, own], high[:, own]) for point in points]
            if len(split) < low.shape[1] or not np.all(np.max(away, axis=0) > SURPLUS):
                raise ValueError("boxes are left over, or no point misses its target from one")
        leaves += len(ends)
        joint, one = split[parts], np.arange(0, 2 * len(parts), 2)
        low, high = (np.repeat(side[:, parts], 2, axis=1) for side in (low, high))
        high[joint, one] = low[joint, one + 1] = (low[joint, one] + high[joint, one]) / 2
    if not leaves or len(splits):
        raise ValueError("there is no box, or more are split than there are")
    return leaves


def require_claim(proof: dict[str, Any]) -> None:
    """Raise ValueError unless shapes agree, numbers are finite, and the claim is not empty.

    There are n ≥ 1 joints with lower ≤ upper limits, motions, points, and tolerances ≥ 0.
    """
    names = ("lower", "upper", "multipliers", "placements", "starts", "targets", "tolerances")
    try:
        numbers = [array(proof[name], (int, float)) for name in names]
        splits, slides = array(proof["splits"], (int,)), array(proof["slides"], (bool,))
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"{error} is missing, or no row of numbers") from None
    lower, upper, multipliers, frames, *points = numbers
    n, motions, count = len(lower), len(frames), len(points[0])
    shapes = ((n,), (n,), (motions, n), (motions, 3, 4), (count, 3), (count, 3), (count,))
    found = [each.shape for each in (lower, upper, multipliers, frames, *points)]
    if not min(n, motions, count) or found != list(shapes) or slides.shape != (motions,):
        raise ValueError("numbers of joints, motions or points are 0, or do not agree")
    if splits.ndim != 1 or not np.all(splits < n):
        raise ValueError("boxes are split along joints that are not there")
    if not np.all(lower <= upper) or not np.all(points[2] >= 0):
        raise ValueError("a lower limit is above the upper one, or a tolerance is below 0")


def array(rows: Any, kinds: tuple[type, ...]) -> Array:
    """Return rows of JSON as an array; TypeError unless all entries are finite, of a kind."""
    entries = [rows]
    while entries:
        entry = entries.pop()
        if isinstance(entry, list):
            entries += entry
        elif type(entry) not in kinds or not np.isfinite(entry):
            raise TypeError(f"{entry!r:.40}")
    return np.array(rows, dtype=float)


def require_bounded_rounding(proof: dict[str, Any]) -> None:
    """Raise ValueError unless rounding is below `SURPLUS`."""
    frames, limits = np.array(proof["placements"]), (proof["lower"], proof["upper"])
    travel = np.abs(proof["multipliers"]) @ np.max(np.abs(limits), axis=0)
    numbers = (frames, travel, proof["starts"], proof["targets"])
    skew = np.abs(frames[:, :, :3].swapaxes(1, 2) @ frames[:, :, :3] - np.eye(3)).max()
    largest = max(np.max(np.abs(each)) for each in numbers)
    if largest > _LARGEST_NUMBER or len(frames) > _MOST_MOTIONS or skew > _LARGEST_SKEW:
        raise ValueError("rounding is not bounded")


def distances(proof: dict[str, Any], point: int, low: Array, high: Array) -> Array:
    """Return how far a point misses its target at least in boxes (n, B), metres, (B,).

    It is below 0 if the point may be there. `form` has the columns c, g_1, g_2, … of the text
    above, (4, columns, B): rows x, y, z, and 1 for c or 0 for a g. `rest` is R, (B,).
    """
    multipliers, turns = np.array(proof["multipliers"]), ~np.array(proof["slides"], dtype=bool)
    middle, half = multipliers @ (low + high) / 2, np.abs(multipliers) @ (high - low) / 2
    form = np.multiply.outer([*proof["starts"][point], 1.0], np.ones((1, low.shape[1])))
    rest = np.zeros(low.shape[1])
    for k in reversed(range(len(multipliers))):
        angle, slide = half[k] * turns[k], half[k] * ~turns[k]
        # x + iy of all columns, turned about z by the middle of the part.
        flat = (form[0] + 1j * form[1]) * np.exp(1j * middle[k] * turns[k])
        lever, flat = np.abs(flat), np.where(angle > 1, 0.0, flat)
        small = angle * (angle / 2 * lever[0] + np.sum(lever[1:], axis=0))
        rest = rest + np.where(angle > 1, np.sum(lever, axis=0), small)
        form[0], form[1], form[2, 0] = flat.real, flat.imag, form[2, 0] + middle[k] * ~turns[k]
        new = np.array([-flat[0].imag * angle, flat[0].real * angle, slide, 0 * slide])
        form = np.append(form, new[:, None], axis=1)
        form[:3] = np.tensordot(proof["placements"][k], form, 1)
    off = form[:3, 0] - np.reshape(proof["targets"][point], (3, -1))
    far = np.linalg.norm(off, axis=0)
    along = np.abs(np.sum(off[:, None] / np.maximum(far, _TINY_M) * form[:3, 1:], axis=0))
    return np.asarray(far - along.sum(axis=0) - rest - proof["tolerances"][point])


if __name__ == "__main__":
    print(f"proved: {check(json.loads(Path(sys.argv[1]).read_text('utf-8')))} leaves")
