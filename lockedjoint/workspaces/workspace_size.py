"""The size of a workspace and its error, from voxels and a sample of points in them.

What comes in: the reachable sets of an arm, its artificial limits, and the voxels that the sets
say are kept. What goes out: a `SizeEstimate`. With any orientation of the tool the grid is not
exact at its surface: the size is that of the voxels and a layer about them, times the share of
a random sample of points in these for which inverse kinematics finds every configuration that
is needed. With a fixed orientation each voxel stands for one random point in it, and the size
is that of the voxels; a small sample only confirms it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.serial_chain import Bits, Ranges, physical_ranges
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.workspaces.failure_sets import FailureSets
from lockedjoint.workspaces.voxel_surface import voxels_at_surface

# Inverse kinematics checks so many points: four times as many halve the error.
_SAMPLE_POINTS = 400
# Inverse kinematics checks so many points with a fixed orientation, which only confirm.
_SAMPLE_POSES = 60
# The error is so many standard errors of a sample: fewer tell a smaller error that is exceeded
# more often.
_STANDARD_ERRORS = 3
# So many layers of voxels about those of the grid are looked at, too: none would miss what the
# grid loses at its surface; more spread the sample over points that do not pass.
_LAYERS_AROUND = 1
# The share that passes is given for so many depths below the surface, in voxels.
_DEPTHS_SHOWN = 4


@dataclass(frozen=True)
class SizeEstimate:
    """The size of what is kept.

    Attributes
    ----------
    size, error
        Area or volume in m² or m³, and how far it may be from the truth.
    passed
        Share of the sampled points that pass, by depth below the surface: 0, 1, 2 voxels, or
        more; NaN where there are none.
    """

    size: float
    error: float
    passed: tuple[float, ...] = ()


def estimated_size(sets: FailureSets, limits: Ranges, voxels: Bits) -> SizeEstimate:
    """Return the size of what counts in and about voxels; there is one voxel at least."""
    if sets.sampled:
        passed, depths = verified(sets, limits, voxels, _SAMPLE_POSES)
        # Every voxel has one random point: only voxels at the surface add to the variance, each
        # at most a quarter of its size squared. The error is two standard errors of their sum.
        size = sets.unit * float(voxels.sum())
        error = sets.unit * float(np.sqrt(voxels_at_surface(voxels)))
        return SizeEstimate(size, error, _share_by_depth(passed, depths))
    # The grid loses cells at the surface; inverse kinematics tells what of them is kept.
    voxels = ndimage.binary_dilation(voxels, iterations=_LAYERS_AROUND)
    passed, depths = verified(sets, limits, voxels, _SAMPLE_POINTS)
    raw = sets.unit * float(voxels.sum())
    count = len(passed)
    share = float(passed.mean())
    # Two points, one that passes, are added: else no variance would be left if all pass.
    guarded = (share * count + 1) / (count + 2)
    standard_error = float(np.sqrt(guarded * (1 - guarded) / count))
    by_depth = _share_by_depth(passed, depths - _LAYERS_AROUND)
    return SizeEstimate(raw * share, _STANDARD_ERRORS * raw * standard_error, by_depth)


def _share_by_depth(passed: Bits, depths: IntArray) -> tuple[float, ...]:
    """Return the share of points that pass at each depth; the last has all that are deeper."""
    deepest = _DEPTHS_SHOWN - 1
    groups = [passed[depths == depth] for depth in range(deepest)]
    groups.append(passed[depths >= deepest])
    return tuple(float(np.mean(group)) if len(group) else np.nan for group in groups)


def verified(
    sets: FailureSets, limits: Ranges, voxels: Bits, sample: int
) -> tuple[Bits, IntArray]:
    """Check a random sample of points in voxels by inverse kinematics.

    A point passes if it is reached within the artificial limits, and with each joint at each
    of its slices within its artificial limits, and at these, within the physical limits.

    Returns
    -------
    passed
        Which points pass, shape (sample,).
    depths
        How many voxels they are below the surface, shape (sample,).
    """
    rng = np.random.default_rng(sets.seed)
    points, drawn = sets.points(voxels, rng, sample)
    passed = sets.reaches(points, *_for_each_point(limits, sample))
    for joint in sets.slices:
        places = sets.places(joint, limits)
        left = np.flatnonzero(passed)
        lower, upper = _for_each_point(physical_ranges(sets.arm), len(left) * len(places))
        lower[:, joint] = upper[:, joint] = np.tile(places, len(left))
        reached = sets.reaches(np.repeat(points[left], len(places), axis=0), lower, upper)
        passed[left] = reached.reshape(len(left), len(places)).all(axis=1)
    return passed, _depths(voxels)[drawn]


def _depths(voxels: Bits) -> IntArray:
    """Return how deep below the surface each voxel of the set is, in voxels."""
    inner = (slice(1, -1),) * voxels.ndim
    layers = ndimage.distance_transform_cdt(np.pad(voxels, 1), metric="taxicab")[inner]
    return np.asarray(layers[voxels] - 1)


def _for_each_point(limits: Ranges, count: int) -> FloatArray:
    """Return lower and upper limits, each for so many points: shape (2, count, n)."""
    return np.repeat(np.transpose(limits)[:, None], count, axis=1)
