"""Wigner functions of a joint, and how functions of several joints are coupled to a total spin.

D^l, shape (2l + 1, 2l + 1), is the matrix of a joint's rotation on spin l, an integer l ≥ 0:
D^0 is 1 and D^1 the rotation itself in a complex basis. The first index of D^l_{Mm} belongs to
the frame, and the second, m, to the phase: v + iω → e^{−iθ}(v + iω) multiplies it by e^{−imθ}.
M and m are from −l to l, and have the places l + M and l + m in arrays. All phases are those of
Condon and Shortley.

From rotations in ``numpy.longdouble`` everything is computed in that precision; results are
rounded to double at the end, unless the caller asks for more.
"""

from fractions import Fraction
from functools import cache
from math import comb, copysign, isqrt, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.nlp.arrays import FloatArray

ComplexArray: TypeAlias = NDArray[np.complex128]

# Spherical unit vectors e_{−1}, e_0, e_{+1}, times √2, as columns.
_SPHERICAL = np.array([[1, 0, -1], [-1j, 0, -1j], [0, np.sqrt(np.longdouble(2)), 0]])


def wigner_matrices(
    rotations: FloatArray, largest: int, *, rounded: bool = True
) -> list[ComplexArray]:
    """Return D^0, …, D^largest, each of shape (…, 2l + 1, 2l + 1), complex.

    D^{l+1} is the part of spin l + 1 of D^l ⊗ D^1: Cᵀ(D^l ⊗ D^1)C with the table C of
    `coupling`.

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
    """Return √square, 0 ≤ square ≤ 1, rounded down, in extended precision of 64 bits."""
    if square == 0:
        return np.longdouble(0)
    # The root times 2^shift, rounded down to an integer, has 64 to 66 bits.
    shift = 64 + (square.denominator // square.numerator).bit_length() // 2
    root = isqrt((square.numerator << 2 * shift) // square.denominator)
    # Two parts of at most 34 bits are exact in extended precision.
    high, low = divmod(root, 2**32)
    return np.ldexp(np.longdouble(high) * 2**32 + np.longdouble(low), -shift)


def _coefficient(first: int, a: int, second: int, b: int, total: int) -> tuple[Fraction, int]:
    """Return the square of ⟨first a, second b | total a + b⟩, and an integer of its sign.

    It is the formula of Racah, in rational arithmetic.
    """
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
    """Return an orthonormal basis of the ways to couple p spins to a total spin L, in sequence.

    Each way is a sequence of spins to which the first two, three, … of them are coupled. Shape
    (couplings, 2l_1 + 1, …, 2l_p + 1, 2L + 1), extended precision. No spins couple to 0 only.
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

    The matrix X, shape (couplings, couplings), is orthogonal. Factor q of the reordered tensor
    is factor order[q] of the original. Reordered tensor b is Σ_c X[c, b] · (tensor c of the
    reordered spins).
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
