"""One representative of each Jacobian modulo frame, phase, order and signs (Section 3).

Two Jacobians are the same manipulator Jacobian when they differ by a rotation or reflection
of the task frame, the order of the joints and the signs of their axes; for unit revolute
joints also by a common phase, (v, ω) → (cosθ v − sinθ ω, sinθ v + cosθ ω), and by the mirror
image (v, −ω). All of it acts on the joints' inner products only by relabelling, signs,
phase and conjugation, so a canonical order of the inner products gives a canonical J.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from formulations.measures.jacobian import as_jacobian
from formulations.measures.joint_order import (
    Symmetry,
    canonical_order,
    inner_products,
    mirror_image,
)
from nlp.arrays import FloatArray
from nlp.errors import InputError

__all__ = ["Symmetry", "canonical_form", "distinct", "symmetry_of"]


def symmetry_of(jacobian: npt.ArrayLike, tolerance: float = 1e-6) -> Symmetry:
    """Return the largest symmetry that the columns allow: by their shape, from J alone."""
    matrix = as_jacobian(jacobian)
    if matrix.shape[0] != 6:
        return Symmetry.FRAME
    velocity, axis = matrix[:3], matrix[3:]
    if np.max(np.abs(np.sum(velocity * axis, axis=0))) > tolerance:
        return Symmetry.FRAME
    gap = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return Symmetry.UNIT_REVOLUTE if np.max(np.abs(gap)) <= tolerance else Symmetry.REVOLUTE


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


def distinct(
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
        symmetry = _common_symmetry(jacobians)
    for position, jacobian in enumerate(jacobians):
        matrix, symmetry = _checked(jacobian, symmetry)
        products = _products(_arranged(matrix, symmetry), symmetry)
        scale = float(np.sum(matrix**2)) / matrix.shape[1]
        near = [np.max(np.abs(products - other)) <= tolerance * scale for other in known]
        if any(near):
            groups[near.index(True)].append(position)
        else:
            known.append(products)
            groups.append([position])
    return groups


def _common_symmetry(jacobians: Sequence[npt.ArrayLike]) -> Symmetry:
    found = {symmetry_of(jacobian) for jacobian in jacobians}
    for symmetry in (Symmetry.FRAME, Symmetry.REVOLUTE):
        if symmetry in found:
            return symmetry
    return Symmetry.UNIT_REVOLUTE


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


def _products(matrix: FloatArray, symmetry: Symmetry) -> FloatArray:
    kernels = inner_products(matrix, symmetry)
    return np.concatenate([kernels.real, kernels.imag])


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
