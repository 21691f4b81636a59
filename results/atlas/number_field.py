"""Exact arithmetic in a number field: numbers a(θ)/d, θ a real root of an integer polynomial.

a is a polynomial with integer coefficients, of smaller degree than that of θ; d is an integer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd

from lockedjoint.formulations.atlas.exact_value import derivative, has_one_root, value_at

# Number of binary digits after the point of the rational number that stands for θ.
_BITS = 1024
# Number of those binary digits that Newton's method may have wrong.
_UNCERTAIN_BITS = 24
# Number of Newton steps: each doubles the correct digits, and the first one has a few.
_NEWTON_STEPS = 12


@dataclass(frozen=True, eq=False)
class NumberField:
    """All numbers a(θ)/d, for one real root θ of a monic polynomial.

    The polynomial need not be irreducible: numbers that are equal modulo any polynomial with
    the root θ are equal.

    Attributes
    ----------
    polynomial
        Integer coefficients of x⁰ to x^degree, the last one 1.
    root
        A rational number near θ.
    radius
        Largest distance of θ from `root`; no other root of the polynomial is as near.
    """

    polynomial: tuple[int, ...]
    root: Fraction
    radius: Fraction

    @staticmethod
    def of(polynomial: Sequence[int], near: Fraction, radius: Fraction) -> NumberField:
        """Return the field of the only root within near ± radius, or raise ValueError."""
        if len(polynomial) < 2 or polynomial[-1] != 1:
            raise ValueError("the polynomial is not monic, of degree 1 at least")
        if radius <= 0:
            raise ValueError("the radius is not above 0")
        if not has_one_root(polynomial, near, radius):
            raise ValueError("the root is not isolated")
        slope = derivative(polynomial)
        grid = 1 << _BITS
        root = near
        for _ in range(_NEWTON_STEPS):
            step = value_at(polynomial, root) / value_at(slope, root)
            root = Fraction(round((root - step) * grid), grid)
        smallest_radius = Fraction(1, grid >> _UNCERTAIN_BITS)
        if abs(root - near) > radius or not has_one_root(polynomial, root, smallest_radius):
            raise ValueError("the root is not found")
        return NumberField(tuple(polynomial), root, smallest_radius)

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.polynomial) - 1

    @property
    def one(self) -> Number:
        """The number 1."""
        return Number(self, (1, *[0] * (self.degree - 1)), 1)

    @property
    def zero(self) -> Number:
        """The number 0."""
        return Number(self, (0,) * self.degree, 1)

    def number(self, coefficients: Sequence[int]) -> Number:
        """Return (c_0 + c_1 θ + … )/d from the list c_0, c_1, …, d; or raise ValueError."""
        *numerators, denominator = coefficients
        if denominator <= 0 or len(numerators) != self.degree:
            raise ValueError("not a number of the field")
        return _in_lowest_terms(self, numerators, denominator)


@dataclass(frozen=True, eq=False)
class Number:
    """A number of a field, in lowest terms; sums and products are exact.

    Attributes
    ----------
    field
        The field.
    numerators
        Coefficients of 1, θ, θ², ….
    denominator
        The denominator of all of them.
    """

    field: NumberField
    numerators: tuple[int, ...]
    denominator: int

    def __bool__(self) -> bool:
        return any(self.numerators)

    def __add__(self, other: Number) -> Number:
        a, b = other.denominator, self.denominator
        terms = zip(self.numerators, other.numerators, strict=True)
        return _in_lowest_terms(self.field, [a * x + b * y for x, y in terms], a * b)

    def __neg__(self) -> Number:
        return Number(self.field, tuple(-x for x in self.numerators), self.denominator)

    def __sub__(self, other: Number) -> Number:
        return self + -other

    def __mul__(self, other: Number) -> Number:
        degree = self.field.degree
        product = [0] * (2 * degree - 1)
        for i, x in enumerate(self.numerators):
            if x:
                for j, y in enumerate(other.numerators):
                    product[i + j] += x * y
        # The polynomial of θ is monic: θ^degree is minus its lower terms.
        while len(product) > degree:
            leading = product.pop()
            for i, c in enumerate(self.field.polynomial[:-1]):
                product[len(product) - degree + i] -= leading * c
        return _in_lowest_terms(self.field, product, self.denominator * other.denominator)

    def times(self, factor: int) -> Number:
        """Return the number times an integer."""
        return _in_lowest_terms(
            self.field, [factor * x for x in self.numerators], self.denominator
        )

    def enclosed(self) -> tuple[Fraction, Fraction]:
        """Return a rational number, and a bound on its distance from this number."""
        root, radius = self.field.root, self.field.radius
        # |a(θ) − a(r)| is at most |θ − r| times a bound on |a′| between θ and r.
        slope = sum(
            i * abs(x) * (abs(root) + 1) ** (i - 1) for i, x in enumerate(self.numerators) if i
        )
        value = value_at(self.numerators, root) / self.denominator
        return value, slope * radius / self.denominator

    def distance_bound(self, near: Fraction) -> Fraction:
        """Return an upper bound on the distance from a rational number."""
        value, error = self.enclosed()
        return abs(value - near) + error

    def __float__(self) -> float:
        return float(self.enclosed()[0])

    @property
    def sign(self) -> int:
        """1, 0 or −1, proved; or raise ValueError."""
        if not self:
            return 0
        value, error = self.enclosed()
        if abs(value) <= error:
            raise ValueError("a number is not told from zero")
        return 1 if value > 0 else -1


def _in_lowest_terms(field: NumberField, numerators: Sequence[int], denominator: int) -> Number:
    common = gcd(denominator, *numerators)
    return Number(field, tuple(x // common for x in numerators), denominator // common)
