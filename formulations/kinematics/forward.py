"""Forward kinematics, Jacobians and inverse kinematics of a chain in NumPy, for many q at once.

Arrays have configurations last: q has shape (n, B), a Jacobian shape (rows, n, B). One NumPy
operation then does as much work as it can, and no small matrices are factored one at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from formulations.kinematics.chain import Chain
from formulations.kinematics.link_chain import HALF_TURN, rotation_vectors
from nlp.arrays import FloatArray

BoolArray = npt.NDArray[np.bool_]
# A pose is reached if position (metres) and orientation (radians) are off by less, each entry.
TOLERANCE = 1e-5
# Most iterations at a sample, and the largest change of a joint in one of them.
_ITERATIONS, _STEP = 6, 0.3
# Damping: this times the squared error, and never less than the second.
_DAMPING, _LEAST = 1e-2, 1e-10


class Kinematics:
    """Forward kinematics, Jacobian and damped least squares for many configurations.

    Parameters
    ----------
    chain
        The joints.
    rows
        The directions that count, of vx, vy, vz, wx, wy, wz along the axes of the base.
    """

    def __init__(self, chain: Chain, rows: Sequence[int] = range(6)) -> None:
        self.rows = list(rows)
        self.orientation = max(self.rows) > 2
        self.size = len(chain.joints)
        self.lower, self.upper = (side[:, None] for side in chain.limits)
        ranged = np.isfinite(self.lower) & np.isfinite(self.upper)
        self._middle = chain.mid_range[:, None]
        self._widths = np.where(ranged, self.upper - self.lower, np.inf)
        self._end = np.array(chain.end)
        self._motions = []
        for motion in chain.motions:
            pose, axis = np.array(motion.placement), np.array(motion.axis)
            cross = np.cross(np.eye(3), axis)
            parts = [pose[:3, :3], pose[:3, :3] @ cross, pose[:3, :3] @ cross @ cross]
            stacked = np.concatenate([part.T for part in parts])
            self._motions.append((motion, stacked, pose[:3, 3], pose[:3, :3] @ axis))

    @property
    def ranges(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest positions to try, (n, 1) each: the limits, or two turns."""
        least = np.where(np.isfinite(self.lower), self.lower, -np.pi)
        largest = np.where(np.isfinite(self.upper), self.upper, np.pi)
        return np.maximum(least, -2 * np.pi), np.minimum(largest, 2 * np.pi)

    def forward(self, q: FloatArray, jacobian: bool = True) -> tuple[FloatArray, ...]:
        """Return position (3, B), rotation (3, 3, B) and, if asked, J of shape (rows, n, B)."""
        count = q.shape[1]
        turn = np.repeat(np.eye(3)[:, :, None], count, axis=2)
        origin = np.zeros((3, count))
        screws = []
        for motion, stacked, shift, direction in self._motions:
            origin = origin + np.matmul(shift, turn)
            axis = np.matmul(direction, turn)
            screws.append((motion, axis, origin))
            value = motion.multiplier * q[motion.variable] + motion.offset
            parts = np.matmul(stacked, turn)
            if motion.prismatic:
                origin = origin + value * axis
                turn = parts[:, :3]
            else:
                turn = parts[:, :3] + np.sin(value) * parts[:, 3:6]
                turn += (1 - np.cos(value)) * parts[:, 6:]
        origin = origin + np.matmul(self._end[:3, 3], turn)
        turn = np.matmul(self._end[:3, :3].T, turn)
        if not jacobian:
            return origin, turn
        matrix = np.zeros((6 if self.orientation else 3, self.size, count))
        for motion, axis, start in screws:
            column = matrix[:, motion.variable]
            scale = motion.multiplier
            if motion.prismatic:
                column[:3] += scale * axis
                continue
            x, y, z = origin - start
            column[0] += scale * (axis[1] * z - axis[2] * y)
            column[1] += scale * (axis[2] * x - axis[0] * z)
            column[2] += scale * (axis[0] * y - axis[1] * x)
            if self.orientation:
                column[3:] += scale * axis
        return origin, turn, matrix[self.rows]

    def error(
        self, origin: FloatArray, turn: FloatArray, position: FloatArray, rotation: FloatArray
    ) -> FloatArray:
        """Return what is missing to a pose, shape (rows, B): metres, and a rotation vector.

        The pose is one for all, (3, 1) and (3, 3, 1), or one for each.
        """
        missing = position - origin
        if not self.orientation:
            return np.asarray(missing[self.rows])
        # R·Rᵀ of the wanted and the present rotation; its axis times the sine of its angle.
        product = np.einsum("ikb,jkb->ijb", np.broadcast_to(rotation, turn.shape), turn)
        vector = np.stack([product[2, 1], product[0, 2], product[1, 0]])
        vector -= np.stack([product[1, 2], product[2, 0], product[0, 1]])
        sine = np.sqrt(np.sum(vector**2, axis=0)) / 2
        cosine = (product[0, 0] + product[1, 1] + product[2, 2] - 1) / 2
        angle = np.arctan2(sine, cosine)
        vector *= angle / np.maximum(sine, 1e-12) / 2
        back = np.flatnonzero((sine < HALF_TURN) & (cosine < 0))
        if back.size:
            vector[:, back] = rotation_vectors(np.moveaxis(product[..., back], 2, 0)).T
        return np.concatenate([missing, vector])[self.rows]

    def reach(
        self,
        q: FloatArray,
        position: FloatArray,
        rotation: FloatArray,
        free: BoolArray | None = None,
        iterations: int = _ITERATIONS,
        centre: float = 0.0,
    ) -> tuple[FloatArray, BoolArray]:
        """Move configurations to a pose by damped least squares, within the limits.

        Parameters
        ----------
        q
            Where they start, shape (n, B).
        position, rotation
            The pose, see `error`.
        free
            Joints that may move, shape (n, B) or (n, 1); all if left out.
        iterations
            Most iterations.
        centre
            How far the first step goes towards the middle of the joints' ranges along the
            self-motion, as a share of the way.

        Returns
        -------
        numpy.ndarray
            Configurations, shape (n, B).
        numpy.ndarray
            Which of them reached the pose, shape (B,).
        """
        q = q.copy()
        movable = np.broadcast_to(True if free is None else free, q.shape).copy()
        done = np.zeros(q.shape[1], dtype=bool)
        active = np.arange(q.shape[1])
        for iteration in range(iterations + 1):
            position_, rotation_ = _some(position, active), _some(rotation, active)
            origin, turn, matrix = self.forward(q[:, active])
            missing = self.error(origin, turn, position_, rotation_)
            near = np.max(np.abs(missing), axis=0) < TOLERANCE
            if not (centre and iteration == 0):
                done[active[near]] = True
                left = ~near
                active, matrix, missing = active[left], matrix[:, :, left], missing[:, left]
            if not active.size or iteration == iterations:
                break
            matrix = matrix * movable[:, active]
            damping = _DAMPING * np.sum(missing**2, axis=0) + _LEAST
            if centre and iteration == 0:
                drift = centre * (self._middle - q[:, active]) * np.isfinite(self._widths)
                drift *= movable[:, active]
                missing = missing - np.einsum("inb,nb->ib", matrix, drift)
                step = drift + _least_squares(matrix, missing, damping)
            else:
                step = _least_squares(matrix, missing, damping)
            step *= np.minimum(1, _STEP / np.maximum(np.max(np.abs(step), axis=0), 1e-12))
            moved = q[:, active] + step
            kept = np.clip(moved, self.lower, self.upper)
            # A joint that is pushed against its limit stays there while the others go on.
            movable[:, active] &= np.abs(moved - kept) < 1e-9
            q[:, active] = kept
        return q, done


def _some(pose: FloatArray, which: npt.NDArray[np.intp]) -> FloatArray:
    return pose if pose.shape[-1] == 1 else pose[..., which]


def _least_squares(matrix: FloatArray, missing: FloatArray, damping: FloatArray) -> FloatArray:
    """Return Jᵀ(JJᵀ + λ)⁻¹e for each of many, shape (n, B): Cholesky, entry by entry."""
    rows = len(matrix)
    factor: list[list[FloatArray]] = []
    right: list[FloatArray] = []
    for i in range(rows):
        line: list[FloatArray] = []
        for j in range(i + 1):
            entry = np.einsum("nb,nb->b", matrix[i], matrix[j])
            if i == j:
                entry += damping
            for k in range(j):
                entry -= line[k] * (factor[j][k] if j < i else line[k])
            line.append(np.sqrt(np.maximum(entry, 1e-14)) if i == j else entry / factor[j][j])
        factor.append(line)
        value = missing[i].copy()
        for k in range(i):
            value -= line[k] * right[k]
        right.append(value / line[i])
    for i in reversed(range(rows)):
        for k in range(i + 1, rows):
            right[i] = right[i] - factor[k][i] * right[k]
        right[i] = right[i] / factor[i][i]
    return np.asarray(np.einsum("inb,ib->nb", matrix, np.stack(right)))
