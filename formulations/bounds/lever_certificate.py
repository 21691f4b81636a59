"""A certificate that isotropic 7R arms with short lever arms do not exist, and its proof.

An isotropic Jacobian of seven revolute joints, scaled so that |ω_i| = 1, has JJᵀ = (7/3) I and
columns of |j_i|² = 1 + |v_i|². Its squared worst case after one locked joint is
7/3 − max |j_i|². If no such arm has all |v_i|² − 1 within a limit A, no worst case σ is above
√(1/3 − A). W̄ = √(3/7) (ω_1, …, ω_7) is a unit tight frame, and A is excluded frame by frame.

The certificate holds centres only. `verify_levers` proves that their balls hold all frames
(`lever_cells.regions`), and that no frame has an arm (`lever_cells.arms`). What it computes
does not depend on how the centres were found.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.arms import arms_excluded
from lockedjoint.formulations.bounds.lever_cells.centres import Centres
from lockedjoint.formulations.bounds.lever_cells.regions import Region, Tally, sphere
from lockedjoint.formulations.bounds.rational_roots import root_above
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.reading import Part
from lockedjoint.nlp.arrays import FloatArray, one_blas_thread
from lockedjoint.nlp.executors import in_groups

#: What the file says that it is.
FORMAT = "lockedjoint-levers-1"
#: The quantity that is bounded, as the file names it.
QUANTITY = "isotropic lever arms"
#: Keys of a file, in order.
FIELDS = ("format", "quantity", "joints", "limit", "bound", "radius", "frames")
#: Number of joints that the proof is about.
JOINTS = 7
#: Largest limit A of a file. Of the best arm that is known A is 0.10257.
LARGEST_LIMIT = Fraction(11, 100)
#: Radii of balls that a file may have: far smaller or larger ones would take for ever.
RADII = (0.1, 0.35)
#: Largest number of centres of a file.
MOST_CENTRES = 500
#: Largest distance of W̄W̄ᵀ from I, and of |w̄_i|² from 3/7, in a file.
TIGHT = 1e-9
#: Two tasks of each centre: its sphere and the arms in its ball.
Task: TypeAlias = Literal["sphere", "arms"]


@dataclass(frozen=True, eq=False)
class LeverCertificate:
    """Centres from which it is proved that isotropic 7R arms have |v_i|² − 1 > A for some i.

    Attributes
    ----------
    limit
        A, a rational number from 0 to `LARGEST_LIMIT`.
    bound
        What no worst case σ is above: at least √(1/3 − A).
    radius
        Radius R of the balls tr P P_c ≥ 3 − R².
    frames
        The centres, unit tight frames, (C,3,7).

    Raises
    ------
    CertificateError
        If it is ill-formed.
    """

    limit: Fraction
    bound: float
    radius: float
    frames: FloatArray

    def __post_init__(self) -> None:
        if not 0 <= self.limit <= LARGEST_LIMIT:
            raise CertificateError(f"limit: {self.limit} is not from 0 to {LARGEST_LIMIT}.")
        if not RADII[0] <= self.radius <= RADII[1]:
            raise CertificateError(
                f"radius: {self.radius} is not from {RADII[0]} to {RADII[1]}."
            )
        proved = Fraction(1, 3) - self.limit
        if not 0 <= self.bound < np.inf or Fraction(self.bound) ** 2 < proved:
            raise CertificateError(
                f"bound: {self.bound} does not follow; it is less than √(1/3 − {self.limit})."
            )
        if self.frames.shape[1:] != (3, JOINTS) or not 1 <= len(self.frames) <= MOST_CENTRES:
            raise CertificateError(f"frames: the shape {self.frames.shape} is not (C, 3, 7).")
        gram = self.frames @ np.swapaxes(self.frames, 1, 2)
        off = np.abs(gram - np.eye(3)).max((1, 2))
        off = np.maximum(off, np.abs((self.frames**2).sum(1) - 3 / 7).max(1))
        # NaN fails this, too.
        for k in np.flatnonzero(~(off <= TIGHT))[:1]:
            raise CertificateError(
                f"frames: [{k}] is no unit tight frame, off by {off[k]:.1e}."
            )

    @classmethod
    def of_frames(cls, frames: FloatArray, radius: float, limit: Fraction) -> LeverCertificate:
        """Return a certificate that claims what follows from a limit."""
        return cls(limit, root_above(Fraction(1, 3) - limit), radius, frames)

    @classmethod
    def read(cls, part: Part) -> LeverCertificate:
        """Return the certificate in a JSON value, or raise CertificateError."""
        form, quantity, joints, limit, bound, radius, frames = part.fields(*FIELDS)
        for one, known in ((form, FORMAT), (quantity, QUANTITY)):
            if one.value != known:
                one.refuse(f"it is not {known!r}")
        joints.whole(range(JOINTS, JOINTS + 1))
        rows = [
            [
                [entry.number(1.0) for entry in row.items(range(7, 8))]
                for row in W.items(range(3, 4))
            ]
            for W in frames.items(range(1, MOST_CENTRES + 1))
        ]
        return cls(limit.rational(), bound.number(1.0), radius.number(1.0), np.array(rows))

    def to_dict(self) -> dict[str, Any]:
        """Return its fields in the file."""
        return {
            "format": FORMAT,
            "quantity": QUANTITY,
            "joints": JOINTS,
            "limit": str(self.limit),
            "bound": self.bound,
            "radius": self.radius,
            "frames": self.frames.tolist(),
        }


@dataclass(frozen=True)
class VerifiedLevers:
    """What was proved from a certificate.

    Attributes
    ----------
    claimed
        The bound on σ, as the certificate states it.
    limit
        The limit A that is excluded.
    centres
        Number of centres.
    sphere_boxes, arm_boxes
        Numbers of boxes on the spheres, and in the balls.
    certificates
        Number of boxes in balls that multipliers exclude.
    programs
        Number of semidefinite programs for these.
    """

    claimed: float
    limit: str
    centres: int
    sphere_boxes: int
    arm_boxes: int
    certificates: int
    programs: int


def verify_levers(
    certificate: LeverCertificate,
    *,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> VerifiedLevers:
    """Prove what a certificate states: first that the balls hold all frames, then the rest.

    Parameters
    ----------
    certificate
        What is to be proved.
    executor
        Where trees are computed; by default in this process.
    progress
        A function that is told how far it is.

    Raises
    ------
    CertificateError
        If a ball or a sphere is not excluded.
    """
    found: dict[Task, Tally] = {"sphere": Tally(), "arms": Tally()}
    for task, total in found.items():
        calls = [(certificate, k, task) for k in range(len(certificate.frames))]
        for k, tally in in_groups(_tree, calls, executor, progress, f"trees ({task})"):
            if tally.left:
                what = "on the sphere" if task == "sphere" else "in the ball"
                raise CertificateError(
                    f"frames: {tally.left} boxes {what} of centre {k} are not excluded."
                )
            total.add(tally)
    arms = found["arms"]
    return VerifiedLevers(
        claimed=certificate.bound,
        limit=str(certificate.limit),
        centres=len(certificate.frames),
        sphere_boxes=found["sphere"].nodes,
        arm_boxes=arms.nodes,
        certificates=arms.certificates,
        programs=arms.programs,
    )


@one_blas_thread()
def _tree(certificate: LeverCertificate, k: int, task: Task) -> tuple[int, Tally]:
    """Return the tree of one centre, and its number."""
    try:
        centres = Centres.of_frames(certificate.frames, certificate.radius)
    except ValueError as error:
        raise CertificateError(f"frames: {error}.") from None
    region = Region.of(centres, k)
    if task == "sphere":
        return k, sphere(region)
    # A limit that is rounded up excludes more.
    limit = float(certificate.limit)
    if limit < certificate.limit:
        limit = float(np.nextafter(limit, 1.0))
    return k, arms_excluded(region, limit)
