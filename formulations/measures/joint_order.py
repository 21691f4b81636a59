"""A canonical order of the joints of a Jacobian, with signs, phase and mirror image.

Rotations of the frame leave the joints' inner products; all else that leaves a manipulator
Jacobian the same only relabels them or changes their signs, phase or conjugation. The joints
are named one by one, such that the inner products with those named before are largest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray

# Inner products closer than this count as equal when joints are put in order.
TIE = 1e-4
# Orders kept side by side while they are tied; only highly symmetric Jacobians need many.
_WIDTH = 512


class Symmetry(Enum):
    """What leaves a Jacobian the same.

    FRAME: J → UJ for any orthogonal U (planar, positional, general screws).
    REVOLUTE: rows are (v; ω), one rotation acts on both, and the mirror image.
    UNIT_REVOLUTE: the same, and the common phase of v and ω.
    """

    FRAME = "frame"
    REVOLUTE = "revolute"
    UNIT_REVOLUTE = "unit-revolute"


@dataclass(frozen=True, eq=False)
class Order:
    """A partial order of the joints: who comes next, with which sign, in which phase."""

    joints: tuple[int, ...]
    signs: tuple[float, ...]
    mirrored: bool
    phase: float | None


def canonical_order(matrix: FloatArray, symmetry: Symmetry) -> Order:
    """Order the joints so that their inner products, read in turn, are largest."""
    mirrors = (False,) if symmetry is Symmetry.FRAME else (False, True)
    kernels = {
        m: inner_products(mirror_image(matrix) if m else matrix, symmetry) for m in mirrors
    }
    scale = float(np.sum(matrix**2)) / matrix.shape[1] or 1.0
    phased = symmetry is Symmetry.UNIT_REVOLUTE
    tied = [Order((), (), mirrored, None) for mirrored in mirrors]
    for _ in range(matrix.shape[1]):
        candidates = [
            found
            for order in tied
            for found in _extended(order, kernels[order.mirrored], phased, scale)
        ]
        tied = _largest(candidates, TIE * scale)[:_WIDTH]
    return tied[0]


def inner_products(matrix: FloatArray, symmetry: Symmetry) -> npt.NDArray[np.complex128]:
    """Inner products of the joints that no frame changes, shape (kinds, n, n).

    The last kind, z_iᵀz_j for unit revolute joints, turns with twice the phase.
    """
    if symmetry is Symmetry.FRAME:
        return np.array([matrix.T @ matrix], dtype=np.complex128)
    velocity, axis = matrix[:3], matrix[3:]
    if symmetry is Symmetry.REVOLUTE:
        cross = velocity.T @ axis
        kinds = [velocity.T @ velocity, axis.T @ axis, cross, cross.T]
        return np.array(kinds, dtype=np.complex128)
    z = velocity + 1j * axis
    return np.array([z.conj().T @ z, z.T @ z])


def _extended(
    order: Order, kernels: npt.NDArray[np.complex128], phased: bool, scale: float
) -> Iterator[tuple[list[float], Order]]:
    """All ways to name one more joint, each with the numbers it is judged by."""
    for joint in range(kernels.shape[1]):
        if joint in order.joints:
            continue
        joints = (*order.joints, joint)
        for sign in (1.0, -1.0) if order.joints else (1.0,):
            signs = (*order.signs, sign)
            row = np.array(signs) * sign * kernels[:, joints, joint]
            phase = order.phase
            if phased:
                phase = _phase(phase, row[-1], scale)
                # Without a phase yet these are too small to tell one; they say nothing.
                row[-1] *= 0.0 if phase is None else np.exp(2j * phase)
            numbers = np.concatenate([row.real, row.imag]).T.ravel().tolist()
            yield numbers, replace(order, joints=joints, signs=signs, phase=phase)


def _phase(known: float | None, row: npt.NDArray[np.complex128], scale: float) -> float | None:
    """Return the phase that makes the first inner product z_iᵀz_j that is not 0 positive."""
    if known is not None:
        return known
    large = row[np.abs(row) > 1e-2 * scale]
    return float(-np.angle(large[0]) / 2) if large.size else None


def _largest(candidates: list[tuple[list[float], Order]], tie: float) -> list[Order]:
    numbers = np.array([row for row, _ in candidates])
    left = np.arange(len(candidates))
    for k in range(numbers.shape[1]):
        column = numbers[left, k]
        left = left[column >= column.max() - tie]
    return [candidates[k][1] for k in left]


def mirror_image(matrix: FloatArray) -> FloatArray:
    """(v, −ω): the mirror image of a spatial arm, signs aside."""
    return np.vstack([matrix[:3], -matrix[3:]])
