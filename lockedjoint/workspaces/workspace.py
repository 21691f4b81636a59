"""What failures leave of the workspace: its size, how far that may be off, and the check.

See `reachable_sets` for the definition. Planar arms of three joints without physical limits
are measured in closed form, `planar`; others on a grid. The grid is not exact at its surface,
so the size is that of its voxels and a layer about them, times the share of a random sample of
points in these for which inverse kinematics finds every configuration that is needed. With a
fixed orientation each voxel stands for one random point in it, `pose_sets`, and the size is
that of its voxels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.serial_chain import (
    Bits,
    Ranges,
    at_zero,
    frames_of,
    link_lengths,
    moved,
    physical_ranges,
)
from lockedjoint.nlp.arrays import FloatArray, finite_or_none
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step, part_of
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets
from lockedjoint.workspaces.planar import closed_form
from lockedjoint.workspaces.reachable_sets import ReachableSets

# This share of a measurement is done when all sets are swept; then come the sampled points.
_SWEPT_SHARE = 0.7
#: Inverse kinematics checks so many points.
_SAMPLE_POINTS = 400
#: Inverse kinematics checks so many points with a fixed orientation: they only confirm.
_SAMPLE_POSES = 60
# A set of which nothing was found may fill so many voxels.
_UNSEEN_VOXELS = 3
# The error is so many standard errors of a sample.
_STANDARD_ERRORS = 3
# So many layers of voxels about those of the grid are looked at, too.
_LAYERS_AROUND = 1
# The share that passes is given for so many depths below the surface, in voxels.
_DEPTHS_SHOWN = 4
# The corners are those of a voxel's side towards x, seen from outside; others are turned.
_SIDE = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]])
# Two triangles of these corners make a side.
_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
# The file in PLY begins with this header.
_PLY = """ply
format binary_little_endian 1.0
comment kept after any failure, in metres
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Workspace:
    """The failure-tolerant workspace of an arm.

    Attributes
    ----------
    arm
        The arm.
    limits
        Artificial limits of the joints, in radians or metres.
    dimension
        2 for an area, 3 for a volume.
    size, error
        Area or volume in m² or m³, and how far it may be from the truth: of the quadrature, or
        three standard errors of the sample, of points in the voxels and in those about them.
        Where nothing was found it is three voxels: of a set that is larger, random points in
        all voxels miss every part with a chance of 5 % at most (e⁻³). It says nothing about
        configurations that the inverse kinematics missed.
    raw
        The same of all voxels: too large, and with a fixed orientation the size itself.
    before
        Size of what is reached within the artificial limits, if no joint fails, raw.
    physical
        The same within the physical limits.
    critical
        Joints whose own failures, somewhere within their artificial limits, leave nothing.
    passed
        Share of the sampled points that pass inverse kinematics, before the failure and after
        every one, by their depth below the surface: 0, 1, 2 voxels, or more. Empty in closed
        form.
    sets
        The reachable sets.
    """

    arm: Chain
    limits: Ranges
    dimension: int
    size: float
    error: float
    raw: float
    before: float
    physical: float
    critical: tuple[str, ...]
    passed: tuple[float, ...]
    sets: FailureSets

    @property
    def voxels(self) -> Bits:
        """Which voxels are in the workspace, before layers are removed."""
        return self.sets.before(self.limits) & self.sets.after(self.limits)

    @property
    def method(self) -> str:
        """``closed form``, ``grid``, or ``self-motion`` if the orientation is fixed."""
        if self.sets.sampled:
            return "self-motion"
        closed = self.sets.clearance is None and closed_form(self.arm, self.limits)
        return "closed form" if closed else "grid"

    @property
    def collisions(self) -> str:
        """What does without configurations in which links are too near.

        ``not checked``; ``none`` in all numbers and voxels, if the orientation is fixed; or
        ``none in the size only``, and its error: voxels and all other sizes are of the grid,
        which disregards them.
        """
        if self.sets.clearance is None:
            return "not checked"
        return "none" if self.sets.sampled else "none in the size only"

    @property
    def share(self) -> float:
        """What is kept of what is reached within the physical limits, 0 to 1."""
        return self.size / self.physical if self.physical else 0.0

    def __repr__(self) -> str:
        """Say in one line how much is kept whichever joint locks."""
        unit = "m²" if self.dimension == 2 else "m³"
        return f"<Workspace: {self.size:.4g} ± {self.error:.1g} {unit}, {self.method}>"

    def to_dict(self) -> dict[str, object]:
        """Return the result as plain values."""
        names, apart = [joint.name for joint in self.arm.joints], self.sets.clearance
        return {
            "quantity": "area" if self.dimension == 2 else "volume",
            "size": self.size,
            "error": self.error,
            "method": self.method,
            "collisions": self.collisions,
            **({"unchecked_links": list(apart.unchecked)} if apart else {}),
            "without_failure": self.before,
            "without_failure_and_artificial_limits": self.physical,
            "share_kept": self.share,
            "critical": list(self.critical),
            "limits": {k: list(v) for k, v in zip(names, self.limits, strict=True)},
            "links": dict(zip(names, link_lengths(self.arm).tolist(), strict=True)),
            "voxel": self.sets.voxel,
            "slice": self.sets.step,
            "raw": self.raw,
            "passed_by_depth": [finite_or_none(share) for share in self.passed],
        }

    def points_file(self) -> bytes:
        """Return an NPZ file: what is kept whichever joint locks.

        It has `points`, one for each voxel, shape (k, 3), in metres along the axes of the
        base: its centre, or with a held orientation the random point that was tried; `voxels`,
        the grid as truth values; `frame`, the placement of the grid in the base, shape (4, 4),
        in which the first voxel's centre is at `first`; `edge`, that of a voxel; and
        `dimension`.
        """
        sets, voxels, frame = self.sets, self.voxels, frames_of(self.arm)[0]
        file = BytesIO()
        np.savez_compressed(
            file,
            points=moved(frame, sets.kept_points(voxels)),
            voxels=voxels,
            frame=frame,
            first=sets.corner * sets.voxel,
            edge=sets.voxel,
            dimension=sets.dimension,
        )
        return file.getvalue()

    def mesh_file(self) -> bytes:
        """Return a PLY file: the surface of the voxels that are kept; of a plane, one layer.

        Along the axes of the base, in metres.
        """
        sets = self.sets
        voxels = self.voxels if sets.dimension == 3 else self.voxels[:, :, None]
        corners, faces = surface_of_voxels(voxels)
        places = np.asarray((corners - 0.5) * sets.voxel, dtype=np.float64)
        places[:, : sets.dimension] += sets.corner * sets.voxel
        places[:, sets.dimension :] += at_zero(self.arm).end_effector[sets.dimension :]
        rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
        rows["count"], rows["corners"] = 3, faces
        head = _PLY.format(vertices=len(places), faces=len(faces)).encode("ascii")
        vertices = moved(frames_of(self.arm)[0], places).astype("<f4")
        return head + vertices.tobytes() + rows.tobytes()


def workspace(
    arm: Chain,
    limits: Ranges,
    voxel: float,
    step: float = SLICE_RAD,
    progress: Progress = lambda _: None,
    clearance: LinkClearance | None = None,
    seed: int = 0,
) -> Workspace:
    """Measure the failure-tolerant workspace of an arm, with any orientation of its tool.

    See `ReachableSets` for voxel and step. With a clearance, of the chain that the arm is of,
    configurations in which links are too near do not count. The seed is of the points that are
    sampled, and of the starts of inverse kinematics. InputError if a limit is outside
    the physical ones, or the grid cannot be made.
    """
    check_limits(arm, limits)
    sets = ReachableSets(arm, voxel, step, part_of(progress, 0.0, _SWEPT_SHARE))
    sets.clearance, sets.seed = clearance, seed
    return measured(sets, limits, progress)


def measured(
    sets: FailureSets, limits: Ranges, progress: Progress = lambda _: None
) -> Workspace:
    """Measure the workspace for one choice of limits, from sets that are there already."""
    before = sets.before(limits)
    voxels = before & sets.after(limits)
    raw = sets.unit * float(voxels.sum())
    planar = closed_form(sets.arm, limits) if sets.clearance is None else None
    size, error, passed = 0.0, _UNSEEN_VOXELS * sets.unit, tuple[float, ...]()
    if planar is not None:
        size, error = planar.area_with_error()
    elif voxels.any():
        progress(Step("inverse kinematics", _SWEPT_SHARE))
        size, error, passed = _size(sets, limits, voxels)
    return Workspace(
        arm=sets.arm,
        limits=limits,
        dimension=sets.dimension,
        size=size,
        error=error,
        raw=raw,
        before=sets.unit * float(before.sum()),
        physical=sets.unit * float(sets.before(physical_ranges(sets.arm)).sum()),
        critical=sets.critical(limits),
        passed=passed,
        sets=sets,
    )


def _size(
    sets: FailureSets, limits: Ranges, voxels: Bits
) -> tuple[float, float, tuple[float, ...]]:
    """Return the size of what counts in voxels and about them, its error, and `passed`."""
    sample, wide = (_SAMPLE_POSES, 0) if sets.sampled else (_SAMPLE_POINTS, _LAYERS_AROUND)
    if wide:
        # The grid loses cells at the surface; inverse kinematics tells what of them is kept.
        voxels = ndimage.binary_dilation(voxels, iterations=wide)
    passed, depths = verified(sets, limits, voxels, sample)
    depths = depths - wide
    groups = [passed[depths == k] for k in range(_DEPTHS_SHOWN - 1)] + [
        passed[depths >= _DEPTHS_SHOWN - 1]
    ]
    by_depth = tuple(float(np.mean(group)) if len(group) else np.nan for group in groups)
    if sets.sampled:
        # Every voxel has one random point: only voxels at the surface add to the variance, each
        # at most a quarter of its size squared.
        size = sets.unit * float(voxels.sum())
        return size, sets.unit * float(np.sqrt(surface(voxels))), by_depth
    share, count = float(passed.mean()), len(passed)
    # The share is guarded so that the estimated binomial variance does not vanish if all pass.
    guarded = (share * count + 1) / (count + 2)
    raw = sets.unit * float(voxels.sum())
    deviation = float(np.sqrt(guarded * (1 - guarded) / count))
    return raw * share, _STANDARD_ERRORS * raw * deviation, by_depth


def verified(
    sets: FailureSets, limits: Ranges, voxels: Bits, sample: int = _SAMPLE_POINTS
) -> tuple[Bits, IntArray]:
    """Check a random sample of points in voxels by inverse kinematics.

    A point passes if it is reached within the artificial limits, and with each joint at each
    of its slices within its artificial limits, and at these, within the physical limits.
    Returns which points pass, and how many voxels they are below the surface, (sample,) each.
    """
    arm, rng = sets.arm, np.random.default_rng(sets.seed)
    inner = (slice(1, -1),) * voxels.ndim
    layers = ndimage.distance_transform_cdt(np.pad(voxels, 1), metric="taxicab")[inner]
    below = layers[voxels] - 1
    points, drawn = sets.points(voxels, rng, sample)
    passed = sets.reaches(points, *_repeated(limits, sample))
    for joint in sets.slices:
        places = sets.places(joint, limits)
        rest = np.flatnonzero(passed)
        lower, upper = _repeated(physical_ranges(arm), len(rest) * len(places))
        lower[:, joint] = upper[:, joint] = np.tile(places, len(rest))
        reached = sets.reaches(np.repeat(points[rest], len(places), axis=0), lower, upper)
        passed[rest] = reached.reshape(len(rest), len(places)).all(axis=1)
    return passed, below[drawn]


def surface_of_voxels(voxels: Bits) -> tuple[IntArray, npt.NDArray[np.intp]]:
    """Return corners on the grid, (k, 3), and triangles, (t, 3), seen from outside."""
    padded, sides = np.pad(voxels, 1), []
    for axis in range(3):
        turned = np.roll(_SIDE, axis, axis=1)
        for ahead in (1, 0):
            open_there = padded & ~np.roll(padded, -1 if ahead else 1, axis=axis)
            corners = turned if ahead else (turned - np.eye(3, dtype=int)[axis])[::-1]
            sides.append((np.argwhere(open_there) - 1)[:, None] + corners)
    places, numbers = np.unique(
        np.concatenate(sides).reshape(-1, 3), axis=0, return_inverse=True
    )
    return places, numbers.reshape(-1, 4)[:, _TRIANGLES].reshape(-1, 3)


def surface(voxels: Bits) -> int:
    """Return how many voxels, in the set or not, have a neighbour on the other side."""
    wide = np.pad(voxels, 1)
    outer = ndimage.binary_dilation(wide) & ~wide
    inner = wide & ~ndimage.binary_erosion(wide)
    return int(outer.sum() + inner.sum())


def _repeated(limits: Ranges, count: int) -> FloatArray:
    """Lower and upper limits, each for so many points: shape (2, count, n)."""
    return np.repeat(np.transpose(limits)[:, None], count, axis=1)


def check_limits(arm: Chain, limits: Ranges) -> None:
    """Raise InputError unless artificial limits are in order and within the physical ones."""
    for step, (low, high) in zip(arm.joints, limits, strict=True):
        if step.continuous and -4 * np.pi <= low <= high <= min(low + 2 * np.pi, 4 * np.pi):
            continue
        if not step.lower - 1e-6 <= low <= high <= step.upper + 1e-6:
            allowed = f"two numbers in order within [{step.lower:.7g}, {step.upper:.7g}]"
            raise InputError(f"artificial limits of {step.name}", f"{low:g}:{high:g}", allowed)
