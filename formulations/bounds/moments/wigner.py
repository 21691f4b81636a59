"""Wigner functions of a joint, their coupling, and which products are rows of blocks.

A unit revolute joint, eq. (21), is a rotation R that takes the axes x, y, z to v, ω and v × ω.
D^l is its matrix on spin l; the first index belongs to the frame, the second, m, to the phase:
v + iω → e^{−iθ}(v + iω) multiplies D^l_{Mm} by e^{−imθ}. Condon–Shortley phases throughout. A
label (l, m) stands for the functions D^l_{Mm} of one joint. As a polynomial in the entries of J
its degree is l if l ≡ m (mod 2), else l + 1; turning the sign of a column multiplies it by
(−1)^m. From rotations in ``numpy.longdouble`` all is computed so, and only the end rounded to
double.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import chain, pairwise, product
from math import comb, copysign, isqrt, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

ComplexArray: TypeAlias = NDArray[np.complex128]
Label: TypeAlias = tuple[int, int]
# The labels of each group of joints.
LabelSet: TypeAlias = tuple[tuple[Label, ...], ...]

# Columns: the spherical unit vectors e_{−1}, e_0, e_{+1}, times √2.
_SPHERICAL = np.array([[1, 0, -1], [-1j, 0, -1j], [0, np.sqrt(np.longdouble(2)), 0]])


def random_rotations(
    rng: np.random.Generator, count: int, joints: int, *, extended: bool = False
) -> FloatArray:
    """Return uniform rotations (count, joints, 3, 3); the same ones, finer, if `extended`."""
    quaternions = rng.standard_normal((count, joints, 4))
    if extended:
        quaternions = quaternions.astype(np.longdouble)
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    matrices = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    return np.asarray(matrices / np.sum(quaternions**2, axis=-1)[..., None, None])


def jacobians_of(rotations: FloatArray) -> FloatArray:
    """Return the Jacobians with columns (v; ω), shape (…, 6, n), of rotations (…, n, 3, 3)."""
    columns = np.concatenate([rotations[..., 0], rotations[..., 1]], axis=-1)
    return np.asarray(np.swapaxes(columns, -1, -2))


def wigner_matrices(
    rotations: FloatArray, largest: int, *, rounded: bool = True
) -> list[ComplexArray]:
    """Return D^0, …, D^largest, (…, 2l+1, 2l+1): D^{l+1} from D^l ⊗ D^1, coupled.

    Rounded to double precision, or in that of the rotations.
    """
    extended = rotations.dtype == np.longdouble
    spherical = _SPHERICAL if extended else _SPHERICAL.astype(complex)
    one = spherical.conj().T @ rotations @ spherical / 2
    found = [np.ones((*rotations.shape[:-2], 1, 1), dtype=one.dtype), one]
    for spin in range(1, largest):
        # The stretched coupling takes a of spin l and b of spin 1 to a + b only.
        table, size = coupling(spin, 1, spin + 1, extended=extended), 2 * spin + 1
        weights = [table[range(size), b, range(b, b + size)] for b in range(3)]
        grown = np.zeros((*rotations.shape[:-2], size + 2, size + 2), dtype=one.dtype)
        for b, row in enumerate(weights):
            part = np.zeros((*rotations.shape[:-2], size, size + 2), dtype=one.dtype)
            for c, column in enumerate(weights):
                part[..., c : c + size] += found[spin] * one[..., b, c, None, None] * column
            grown[..., b : b + size, :] += row[:, None] * part
        found.append(grown)
    found = found[: largest + 1]
    return [matrices.astype(complex) for matrices in found] if rounded else found


@cache
def coupling(first: int, second: int, total: int, *, extended: bool = False) -> FloatArray:
    """Return ⟨first a, second b | total M⟩, shape (2·first+1, 2·second+1, 2·total+1).

    Each entry is off by at most two units in the last place, of double or extended precision.
    """
    shape = (2 * first + 1, 2 * second + 1, 2 * total + 1)
    table: FloatArray = np.zeros(shape, dtype=np.longdouble if extended else float)
    if abs(first - second) <= total <= first + second:
        for a in range(-first, first + 1):
            for b in range(max(-second, -total - a), min(second, total - a) + 1):
                square, sign = _coefficient(first, a, second, b, total)
                root = _extended_root(square) if extended else sqrt(square)
                table[first + a, second + b, total + a + b] = copysign(1.0, sign) * root
    table.flags.writeable = False
    return table


def _extended_root(square: Fraction) -> Any:
    """Return √square, 0 ≤ square ≤ 1, in extended precision."""
    if square == 0:
        return np.longdouble(0)
    shift = 64 + (square.denominator // square.numerator).bit_length() // 2
    digits = isqrt((square.numerator << 2 * shift) // square.denominator)
    # At most 66 bits: two parts that are exact.
    high, low = divmod(digits, 2**32)
    return np.ldexp(np.longdouble(high) * 2**32 + np.longdouble(low), -shift)


def _coefficient(first: int, a: int, second: int, b: int, total: int) -> tuple[Fraction, int]:
    """Return the square of a Clebsch–Gordan coefficient, and an integer of its sign (Racah)."""
    lost = first + second - total
    series = sum(
        (-1) ** k
        * comb(lost, k)
        * comb(2 * first - lost, first - a - k)
        * comb(2 * second - lost, second + b - k)
        for k in range(min(lost, first - a, second + b) + 1)
    )
    norm = Fraction(
        comb(2 * first, lost) * comb(2 * second, lost),
        comb(first + second + total + 1, lost)
        * comb(2 * first, first - a)
        * comb(2 * second, second - b)
        * comb(2 * total, total - a - b),
    )
    return norm * series**2, series


@cache
def coupled_tensors(spins: tuple[int, ...], total: int) -> FloatArray:
    """Return an orthonormal basis of the ways to couple spins to a total spin, in sequence.

    Shape (ways, 2l_1+1, …, 2l_p+1, 2L+1), extended precision.
    """
    if not spins:
        return np.ones((1, 1)) if total == 0 else np.zeros((0, 2 * total + 1))
    unit: Any = np.eye(2 * spins[0] + 1, dtype=np.longdouble)
    partial: dict[int, list[FloatArray]] = {spins[0]: [unit]}
    for position, spin in enumerate(spins[1:], start=1):
        rest = sum(spins[position + 1 :])
        grown: dict[int, list[FloatArray]] = {}
        for reached, tensors in partial.items():
            for target in range(abs(reached - spin), min(reached + spin, total + rest) + 1):
                table = coupling(reached, spin, target, extended=True)
                grown.setdefault(target, []).extend(
                    np.tensordot(tensor, table, axes=1) for tensor in tensors
                )
        partial = grown
    found = partial.get(total, [])
    shape = (0, *(2 * spin + 1 for spin in spins), 2 * total + 1)
    return np.stack(found) if found else np.zeros(shape)


def axis_exchange(spins: tuple[int, ...], total: int, order: tuple[int, ...]) -> FloatArray:
    """Return `extended_exchange` in double precision."""
    return extended_exchange(spins, total, order).astype(float)


@cache
def extended_exchange(spins: tuple[int, ...], total: int, order: tuple[int, ...]) -> FloatArray:
    """Return how reordering the factors acts on the basis of `coupled_tensors`, (ways, ways).

    Factor q of the reordered tensor is factor order[q] of the given one; reordered tensor b is
    Σ_c X[c, b] · tensor c of the reordered spins.
    """
    given = coupled_tensors(spins, total)
    if order == tuple(range(len(order))):
        return np.eye(len(given), dtype=np.longdouble)
    goal = coupled_tensors(tuple(spins[q] for q in order), total)
    moved = given.transpose(0, *(1 + q for q in order), given.ndim - 1)
    # Every component of L gives the same overlaps; the highest one is enough. The other
    # components add up to it: most entries are 0.
    first = goal[..., -1].reshape(len(goal), -1)
    second = moved[..., -1].reshape(len(moved), -1)
    filled = first.any(axis=0) | second.any(axis=0)
    return np.asarray(first[:, filled] @ second[:, filled].T)


def residual_values(rotations: FloatArray) -> FloatArray:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F² at rotations (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    gram = jacobians @ jacobians.swapaxes(-1, -2)
    # n · I is exact; one division in the precision of the rotations.
    defect = gram - jacobians.shape[-1] * np.eye(6, dtype=gram.dtype) / 3
    return np.asarray(0.5 * np.sum(defect**2, axis=(-1, -2)))


@dataclass(frozen=True, order=True)
class RowSector:
    """The products of Wigner functions with one behaviour under all symmetries but S_n.

    InputError unless all numbers are non-negative, c ≡ d and k + parity ≡ c (mod 2).
    """

    #: Number k of joints with odd m, a locked one not counted. None where the signs of the
    #: columns are fixed: then m of any parity may occur at any joint.
    odd: int | None
    #: Sum c of all m.
    charge: int
    #: Total spin L to which the product is coupled.
    spin: int
    #: Largest degree d in the entries of J.
    degree: int
    #: Parity of m of the locked joint, 0 or 1, always 0 without k; None if no joint is locked.
    locked: int | None = None

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        name = "row sector (k, c, L, d, parity)"
        parities = (None, 0) if self.odd is None else (None, 0, 1)
        if min(self.odd or 0, *values[1:4]) < 0 or self.locked not in parities:
            raise InputError(name, values, "non-negative integers")
        odd = self.charge if self.odd is None else self.odd + (self.locked or 0)
        if (odd - self.charge) % 2 or (self.charge - self.degree) % 2:
            raise InputError(name, values, "k + parity ≡ c ≡ d modulo 2")

    def places(self, joints: int) -> tuple[range, ...]:
        """Return the groups of joints: the locked one if any, odd and even joints or all."""
        start = 0 if self.locked is None else 1
        ends = [start, joints] if self.odd is None else [start, start + self.odd, joints]
        groups = tuple(range(a, b) for a, b in pairwise(ends))
        return groups if self.locked is None else (range(1), *groups)

    def label_sets(self, joints: int) -> list[LabelSet]:
        """Return the labels that the groups of joints can carry, without (0, 0)."""
        even, odd, both = (_labels(self.degree, some) for some in ((0,), (1,), (0, 1)))
        # The labels of each group, and how many of them it can carry.
        groups: list[tuple[list[Label], range]] = []
        if self.locked is not None:
            own = both if self.odd is None else (even, odd)[self.locked]
            groups.append((own, range(self.locked, 2)))
        others = range(joints - len(groups) - (self.odd or 0) + 1)
        if self.odd is None:
            groups.append((both, others))
        else:
            groups += [(odd, range(self.odd, self.odd + 1)), (even, others)]
        parts = [
            [chosen for size in sizes for chosen in _multisets(labels, size, self.degree)]
            for labels, sizes in groups
        ]
        found = []
        for chosen in product(*parts):
            labels = [*chain(*chosen)]
            charge, degree = sum(m for _, m in labels), sum(map(label_degree, labels))
            if charge == self.charge and degree <= self.degree:
                found.append(chosen)
        return found


def label_degree(label: Label) -> int:
    """Return the degree of D^l_{Mm} as a polynomial in the entries of J."""
    spin, m = label
    return spin + (spin - m) % 2


def degree_sectors(
    degree: int, spins: range, charges: range | None = None, locked: int | None = None
) -> list[RowSector]:
    """Return all sectors of one degree, within the given total spins and charges."""
    allowed = range(degree + 1) if charges is None else charges
    return [
        RowSector(k, c, spin, degree, locked)
        for spin, k, c in product(spins, range(degree + 1), allowed)
        if (k + (locked or 0) - degree) % 2 == 0 and (c - degree) % 2 == 0
    ]


def unsigned_sectors(
    degree: int, spins: range, *, locked: bool = False
) -> tuple[RowSector, ...]:
    """Return all sectors of one degree where the signs of the columns are fixed."""
    parity = 0 if locked else None
    charges = range(degree % 2, degree + 1, 2)
    return tuple(RowSector(None, c, spin, degree, parity) for spin in spins for c in charges)


def without_repetition(sectors: list[RowSector]) -> tuple[RowSector, ...]:
    """Return the sectors, sorted, but of those that differ in degree the largest only."""
    largest = {(one.odd, one.charge, one.spin, one.locked): one for one in sorted(sectors)}
    return tuple(largest.values())


def _labels(degree: int, parities: tuple[int, ...]) -> list[Label]:
    """Return the labels with m of these parities and degree from 1 to `degree`, ascending."""
    return [
        (spin, m)
        for spin in range(1, degree + 1)
        for m in range(-spin, spin + 1)
        if m % 2 in parities and label_degree((spin, m)) <= degree
    ]


def _multisets(labels: list[Label], size: int, degree: int) -> Iterator[tuple[Label, ...]]:
    """Give the ascending choices of `size` labels with total degree at most `degree`."""
    if size == 0:
        yield ()
        return
    for k, label in enumerate(labels):
        left = degree - label_degree(label)
        if left >= size - 1:  # the others have degree 1 at least
            for others in _multisets(labels[k:], size - 1, left):
                yield (label, *others)


#: Rows of degree 4, which alone give no more than ρ ≥ 0 for seven joints.
DEGREE_4 = tuple(degree_sectors(4, range(3)))
