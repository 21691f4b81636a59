"""Check a proof that a goal is out of reach: ``python -m formulations.recovery.check_proof``.

Of a file, alone with it and NumPy. The box of all positions of the joints is bisected, level by
level: `splits` says of each box at the middle of which joint, or, from -1 downwards, that a
point of the tool misses its target there. The parts in which one does cover the box. Motions
turn about, or slide along, z of their frames, by multiples of the joints' positions; placements
are 3×4, those of the frames in the frames before them.

In a box let c be the middle, and r half the range of a motion. The motions go from c to where
they are one by one, the last one first. At c the point y is off its target along u, and changes
with a motion by y'. Let M be its distance from the axis there, and the chords of the motions
after it; of a slide it is longer than that. A turn takes y by at most its chord, 2 M sin(r/2),
a slide by r; and along u each by at most r (|u·y'| + chords + M r/2), with the chords of the
motions after it: they, and the motion itself, change y' by no more.

Rounding: with A the largest position of a motion, and L all lengths, a motion takes fewer than
100 operations, each wrong by less than 2⁻⁵¹ (1 + A) L. So y and y' of k motions are wrong by
less than 10⁻¹³ k (1 + A) L, and what frames are skew by adds to that. It has to be less than
`LONGER`, by which M is longer: no chord is too short. All other rounding is less than 100 times
as much, which `SURPLUS` pays for.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
#: Metres by which a point has to be farther away than its tolerance, and of rounding.
SURPLUS, LONGER = 1e-6, 1e-8


def check(proof: dict[str, Any]) -> bool:
    """Whether rounding is bounded, and in each box that is left a point misses its target.

    Of what is no proof, no list of boxes for example, it may also raise an error.
    """
    low, high = (np.array(proof[side], dtype=float)[:, None] for side in ("lower", "upper"))
    frames = np.array(proof["placements"])[:, :3, :3]
    skew = np.abs(frames.swapaxes(1, 2) @ frames - np.eye(3)).max()
    most = np.abs(proof["multipliers"]) @ np.maximum(np.abs(low), np.abs(high))
    size = most.sum() + sum(np.abs(proof[k]).sum() for k in ("placements", "starts", "targets"))
    right = (1e-13 + 4 * skew) * len(frames) * (1 + most.max()) * size < LONGER
    for split in [np.array(level, dtype=int) for level in proof["splits"]]:
        right &= split.shape == low.shape[1:] and min(split) >= -len(proof["starts"])
        for point in range(len(proof["starts"])):
            own = split == -1 - point
            right &= np.all(sum(distances(proof, point, low[:, own], high[:, own])) > SURPLUS)
        joint, one = split[split >= 0], np.arange(0, 2 * np.sum(split >= 0), 2)
        low, high = (np.repeat(side[:, split >= 0], 2, axis=1) for side in (low, high))
        high[joint, one] = low[joint, one + 1] = (low[joint, one] + high[joint, one]) / 2
    return bool(right and not low.size)


def distances(proof: Any, point: int, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return by how much a point misses its target at the middle of boxes (n, B), and less.

    Metres, shape (1 + k, B): the distance, less its tolerance, and below 0 what each motion may
    take of it, the last one first.
    """
    share, slides = np.array(proof["multipliers"]), np.array(proof["slides"])
    middle, half = share @ (low + high) / 2, np.abs(share) @ (high - low) / 2
    # The point, and its changes with the motions that are done, in the present frame.
    columns = np.array([*proof["starts"][point], 1.0])[:, None, None] + 0 * low[:1]
    chords, bends = list[FloatArray](), list[FloatArray]()
    for k, r in reversed(list(enumerate(half))):
        turn, shift = (0.0, middle[k]) if slides[k] else (middle[k], 0.0)
        x, y, z, one = columns
        flat = (x + 1j * y) * np.exp(1j * turn)
        columns = np.array([flat.real, flat.imag, z + shift * one, one])
        x, y, z, one = columns[:, :1]
        rate = np.array([0 * x, 0 * x, one, 0 * x] if slides[k] else [-y, x, 0 * x, 0 * x])
        most = np.linalg.norm(rate[:, 0], axis=0) + LONGER + sum(chords)
        bends.append(sum(chords) + most * r / 2)
        chords.append(r if slides[k] else 2 * most * np.sin(np.minimum(r, np.pi) / 2))
        columns = np.append(columns, rate, axis=1)
        columns[:3] = np.tensordot(proof["placements"][k], columns, 1)
    off = (columns[:3, 0].T - proof["targets"][point]).T
    far = np.linalg.norm(off, axis=0)
    along = np.abs(np.einsum("ib,ikb->kb", off / np.maximum(far, 1e-300), columns[:3, 1:]))
    taken = np.minimum(chords, half[::-1] * (along + bends))
    return np.vstack([far - proof["tolerances"][point], -taken])


if __name__ == "__main__":
    if not check(json.loads(Path(sys.argv[1]).read_text("utf-8"))):
        sys.exit("not proved")
    print("proved")
