"""What failures leave of the workspace of an arm: its size, and how far that may be off.

What comes in: an arm, artificial limits of its joints, and the edge of a voxel. What goes out:
a `Workspace`. See `reachable_sets` for the definition. Planar arms of three joints without
physical limits are measured in closed form, `planar`; others on a grid, whose size
`workspace_size` corrects. To change what a voxel means, see `reachable_sets` and, with a fixed
orientation of the tool, `pose_sets`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import Chain, range_text
from lockedjoint.kinematics.in_degrees import FromDegrees
from lockedjoint.kinematics.serial_chain import (
    Bits,
    Ranges,
    at_zero,
    frames_of,
    link_lengths,
    moved,
    physical_ranges,
)
from lockedjoint.nlp.arrays import finite_or_none
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step, part_of
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets
from lockedjoint.workspaces.planar import closed_form
from lockedjoint.workspaces.reachable_sets import ReachableSets
from lockedjoint.workspaces.voxel_surface import ply_file, surface_of_voxels
from lockedjoint.workspaces.workspace_size import SizeEstimate, estimated_size

# This share of a measurement is done when all sets are swept; then come the sampled points.
# It changes nothing but the progress that is shown.
_SWEPT_SHARE = 0.7
# A set of which nothing was found may fill so many voxels: see `Workspace.error`. Fewer would
# miss the truth more often than 5 %.
_UNSEEN_VOXELS = 3
# Limits may be this far outside the physical ones, in radians or metres: texts round them. Less
# would refuse limits that were copied from a text; more would accept wrong ones.
_LIMIT_ROUNDING_RAD_OR_M = 1e-6
# Limits of a joint that turns without end are within this many radians of zero. One turn is all
# that such a joint can use; two each way leave a choice of where it begins.
_MOST_TURNS_RAD = 4 * np.pi
#: A function that is told, with a line of text, what is being done.
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Workspace:
    """The failure-tolerant workspace of an arm.

    Attributes
    ----------
    arm
        The arm.
    limits
        Artificial limits of the joints, a pair (low, high) for each, in radians or metres.
    dimension
        2 for an area, 3 for a volume.
    size, error
        Area or volume in m² or m³, and how far it may be from the truth. In closed form that is
        the error of the quadrature; on a grid, three standard errors of a sample of points in
        the voxels and in those about them; with a fixed orientation, two standard errors of
        the number of voxels.
        Where nothing was found it is three voxels: of a set that is larger, random points in
        all voxels miss every part with a chance of 5 % at most (e⁻³). It says nothing about
        configurations that the inverse kinematics missed.
    raw
        Size of all voxels together, in m² or m³. It is too large, but with a fixed orientation
        it is the size itself.
    before
        Size of what is reached within the artificial limits, if no joint fails: of all
        its voxels together, in m² or m³.
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
    notes
        What to check in what was asked for, one sentence each.
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
    notes: tuple[str, ...] = ()

    @property
    def voxels(self) -> Bits:
        """Which voxels of the grid are in the workspace, raw: truth values, 2D or 3D."""
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
        """Return the result as plain values: lengths in m, sizes in m² or m³, angles in rad."""
        names, clearance = [joint.name for joint in self.arm.joints], self.sets.clearance
        return {
            "quantity": "area" if self.dimension == 2 else "volume",
            "size": self.size,
            "error": self.error,
            "method": self.method,
            "collisions": self.collisions,
            **({"unchecked_links": list(clearance.unchecked)} if clearance else {}),
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
        corners, triangles = surface_of_voxels(voxels)
        # Voxels are named by their centres: corners are half a voxel off.
        places = np.asarray((corners - 0.5) * sets.voxel, dtype=np.float64)
        places[:, : sets.dimension] += sets.corner * sets.voxel
        # A planar arm may move in a plane beside the origin.
        places[:, sets.dimension :] += at_zero(self.arm).end_effector[sets.dimension :]
        base = frames_of(self.arm)[0]
        return ply_file(moved(base, places), triangles)


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

    `voxel` is an edge in metres; see `ReachableSets` for it and for `step`. With a clearance,
    of the chain that the arm is of, configurations in which links are too near do not count.
    The sampled points and the starts of inverse kinematics are random, from `seed`. InputError
    if a limit is outside the physical ones, or the grid cannot be made.
    """
    check_limits(arm, limits)
    sets = ReachableSets(arm, voxel, step, part_of(progress, 0.0, _SWEPT_SHARE))
    sets.clearance, sets.seed = clearance, seed
    return measured(sets, limits, progress)


def measured(
    sets: FailureSets, limits: Ranges, progress: Progress = lambda _: None
) -> Workspace:
    """Measure the workspace for one choice of limits, from sets that are there already.

    The size is in closed form if there is one and links are not checked; it is estimated from
    sampled points if a voxel is kept; otherwise it is 0, with an error of a few voxels.
    """
    before = sets.before(limits)
    voxels = before & sets.after(limits)
    raw = sets.unit * float(voxels.sum())
    planar = closed_form(sets.arm, limits) if sets.clearance is None else None
    estimate = SizeEstimate(size=0.0, error=_UNSEEN_VOXELS * sets.unit)
    if planar is not None:
        estimate = SizeEstimate(*planar.area_with_error())
    elif voxels.any():
        progress(Step("inverse kinematics", _SWEPT_SHARE))
        estimate = estimated_size(sets, limits, voxels)
    return Workspace(
        arm=sets.arm,
        limits=limits,
        dimension=sets.dimension,
        size=estimate.size,
        error=estimate.error,
        raw=raw,
        before=sets.unit * float(before.sum()),
        physical=sets.unit * float(sets.before(physical_ranges(sets.arm)).sum()),
        critical=sets.critical(limits),
        passed=estimate.passed,
        sets=sets,
    )


def check_limits(arm: Chain, limits: Ranges) -> None:
    """Raise InputError unless artificial limits are in order and within the physical ones."""
    for joint, (low, high) in zip(arm.joints, limits, strict=True):
        if joint.continuous:
            highest = min(low + 2 * np.pi, _MOST_TURNS_RAD)
            if -_MOST_TURNS_RAD <= low <= high <= highest:
                continue
        lower, upper = (
            joint.lower - _LIMIT_ROUNDING_RAD_OR_M,
            joint.upper + _LIMIT_ROUNDING_RAD_OR_M,
        )
        if not lower <= low <= high <= upper:
            in_degrees = isinstance(low, FromDegrees)
            own = range_text(joint.lower, joint.upper, joint.prismatic, in_degrees)
            given = range_text(low, high, joint.prismatic)
            allowed = f"two numbers in order within {own}"
            raise InputError(f"artificial limits of {joint.name}", given, allowed)
