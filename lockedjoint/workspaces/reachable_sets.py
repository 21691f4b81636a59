"""Failure-tolerant workspace of any serial arm, from reachable sets on a grid.

What comes in: an arm and the edge of a voxel. What goes out: `ReachableSets`, which says of
each voxel whether it is reached before a failure, and after each one.

The position p of the tool, with any orientation, is in the workspace if some configuration
within the artificial limits reaches it, and for every joint f and every position θ within the
artificial limits of f, some configuration with q_f = θ and the other joints within their
physical limits reaches it. Artificial limits hold before a failure and are released after it.

The set of tip positions is swept from tip to base, S_{k-1} = A_k ∪_q R_z(q) S_k, where A_k is
the fixed placement of joint k. Sets of points are kept as points while they are curves or
surfaces, and on a grid of cylindrical coordinates about the axis of the next joint from then
on, where the union over q is a maximum filter.

In shapes n is the number of joints and k that of points. Lengths are in metres, angles in
radians. A grid's cells have the shape (height, radii, angles), see `cylinder_grid`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.inverse import damped_least_squares
from lockedjoint.kinematics.serial_chain import (
    Bits,
    Ranges,
    chain_about_z,
    frames_of,
    from_first_joint,
    idle_joints,
    is_planar,
    link_lengths,
    moved,
    moved_back,
    physical_ranges,
    tip_of,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces.cylinder_grid import TURN_RAD, check_grid
from lockedjoint.workspaces.failure_sets import SLICE_RAD, FailureSets

# Points that are all nearer to an axis than this do not move about it.
_TINY_M = 1e-9
# Inverse kinematics takes at most so many steps from a start: fewer miss more points.
_MOST_STEPS = 80
# The damping of inverse kinematics is this share of the squared sum of the links: more is
# slower and calmer near singularities.
_DAMPING_SHARE = 1e-6
# A point counts as reached if it is this near, as a share of the sum of the links: far less
# than a voxel.
_REACHED_SHARE = 1e-4


@dataclass(frozen=True, eq=False)
class _Reach:
    """Positions of the tip in a joint's frame: points, or cells of its grid; one is None."""

    points: FloatArray | None  #: Of shape (k, 3), in metres.
    cells: Bits | None  #: Truth values, (height, radii, angles).
    dimension: int  #: Of the set: how many joints with a range have moved it.


class ReachableSets(FailureSets):
    """The reachable sets of an arm, before and after every failure.

    Raises
    ------
    InputError
        If not more joints move the tip than the workspace has dimensions, or the voxels are not
        above 0 or too small for the memory.
    """

    def __init__(
        self,
        arm: Chain,
        voxel: float,
        step: float = SLICE_RAD,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._grids = check_grid(arm, voxel, step)
        self.dimension = 2 if is_planar(arm) else 3
        self.arm, self.voxel, self.step = arm, voxel, step
        self._prepare()
        self.slices, self._reached = {}, {}
        free = self._from_tip(physical_ranges(arm))
        moving = np.flatnonzero(~np.array(idle_joints(arm))).tolist()
        for done, joint in enumerate(moving):
            progress(Step(f"failures of {arm.joints[joint].name}", done / len(moving)))
            self.slices[joint] = places = self._positions(joint)
            after = (self._to_base(free[joint], joint, place) for place in places.tolist())
            self._reached[joint] = np.array([np.packbits(self._base(reach)) for reach in after])

    def before(self, limits: Ranges) -> Bits:
        """Voxels that are reached within limits, before a failure."""
        return self._base(self._swept(self._from_tip(limits)[0], 0, limits[0]))

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, int] | None:
        """Draw a configuration within the physical limits, and its voxel in the flat grid."""
        drawn = rng.uniform(*np.transpose(physical_ranges(self.arm)))
        tip = from_first_joint(self.arm).tip_at(drawn[:, None])[0][: self.dimension, 0]
        place = np.round(tip / self.voxel).astype(int) - self.corner
        if np.any(place < 0) or np.any(place >= self.shape):
            return None
        return drawn, int(np.ravel_multi_index(tuple(place), self.shape))

    def _solved(
        self, points: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, Bits]:
        size = float(np.sum(link_lengths(self.arm)))

        def missing(which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
            tip, _, matrix = from_first_joint(self.arm).forward(q, range(3))
            return points.T[:, which] - tip, matrix

        q, reached = damped_least_squares(
            missing,
            start.T,
            lower.T,
            upper.T,
            reached=_REACHED_SHARE * size,
            damping=_DAMPING_SHARE * size**2,
            steps=_MOST_STEPS,
        )
        return q.T, reached

    def _prepare(self) -> None:
        """Make the grids, cropped to what is reached at all, and the maps between them."""
        arm = self._flat = self.arm
        if is_planar(arm):
            level = np.ones((4, 4))
            level[2, 3] = 0.0  # heights of the links along the axes do not matter
            frames = list(frames_of(arm) * level)
            self._flat = chain_about_z(arm.joints, frames, np.array(arm.end) * level)
        self._link()
        cropped = []
        physical = physical_ranges(arm)
        for joint, reach in enumerate(self._from_tip(physical)):
            grid, swept = self._grids[joint], self._swept(reach, joint, physical[joint])
            cells = self._cells(reach, joint) | self._cells(swept, joint)
            z, r = np.nonzero(cells.any(axis=2))
            low, high = max(int(z.min()) - 1, 0), min(int(z.max()) + 2, grid.height)
            near, far = max(int(r.min()) - 1, 0), min(int(r.max()) + 2, grid.radii)
            size = {"height": high - low, "radii": far - near}
            cropped.append(replace(grid, bottom=grid.bottom + low, inner=near, **size))
        self._grids = cropped
        self._link()

    def _link(self) -> None:
        """Map the cells of each joint's grid, and the voxels, to cells of the next grid."""
        self._maps = []
        for k, grid in enumerate(self._grids[:-1]):
            points = moved_back(frames_of(self._flat)[k + 1], grid.centres())
            self._maps.append(self._grids[k + 1].index(points))
        first = self._grids[0]
        wide = first.inner + first.radii
        rows = [np.arange(-wide, wide + 1)] * 2
        if not is_planar(self.arm):
            rows.append(np.arange(first.height) + first.bottom)
        self.shape = tuple(map(len, rows))
        self.corner = np.array([row[0] for row in rows])
        places = np.stack(np.meshgrid(*rows, indexing="ij"), axis=-1).reshape(-1, len(rows))
        points = np.zeros((len(places), 3))
        points[:, : len(rows)] = places * self.voxel
        self._base_map = first.index(points)

    def _from_tip(self, limits: Ranges) -> list[_Reach]:
        """For each joint the set in its moving frame, from the joints after it."""
        sets = [_Reach(tip_of(self._flat)[None], None, 0)]
        for joint in range(len(limits) - 1, 0, -1):
            sets.append(self._carried(self._swept(sets[-1], joint, limits[joint]), joint))
        return sets[::-1]

    def _to_base(self, reach: _Reach, joint: int, place: float) -> _Reach:
        """Return the set in the frame of joint 1 if a joint is locked at a place."""
        reach = self._swept(reach, joint, (place, place))
        for k in range(joint - 1, -1, -1):
            reach = self._swept(self._carried(reach, k + 1), k, physical_ranges(self.arm)[k])
        return reach

    def _swept(self, reach: _Reach, joint: int, limits: tuple[float, float]) -> _Reach:
        """Return the union of a set over the positions of a joint within limits."""
        prismatic = self.arm.joints[joint].prismatic
        low, high = limits
        thin = low == high or reach.dimension < self.dimension - 1
        if reach.points is not None and thin:
            return self._swept_points(reach, prismatic, low, high)
        cells, grid = self._cells(reach, joint), self._grids[joint]
        unit = self.voxel if prismatic else TURN_RAD / grid.angles
        first, last = round(low / unit), round(high / unit)
        size = last - first + 1
        if not prismatic and size >= grid.angles:
            cells = np.broadcast_to(cells.any(axis=2, keepdims=True), grid.shape)
        else:
            axis, mode = (0, "constant") if prismatic else (2, "wrap")
            if size > 1:
                cells = ndimage.maximum_filter1d(cells, size, axis=axis, mode=mode)
            shift = last - size // 2
            cells = _shifted(cells, shift) if prismatic else np.roll(cells, shift, axis=2)
        return _Reach(None, cells, reach.dimension + (size > 1))

    def _swept_points(self, reach: _Reach, prismatic: bool, low: float, high: float) -> _Reach:
        """Return the union of points, half a voxel apart, over positions from low to high."""
        assert reach.points is not None
        points = reach.points
        far = 1.0 if prismatic else float(np.hypot(points[:, 0], points[:, 1]).max())
        moves = high > low and far > _TINY_M
        count = int(np.ceil((high - low) * far / (self.voxel / 2))) + 1 if moves else 1
        places = np.linspace(low, high, count)[:, None]
        x, y, z = (np.broadcast_to(column, (count, len(points))) for column in points.T)
        if prismatic:
            z = z + places
        else:
            cos, sin = np.cos(places), np.sin(places)
            x, y = cos * x - sin * y, sin * x + cos * y
        swept = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        if len(swept) > 1:
            rounded = np.round(swept / (self.voxel / 4)).astype(np.int64)
            rounded -= rounded.min(axis=0)
            # One number for each cell: to sort numbers is faster than to sort rows.
            cell = np.ravel_multi_index(tuple(rounded.T), tuple(rounded.max(axis=0) + 1))
            swept = swept[np.unique(cell, return_index=True)[1]]
        return _Reach(swept, None, reach.dimension + moves)

    def _carried(self, reach: _Reach, joint: int) -> _Reach:
        """Return a set of a joint's fixed frame in the moving frame of the previous one."""
        if reach.points is not None:
            placement = frames_of(self._flat)[joint]
            return replace(reach, points=moved(placement, reach.points))
        cells = self._mapped(reach, joint, self._maps[joint - 1])
        return replace(reach, cells=cells.reshape(self._grids[joint - 1].shape))

    def _cells(self, reach: _Reach, joint: int) -> Bits:
        """Return a set as cells of a joint's grid."""
        if reach.cells is not None:
            return reach.cells
        assert reach.points is not None
        grid = self._grids[joint]
        marked = np.zeros(grid.size + 1, dtype=bool)
        marked[grid.index(reach.points)] = True
        return marked[:-1].reshape(grid.shape)

    def _mapped(self, reach: _Reach, joint: int, indices: npt.NDArray[np.int32]) -> Bits:
        """Return cells of a joint's grid by their indices; beyond it there are none."""
        return np.append(self._cells(reach, joint).ravel(), False)[indices]

    def _base(self, reach: _Reach) -> Bits:
        """Return a set in the frame of joint 1 as voxels."""
        return self._mapped(reach, 0, self._base_map).reshape(self.shape)


def _shifted(cells: Bits, by: int) -> Bits:
    """Return cells moved along the first axis; those that leave the grid are lost."""
    rolled = np.roll(cells, by, axis=0)
    rolled[slice(by) if by > 0 else slice(max(len(cells) + by, 0), None)] = False
    return rolled
