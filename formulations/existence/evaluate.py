"""Evaluate the identity of a certificate at random matrices: an independent check.

W is a random symmetric matrix of Gaussian integers with zero diagonal. Unlike the W of a
Jacobian it violates every equation, so that a wrong multiplier shows. The average over all 5040
permutations of the joints is exact: all numbers are Gaussian integers below 2⁵³ (entries have
modulus at most 3√2, products at most eight factors), so double precision represents them
without rounding; the rational coefficients are applied last. This module uses neither the
derivation nor the verification.
"""

from fractions import Fraction
from itertools import permutations
from math import prod

import numpy as np
from numpy.typing import NDArray

from formulations.existence.certificate import JOINTS, Certificate, Multiplier, Pairs, Square

GaussianIntegers = NDArray[np.complex128]

ENTRY = 3  # largest real or imaginary part, in modulus, of a random entry of W


def defects(
    certificate: Certificate, *, samples: int = 3, seed: int = 0
) -> tuple[Fraction, ...]:
    """Return the value of the identity, averaged over S₇, at random matrices.

    Parameters
    ----------
    certificate
        The certificate to check.
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


def _violating(generator: np.random.Generator) -> GaussianIntegers:
    """Draw matrices W until one violates every equation at every place."""
    while True:
        upper = np.triu(generator.integers(-ENTRY, ENTRY + 1, size=(2, JOINTS, JOINTS)), k=1)
        real, imaginary = (part + part.T for part in upper)
        w = real + 1j * imaginary
        if all(left.all() for left in _left_hand_sides(w).values()):
            return np.asarray(w)


def _left_hand_sides(w: GaussianIntegers) -> dict[str, GaussianIntegers]:
    """Return seven times the left-hand sides of the equations of each kind, (…, 7, 7).

    The row sum i is in all places (i, j).
    """
    product = w @ w.conj()
    projector = JOINTS * np.eye(JOINTS) - 1
    return {
        "row-sum": JOINTS * np.broadcast_to(w.sum(axis=-1, keepdims=True), w.shape),
        "square": JOINTS * (w @ w),
        "tight-frame": JOINTS * (product + product.conj()) - 4 * projector,
    }


def _defect(certificate: Certificate, w: GaussianIntegers) -> Fraction:
    orders = np.array(list(permutations(range(JOINTS))))
    permuted = w[orders[:, :, None], orders[:, None, :]]
    equations = _left_hand_sides(permuted)
    squares = sum(_square(square, permuted) for square in certificate.squares)
    multiples = sum(
        _multiplier(m, permuted, equations[m.kind]) for m in certificate.multipliers
    )
    return Fraction(squares - multiples) / len(orders) + certificate.constant


def _square(square: Square, w: GaussianIntegers) -> Fraction:
    """Return weight · Σ |p|² over all orders, from the real inner products of its terms."""
    values = np.stack([_monomial(term.w, term.wbar, w) for term in square.terms])
    products = (values @ values.conj().T).real.astype(int).astype(object)
    coefficients = np.array([term.coefficient for term in square.terms], dtype=object)
    return Fraction(square.weight * (coefficients @ products @ coefficients))


def _multiplier(
    multiplier: Multiplier, w: GaussianIntegers, equations: GaussianIntegers
) -> Fraction:
    left = equations[:, multiplier.place[0], multiplier.place[-1]]
    value = (_monomial(multiplier.w, multiplier.wbar, w) * left).real.sum()
    return multiplier.coefficient * int(value) / JOINTS


def _monomial(w: Pairs, wbar: Pairs, matrices: GaussianIntegers) -> GaussianIntegers:
    """Return a product of entries, for each of the matrices."""
    factors = [matrices[:, i, j] for i, j in w] + [matrices[:, i, j].conj() for i, j in wbar]
    return prod(factors, start=np.ones(len(matrices), dtype=complex))
