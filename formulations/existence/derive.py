"""Derive the certificate that no optimally failure-tolerant 7R Jacobian exists.

Two squares, averaged over the joint orders, are divided by the equations. What remains of
each is an affine function of one invariant, τ; |p|² ≥ 0 bounds it from above, |q|² ≥ 0 from
below, and the bounds exclude each other. The combination in which τ cancels is

    Σ weight · |square|² = −constant + Σ coefficient · monomial · equation  (averaged)

and the quotients of the division are the multipliers (docs/nonexistence.md, sections 4, 5).
Everything is computed from the definitions in rational arithmetic; no answer is stored.
"""

from __future__ import annotations

from fractions import Fraction
from math import gcd, lcm

from formulations.existence.certificate import Certificate, Multiplier, Square, Term
from formulations.existence.equations import Frame, Multiple
from formulations.existence.graphs import ONE, Monomial
from formulations.existence.polynomials import (
    Polynomial,
    class_sums,
    combined,
    hermitian_product,
    symmetrised,
)
from formulations.existence.rewriting import rewriting

SEVEN_REVOLUTE = Frame(joints=7, task_dimension=6)
ORDER = 3
TABLEAU = ((0, 1, 2), (3, 4, 5), (6,))


def derive() -> Certificate:
    """Return the certificate, found from the equations and the two squares alone."""
    equations = rewriting(SEVEN_REVOLUTE, ORDER)
    squares = squared_polynomials()
    averages = [class_sums(hermitian_product(p, p)) for p in squares]
    weights = cancelling_weights(*(equations.divide(average)[1] for average in averages))
    total = combined(zip(weights, averages, strict=True))
    quotients, remainder = equations.divide(total)
    return Certificate(
        joints=SEVEN_REVOLUTE.joints,
        constant=-remainder[ONE],
        squares=tuple(_square(*pair) for pair in zip(weights, squares, strict=True)),
        multipliers=tuple(_multiplier(*item) for item in sorted(quotients.items())),
    )


def squared_polynomials() -> tuple[Polynomial, Polynomial]:
    """Return p₁ and q = 3p₁ + p₂, with p₁, p₂ of charge 1 and of type (3,3,1).

    p₁ and p₂ come from |W₀₁|²W₂₃ and W₀₁W₂₃conj(W₀₂). Any a·p₁ + p₂ with a = 2, 3, 4 would
    do for q; a = 3 gives the smallest weights.
    """
    p1 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 1),)))
    p2 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 2),)))
    return p1, combined([(Fraction(3), p1), (Fraction(1), p2)])


def cancelling_weights(p: Polynomial, q: Polynomial) -> tuple[Fraction, Fraction]:
    """Return the smallest whole weights that make two affine functions of τ a constant."""
    (invariant,) = (p.keys() | q.keys()) - {ONE}
    slopes = p[invariant], q[invariant]
    assert slopes[0] * slopes[1] < 0, "one square bounds the invariant above, one below"
    numerators = [abs(slope) * lcm(*(s.denominator for s in slopes)) for slope in slopes]
    common = gcd(*(numerator.numerator for numerator in numerators))
    return numerators[1] / common, numerators[0] / common


def _square(weight: Fraction, polynomial: Polynomial) -> Square:
    terms = sorted(polynomial.items())
    return Square(weight, tuple(Term(value, m.w, m.wbar) for m, value in terms))


def _multiplier(multiple: Multiple, coefficient: Fraction) -> Multiplier:
    equation, monomial = multiple.equation, multiple.monomial
    return Multiplier(coefficient, equation.kind, equation.place, monomial.w, monomial.wbar)
