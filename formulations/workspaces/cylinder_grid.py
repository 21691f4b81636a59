"""Grids of cylindrical coordinates about the axes of an arm's joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formulations.kinematics.serial_arm import SerialArm
from formulations.workspaces.failure_sets import check_step
from nlp.arrays import FloatArray
from nlp.errors import InputError

_TURN = 2 * np.pi
_MOST_CELLS = 5_000_000


@dataclass(frozen=True)
class CylinderGrid:
    """A grid of cylindrical coordinates (z, r, φ) about a joint's axis."""

    cell: float
    bottom: int  # of z, in cells
    height: int
    inner: int  # of r, in cells
    radii: int
    angles: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of cells in z, r and φ."""
        return self.height, self.radii, self.angles

    @property
    def size(self) -> int:
        """Number of all cells."""
        return self.height * self.radii * self.angles

    def index(self, points: FloatArray) -> npt.NDArray[np.int32]:
        """Cells of points (k, 3) in the flat grid; its size for those outside."""
        z = np.floor(points[:, 2] / self.cell + 0.5).astype(int) - self.bottom
        r = np.floor(np.hypot(points[:, 0], points[:, 1]) / self.cell).astype(int) - self.inner
        turn = np.arctan2(points[:, 1], points[:, 0]) / _TURN * self.angles
        phi = np.floor(turn).astype(int) % self.angles
        inside = (z >= 0) & (z < self.height) & (r >= 0) & (r < self.radii)
        flat = (z * self.radii + r) * self.angles + phi
        return np.where(inside, flat, self.size).astype(np.int32)

    def centres(self) -> FloatArray:
        """Centres of the cells, shape (size, 3)."""
        z = (np.arange(self.height) + self.bottom) * self.cell
        r = (np.arange(self.radii) + self.inner + 0.5) * self.cell
        phi = (np.arange(self.angles) + 0.5) * _TURN / self.angles
        heights, radii, turns = np.meshgrid(z, r, phi, indexing="ij")
        points = [radii * np.cos(turns), radii * np.sin(turns), heights]
        return np.stack(points, axis=-1).reshape(-1, 3)


def check_grid(arm: SerialArm, voxel: float, step: float) -> list[CylinderGrid]:
    """Return the grid of each joint, for all that links of such lengths can reach.

    Raises
    ------
    InputError
        As `ReachableSets` does.
    """
    solid = 2 if arm.is_planar else 3
    moving = len(arm.steps) - sum(arm.idle)
    if moving <= solid:
        allowed = f"more than {solid}: with one locked, what is reached has no size"
        raise InputError("number of joints that move the tip", moving, allowed)
    check_step(voxel, step)
    reach = float(np.linalg.norm(arm.tip))
    grids: list[CylinderGrid] = []
    for joint in reversed(arm.steps):
        reach += max(abs(joint.lower), abs(joint.upper)) if joint.prismatic else 0.0
        radii = int(reach / voxel) + 2
        height = 1 if arm.is_planar else 2 * radii + 1
        plane = -(height // 2)
        angles = max(16, round(_TURN * radii))
        grid = CylinderGrid(voxel, plane, height, 0, radii, angles)
        if grid.size > _MOST_CELLS:
            allowed = f"larger: the grid has at most {_MOST_CELLS} cells"
            raise InputError("voxel", f"{voxel:g}", allowed)
        grids.insert(0, grid)
        reach += float(np.linalg.norm(joint.placement[:3, 3]))
    return grids
