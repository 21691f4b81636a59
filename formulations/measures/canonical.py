"""What leaves a Jacobian the same, and one representative of each class (Section 3).

Two Jacobians are the same manipulator Jacobian when they differ by a rotation or reflection
of the task frame, the order of the joints and the signs of their axes; for unit revolute
joints also by a common phase, (v, ω) → (cosθ v − sinθ ω, sinθ v + cosθ ω), and by the mirror
image (v, −ω). All of it acts on the joints' inner products only by relabelling, signs, phase
and conjugation. `invariants` do not depend on these and change by at most 5/3 of what the inner
products do: Jacobians of one class have equal numbers, and others belong to other classes.

For the representative the joints are named one by one, such that the inner products with those
named before are largest. A canonical order of the inner products gives a canonical J.

- J, `matrix`: shape (m, n), a column for each joint. Six rows are (v; ω): `velocity` is v and
  `axis` is ω, both of shape (3, n);
- z = v + iω, shape (3, n): a common phase of the joints turns it by exp(iθ);
- kind of inner product: what two joints i and j are compared by, such as v_iᵀv_j. The kinds of
  each symmetry: `inner_products`. `products` and `kernels` have the shape (kinds, n, n);
- scale: ‖J‖_F²/n, the mean squared norm of a column, by which all tolerances are multiplied.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.measures import as_jacobian
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import InputError, entries_of

# Largest difference of inner products, relative to ‖J‖_F²/n, within a class.
TOLERANCE = 1e-3
# v·ω and |v|² − |ω|² of a column count as 0 if they are at most this; v·ω of two columns that
# differ by at most this count as equal. A larger number sees symmetries that J has only nearly.
_SQUARE = 1e-6
#: Largest number of classes that are distinguished: where optima come in families every start
#: has its own, and the list would have no end.
MOST = 1000
# Share of the scale above which an inner product z_iᵀz_j is large enough to fix the phase.
_FIXES_PHASE = 1e-2
# Shares of the longest vector that a vector has to add to those chosen before: first vectors
# that add a direction clearly are taken, then those above rounding.
_ADDED_DIRECTIONS = (1e-2, 1e-12)


class Symmetry(Enum):
    """What leaves a Jacobian the same.

    FRAME: J → UJ for any orthogonal U (planar, positional, general screws).
    REVOLUTE: rows are (v; ω), one rotation acts on both, and the mirror image; screws, too.
    UNIT_REVOLUTE: the same, and the common phase of v and ω.
    """

    FRAME = "frame"
    REVOLUTE = "revolute"
    UNIT_REVOLUTE = "unit-revolute"


def symmetry_of(jacobian: npt.ArrayLike) -> Symmetry:
    """Return the largest symmetry that the columns allow: by their shape, from J alone."""
    matrix = as_jacobian(jacobian)
    if matrix.shape[0] != 6:
        return Symmetry.FRAME
    velocity, axis = matrix[:3], matrix[3:]
    pitches = np.abs(np.sum(velocity * axis, axis=0))
    if np.ptp(pitches) > _SQUARE:
        return Symmetry.FRAME
    if pitches.max() > _SQUARE:  # screws of one pitch, or of two hands
        return Symmetry.REVOLUTE
    gap = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return Symmetry.UNIT_REVOLUTE if np.max(np.abs(gap)) <= _SQUARE else Symmetry.REVOLUTE


def inner_products(matrix: FloatArray, symmetry: Symmetry) -> npt.NDArray[np.complex128]:
    """Return the inner products of the joints that no frame changes, shape (kinds, n, n).

    The kinds, in this order, are for joints i and j::

        FRAME           j_iᵀj_j
        REVOLUTE        v_iᵀv_j,   ω_iᵀω_j,   v_iᵀω_j,   ω_iᵀv_j
        UNIT_REVOLUTE   z_i*z_j,   z_iᵀz_j                          with z = v + iω

    The last kind of unit revolute joints turns with twice the phase.
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


class _Kinds(NamedTuple):
    """How many of the kinds of `inner_products`, the first ones, have which invariants."""

    #: Kinds whose products in a cycle of three joints do not depend on signs and phase.
    cyclic: int
    #: Kinds that are not the transpose of one before.
    distinct: int


_KINDS = {
    Symmetry.FRAME: _Kinds(cyclic=1, distinct=1),
    # The mirror image changes the sign of a cycle of v_iᵀω_j; ω_iᵀv_j is the transpose of it.
    Symmetry.REVOLUTE: _Kinds(cyclic=2, distinct=3),
    # A cycle of z_iᵀz_j turns with the phase.
    Symmetry.UNIT_REVOLUTE: _Kinds(cyclic=1, distinct=2),
}


def _mirror_image(matrix: FloatArray) -> FloatArray:
    """Return (v; −ω): the mirror image of a spatial arm, signs aside."""
    return np.vstack([matrix[:3], -matrix[3:]])


def classes(jacobians: Sequence[FloatArray], symmetry: Symmetry) -> list[list[int]]:
    """Group Jacobians by their `invariants`: positions, in the order of first appearance.

    When there are `MOST` classes, no new ones begin.
    """
    rows = ((invariants(one, symmetry), TOLERANCE * _scale(one)) for one in jacobians)
    return _grouped(rows, MOST)


def invariants(jacobian: FloatArray, symmetry: Symmetry) -> FloatArray:
    """Return a vector of numbers that are the same for all Jacobians of a class.

    They agree within `TOLERANCE` times the scale.

    For each kind of inner product: all moduli, sorted; for each joint, the root mean square
    and the largest of those with the others, sorted over joints; and for each three joints
    the product in a cycle, in which signs and phase cancel. None of them changes by more than
    5/3 of what the inner products do: abc/(3s²), s the largest modulus, by 1 with a, b and c
    and by 2/3 with s, the others by 1.
    """
    products = inner_products(jacobian, symmetry)
    count = _KINDS[symmetry]
    first, second, third = _triples(jacobian.shape[1])
    parts = []
    for kind in products[: count.cyclic]:
        size = float(np.max(np.abs(kind))) or 1.0
        cycles = (kind[first, second] * kind[second, third] * kind[third, first]).real
        parts.append(np.sort(cycles / (3 * size**2)))
    for kind in np.abs(products[: count.distinct]):
        # Joints are rows of one side and columns of the other: v_iᵀω_j is not symmetric.
        sides = (kind, kind.T)
        parts.append(np.sort(kind, axis=None))
        parts += [np.sort(np.sqrt(np.mean(side**2, axis=1))) for side in sides]
        parts += [np.sort(np.max(side, axis=1)) for side in sides]
    return np.concatenate(parts)


@lru_cache(maxsize=8)
def _triples(joints: int) -> npt.NDArray[np.intp]:
    """Return the three joints of all sets of three, shape (3, sets)."""
    return np.array(list(combinations(range(joints), 3)), dtype=np.intp).reshape(-1, 3).T


#: Inner products closer than this, relative to ‖J‖_F²/n, count as equal when joints are put in
#: order.
TIE = 1e-4
# Largest number of orders that are kept side by side while they are tied; only highly symmetric
# Jacobians need many. If it is exceeded the symmetries are not counted.
_WIDTH = 512


def canonical_form(jacobian: npt.ArrayLike, symmetry: Symmetry | None = None) -> FloatArray:
    """Return the form that all Jacobians share that are the same as J, shape (m, n).

    Two Jacobians are the same if they differ only by the frame of the task, the order of the
    joints and the signs of their axes; if all joints are unit revolute, also by a common phase
    and the mirror image.

    Parameters
    ----------
    jacobian
        Shape (m, n), n > m.
    symmetry
        Which of these changes count; by default `symmetry_of` J.

    Raises
    ------
    InputError
        If the symmetry needs six rows and J has another number.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> jacobian = lj.optimal_jacobian(8)
    >>> lj.canonical_form(jacobian).shape
    (6, 8)
    """
    matrix, symmetry = _checked(jacobian, symmetry)
    return _in_canonical_frame(_arranged(matrix, symmetry), symmetry)


def count_symmetries(jacobian: npt.ArrayLike) -> int | None:
    """Return how many ways there are to rename J's joints that a change of frame undoes.

    With the joints their signs change, and the mirror image and the phase where `symmetry_of` J
    has them; all signs at once do not count apart. It is the order of J's symmetry group, or
    None where more than 512 ways to rename some of the joints are tied.
    """
    matrix, symmetry = _checked(jacobian, None)
    orders, are_all = _canonical_orders(matrix, symmetry)
    return len(orders) if are_all else None


def group_equivalent(
    jacobians: Sequence[npt.ArrayLike],
    tolerance: float = 1e-3,
    symmetry: Symmetry | None = None,
) -> list[list[int]]:
    """Group Jacobians that are the same; see `canonical_form`.

    Parameters
    ----------
    jacobians
        Matrices of one shape (m, n).
    tolerance
        Largest difference of inner products, relative to ‖J‖_F²/n, within a group.
    symmetry
        Which changes count; by default those that all of them allow.

    Returns
    -------
    list of list of int
        Positions in `jacobians`, one list per group, in the order of first appearance.

    Raises
    ------
    InputError
        If the shapes differ, a matrix is no Jacobian, or the tolerance is negative.

    Examples
    --------
    >>> import numpy as np
    >>> import lockedjoint as lj
    >>> jacobian = lj.optimal_jacobian(8)
    >>> lj.group_equivalent([jacobian, jacobian[:, ::-1], np.eye(6, 8)])
    [[0, 1], [2]]
    """
    jacobians = entries_of("jacobians", jacobians, "a list of matrices")
    if len({np.shape(one) for one in map(as_jacobian, jacobians)}) > 1:
        raise InputError("jacobians", "of several shapes", "matrices of one shape")
    real_number("tolerance", tolerance, "a number of at least 0", least=0.0)
    if symmetry is None:
        allowed = {symmetry_of(jacobian) for jacobian in jacobians}
        symmetry = next((kind for kind in Symmetry if kind in allowed), None)
    rows = []
    for jacobian in jacobians:
        matrix, symmetry = _checked(jacobian, symmetry)
        kernels = inner_products(_arranged(matrix, symmetry), symmetry)
        products = np.concatenate([kernels.real, kernels.imag]).ravel()
        rows.append((products, tolerance * _scale(matrix)))
    return _grouped(rows)


def _grouped(
    rows: Iterable[tuple[FloatArray, float]], most: int | None = None
) -> list[list[int]]:
    """Group vectors, each given with its limit; return the positions of each group's members.

    A vector joins the first group whose first member is within its limit in all entries. When
    there are `most` groups, vectors that fit none are left out.
    """
    groups: list[list[int]] = []
    known: FloatArray = np.zeros((0, 1))
    for position, (row, limit) in enumerate(rows):
        near = np.flatnonzero(np.max(np.abs(known - row), axis=1, initial=0.0) <= limit)
        if near.size:
            groups[int(near[0])].append(position)
        elif most is None or len(groups) < most:
            known = np.vstack([known, row]) if groups else row[None]
            groups.append([position])
    return groups


def _scale(matrix: FloatArray) -> float:
    """Return ‖J‖_F²/n, in whose units inner products are compared."""
    return float(np.sum(matrix**2) / matrix.shape[1])


def _checked(jacobian: npt.ArrayLike, symmetry: Symmetry | None) -> tuple[FloatArray, Symmetry]:
    """Return a Jacobian and what counts as the same, by default `symmetry_of` J."""
    matrix = as_jacobian(jacobian)
    if symmetry is None:
        symmetry = symmetry_of(matrix)
    if symmetry is not Symmetry.FRAME and matrix.shape[0] != 6:
        raise InputError("jacobian", f"with {matrix.shape[0]} rows", "six rows (v; ω)")
    return matrix, symmetry


def _arranged(matrix: FloatArray, symmetry: Symmetry) -> FloatArray:
    """Return J, shape (m, n), with joints, signs, phase and mirror image in canonical order.

    The frame stays.
    """
    orders, _ = _canonical_orders(matrix, symmetry)
    # Orders that tie give the same inner products.
    order = orders[0]
    arranged = _mirror_image(matrix) if order.mirrored else matrix
    arranged = np.asarray(arranged[:, list(order.joints)] * np.array(order.signs))
    if order.phase is None:
        return arranged
    z = (arranged[:3] + 1j * arranged[3:]) * np.exp(1j * order.phase)
    return np.asarray(np.vstack([z.real, z.imag]))


def _in_canonical_frame(matrix: FloatArray, symmetry: Symmetry) -> FloatArray:
    """Return J, shape (m, n), turned so that the first vectors that span it are triangular."""
    if symmetry is Symmetry.FRAME:
        return _frame(matrix).T @ matrix
    velocity, axis = matrix[:3], matrix[3:]
    # The columns v_1, ω_1, v_2, ω_2, …, shape (3, 2n).
    vectors = np.stack([velocity, axis], axis=2).reshape(3, -1)
    frame = _frame(vectors)
    return np.vstack([frame.T @ velocity, frame.T @ axis])


def _frame(vectors: FloatArray) -> FloatArray:
    """Return orthonormal columns, shape (size, size), from vectors of shape (size, count).

    Gram–Schmidt takes the vectors in their order, those that add a direction clearly first.
    """
    size = vectors.shape[0]
    scale = np.max(np.linalg.norm(vectors, axis=0))
    chosen: list[FloatArray] = []
    for threshold in _ADDED_DIRECTIONS:
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
    """Joints that are named so far, in the order of their names."""

    #: Their numbers in J.
    joints: tuple[int, ...]
    #: The sign of each, 1 or −1.
    signs: tuple[float, ...]
    #: Whether they are those of the mirror image of J.
    mirrored: bool
    #: The angle (rad) by which z is turned; None while no inner product fixes it.
    phase: float | None


def _canonical_orders(matrix: FloatArray, symmetry: Symmetry) -> tuple[list[Order], bool]:
    """Order the joints so that their inner products, read in turn, are largest.

    Returns orders that tie, and whether these are all.
    """
    mirrors = (False,) if symmetry is Symmetry.FRAME else (False, True)
    kernels = {
        mirrored: inner_products(_mirror_image(matrix) if mirrored else matrix, symmetry)
        for mirrored in mirrors
    }
    scale = _scale(matrix) or 1.0
    phased = symmetry is Symmetry.UNIT_REVOLUTE
    tied = [Order(joints=(), signs=(), mirrored=one, phase=None) for one in mirrors]
    are_all = True
    for _ in range(matrix.shape[1]):
        candidates = [
            candidate
            for order in tied
            for candidate in _extended(order, kernels[order.mirrored], phased, scale)
        ]
        tied = _largest(candidates, TIE * scale)
        are_all = are_all and len(tied) <= _WIDTH
        tied = tied[:_WIDTH]
    return tied, are_all


def _extended(
    order: Order, kernels: npt.NDArray[np.complex128], phased: bool, scale: float
) -> Iterator[tuple[list[float], Order]]:
    """Yield all ways to name one more joint, each after the numbers it is judged by.

    These are its inner products with the joints named before, and with itself: for each of them
    the real parts of all kinds, then the imaginary parts. The first joint needs no sign: all
    signs at once change no inner product.
    """
    for joint in range(kernels.shape[1]):
        if joint in order.joints:
            continue
        joints = (*order.joints, joint)
        for sign in (1.0, -1.0) if order.joints else (1.0,):
            signs = (*order.signs, sign)
            # Shape (kinds, joints named).
            row = np.array(signs) * sign * kernels[:, joints, joint]
            phase = order.phase
            if phased:
                turning = row[-1]  # a view of the last kind, z_iᵀz_j
                phase = _phase(phase, turning, scale)
                # Entries too small to tell a phase say nothing while there is none.
                turning *= 0.0 if phase is None else np.exp(2j * phase)
            numbers = np.concatenate([row.real, row.imag]).T.ravel().tolist()
            yield numbers, replace(order, joints=joints, signs=signs, phase=phase)


def _phase(known: float | None, row: npt.NDArray[np.complex128], scale: float) -> float | None:
    """Return the phase that makes the first inner product z_iᵀz_j that is not 0 positive."""
    if known is not None:
        return known
    large = row[np.abs(row) > _FIXES_PHASE * scale]
    return float(-np.angle(large[0]) / 2) if large.size else None


def _largest(candidates: list[tuple[list[float], Order]], tie: float) -> list[Order]:
    """Return the orders with the largest numbers: the first decide, ties go to the next."""
    # Shape (candidates, numbers of each).
    numbers = np.array([row for row, _ in candidates])
    tied = np.arange(len(candidates))
    for k in range(numbers.shape[1]):
        column = numbers[tied, k]
        tied = tied[column >= column.max() - tie]
    return [candidates[k][1] for k in tied]
