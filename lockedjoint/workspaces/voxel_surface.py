"""The surface of voxels: as triangles, as a file, and as a number of voxels.

What comes in: voxels, truth values of shape (a, b, c), or (a, b) where only their number
counts. Nothing here knows about robots.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.serial_chain import Bits
from lockedjoint.nlp.arrays import FloatArray

# These are the corners of a voxel's side towards x, seen from outside; other sides are turned.
_CORNERS_OF_SIDE = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]])
# Two triangles of these corners make a side.
_TRIANGLES_OF_SIDE = np.array([[0, 1, 2], [0, 2, 3]])
# The file in PLY begins with this header.
_PLY_HEADER = """ply
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


def surface_of_voxels(voxels: Bits) -> tuple[IntArray, npt.NDArray[np.intp]]:
    """Return the surface of voxels as triangles.

    Parameters
    ----------
    voxels
        Which voxels are inside, shape (a, b, c).

    Returns
    -------
    corners
        Places on the grid of corners, shape (k, 3). The lowest corner of voxel (i, j, l) is at
        (i, j, l).
    triangles
        Numbers of three corners, shape (t, 3), in mathematically positive order seen from
        outside.
    """
    padded = np.pad(voxels, 1)
    sides = []
    for axis in range(3):
        upper_side = np.roll(_CORNERS_OF_SIDE, axis, axis=1)
        # The lower side is the upper one, a voxel further down and seen from below.
        lower_side = (upper_side - np.eye(3, dtype=int)[axis])[::-1]
        for side, towards in ((upper_side, -1), (lower_side, 1)):
            is_open = padded & ~np.roll(padded, towards, axis=axis)
            places = np.argwhere(is_open) - 1
            sides.append(places[:, None] + side)
    every_corner = np.concatenate(sides).reshape(-1, 3)
    corners, numbers = np.unique(every_corner, axis=0, return_inverse=True)
    return corners, numbers.reshape(-1, 4)[:, _TRIANGLES_OF_SIDE].reshape(-1, 3)


def ply_file(vertices: FloatArray, triangles: npt.NDArray[np.intp]) -> bytes:
    """Return a PLY file of vertices (k, 3), metres, and triangles (t, 3) of their numbers."""
    rows = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"] = 3
    rows["corners"] = triangles
    header = _PLY_HEADER.format(vertices=len(vertices), faces=len(triangles))
    return header.encode("ascii") + vertices.astype("<f4").tobytes() + rows.tobytes()


def voxels_at_surface(voxels: Bits) -> int:
    """Return how many voxels, in the set or not, have a neighbour on the other side."""
    wide = np.pad(voxels, 1)
    outer = ndimage.binary_dilation(wide) & ~wide
    inner = wide & ~ndimage.binary_erosion(wide)
    return int(outer.sum() + inner.sum())
