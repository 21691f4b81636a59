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

from formulations.existence.certificate import JOINTS, Certificate, Pairs

_Gaussian = NDArray[np.complex128]
_ENTRY = 3  # largest real or imaginary part, in modulus, of a random entry of W


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


def _violating(generator: np.random.Generator) -> _Gaussian:
    """Draw matrices W until one violates every equation at every place."""
    while True:
        upper = np.triu(generator.integers(-_ENTRY, _ENTRY + 1, size=(2, JOINTS, JOINTS)), k=1)
        real, imaginary = (part + part.T for part in upper)
        w = np.asarray(real + 1j * imaginary)
        if all(left.all() for left in _left_hand_sides(w).values()):
            return w


def _left_hand_sides(w: _Gaussian) -> dict[str, _Gaussian]:
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


def _defect(certificate: Certificate, w: _Gaussian) -> Fraction:
    orders = np.array(list(permutations(range(JOINTS))))
    permuted = w[orders[:, :, None], orders[:, None, :]]
    equations = _left_hand_sides(permuted)
    total = len(orders) * certificate.constant
    for square in certificate.squares:
        # Σ |p|² over all orders, from the real inner products of its terms.
        values = np.stack([_monomial(term.w, term.wbar, permuted) for term in square.terms])
        products = (values @ values.conj().T).real.astype(int).astype(object)
        coefficients = np.array([term.coefficient for term in square.terms], dtype=object)
        total += square.weight * (coefficients @ products @ coefficients)
    for m in certificate.multipliers:
        left = equations[m.kind][:, m.place[0], m.place[-1]]
        value = (_monomial(m.w, m.wbar, permuted) * left).real.sum()
        total -= m.coefficient * int(value) / JOINTS
    return Fraction(total) / len(orders)


def _monomial(w: Pairs, wbar: Pairs, matrices: _Gaussian) -> _Gaussian:
    """Return a product of entries, for each of the matrices."""
    factors = [matrices[:, i, j] for i, j in w] + [matrices[:, i, j].conj() for i, j in wbar]
    return prod(factors, start=np.ones(len(matrices), dtype=complex))
