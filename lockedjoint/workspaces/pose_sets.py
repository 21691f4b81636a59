"""Failure-tolerant workspace of an arm that holds the orientation of its tool.

What comes in: an arm, a rotation (3, 3) and the edge of a voxel. What goes out: `PoseSets`,
which says of each voxel whether its point is reached before a failure, and after each one. A
voxel stands for one random point in it.

With one joint more than a pose has dimensions (four joints in the plane, seven in space) the
configurations of a pose are curves, see `pose_curves`; with more joints they are surfaces, see
`pose_sheets`. This file has the grid, and keeps what these find.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import LIMIT_TOLERANCE, Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.serial_chain import (
    Bits,
    Ranges,
    at_zero,
    frames_of,
    from_first_joint,
    is_planar,
    link_lengths,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets, check_step
from lockedjoint.workspaces.held_poses import HeldPoses
from lockedjoint.workspaces.pose_curves import curves_of, mark_passed
from lockedjoint.workspaces.pose_sheets import mark_sheets

# A grid with more voxels is refused: each takes time and memory.
_MOST_VOXELS = 60_000
# The curves of so many voxels are followed at once: more need more memory.
_VOXELS_AT_ONCE = 1000
# The entry zz of a planar arm's rotation may differ from 1 by so much, which is rounding.
_OUT_OF_PLANE = 1e-6
# A turn has this angle.
_TURN_RAD = 2 * np.pi


class PoseSets(FailureSets):
    """What an arm reaches with one orientation of its tool, before and after every failure.

    Voxels stand for one random point each, so that an area or volume has a statistical error
    and no bias from the grid. Curves that no random configuration leads to are missed. The
    rotation is that of the tool in the frame of the base, shape (3, 3).

    Raises
    ------
    InputError
        If a planar arm has less than four joints or another one less than seven, the arm cannot
        turn its tool so, or the grid has too many voxels.
    """

    sampled = True

    def __init__(
        self,
        arm: Chain,
        rotation: FloatArray,
        voxel: float,
        step: float = SLICE_RAD,
        progress: Callable[[str], None] = lambda _: None,
        seed: int = 0,
        clearance: LinkClearance | None = None,
    ) -> None:
        self.arm, self.voxel, self.step = arm, voxel, step
        self.clearance, self.seed = clearance, seed
        # The orientation at q = 0, in the frame of joint 1.
        at_start = from_first_joint(arm).tip_at(np.zeros((len(arm.joints), 1)))[1][..., 0]
        first_joint = frames_of(arm)[0][:3, :3]
        self._held = HeldPoses(arm, first_joint.T @ rotation @ at_start.T, clearance)
        self.corner, self.shape = _grid_of(arm, self._held.rotation, voxel, step)
        self.dimension = len(self.shape)
        self.slices = {k: self._positions(k) for k in range(len(arm.joints))}
        rng = np.random.default_rng(seed)
        self._points = self._random_points(rng)
        # Marks, by joint, (voxels, slices), say whether a pose is kept if it locks there.
        marks = {
            joint: np.zeros((len(self._points), len(places)), bool)
            for joint, places in self.slices.items()
        }
        self._find_configurations(marks, rng, progress)
        self._reached = {
            joint: np.packbits(marked.T, axis=1) for joint, marked in marks.items()
        }

    def _random_points(self, rng: np.random.Generator) -> FloatArray:
        """Return a random point in each voxel, shape (voxels, 3)."""
        wide = self.dimension
        places = np.indices(self.shape).reshape(wide, -1).T + self.corner
        points = np.zeros((len(places), 3))
        points[:, :wide] = (places + rng.uniform(-0.5, 0.5, places.shape)) * self.voxel
        points[:, wide:] = at_zero(self.arm).end_effector[wide:]
        return points

    def _find_configurations(
        self, marks: dict[int, Bits], rng: np.random.Generator, progress: Callable[[str], None]
    ) -> None:
        """Set the marks; keep configurations and the voxels, `_owners`, that they are of."""
        near = np.flatnonzero(np.linalg.norm(self._points, axis=1) <= _reach(self.arm))
        configurations = [np.zeros((0, len(self.arm.joints)), dtype=np.float32)]
        owners = [np.zeros(0, dtype=np.intp)]
        for first in range(0, len(near), _VOXELS_AT_ONCE):
            progress(Step(f"self-motion at {len(near)} points", first / len(near)))
            own = near[first : first + _VOXELS_AT_ONCE]
            # Curves have a shape (c, steps, n), and are NaN where a step is missing.
            if self._held.spare_joints == 1:
                found = [
                    (which, self._clear(curves))
                    for which, curves in curves_of(self._held, self._points[own], rng)
                ]
                for which, curves in found:
                    mark_passed(marks, self.slices, self._held, own[which], curves)
            else:
                found = list(
                    mark_sheets(self._held, self._points, self.slices, marks, own, rng)
                )
            for which, curves in found:
                there = ~np.isnan(curves[:, :, 0])
                configurations.append(curves[there].astype(np.float32))
                owners.append(np.repeat(own[which], there.sum(axis=1)))
        self._q, self._owners = np.concatenate(configurations), np.concatenate(owners)

    def _clear(self, curves: FloatArray) -> FloatArray:
        """Return curves without the configurations in which links are too near."""
        there = ~np.isnan(curves[:, :, 0])
        there[there] = self._held.is_clear(curves[there])
        return np.where(there[:, :, None], curves, np.nan)

    def before(self, limits: Ranges) -> Bits:
        """Voxels whose point is reached within limits, before a failure."""
        inside = np.ones(len(self._q), dtype=bool)
        for k, (low, high) in enumerate(limits):
            inside &= within(self._q[:, k], low, high, self.arm.joints[k].continuous)
        reached = np.zeros(self.shape, dtype=bool)
        reached.ravel()[self._owners[inside]] = True
        return reached

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, int] | None:
        """Draw a configuration that was found, and its voxel in the flat grid."""
        if not len(self._q):
            return None
        drawn = rng.integers(len(self._q))
        return self._q[drawn].astype(float), int(self._owners[drawn])

    def kept_points(self, voxels: Bits) -> FloatArray:
        """Points that voxels stand for, in the frame of joint 1, shape (k, 3)."""
        return self._points[voxels.ravel()]

    def _solved(
        self, points: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, Bits]:
        return self._held.solved(points, start, lower, upper)


def within(q: npt.NDArray[np.floating], low: float, high: float, continuous: bool) -> Bits:
    """Whether positions, in radians or metres, are between limits, but for rounding.

    Of a continuous joint whole turns may be added.
    """
    above = q - low + LIMIT_TOLERANCE
    if continuous:
        above = above % _TURN_RAD
    return np.asarray((above >= 0) & (above <= high - low + 2 * LIMIT_TOLERANCE))


def _grid_of(
    arm: Chain, rotation: FloatArray, voxel: float, step: float
) -> tuple[IntArray, tuple[int, ...]]:
    """Return the place of the first voxel, in voxels, and the grid's shape.

    InputError as `PoseSets`.
    """
    dimension, needed = (2, 4) if is_planar(arm) else (3, 7)
    if len(arm.joints) < needed:
        kind = "a planar arm" if is_planar(arm) else "an arm"
        wanted = f"{needed} or more for {kind} that holds an orientation"
        allowed = f"{wanted}: more than its poses have dimensions"
        raise InputError("number of joints", len(arm.joints), allowed)
    check_step(voxel, step)
    if is_planar(arm) and abs(rotation[2, 2] - 1) > _OUT_OF_PLANE:
        allowed = "a turn about the parallel axes of this planar arm from its zero posture"
        raise InputError("orientation", "out of the plane", allowed)
    reach = _reach(arm)
    # The grid has so many voxels on each side of joint 1, along each axis.
    most_on_side = (int(_MOST_VOXELS ** (1 / dimension)) - 1) // 2
    if reach >= most_on_side * voxel:
        most = f"with an orientation the grid has at most {_MOST_VOXELS} voxels"
        raise InputError("voxel", f"{voxel:g}", f"above {reach / most_on_side:.4g}: {most}")
    on_side = int(reach / voxel) + 1
    return np.full(dimension, -on_side), (2 * on_side + 1,) * dimension


def _reach(arm: Chain) -> float:
    """Return a distance from joint 1, in metres, that the tool is never beyond."""
    travels = (max(abs(one.lower), abs(one.upper)) for one in arm.joints if one.prismatic)
    return float(np.sum(link_lengths(arm))) + sum(travels)
