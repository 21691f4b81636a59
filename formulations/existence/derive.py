"""Derive the certificate that no optimally failure-tolerant 7R Jacobian exists.

Two squares, averaged over the joint orders, are divided by the equations. What remains of
each is an affine function of one invariant, τ; |p|² ≥ 0 bounds it from above, |q|² ≥ 0 from
below, and the bounds exclude each other. The combination in which τ cancels is

    Σ weight · |square|² = −constant + Σ coefficient · monomial · equation  (averaged)

and the quotients of the division are the multipliers (docs/nonexistence.md, sections 4, 5).
Everything is computed from the definitions in rational arithmetic; no result is stored.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, permutations, product, zip_longest
from math import gcd, lcm, prod
from typing import TypeAlias

from formulations.existence.certificate import Certificate, Multiplier, Square, Term
from formulations.existence.equations import (
    Frame,
    Polynomial,
    class_sums,
    collected,
    combined,
    hermitian_product,
)
from formulations.existence.graphs import ONE, Monomial
from formulations.existence.rewriting import rewriting

Tableau: TypeAlias = tuple[tuple[int, ...], ...]
Permutation: TypeAlias = tuple[int, ...]

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
        squares=tuple(
            Square(weight, tuple(Term(c, m.w, m.wbar) for m, c in sorted(square.items())))
            for weight, square in zip(weights, squares, strict=True)
        ),
        multipliers=tuple(
            Multiplier(c, m.equation.kind, m.equation.place, m.monomial.w, m.monomial.wbar)
            for m, c in sorted(quotients.items())
        ),
    )


def squared_polynomials() -> tuple[Polynomial, Polynomial]:
    """Return p₁ and q = 3p₁ + p₂, with p₁, p₂ of charge 1 and of type (3,3,1).

    p₁ and p₂ come from |W₀₁|²W₂₃ and W₀₁W₂₃conj(W₀₂). Any a·p₁ + p₂ with a = 2, 3, 4 would
    do for q; a = 3 gives the smallest weights.
    """
    p1 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 1),)))
    p2 = symmetrised(TABLEAU, Monomial(w=((0, 1), (2, 3)), wbar=((0, 2),)))
    return p1, combined([(3, p1), (1, p2)])


def symmetrised(tableau: Tableau, monomial: Monomial) -> Polynomial:
    """Apply a Young symmetriser: the result is of one irreducible type of S_n.

    Parameters
    ----------
    tableau
        Rows of joints, each joint once, rows of decreasing length.
    monomial
        The monomial acted on.

    Returns
    -------
    Polynomial
        Σ sign(c) c·r·monomial over row permutations r and column permutations c, divided by
        the greatest common divisor of its coefficients.
    """
    columns = tuple(
        tuple(joint for joint in column if joint is not None)
        for column in zip_longest(*tableau)
    )
    terms = collected(
        (monomial.relabel(row).relabel(column), Fraction(sign(column)))
        for row in _stabiliser(tableau)
        for column in _stabiliser(columns)
    )
    content = gcd(*(value.numerator for value in terms.values()))
    return {term: value / content for term, value in sorted(terms.items())}


def sign(permutation: Permutation) -> int:
    """Return +1 for an even and −1 for an odd permutation."""
    images = range(len(permutation))
    return prod(-1 for i in images for j in range(i) if permutation[j] > permutation[i])


def _stabiliser(blocks: Sequence[tuple[int, ...]]) -> Iterator[Permutation]:
    """Give all permutations that map every block to itself."""
    joints = tuple(chain(*blocks))
    for images in product(*map(permutations, blocks)):
        moved = dict(zip(joints, chain(*images), strict=True))
        yield tuple(moved[joint] for joint in range(len(joints)))


def cancelling_weights(p: Polynomial, q: Polynomial) -> tuple[Fraction, Fraction]:
    """Return the smallest whole weights that make two affine functions of τ a constant."""
    (invariant,) = (p.keys() | q.keys()) - {ONE}
    slopes = p[invariant], q[invariant]
    assert slopes[0] * slopes[1] < 0, "one square bounds the invariant above, one below"
    numerators = [abs(slope) * lcm(*(s.denominator for s in slopes)) for slope in slopes]
    common = gcd(*(numerator.numerator for numerator in numerators))
    return numerators[1] / common, numerators[0] / common
