"""A workspace as files that others read: points in NPZ, the surface of its voxels in PLY.

Places are in metres along the axes of the arm's base.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np
import numpy.typing as npt

from formulations.kinematics.link_chain import IntArray
from formulations.kinematics.serial_arm import Bits, moved
from formulations.workspaces.workspace import Workspace

# Corners of a voxel's side towards x, and towards −x; each seen from outside.
_SIDE = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]])
_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
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


def points_file(workspace: Workspace) -> bytes:
    """Return an NPZ file: what is kept whichever joint locks.

    It has `points`, one for each voxel, shape (k, 3): its centre, or with a held orientation
    the random point that was tried; `voxels`, the grid as truth values; `frame`, the placement
    of the grid in the base, shape (4, 4), in which the first voxel's centre is at `first`;
    `edge`, that of a voxel; and `dimension`.
    """
    sets, voxels = workspace.sets, workspace.voxels
    frame = workspace.arm.steps[0].placement
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


def mesh_file(workspace: Workspace) -> bytes:
    """Return a PLY file: the surface of the voxels that are kept; of a plane, one layer."""
    sets = workspace.sets
    voxels = workspace.voxels if sets.dimension == 3 else workspace.voxels[:, :, None]
    corners, faces = surface_of_voxels(voxels)
    places = np.asarray((corners - 0.5) * sets.voxel, dtype=np.float64)
    places[:, : sets.dimension] += sets.corner * sets.voxel
    places[:, sets.dimension :] += workspace.arm.at_zero.end_effector[sets.dimension :]
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    head = _PLY.format(vertices=len(places), faces=len(faces)).encode("ascii")
    vertices = moved(workspace.arm.steps[0].placement, places).astype("<f4")
    return head + vertices.tobytes() + rows.tobytes()


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
