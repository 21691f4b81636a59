"""One representative of each Jacobian modulo frame, phase, order and signs (Section 3).

The joints are named one by one, such that the inner products with those named before are
largest. A canonical order of the inner products gives a canonical J; see `symmetry`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from formulations.measures import as_jacobian
from formulations.measures.symmetry import Symmetry, inner_products, mirror_image, symmetry_of
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Inner products closer than this count as equal when joints are put in order.
TIE = 1e-4
# Orders kept side by side while they are tied; only highly symmetric Jacobians need many.
_WIDTH = 512


def canonical_form(jacobian: npt.ArrayLike, symmetry: Symmetry | None = None) -> FloatArray:
    """Return the representative of J's class, shape (m, n).

    Parameters
    ----------
    jacobian
        Shape (m, n), n > m.
    symmetry
        What counts as the same; by default `symmetry_of` J.

    Raises
    ------
    InputError
        If the symmetry needs six rows and J has another number.
    """
    matrix, symmetry = _checked(jacobian, symmetry)
    return _in_canonical_frame(_arranged(matrix, symmetry), symmetry)


def group_equivalent(
    jacobians: Sequence[npt.ArrayLike],
    tolerance: float = 1e-3,
    symmetry: Symmetry | None = None,
) -> list[list[int]]:
    """Group Jacobians that are the same.

    Parameters
    ----------
    jacobians
        Matrices of one shape.
    tolerance
        Largest difference of inner products, relative to ‖J‖_F²/n, within a group.
    symmetry
        What counts as the same; by default what all of them allow.

    Returns
    -------
    list of list of int
        Positions in `jacobians`, one list per class, in the order of first appearance.
    """
    groups: list[list[int]] = []
    known: list[FloatArray] = []
    if symmetry is None:
        allowed = {symmetry_of(jacobian) for jacobian in jacobians}
        symmetry = next((one for one in Symmetry if one in allowed), None)
    for position, jacobian in enumerate(jacobians):
        matrix, symmetry = _checked(jacobian, symmetry)
        kernels = inner_products(_arranged(matrix, symmetry), symmetry)
        products = np.concatenate([kernels.real, kernels.imag])
        scale = float(np.sum(matrix**2)) / matrix.shape[1]
        near = [np.max(np.abs(products - other)) <= tolerance * scale for other in known]
        if any(near):
            groups[near.index(True)].append(position)
        else:
            known.append(products)
            groups.append([position])
    return groups


def _checked(jacobian: npt.ArrayLike, symmetry: Symmetry | None) -> tuple[FloatArray, Symmetry]:
    matrix = as_jacobian(jacobian)
    if symmetry is None:
        symmetry = symmetry_of(matrix)
    if symmetry is not Symmetry.FRAME and matrix.shape[0] != 6:
        raise InputError("jacobian", f"with {matrix.shape[0]} rows", "six rows (v; ω)")
    return matrix, symmetry


def _arranged(matrix: FloatArray, symmetry: Symmetry) -> FloatArray:
    """J with joints, signs, phase and mirror image in canonical order; frame untouched."""
    order = canonical_order(matrix, symmetry)
    arranged = mirror_image(matrix) if order.mirrored else matrix
    arranged = np.asarray(arranged[:, list(order.joints)] * np.array(order.signs))
    if order.phase is None:
        return arranged
    z = (arranged[:3] + 1j * arranged[3:]) * np.exp(1j * order.phase)
    return np.asarray(np.vstack([z.real, z.imag]))


def _in_canonical_frame(matrix: FloatArray, symmetry: Symmetry) -> FloatArray:
    """Turn the frame so that the first vectors that span it become triangular."""
    if symmetry is Symmetry.FRAME:
        return _frame(matrix).T @ matrix
    velocity, axis = matrix[:3], matrix[3:]
    frame = _frame(np.stack([velocity, axis], axis=2).reshape(3, -1))
    return np.vstack([frame.T @ velocity, frame.T @ axis])


def _frame(vectors: FloatArray) -> FloatArray:
    """Orthonormal columns by Gram–Schmidt, taking vectors that add a direction clearly."""
    size = vectors.shape[0]
    scale = np.max(np.linalg.norm(vectors, axis=0))
    chosen: list[FloatArray] = []
    for threshold in (1e-2, 1e-12):
        for vector in vectors.T:
            basis = np.array(chosen).reshape(len(chosen), size)
            rest = vector - basis.T @ (basis @ vector)
            if len(chosen) < size and np.linalg.norm(rest) > threshold * scale:
                chosen.append(rest / np.linalg.norm(rest))
    if len(chosen) < size:  # J spans less than the task space: complete it somehow
        basis = np.array(chosen).reshape(len(chosen), size)
        chosen += list(np.linalg.svd(basis)[2][len(chosen) :])
    return np.array(chosen).T


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
