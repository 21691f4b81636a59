"""Sparse polynomials in the entries of W and its conjugate, with rational coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import chain, permutations, product, zip_longest
from math import gcd, prod
from typing import TypeAlias

from formulations.existence.graphs import Monomial, canonical

Polynomial: TypeAlias = Mapping[Monomial, Fraction]
Tableau: TypeAlias = tuple[tuple[int, ...], ...]
Permutation: TypeAlias = tuple[int, ...]


def collected(terms: Iterable[tuple[Monomial, Fraction]]) -> Polynomial:
    """Add up terms and drop those that cancel."""
    total: dict[Monomial, Fraction] = {}
    for monomial, coefficient in terms:
        total[monomial] = total.get(monomial, Fraction(0)) + coefficient
    return {monomial: value for monomial, value in total.items() if value}


def combined(parts: Iterable[tuple[Fraction, Polynomial]]) -> Polynomial:
    """Return the linear combination Σ factor · polynomial."""
    return collected((m, factor * value) for factor, part in parts for m, value in part.items())


def times(monomial: Monomial, polynomial: Polynomial) -> Polynomial:
    """Return the product of a monomial and a polynomial."""
    return {monomial * other: value for other, value in polynomial.items()}


def hermitian_product(p: Polynomial, q: Polynomial) -> Polynomial:
    """Return p · conj(q)."""
    return collected((a * b.conjugate(), x * y) for a, x in p.items() for b, y in q.items())


def class_sums(polynomial: Polynomial) -> Polynomial:
    """Return the average over joint orders and conjugation, as a combination of classes.

    A class stands for the average of its members, hence for the average of each of them.
    """
    return collected((canonical(monomial), value) for monomial, value in polynomial.items())


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
