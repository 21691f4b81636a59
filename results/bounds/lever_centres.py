"""Centres whose balls hold all unit tight frames, and the certificate made of them.

A certificate proves that no isotropic 7R arm has all lever arms within a limit. It holds the
centres only: `lockedjoint verify` proves from them that their balls hold all frames, and that
no frame has an arm. The proofs are in lever_cells.md.
"""

import argparse
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.formulations.bounds.certified import best_known
from lockedjoint.formulations.bounds.lever_cells.centres import (
    COLS,
    DIAGONAL,
    ORDERS,
    ROWS,
    SIGNS,
    Centres,
    HalfSpaces,
    upper,
)
from lockedjoint.formulations.bounds.lever_cells.charts import (
    CENTRE_RESIDUAL,
    Chart,
    middles,
    roots,
    tight_chart,
)
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray
from lockedjoint.formulations.bounds.lever_certificate import (
    LeverCertificate,
    VerifiedLevers,
    verify_levers,
)
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.io.files import write_json
from lockedjoint.nlp.arrays import FloatArray

#: The file that is written.
CERTIFICATE = Path(__file__).parent / "certificates" / "isotropic_levers.json"
#: Limit of lever arms that it claims to be impossible.
LIMIT = Fraction(9, 100)
#: Radius of the balls.
RADIUS = 0.25
#: Distance within which a centre has each random sample, at first.
CLOSE = 0.21
#: Number of samples.
SAMPLES = 800
#: Number of random frames of which centres are chosen.
CANDIDATES = 150
#: Number of places on a sphere where holes are looked for at first.
PLACES = 2000
#: Number of these that are kept in each step.
KEPT = 50
#: Number of places near each in the next step.
CHILDREN = 17
#: Lengths of steps on the sphere, in radii.
STEP_LENGTHS = (0.12, 0.07, 0.04, 0.02, 0.01)
#: Difference of traces, to the nearest other centre, below which a place counts as a hole.
GAP = 0.004
#: Length of K within which a better conditioned frame is looked for.
NEARBY = 0.04
#: Distance of Σ ω_iω_iᵀ from (7/3) I up to which random axes are made a tight frame.
NEAR = 0.5
#: Steps of that at most, and the residual at its end.
STEPS = 500
RESIDUAL = 1e-13
#: Orthonormal basis of the symmetric 3×3 matrices of trace 0.
TRACELESS = np.array(
    [
        [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, -2]],
    ]
) / np.sqrt([2, 2, 2, 2, 6]).reshape(5, 1, 1)


def random_frame(rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Return a random unit tight frame W̄ (3,7), and its weight: weighted means are over volume.

    Random axes near a tight frame are made one by alternate projections. The weight is the
    volume by which the map from axes to the traceless part of Σ ω_iω_iᵀ stretches.
    """
    while True:
        axes = rng.normal(size=(3, 7))
        axes /= np.linalg.norm(axes, axis=0)
        if np.linalg.norm(axes @ axes.T - 7 / 3 * np.eye(3)) > NEAR:
            continue
        for _ in range(STEPS):
            left, _, right = np.linalg.svd(axes, full_matrices=False)
            frame = left @ right
            lengths = np.linalg.norm(frame, axis=0)
            if np.abs(lengths**2 - 3 / 7).max() < RESIDUAL:
                return frame, _weight(axes)
            axes = frame / lengths


def _weight(axes: FloatArray) -> float:
    """Return √det DDᵀ, D the derivative of the traceless part of Σ ω_iω_iᵀ along spheres."""
    moves = 2 * TRACELESS @ axes
    moves -= (moves * axes).sum(1, keepdims=True) * axes
    flat = moves.reshape(5, 21)
    return float(np.sqrt(np.linalg.det(flat @ flat.T)))


def distances(centres: Centres, P: FloatArray) -> FloatArray:
    """Return 3 − tr P P_i for projections P (N,7,7) and their nearest image i of each centre.

    In single precision, (N,C).
    """
    samples = upper(P).astype(np.float32)
    signs = (SIGNS[:, ROWS] * SIGNS[:, COLS]).astype(np.float32)
    found = []
    for centre in centres.P:
        orders = centre[ORDERS[:, ROWS], ORDERS[:, COLS]].astype(np.float32)
        nearest = [((samples * one) @ orders.T).max(1) for one in signs]
        found.append(3 - DIAGONAL - 2 * np.max(nearest, 0))
    return np.array(found, float).T


def covering(rng: np.random.Generator) -> list[FloatArray]:
    """Return few random frames that have all samples within `CLOSE`, chosen greedily."""
    samples = np.array([random_frame(rng)[0] for _ in range(SAMPLES)])
    candidates = Centres.of_frames([random_frame(rng)[0] for _ in range(CANDIDATES)], RADIUS)
    within = distances(candidates, np.swapaxes(samples, 1, 2) @ samples) < CLOSE**2
    least = np.array([chart.least for chart in candidates.charts])
    chosen: list[FloatArray] = []
    left = within.any(1)
    while left.any():
        # of equal ones the best conditioned
        best = (within[left].sum(0) + 0.01 * least).argmax()
        chosen.append(candidates.charts[best].W)
        left &= ~within[:, best]
    return chosen


def hole(centres: Centres, a: int, rng: np.random.Generator) -> FloatArray | None:
    """Return a frame near the sphere of centre a that no ball holds by much, or None.

    Places on the sphere are moved at random to where the nearest other centre is farthest, in
    shorter and shorter steps. Then a frame nearby with a great least singular value is taken,
    as boxes around it have sharp bounds.
    """
    chart, half_spaces = centres.charts[a], centres.near(a)
    t = rng.normal(size=(PLACES, 6))
    t *= chart.greatest / np.linalg.norm(t, axis=1, keepdims=True)
    frames, gaps = _on_sphere(chart, half_spaces, t)
    for step in STEP_LENGTHS:
        best = np.argsort(gaps)[:KEPT]
        t = np.tile(t[best], (CHILDREN, 1))
        t[KEPT:] += rng.normal(size=t[KEPT:].shape) * step * chart.greatest
        frames, gaps = _on_sphere(chart, half_spaces, t)
    worst = gaps.argmin()
    if gaps[worst] > GAP:
        return None
    around = tight_chart(frames[worst], NEARBY**2)
    t = rng.normal(size=(CHILDREN, 6)) * NEARBY / np.sqrt(6)
    t[0] = 0
    tried = [tight_chart(W, NEARBY**2) for W in _frames(around, t)[0]]
    return max(tried, key=lambda one: one.least).W


def _frames(chart: Chart, t: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the frames (N,3,7) with coordinates t (N,6), and which of them are tight."""
    z, residual = middles(chart, t, np.zeros_like(t))
    K = (t @ chart.B + z @ chart.C).reshape(-1, 3, 4)
    return roots(K)[1] @ (chart.W + K @ chart.F), residual < CENTRE_RESIDUAL


def _on_sphere(
    chart: Chart, half_spaces: HalfSpaces, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return frames in the directions of t at the level, and how much nearer others are."""
    level, P_c = 3 - RADIUS**2, chart.W.T @ chart.W
    for _ in range(3):
        frames, found = _frames(chart, t)
        traces = ((frames @ P_c) * frames).sum((1, 2))
        t *= np.sqrt((3 - level) / np.maximum(3 - traces, 1e-3))[:, None]
    P = np.swapaxes(frames, 1, 2) @ frames
    gaps = (P.reshape(-1, 49) @ half_spaces.X.reshape(-1, 49).T).max(1)
    return frames, np.where(found, gaps, np.inf)


def centres(seed: int) -> Centres:
    """Return centres whose spheres have no hole that samples find."""
    rng = np.random.default_rng(seed)
    frames = covering(rng)
    a = 0
    while a < len(frames):
        more = hole(Centres.of_frames(frames, RADIUS), a, rng)
        if more is None:
            a += 1
        else:
            frames.append(more)
            print(f"centre {len(frames)} fills a hole on sphere {a + 1}", flush=True)
    return Centres.of_frames(frames, RADIUS)


def lever_bound(
    seed: int, progress: Callable[[str], None], out: Path, executor: Executor
) -> dict[str, Any]:
    """Find centres, write the certificate, and prove it from its file, in hours."""
    start = time.monotonic()
    write_json(out, certificate_of(centres(seed), LIMIT).to_dict())
    found = time.monotonic()
    report = verify_levers(read_any(out), executor=executor, progress=progress)
    seconds = {"centres": found - start, "verification": time.monotonic() - found}
    return plain(report, seconds)


def plain(report: VerifiedLevers, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Return what was proved, in the form of the JSON files of this folder."""
    known = best_known("isotropy", "lever-revolute", 7)
    assert known is not None
    gap = report.claimed - known
    return {
        "quantity": "isotropy",
        "joints": 7,
        "preset": "axes",
        "kind": "rigorous",
        "bound": report.claimed,
        "limit": report.limit,
        "best_known": known,
        "gap": gap,
        "gap_percent": 100 * gap / report.claimed,
        "size": {
            "centres": report.centres,
            "boxes": report.sphere_boxes + report.arm_boxes,
            "certificates": report.certificates,
            "programs": report.programs,
        },
        "how_checked": "branch and bound from the centres in the file of the certificate",
        "seconds": dict(seconds),
    }


def certificate_of(found: Centres, limit: Fraction) -> LeverCertificate:
    """Return the certificate that isotropic arms exceed a limit, with these centres."""
    frames = np.array([chart.W for chart in found.charts])
    return LeverCertificate.of_frames(frames, RADIUS, limit)


def main() -> None:
    """Write the certificate."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--limit", type=Fraction, default=LIMIT, help="of lever arms")
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--out", type=Path, default=CERTIFICATE)
    options = asked.parse_args()
    found = centres(options.seed)
    try:
        certificate = certificate_of(found, options.limit)
    except CertificateError as error:
        asked.error(str(error))
    write_json(options.out, certificate.to_dict())
    print(f"{len(found)} centres are in {options.out}; `lockedjoint verify` proves it.")


if __name__ == "__main__":
    main()
