"""Rotations, homogeneous matrices and distances of segments, of many at once in NumPy.

Angles are radians. In shapes … stands for any dimensions in front. A rotation R is a matrix
whose columns are the turned axes; a rotation vector is a unit axis a times the angle φ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray

# The axis of a rotation near half a turn, where its sine is less than this, is found otherwise:
# R - Rᵀ, which is as large as the sine, has lost digits there.
_SMALL_SINE = 1e-3
# A sine counts as at least this when it is a divisor, so that the identity, whose
# sine is 0, has the vector 0.
_LEAST_SINE = 1e-12
# Rotation vectors count as at least this long in their rates: 1 - φ/2 cot(φ/2) loses its digits
# where the angle is small, and is divided by φ².
_LEAST_ANGLE_RAD = 1e-6
# Lines are parallel if the squared sine of the angle between them is at most this: rounding.
_PARALLEL_SQUARED_SINE = 1e-20
# A pitch is a quarter turn if its cosine is less than this: roll and yaw have no digits there.
_QUARTER_TURN_COSINE = 1e-7
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]


def rotation(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Rotate about unit axes a (…, 3) by angles φ (…): I + sin φ [a]ₓ + (1 − cos φ) [a]ₓ².

    Rodrigues' formula; the result is (…, 3, 3).
    """
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    cross = cross.reshape((*axis.shape[:-1], 3, 3))
    sine = np.sin(angle)[..., None, None]
    versine = 2 * (np.sin(angle / 2) ** 2)[..., None, None]  # 1 − cos, exact for small angles
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def roll_pitch_yaw(turn: FloatArray) -> FloatArray:
    """Return turns about the fixed axes x, y, z, one after the other, of a rotation, (3, 3).

    As in URDF. At a pitch of a quarter turn only a sum of the others counts: yaw is then 0.
    """
    cosine = float(np.hypot(turn[0, 0], turn[1, 0]))
    pitch = np.arctan2(-turn[2, 0], cosine)
    if cosine < _QUARTER_TURN_COSINE:
        return np.array([np.arctan2(-turn[1, 2], turn[1, 1]), pitch, 0.0])
    roll = np.arctan2(turn[2, 1], turn[2, 2])
    return np.array([roll, pitch, np.arctan2(turn[1, 0], turn[0, 0])])


def screw(axis: FloatArray, angle: float, travel: float) -> FloatArray:
    """Return a rotation about a unit vector, (3,), and a travel along it in metres, 4×4."""
    return homogeneous(rotation(axis, np.asarray(angle)), travel * axis)


def homogeneous(turn: FloatArray, shift: npt.ArrayLike = 0.0) -> FloatArray:
    """Return rotations, (…, 3, 3), and shifts after them, (…, 3), as matrices, (…, 4, 4)."""
    pose = np.zeros((*turn.shape[:-2], 4, 4))
    pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = turn, shift, 1.0
    return pose


def crosses(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return vector products (…, 3, B) of vectors (…, 3, B): components are last but one.

    This is several times as fast as NumPy's function.
    """
    x, y, z = left[..., 0, :], left[..., 1, :], left[..., 2, :]
    a, b, c = right[..., 0, :], right[..., 1, :], right[..., 2, :]
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=-2)


def rotation_vectors(orientation: FloatArray) -> FloatArray:
    """Return the vectors (3, k) about which rotations (3, 3, k) turn, as long as the angle.

    The axis is that of R - Rᵀ, which vanishes at half a turn. Near there it is found from
    (R + Rᵀ)/2 = cos φ I + (1 - cos φ) a aᵀ, and R - Rᵀ gives only its sign.
    """
    twice = np.stack([orientation[2, 1], orientation[0, 2], orientation[1, 0]])
    # These are the entries of R - Rᵀ: 2 sin φ a.
    twice -= np.stack([orientation[1, 2], orientation[2, 0], orientation[0, 1]])
    sine = np.sqrt(np.sum(twice**2, axis=0)) / 2
    cosine = (orientation[0, 0] + orientation[1, 1] + orientation[2, 2] - 1) / 2
    angle = np.arctan2(sine, cosine)
    vectors = twice * (angle / np.maximum(sine, _LEAST_SINE) / 2)
    back = np.flatnonzero((sine < _SMALL_SINE) & (cosine < 0))
    if back.size:
        some = np.moveaxis(orientation[..., back], 2, 0)
        # The square becomes (1 - cos φ) a aᵀ, whose columns are along a: the largest is taken.
        square = (some + np.swapaxes(some, 1, 2)) / 2
        square -= cosine[back, None, None] * np.eye(3)
        largest = np.argmax(np.einsum("kii->ki", square), axis=1)
        axis = square[np.arange(len(back)), largest].T
        axis /= np.linalg.norm(axis, axis=0)
        axis *= np.where(np.sum(axis * twice[:, back], axis=0) < 0, -1.0, 1.0)
        vectors[:, back] = axis * angle[back]
    return np.asarray(vectors)


def rotation_vector_rates(vectors: FloatArray) -> FloatArray:
    """Return M of ṙ = Mω for rotation vectors r (3, B), where Ṙ = R [ω]ₓ; shape (B, 3, 3).

    M = I + [r]ₓ/2 + (1 − φ/2 cot(φ/2))/φ² [r]ₓ², with φ = |r|.
    """
    angle = np.maximum(np.linalg.norm(vectors, axis=0), _LEAST_ANGLE_RAD)
    cross = np.cross(np.eye(3)[None], vectors.T[:, None, :])
    half = angle / 2
    factor = (1 - half / np.tan(half)) / angle**2
    return np.asarray(np.eye(3) + cross / 2 + factor[:, None, None] * (cross @ cross))


def segment_distance(
    start: FloatArray,
    end: FloatArray,
    other_start: FloatArray,
    other_end: FloatArray,
    axis: int = -1,
) -> FloatArray:
    """Distances between two segments each, in the unit of their ends.

    Ends have shapes that broadcast, with three coordinates along one axis, the last one by
    default; the result has the shape without this axis. The nearest points of
    the two lines are s and t of the way along the segments. If s is cut off at an end, t is
    where that end is nearest; if t is cut off in turn, s is where the end of the other is
    nearest (Ericson, 2004).
    """
    u, v, gap = (
        np.moveaxis(one, axis, 0)
        for one in (end - start, other_end - other_start, other_start - start)
    )
    cross, across = _cross(u, v), _cross(gap, v)
    # Lengths are squared here; square is |u × v|².
    square, length, other_length = _dot(cross, cross), _dot(u, u), _dot(v, v)
    skew = square > _PARALLEL_SQUARED_SINE * length * other_length
    s = np.where(skew, _dot(across, cross) / np.where(skew, square, 1.0), 0.0)
    both = _dot(u, v)
    t = (np.clip(s, 0, 1) * both - _dot(gap, v)) / np.where(other_length > 0, other_length, 1)
    t = np.clip(t, 0, 1)
    s = np.clip((t * both + _dot(gap, u)) / np.where(length > 0, length, 1), 0, 1)
    apart = [s * u[k] - t * v[k] - gap[k] for k in range(3)]
    return np.asarray(np.sqrt(_dot(apart, apart)))


def _dot(
    left: Sequence[FloatArray] | FloatArray, right: Sequence[FloatArray] | FloatArray
) -> FloatArray:
    """Return scalar products of vectors by components; several times as fast as sums."""
    return np.asarray(left[0] * right[0] + left[1] * right[1] + left[2] * right[2])


def _cross(left: FloatArray, right: FloatArray) -> list[FloatArray]:
    """Return vector products of vectors by components."""
    (x, y, z), (a, b, c) = left, right
    return [y * c - z * b, z * a - x * c, x * b - y * a]
