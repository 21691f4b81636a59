"""Grids of cylindrical coordinates about the axes of an arm's joints.

What comes in: an arm and the edge of a voxel. What goes out: a `CylinderGrid` for each joint,
large enough for all that the links after it can reach. On such a grid a joint that turns moves
cells along φ, and one that slides moves them along z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.serial_chain import idle_joints, is_planar, link_lengths
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.workspaces.failure_sets import check_step

#: A turn has this angle.
TURN_RAD = 2 * np.pi
# A grid with more cells is refused.
_MOST_CELLS = 5_000_000
# A grid has at least so many cells about the axis.
_LEAST_ANGLES = 16


@dataclass(frozen=True)
class CylinderGrid:
    """A grid of cylindrical coordinates (z, r, φ) about a joint's axis."""

    cell: float  #: The edge of a cell along z and r, in metres.
    bottom: int  #: The lowest z, in cells.
    height: int  #: The number of cells along z.
    inner: int  #: The smallest r, in cells.
    radii: int  #: The number of cells along r.

    @property
    def angles(self) -> int:
        """Number of cells in φ."""
        return max(_LEAST_ANGLES, round(TURN_RAD * (self.inner + self.radii)))

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
        bearing = np.arctan2(points[:, 1], points[:, 0]) / TURN_RAD * self.angles
        phi = np.floor(bearing).astype(int) % self.angles
        inside = (z >= 0) & (z < self.height) & (r >= 0) & (r < self.radii)
        flat = (z * self.radii + r) * self.angles + phi
        return np.where(inside, flat, self.size).astype(np.int32)

    def centres(self) -> FloatArray:
        """Centres of the cells, shape (size, 3)."""
        z = (np.arange(self.height) + self.bottom) * self.cell
        r = (np.arange(self.radii) + self.inner + 0.5) * self.cell
        phi = (np.arange(self.angles) + 0.5) * TURN_RAD / self.angles
        heights, radii, bearings = np.meshgrid(z, r, phi, indexing="ij")
        points = [radii * np.cos(bearings), radii * np.sin(bearings), heights]
        return np.stack(points, axis=-1).reshape(-1, 3)


def check_grid(arm: Chain, voxel: float, step: float) -> list[CylinderGrid]:
    """Return the grid of each joint, for all that links of such lengths can reach."""
    dimension = 2 if is_planar(arm) else 3
    moving = len(arm.joints) - sum(idle_joints(arm))
    if moving <= dimension:
        allowed = f"more than {dimension}: with one locked, what is reached has no size"
        raise InputError("number of joints that move the tip", moving, allowed)
    check_step(voxel, step)
    travels = [
        max(abs(joint.lower), abs(joint.upper)) * joint.prismatic for joint in arm.joints
    ]
    # The farthest that the tip can be from each joint, in metres.
    reaches = np.cumsum((link_lengths(arm) + travels)[::-1])[::-1]
    grids = [_grid(voxel, int(reach / voxel) + 2, is_planar(arm)) for reach in reaches]
    if grids[0].size > _MOST_CELLS:
        most_radii = 2
        while _grid(voxel, most_radii + 1, is_planar(arm)).size <= _MOST_CELLS:
            most_radii += 1
        least_voxel = reaches[0] / (most_radii - 1)
        allowed = f"above {least_voxel:.4g}: the grid has at most {_MOST_CELLS} cells"
        raise InputError("voxel", f"{voxel:g}", allowed)
    return grids


def _grid(voxel: float, radii: int, planar: bool) -> CylinderGrid:
    """Return the grid of a ball, or of a disc, of so many cells about the axis."""
    height = 1 if planar else 2 * radii + 1
    return CylinderGrid(cell=voxel, bottom=-(height // 2), height=height, inner=0, radii=radii)
