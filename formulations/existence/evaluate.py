"""Evaluate the identity of a certificate at random matrices: a third opinion.

W is a random symmetric matrix of Gaussian integers with zero diagonal. Unlike the W of a
Jacobian it violates every equation, so that a wrong multiplier shows. The sum over all 5040
permutations of the joints is formed exactly, in 64-bit integers that cannot overflow at these
sizes, and the rational coefficients are applied last. Neither the derivation nor the
verification has a part in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement, permutations

import numpy as np
from numpy.typing import NDArray

from formulations.existence.certificate import (
    JOINTS,
    KINDS,
    Certificate,
    Multiplier,
    Pairs,
    Square,
)

ENTRY = 3  # largest real or imaginary part, in modulus, of a random entry of W


@dataclass(frozen=True)
class Gaussian:
    """An array of Gaussian integers, one per permutation of the joints."""

    real: NDArray[np.int64]
    imaginary: NDArray[np.int64]

    def __add__(self, other: Gaussian) -> Gaussian:
        return Gaussian(self.real + other.real, self.imaginary + other.imaginary)

    def __mul__(self, other: Gaussian) -> Gaussian:
        return Gaussian(
            self.real * other.real - self.imaginary * other.imaginary,
            self.real * other.imaginary + self.imaginary * other.real,
        )

    def scaled(self, factor: int) -> Gaussian:
        """Return the array times a whole number."""
        return Gaussian(factor * self.real, factor * self.imaginary)

    def conjugate(self) -> Gaussian:
        """Return the complex conjugate."""
        return Gaussian(self.real, -self.imaginary)


class PermutedMatrices:
    """One symmetric zero-diagonal matrix W in all orders of its joints."""

    def __init__(self, generator: np.random.Generator) -> None:
        upper = np.triu(generator.integers(-ENTRY, ENTRY + 1, size=(2, JOINTS, JOINTS)), k=1)
        real, imaginary = (part + part.T for part in upper.astype(np.int64))
        orders = np.array(list(permutations(range(JOINTS))))
        self.orders = len(orders)
        self._entries = {
            (i, j): Gaussian(
                real[orders[:, i], orders[:, j]], imaginary[orders[:, i], orders[:, j]]
            )
            for i in range(JOINTS)
            for j in range(JOINTS)
        }

    def violate_every_equation(self) -> bool:
        """Return whether no equation holds, at any place, for the matrix as drawn."""
        places = list(combinations_with_replacement(range(JOINTS), 2))
        rows = [self.equation("row-sum", (i,)) for i in range(JOINTS)]
        entries = [self.equation(kind, place) for kind in KINDS[1:] for place in places]
        return all(left.real[0] or left.imaginary[0] for left in rows + entries)

    def entry(self, i: int, j: int) -> Gaussian:
        """Return W_ij in all orders."""
        return self._entries[i, j]

    def constant(self, value: int) -> Gaussian:
        """Return the same whole number in all orders."""
        ones = np.ones(self.orders, dtype=np.int64)
        return Gaussian(value * ones, 0 * ones)

    def monomial(self, w: Pairs, wbar: Pairs) -> Gaussian:
        """Return a product of entries in all orders."""
        result = self.constant(1)
        for i, j in w:
            result = result * self.entry(i, j)
        for i, j in wbar:
            result = result * self.entry(i, j).conjugate()
        return result

    def equation(self, kind: str, place: tuple[int, ...]) -> Gaussian:
        """Return seven times the left-hand side of an equation in all orders."""
        result = self.constant(0)
        i, j = place[0], place[-1]
        for k in range(JOINTS):
            left, right = self.entry(i, k), self.entry(k, j)
            if kind == "row-sum":
                result = result + left
            elif kind == "square":
                result = result + left * right
            else:
                result = result + left * right.conjugate() + left.conjugate() * right
        result = result.scaled(JOINTS)
        if kind == "tight-frame":
            result = result + self.constant(-4 * (JOINTS * (i == j) - 1))
        return result


def defects(
    certificate: Certificate, *, samples: int = 3, seed: int = 0
) -> tuple[Fraction, ...]:
    """Return the value of the identity, averaged over S₇, at random matrices.

    Parameters
    ----------
    certificate
        The certificate to judge.
    samples
        Number of random matrices.
    seed
        Seed of the random generator.

    Returns
    -------
    tuple of Fraction
        One exact number per matrix; all zero if the identity holds.
    """
    generator = np.random.default_rng(seed)
    return tuple(_defect(certificate, _violating(generator)) for _ in range(samples))


def _violating(generator: np.random.Generator) -> PermutedMatrices:
    """Draw until no equation happens to hold."""
    matrices = PermutedMatrices(generator)
    return matrices if matrices.violate_every_equation() else _violating(generator)


def _defect(certificate: Certificate, matrices: PermutedMatrices) -> Fraction:
    total = Fraction(0)
    for square in certificate.squares:
        total += _square(square, matrices)
    for multiplier in certificate.multipliers:
        total -= _multiplier(multiplier, matrices)
    return total / matrices.orders + certificate.constant


def _square(square: Square, matrices: PermutedMatrices) -> Fraction:
    """Return weight · Σ |p|² over all orders, from the real inner products of its terms."""
    values = [matrices.monomial(term.w, term.wbar) for term in square.terms]
    real = np.stack([value.real for value in values])
    imaginary = np.stack([value.imaginary for value in values])
    products: list[list[int]] = (real @ real.T + imaginary @ imaginary.T).tolist()
    total = Fraction(0)
    for a, row in zip(square.terms, products, strict=True):
        for b, inner in zip(square.terms, row, strict=True):
            total += a.coefficient * b.coefficient * inner
    return square.weight * total


def _multiplier(multiplier: Multiplier, matrices: PermutedMatrices) -> Fraction:
    monomial = matrices.monomial(multiplier.w, multiplier.wbar)
    value = monomial * matrices.equation(multiplier.kind, multiplier.place)
    return multiplier.coefficient * int(value.real.sum()) / JOINTS
