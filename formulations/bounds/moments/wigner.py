"""Wigner functions of a joint, their coupling, and which products are rows of blocks.

A unit revolute joint, eq. (21), is a rotation R that takes the axes x, y, z to v, ω and v × ω.
D^l is its matrix on spin l. The first index of D^l_{Mm} belongs to the frame, and the second,
m, to the phase: v + iω → e^{−iθ}(v + iω) multiplies it by e^{−imθ}. All phases are those of
Condon and Shortley.

A label (l, m) stands for the functions D^l_{Mm} of one joint. They are polynomials in the
entries of J, of degree l if l ≡ m (mod 2), else l + 1. A change of the column's sign multiplies
them by (−1)^m.

From rotations in ``numpy.longdouble`` everything is computed in that precision; results are
rounded to double at the end, unless the caller asks for more.
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
#: (l, m).
Label: TypeAlias = tuple[int, int]
#: The labels of each group of joints.
LabelSet: TypeAlias = tuple[tuple[Label, ...], ...]

# Spherical unit vectors e_{−1}, e_0, e_{+1}, times √2, as columns.
_SPHERICAL = np.array([[1, 0, -1], [-1j, 0, -1j], [0, np.sqrt(np.longdouble(2)), 0]])


def random_rotations(
    rng: np.random.Generator, count: int, joints: int, *, extended: bool = False
) -> FloatArray:
    """Return uniform rotations, shape (count, joints, 3, 3).

    `extended` makes the same rotations in extended precision, from the same quaternions.
    """
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
    """Return D^0, …, D^largest, each of shape (…, 2l + 1, 2l + 1).

    D^{l+1} is the part of spin l + 1 of D^l ⊗ D^1.

    Parameters
    ----------
    rotations
        Shape (…, 3, 3), in double or extended precision.
    largest
        Largest spin.
    rounded
        Whether the result is rounded to double precision.
    """
    extended = rotations.dtype == np.longdouble
    spherical = _SPHERICAL if extended else _SPHERICAL.astype(complex)
    one = spherical.conj().T @ rotations @ spherical / 2
    leading = rotations.shape[:-2]
    matrices = [np.ones((*leading, 1, 1), dtype=one.dtype), one]
    for spin in range(1, largest):
        size = 2 * spin + 1
        # The coupling to spin l + 1 takes component a of spin l and b of spin 1 to a + b only.
        table = coupling(spin, 1, spin + 1, extended=extended)
        weights = [table[range(size), b, range(b, b + size)] for b in range(3)]
        larger = np.zeros((*leading, size + 2, size + 2), dtype=one.dtype)
        for b, row in enumerate(weights):
            part = np.zeros((*leading, size, size + 2), dtype=one.dtype)
            for c, column in enumerate(weights):
                part[..., c : c + size] += matrices[spin] * one[..., b, c, None, None] * column
            larger[..., b : b + size, :] += row[:, None] * part
        matrices.append(larger)
    matrices = matrices[: largest + 1]
    return [one.astype(complex) for one in matrices] if rounded else matrices


@cache
def coupling(first: int, second: int, total: int, *, extended: bool = False) -> FloatArray:
    """Return the Clebsch–Gordan coefficients ⟨first a, second b | total M⟩ of three spins.

    Shape (2·first + 1, 2·second + 1, 2·total + 1). Each entry is off by at most two units in
    the last place, of double precision or of extended.
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
    # The root times 2^shift, rounded down to an integer, has 64 to 66 bits.
    shift = 64 + (square.denominator // square.numerator).bit_length() // 2
    root = isqrt((square.numerator << 2 * shift) // square.denominator)
    # Two parts of at most 34 bits are exact in extended precision.
    high, low = divmod(root, 2**32)
    return np.ldexp(np.longdouble(high) * 2**32 + np.longdouble(low), -shift)


def _coefficient(first: int, a: int, second: int, b: int, total: int) -> tuple[Fraction, int]:
    """Return a Clebsch–Gordan coefficient: its square, and an integer of its sign (Racah)."""
    deficit = first + second - total
    series = sum(
        (-1) ** k
        * comb(deficit, k)
        * comb(2 * first - deficit, first - a - k)
        * comb(2 * second - deficit, second + b - k)
        for k in range(min(deficit, first - a, second + b) + 1)
    )
    norm = Fraction(
        comb(2 * first, deficit) * comb(2 * second, deficit),
        comb(first + second + total + 1, deficit)
        * comb(2 * first, first - a)
        * comb(2 * second, second - b)
        * comb(2 * total, total - a - b),
    )
    return norm * series**2, series


@cache
def coupled_tensors(spins: tuple[int, ...], total: int) -> FloatArray:
    """Return an orthonormal basis of the ways to couple spins to a total spin, in sequence.

    Shape (couplings, 2l_1 + 1, …, 2l_p + 1, 2L + 1), extended precision.
    """
    if not spins:
        return np.ones((1, 1)) if total == 0 else np.zeros((0, 2 * total + 1))
    unit: Any = np.eye(2 * spins[0] + 1, dtype=np.longdouble)
    # Tensors of the spins so far, by the spin to which they are coupled.
    coupled: dict[int, list[FloatArray]] = {spins[0]: [unit]}
    for position, spin in enumerate(spins[1:], start=1):
        remaining = sum(spins[position + 1 :])
        longer: dict[int, list[FloatArray]] = {}
        for before, tensors in coupled.items():
            for after in range(abs(before - spin), min(before + spin, total + remaining) + 1):
                table = coupling(before, spin, after, extended=True)
                products = [np.tensordot(tensor, table, axes=1) for tensor in tensors]
                longer.setdefault(after, []).extend(products)
        coupled = longer
    tensors = coupled.get(total, [])
    shape = (0, *(2 * spin + 1 for spin in spins), 2 * total + 1)
    return np.stack(tensors) if tensors else np.zeros(shape)


def axis_exchange(spins: tuple[int, ...], total: int, order: tuple[int, ...]) -> FloatArray:
    """Return `extended_exchange` in double precision."""
    return extended_exchange(spins, total, order).astype(float)


@cache
def extended_exchange(spins: tuple[int, ...], total: int, order: tuple[int, ...]) -> FloatArray:
    """Return how reordering the factors acts on the basis `coupled_tensors`.

    Shape (couplings, couplings). Factor q of the reordered tensor is factor order[q] of the
    original. Reordered tensor b is Σ_c X[c, b] · (tensor c of the reordered spins).
    """
    original = coupled_tensors(spins, total)
    if order == tuple(range(len(order))):
        return np.eye(len(original), dtype=np.longdouble)
    basis = coupled_tensors(tuple(spins[q] for q in order), total)
    reordered = original.transpose(0, *(1 + q for q in order), original.ndim - 1)
    # Every component of L gives the same overlaps, so that the highest one is enough. Most of
    # its entries are 0: only components that add up to it are not.
    first = basis[..., -1].reshape(len(basis), -1)
    second = reordered[..., -1].reshape(len(reordered), -1)
    nonzero = first.any(axis=0) | second.any(axis=0)
    return np.asarray(first[:, nonzero] @ second[:, nonzero].T)


def residual_values(rotations: FloatArray) -> FloatArray:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F² at rotations (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    gram = jacobians @ jacobians.swapaxes(-1, -2)
    # n·I is exact, and one division is in the precision of the rotations.
    defect = gram - jacobians.shape[-1] * np.eye(6, dtype=gram.dtype) / 3
    return np.asarray(0.5 * np.sum(defect**2, axis=(-1, -2)))


@dataclass(frozen=True, order=True)
class RowSector:
    """The products of Wigner functions with one behaviour under all symmetries but S_n.

    Attributes
    ----------
    odd
        Number k of joints with odd m, a locked one not counted. None where the signs of the
        columns are fixed: then m of any parity may occur at any joint.
    charge
        Sum c of all m.
    spin
        Total spin L to which the product is coupled.
    degree
        Largest degree d in the entries of J.
    locked
        Parity of m of the locked joint, 0 or 1; always 0 if `odd` is None. None if no joint is
        locked.

    Raises
    ------
    InputError
        Unless all numbers are non-negative, c ≡ d and k + parity ≡ c (mod 2).
    """

    odd: int | None
    charge: int
    spin: int
    degree: int
    locked: int | None = None

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        name = "row sector (k, c, L, d, parity)"
        parities = (None, 0) if self.odd is None else (None, 0, 1)
        least = min(self.odd or 0, self.charge, self.spin, self.degree)
        if least < 0 or self.locked not in parities:
            raise InputError(name, values, "non-negative integers")
        # Without k the number of odd m is not fixed, and its parity is that of the charge.
        odd = self.charge if self.odd is None else self.odd + (self.locked or 0)
        if (odd - self.charge) % 2 or (self.charge - self.degree) % 2:
            raise InputError(name, values, "k + parity ≡ c ≡ d modulo 2")

    def groups(self, joints: int) -> tuple[range, ...]:
        """Return the groups of joints: the locked one, those with odd m, the others.

        Without a locked joint there is no first group; where signs are fixed one for all
        others.
        """
        start = 0 if self.locked is None else 1
        ends = [start, joints] if self.odd is None else [start, start + self.odd, joints]
        groups = tuple(range(a, b) for a, b in pairwise(ends))
        return groups if self.locked is None else (range(1), *groups)

    def label_sets(self, joints: int) -> list[LabelSet]:
        """Return the labels that the groups of joints can carry, without (0, 0)."""
        even = _labels(self.degree, (0,))
        odd = _labels(self.degree, (1,))
        both = _labels(self.degree, (0, 1))
        # Each group has a list of possible labels, and possible numbers of them.
        groups: list[tuple[list[Label], range]] = []
        if self.locked is not None:
            possible = both if self.odd is None else (even, odd)[self.locked]
            groups.append((possible, range(self.locked, 2)))
        others = range(joints - len(groups) - (self.odd or 0) + 1)
        if self.odd is None:
            groups.append((both, others))
        else:
            groups.append((odd, range(self.odd, self.odd + 1)))
            groups.append((even, others))
        choices = [
            [chosen for size in sizes for chosen in _multisets(labels, size, self.degree)]
            for labels, sizes in groups
        ]
        label_sets = []
        for chosen in product(*choices):
            labels = [*chain(*chosen)]
            charge = sum(m for _, m in labels)
            if charge == self.charge and sum(map(label_degree, labels)) <= self.degree:
                label_sets.append(chosen)
        return label_sets


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
    """Return the sectors, sorted; of those that differ only in degree, the largest."""
    # A later one replaces the one before, and the degree grows.
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
    """Yield the ascending choices of `size` labels with total degree at most `degree`."""
    if size == 0:
        yield ()
        return
    for k, label in enumerate(labels):
        remaining = degree - label_degree(label)
        if remaining >= size - 1:  # each of the others has degree 1 at least
            for others in _multisets(labels[k:], size - 1, remaining):
                yield (label, *others)


#: Sectors of degree 4; alone they give no more than ρ ≥ 0 for seven joints.
DEGREE_4 = tuple(degree_sectors(4, range(3)))
