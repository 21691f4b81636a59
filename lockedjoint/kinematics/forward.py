"""Forward kinematics and Jacobians of a chain: in NumPy for many q at once, and in CasADi.

In NumPy configurations come last: q has shape (n, B), a Jacobian shape (rows, n, B). One
operation then does as much work as it can.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from lockedjoint.kinematics.chain import Bodies, Chain, Transform
from lockedjoint.kinematics.link_chain import crosses, homogeneous, rotation_vectors
from lockedjoint.nlp.arrays import FloatArray

# Sine of the angle between two axes that are parallel, but for rounding.
_PARALLEL = 1e-15


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
        self.turns = chain.turning[:, None] & (self.upper - self.lower >= 4 * np.pi)
        self._motions = chain.motions
        self._variables = [motion.variable for motion in chain.motions]
        self._multipliers = np.array([[motion.multiplier] for motion in chain.motions])
        self._slides = np.array([[motion.prismatic] for motion in chain.motions])
        self._offsets = np.array([[motion.offset] for motion in chain.motions])
        self._steps, self._turns, self._outset, self._end = _about_z(chain)

    @property
    def reach(self) -> float:
        """Most distance of the tip from a joint's axis, but for travels, in metres."""
        shifts = [np.linalg.norm(shift) for shift, _, _ in self._steps[1:]]
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
        values = self._multipliers * q[self._variables] + self._offsets
        angles = np.where(self._slides, 0.0, values) + self._turns
        # One tangent takes half as long as a cosine and a sine.
        tangents = np.tan(angles / 2)
        shares = 2 / (1 + tangents**2)
        cosines, sines = shares - 1, shares * tangents
        x, y, z = np.repeat(self._outset.T[:, :, None], q.shape[1], axis=2)
        position = np.zeros((3, q.shape[1]))
        axes, origins = np.empty((2, len(values), 3, q.shape[1]))
        for k, (shift, cosine, sine) in enumerate(self._steps):
            for length, axis in zip(shift, (x, y, z), strict=True):
                if length:
                    position = position + length * axis
            if abs(cosine) <= _PARALLEL:
                y, z = (z, -y) if sine > 0 else (-z, y)
            elif sine:
                y, z = cosine * y + sine * z, cosine * z - sine * y
            elif cosine < 0:
                y, z = -y, -z
            origins[k], axes[k] = position, z
            if self._slides[k]:
                position = position + values[k] * z
            cos, sin = cosines[k], sines[k]
            x, y = cos * x + sin * y, cos * y - sin * x
        orientation = np.stack([x, y, z], axis=1)
        position = position + np.matmul(self._end[:3, 3], orientation)
        return axes, origins, position, np.matmul(self._end[:3, :3].T, orientation)

    def forward(self, q: FloatArray, jacobian: bool = True) -> tuple[FloatArray, ...]:
        """Return position (3, B), rotation (3, 3, B) and, if asked, J of shape (rows, n, B)."""
        axes, origins, position, orientation = self.frames(q)
        if not jacobian:
            return position, orientation
        columns = self._columns(axes, origins, position, 6 if self.angular else 3)
        if self._variables == list(range(self.size)) and np.all(self._multipliers == 1):
            return position, orientation, columns[self.rows]
        matrix = np.zeros((len(columns), self.size, q.shape[1]))
        for k, motion in enumerate(self._motions):
            matrix[:, motion.variable] += motion.multiplier * columns[:, k]
        return position, orientation, matrix[self.rows]

    def _columns(
        self, axes: FloatArray, origins: FloatArray, position: FloatArray, rows: int
    ) -> FloatArray:
        """Return v, or (v; ω), of the tip for each of k motions, (rows, k, B)."""
        columns = np.zeros((rows, len(axes), axes.shape[2]))
        columns[:3] = crosses(axes, position - origins).swapaxes(0, 1)
        axes = axes.swapaxes(0, 1)
        if rows > 3:
            columns[3:] = axes
        slides = self._slides[:, 0]
        if slides.any():
            columns[:3, slides], columns[3:, slides] = axes[:, slides], 0.0
        return columns

    def motion_columns(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (v; ω) of the tip for each of k motions, (k, 6, B), and its orientation."""
        axes, origins, position, orientation = self.frames(q)
        columns = self._columns(axes, origins, position, 6)
        return np.ascontiguousarray(columns.swapaxes(0, 1)), orientation

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


def _about_z(
    chain: Chain,
) -> tuple[list[tuple[list[float], float, float]], FloatArray, FloatArray, FloatArray]:
    """Return a chain whose motions are about or along z, in frames of Denavit and Hartenberg.

    A placement is a shift, and turns about z, x and z: only that about x is left between two
    motions, as its cosine and sine; the others are part of the angles before and after.
    Returned are shifts and turns about x, angles to be added to the motions' own, (k, 1), the
    orientation before the first motion, (3, 3), and the end, (4, 4).
    """
    steps, turns = [], np.zeros((len(chain.motions), 1))
    outset, carried = np.eye(3), np.eye(4)
    for k, motion in enumerate(chain.motions):
        to_axis = homogeneous(turn_to(np.array(motion.axis)))
        pose = carried @ np.array(motion.placement) @ to_axis
        cosine, sine = pose[2, 2], float(np.hypot(*pose[:2, 2]))
        theta = np.arctan2(pose[0, 2], -pose[1, 2]) if sine > _PARALLEL else 0.0
        if sine <= _PARALLEL:
            cosine, sine = np.sign(cosine), 0.0
        cos, sin = np.cos(theta), np.sin(theta)
        back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        if k:
            turns[k - 1] += theta
        else:
            outset = back.T
        rest = back @ pose[:3, :3]
        turns[k] = np.arctan2(-rest[0, 1], rest[0, 0])
        steps.append(((back @ pose[:3, 3]).tolist(), float(cosine), float(sine)))
        carried = to_axis.T
    return steps, turns, outset, carried @ np.array(chain.end)


def turn_to(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes the z axis to a unit vector, (3, 3)."""
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, x) if abs(axis[2]) < 1 - 1e-12 else np.array([1.0, 0, 0])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def tip_kinematics(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the Jacobian (v; ω), as in eq. (21), shape (6, n), and where the tip is.

    Of symbols of the free joints' positions, shape (n, 1); along the axes of the base, in
    metres and radians. The position of the tip's point has shape (3, 1), the rotation from its
    axes to those of the base (3, 3).
    """
    rotations, origins, axes = body_frames(tuple(enumerate(chain.motions)), positions)
    orientation, tip = _moved(rotations[-1], origins[-1], chain.end)
    matrix = ca.SX.zeros(6, len(chain.joints))
    for motion, axis, origin in zip(chain.motions, axes, origins[1:], strict=True):
        column = ca.vertcat(ca.cross(axis, tip - origin), axis)
        if motion.prismatic:
            column = ca.vertcat(axis, ca.SX.zeros(3))
        matrix[:, motion.variable] += motion.multiplier * column
    return matrix, tip, orientation


def slope_of_columns(
    columns: FloatArray, weights: FloatArray, tip_frame: bool = False
) -> FloatArray:
    """Return ∂/∂q_i of Σ_k w_k·c_k, c_k = (v_k; ω_k) the columns of a serial chain.

    From the columns alone, in O(k): motion i turns v_k and ω_k of the later ones as ω_i × v_k
    and ω_i × ω_k, and moves the tip of the earlier ones, which changes v_k by ω_k × v_i.
    Columns and weights have shape (k, 6, B), one for each motion, along the axes of the base,
    or of the tip, which turn, too; the slope has shape (k, B).
    """
    linear, angular = columns[:, :3], columns[:, 3:]
    force = np.cumsum(crosses(weights[:, :3], angular), axis=0)
    moment = crosses(linear, weights[:, :3]) + crosses(angular, weights[:, 3:])
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
            cross = ca.skew(ca.DM(motion.axis))
            versine = (1 - ca.cos(value)) * (cross @ cross)
            rotation = rotation @ (ca.SX.eye(3) + ca.sin(value) * cross + versine)
        rotations.append(rotation)
        origins.append(origin)
    return rotations, origins, axes


class BodyKinematics:
    """Where all bodies of a robot are, for many configurations."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = []
        for parent, motion in bodies:
            pose, axis = np.array(motion.placement), np.array(motion.axis)
            skew = np.cross(np.eye(3), axis)
            turned = (pose[:3, :3], pose[:3, :3] @ skew, pose[:3, :3] @ skew @ skew)
            parts = np.concatenate([part.T for part in turned])
            self._bodies.append((parent, motion, parts, pose[:3, 3], pose[:3, :3] @ axis))

    def frames(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rotations (bodies, 3, 3, B), origins (bodies, 3, B) at configurations."""
        rotations = np.empty((len(self._bodies) + 1, 3, 3, q.shape[1]))
        origins = np.zeros((len(self._bodies) + 1, 3, q.shape[1]))
        rotations[0] = np.eye(3)[:, :, None]
        for k, (parent, motion, turns, shift, axis) in enumerate(self._bodies, 1):
            value = motion.multiplier * q[motion.variable] + motion.offset
            parts = np.matmul(turns, rotations[parent])
            rotations[k] = parts[:, :3]
            origins[k] = origins[parent] + np.matmul(shift, rotations[parent])
            if motion.prismatic:
                origins[k] += value * np.matmul(axis, rotations[parent])
            else:
                rotations[k] += np.sin(value) * parts[:, 3:6]
                rotations[k] += (1 - np.cos(value)) * parts[:, 6:]
        return rotations, origins


def _moved(orientation: ca.SX, origin: ca.SX, placement: Transform) -> tuple[ca.SX, ca.SX]:
    pose = np.array(placement)
    return orientation @ ca.DM(pose[:3, :3]), origin + orientation @ ca.DM(pose[:3, 3])
