"""Sparse polynomials in the entries of W and its conjugate, with rational coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import TypeAlias

from formulations.existence.graphs import Monomial, canonical

Polynomial: TypeAlias = Mapping[Monomial, Fraction]


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
