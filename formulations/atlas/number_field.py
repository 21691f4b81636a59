"""Exact numbers a(θ)/d, θ a real root of a monic polynomial in whole numbers, d > 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd

# Enclosures of θ have this many bits after the point.
_BITS = 1024


@dataclass(frozen=True, eq=False)
class NumberField:
    """All a(θ)/d, for the root θ of a monic polynomial next to a rational number.

    Nothing here asks for an irreducible polynomial: what is equal modulo any polynomial with
    root θ is equal at θ.

    Attributes
    ----------
    polynomial
        Coefficients of x⁰ to x^degree, the last one 1.
    root
        A rational number r with \\|r − θ\\| < `width`.
    width
        A sign of the polynomial changes, and its derivative has one, within r ± `width`.
    """

    polynomial: tuple[int, ...]
    root: Fraction
    width: Fraction

    @staticmethod
    def of(polynomial: Sequence[int], near: Fraction, width: Fraction) -> NumberField:
        """Return the field of the only root within near ± width, or raise ValueError."""
        if len(polynomial) < 2 or polynomial[-1] != 1 or width <= 0:
            raise ValueError("the polynomial is not monic")
        if not has_one_root(polynomial, near, width):
            raise ValueError("the root is not isolated")
        low, high = near - width, near + width
        rising = value_at(polynomial, high) > 0
        while high - low > Fraction(1, 1 << _BITS):
            # Rounded, so that numerators stay short.
            middle = Fraction(((low + high) / 2 * (1 << (_BITS + 2))).__floor__(), 1 << (_BITS + 2))
            if (value_at(polynomial, middle) > 0) == rising:
                high = middle
            else:
                low = middle
        return NumberField(tuple(polynomial), low, high - low)

    def number(self, stated: Sequence[int]) -> Number:
        """Return the number with these coefficients of 1, θ, θ², …, over the last one."""
        *numerators, denominator = stated
        if denominator <= 0 or len(numerators) != len(self.polynomial) - 1:
            raise ValueError("not a number of the field")
        return _lowest(self, numerators, denominator)


@dataclass(frozen=True, eq=False)
class Number:
    """One of these numbers, in lowest terms; sums and products are exact."""

    field: NumberField
    numerators: tuple[int, ...]
    denominator: int

    def __bool__(self) -> bool:
        return any(self.numerators)

    def __add__(self, other: Number) -> Number:
        a, b = other.denominator, self.denominator
        terms = zip(self.numerators, other.numerators, strict=True)
        return _lowest(self.field, [a * x + b * y for x, y in terms], a * b)

    def __neg__(self) -> Number:
        return Number(self.field, tuple(-x for x in self.numerators), self.denominator)

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __mul__(self, other: Number) -> Number:
        size = len(self.numerators)
        product = [0] * (2 * size - 1)
        for i, x in enumerate(self.numerators):
            if x:
                for j, y in enumerate(other.numerators):
                    product[i + j] += x * y
        while len(product) > size:
            leading = product.pop()
            for i, c in enumerate(self.field.polynomial[:-1]):
                product[len(product) - size + i] -= leading * c
        return _lowest(self.field, product, self.denominator * other.denominator)

    def times(self, whole: int) -> Number:
        """Return the number times an integer."""
        return _lowest(self.field, [whole * x for x in self.numerators], self.denominator)

    def approximate(self) -> float:
        """Return the nearest double but for 1e-15, of it and absolute, or raise ValueError."""
        r, width = self.field.root, self.field.width
        # |a(θ) − a(r)| is at most |θ − r| times the largest |a′| between them.
        slope = sum(i * abs(x) * (abs(r) + 1) ** (i - 1) for i, x in enumerate(self.numerators) if i)
        if slope * width > Fraction(self.denominator, 1 << 60):
            raise ValueError("a number is not known well enough")
        return float(value_at(self.numerators, r) / self.denominator)


def _lowest(field: NumberField, numerators: Sequence[int], denominator: int) -> Number:
    common = gcd(denominator, *numerators)
    return Number(field, tuple(x // common for x in numerators), denominator // common)


def value_at(polynomial: Sequence[int], x: Fraction) -> Fraction:
    """Return a polynomial's value, coefficients of x⁰ first."""
    total = Fraction(0)
    for c in reversed(polynomial):
        total = total * x + c
    return total


def has_one_root(polynomial: Sequence[int], near: Fraction, width: Fraction) -> bool:
    """Whether it is proved that there is exactly one root within near ± width.

    The sign changes, and |p′(near)| is more than `width` times what |p″| is at most there.
    """
    ends = [value_at(polynomial, near + side * width) for side in (-1, 1)]
    slope = [i * c for i, c in enumerate(polynomial)][1:]
    bend = [i * abs(c) for i, c in enumerate(slope)][1:]
    steep = abs(value_at(slope, near)) > width * value_at(bend, abs(near) + width)
    return ends[0] * ends[1] < 0 and steep
