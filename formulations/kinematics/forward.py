"""Forward kinematics and Jacobians of a chain: in NumPy for many q at once, and in CasADi.

In NumPy configurations come last: q has shape (n, B), a Jacobian shape (rows, n, B). One
operation then does as much work as it can.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from formulations.kinematics.chain import Bodies, Chain, Transform
from formulations.kinematics.link_chain import rotation_vectors
from nlp.arrays import FloatArray


class Kinematics:
    """Forward kinematics and Jacobian for many configurations.

    Rows are the directions that count, of vx, vy, vz, wx, wy, wz along the axes of the base.
    """

    def __init__(self, chain: Chain, rows: Sequence[int] = range(6)) -> None:
        self.rows = list(rows)
        self.angular = max(self.rows) > 2
        self.size = len(chain.joints)
        self.lower, self.upper = (side[:, None] for side in chain.limits)
        self.ranged = np.isfinite(self.lower) & np.isfinite(self.upper)
        self.middle = chain.mid_range[:, None]
        #: Joints whose positions all are within the limits, some turns away; shape (n, 1).
        self.turns = self.upper - self.lower >= 4 * np.pi
        for motion in chain.motions:
            if motion.prismatic or motion.multiplier % 1:
                self.turns[motion.variable] = False
        self._end = np.array(chain.end)
        self._motions = []
        for motion in chain.motions:
            pose, axis = np.array(motion.placement), np.array(motion.axis)
            cross = np.cross(np.eye(3), axis)
            parts = [pose[:3, :3], pose[:3, :3] @ cross, pose[:3, :3] @ cross @ cross]
            stacked = np.concatenate([part.T for part in parts])
            self._motions.append((motion, stacked, pose[:3, 3], pose[:3, :3] @ axis))

    @property
    def reach(self) -> float:
        """Most distance of the tip from a joint's axis, but for travels, in metres."""
        shifts = [np.linalg.norm(shift) for _, _, shift, _ in self._motions[1:]]
        return float(np.sum(shifts) + np.linalg.norm(self._end[:3, 3]))

    def turned(self, q: FloatArray) -> FloatArray:
        """Return configurations or differences (n, B) less the whole turns in them."""
        return q - 2 * np.pi * np.round(q / (2 * np.pi)) * self.turns

    @property
    def ranges(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest positions to try, (n, 1) each: the limits, or two turns."""
        least = np.where(np.isfinite(self.lower), self.lower, -np.pi)
        largest = np.where(np.isfinite(self.upper), self.upper, np.pi)
        return np.maximum(least, -2 * np.pi), np.minimum(largest, 2 * np.pi)

    def frames(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return where the joints and the tip are at configurations (n, B).

        Axes of the chain's k motions and their origins, shape (k, 3, B) each; the tip's
        position, (3, B), and orientation, (3, 3, B).
        """
        count = q.shape[1]
        orientation = np.repeat(np.eye(3)[:, :, None], count, axis=2)
        position = np.zeros((3, count))
        axes, origins = np.empty((2, len(self._motions), 3, count))
        for k, (motion, stacked, shift, direction) in enumerate(self._motions):
            origins[k] = position = position + np.matmul(shift, orientation)
            axes[k] = np.matmul(direction, orientation)
            value = motion.multiplier * q[motion.variable] + motion.offset
            parts = np.matmul(stacked, orientation)
            if motion.prismatic:
                position = position + value * axes[k]
                orientation = parts[:, :3]
            else:
                orientation = parts[:, :3] + np.sin(value) * parts[:, 3:6]
                orientation += (1 - np.cos(value)) * parts[:, 6:]
        position = position + np.matmul(self._end[:3, 3], orientation)
        return axes, origins, position, np.matmul(self._end[:3, :3].T, orientation)

    def forward(self, q: FloatArray, jacobian: bool = True) -> tuple[FloatArray, ...]:
        """Return position (3, B), rotation (3, 3, B) and, if asked, J of shape (rows, n, B)."""
        axes, origins, position, orientation = self.frames(q)
        if not jacobian:
            return position, orientation
        matrix = np.zeros((6 if self.angular else 3, self.size, q.shape[1]))
        for (motion, *_), axis, origin in zip(self._motions, axes, origins, strict=True):
            column = matrix[:, motion.variable]
            if motion.prismatic:
                column[:3] += motion.multiplier * axis
                continue
            column[:3] += motion.multiplier * _cross(axis, position - origin)
            if self.angular:
                column[3:] += motion.multiplier * axis
        return position, orientation, matrix[self.rows]

    def motion_columns(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (v; ω) of the tip for each of k motions, (k, 6, B), and its orientation."""
        axes, origins, position, orientation = self.frames(q)
        columns = np.zeros((len(axes), 6, q.shape[1]))
        for (motion, *_), column, axis, origin in zip(
            self._motions, columns, axes, origins, strict=True
        ):
            column[:3] = axis if motion.prismatic else _cross(axis, position - origin)
            column[3:] = 0.0 if motion.prismatic else axis
        return columns, orientation

    def error(
        self,
        origin: FloatArray,
        orientation: FloatArray,
        position: FloatArray,
        rotation: FloatArray,
    ) -> FloatArray:
        """Return what is missing to a pose, shape (rows, B): metres, and a rotation vector.

        The pose is one for all, (3, 1) and (3, 3, 1), or one for each.
        """
        missing = position - origin
        if not self.angular:
            return np.asarray(missing[self.rows])
        # R·Rᵀ of the wanted and the present rotation.
        product = np.einsum(
            "ikb,jkb->ijb", np.broadcast_to(rotation, orientation.shape), orientation
        )
        return np.concatenate([missing, rotation_vectors(product)])[self.rows]


def tip_kinematics(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the Jacobian (v; ω), as in eq. (21), shape (6, n), and where the tip is.

    Of symbols of the free joints' positions, shape (n, 1); along the axes of the base, in
    metres and radians. The position of the tip's point has shape (3, 1), the rotation from its
    axes to those of the base (3, 3).
    """
    columns, tip, orientation = tip_columns(chain, positions)
    matrix = ca.SX.zeros(6, len(chain.joints))
    for motion, column in zip(chain.motions, columns, strict=True):
        matrix[:, motion.variable] += motion.multiplier * column
    return matrix, tip, orientation


def tip_columns(chain: Chain, positions: ca.SX) -> tuple[list[ca.SX], ca.SX, ca.SX]:
    """Return the column (v; ω) of each motion, and the tip's position and orientation."""
    rotations, origins, axes = body_frames(tuple(enumerate(chain.motions)), positions)
    orientation, tip = _moved(rotations[-1], origins[-1], chain.end)
    columns = [
        ca.vertcat(axis, ca.SX.zeros(3))
        if motion.prismatic
        else ca.vertcat(ca.cross(axis, tip - origin), axis)
        for motion, axis, origin in zip(chain.motions, axes, origins[1:], strict=True)
    ]
    return columns, tip, orientation


def slope_of_columns(
    columns: npt.NDArray[Any], weights: npt.NDArray[Any], tip_frame: bool = False
) -> npt.NDArray[Any]:
    """Return ∂/∂q_i of Σ_k w_k·c_k, c_k = (v_k; ω_k) the columns of a serial chain.

    From the columns alone, in O(k), for numbers and for symbols: motion i turns v_k and ω_k of
    the later ones as ω_i × v_k and ω_i × ω_k, and moves the tip of the earlier ones, which
    changes v_k by ω_k × v_i. Columns and weights have shape (k, 6, ...), one for each motion,
    along the axes of the base, or of the tip, which turn, too; the slope has shape (k, ...).
    """
    linear, angular = columns[:, :3], columns[:, 3:]
    force = np.cumsum(_crosses(weights[:, :3], angular), axis=0)
    moment = _crosses(linear, weights[:, :3]) + _crosses(angular, weights[:, 3:])
    turned = np.cumsum(moment, axis=0)
    turned = -turned if tip_frame else turned[-1:] - turned
    return np.asarray(np.sum(linear * force + angular * turned, axis=1))


def body_frames(
    bodies: Bodies, positions: ca.SX
) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
    """Return where bodies are, from symbols of the joints' positions.

    Rotations (3, 3) and origins (3, 1), the fixed body's first, and the axes of the motions,
    (3, 1), in the frame of that body.
    """
    rotations, origins, axes = [ca.SX.eye(3)], [ca.SX.zeros(3)], []
    for parent, motion in bodies:
        rotation, origin = _moved(rotations[parent], origins[parent], motion.placement)
        axes.append(rotation @ ca.DM(motion.axis))
        value = motion.multiplier * positions[motion.variable] + motion.offset
        if motion.prismatic:
            origin = origin + axes[-1] * value
        else:
            rotation = rotation @ _rotation(motion.axis, value)
        rotations.append(rotation)
        origins.append(origin)
    return rotations, origins, axes


def _crosses(left: npt.NDArray[Any], right: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Cross products along the second axis, which np.cross takes ten times as long for."""
    product = _cross(left.swapaxes(0, 1), right.swapaxes(0, 1))
    return product.swapaxes(0, 1)


def _cross(left: npt.NDArray[Any], right: npt.NDArray[Any]) -> npt.NDArray[Any]:
    (a, b, c), (x, y, z) = left, right
    return np.asarray([b * z - c * y, c * x - a * z, a * y - b * x])


def _moved(orientation: ca.SX, origin: ca.SX, placement: Transform) -> tuple[ca.SX, ca.SX]:
    pose = np.array(placement)
    return orientation @ ca.DM(pose[:3, :3]), origin + orientation @ ca.DM(pose[:3, 3])


def _rotation(axis: Sequence[float], angle: ca.SX) -> ca.SX:
    """Rotation by an angle in radians about a unit vector, shape (3, 3)."""
    cross = ca.skew(ca.DM(axis))
    return ca.SX.eye(3) + ca.sin(angle) * cross + (1 - ca.cos(angle)) * (cross @ cross)
