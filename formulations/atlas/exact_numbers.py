"""Exact values on record, and numbers a(θ)/d, θ a root of a polynomial in whole numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from importlib.resources import files
from math import gcd, sqrt
from typing import Any

# Approximations of θ have this many bits after the point.
_BITS = 1024
_NEWTON_STEPS = 12
# What a value in a file and its exact one differ by at most.
_NEXT = 1e-7


@dataclass(frozen=True)
class ExactValue:
    """The squared worst case of an exact Jacobian next to an entry's.

    Attributes
    ----------
    polynomial
        Coefficients of t⁰, t¹, … of one in whole numbers that σ² is a root of.
    near
        A decimal number; no other root is within 1e-15 of it.
    proof
        ``maximum`` if the Jacobian is proved to be a strict local maximum, ``attained`` if only
        its value is, ``numerical`` if it is no more than a relation of 300 digits.
    """

    polynomial: tuple[int, ...]
    near: str
    proof: str

    def __str__(self) -> str:
        terms = [
            f"{c:+d}" + ("" if i == 0 else "t" if i == 1 else f"t^{i}")
            for i, c in enumerate(self.polynomial)
            if c
        ]
        text = " ".join(reversed(terms)).replace("+1t", "+t").replace("-1t", "-t")
        return f"t = σ² = {self.near}, a root of {text.removeprefix('+')}; {self.known}"

    @property
    def known(self) -> str:
        """Say whether it is proved."""
        return "not proved" if self.proof == "numerical" else "proved"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return {"polynomial": list(self.polynomial), "near": self.near, "proof": self.proof}


@lru_cache
def records() -> Mapping[str, Mapping[str, Any]]:
    """Return what is on record, by the names of entries."""
    stated = (files("lockedjoint.formulations.atlas") / "exact.json").read_text(
        encoding="utf-8"
    )
    found: Mapping[str, Mapping[str, Any]] = json.loads(stated)
    return found


def sets_on_record(name: str) -> list[tuple[int, ...]] | None:
    """Return the sets of joints whose multipliers are not zero, None if they are not known."""
    record = records()[name]
    if "sets" not in record:
        return None
    multipliers = [record["numbers"][index][:-1] for index in record["multipliers"]]
    both = zip(record["sets"], multipliers, strict=True)
    return [tuple(own) for own, numerators in both if any(numerators)]


def exact_value(name: str, value: str) -> ExactValue | None:
    """Return the exact value on record of an entry, where `value` is next to it."""
    record = records().get(name)
    if record is None or abs(sqrt(float(record["near"])) - float(value)) > _NEXT:
        return None
    return ExactValue(tuple(record["polynomial"]), record["near"], record["proof"])


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
        A rational number less than `width` from θ.
    width
        A sign of the polynomial changes, and its derivative has one, within `width` of it.
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
        slope = [i * c for i, c in enumerate(polynomial)][1:]
        root, grid = near, 1 << _BITS
        for _ in range(_NEWTON_STEPS):
            step = value_at(polynomial, root) / value_at(slope, root)
            root = Fraction(((root - step) * grid).__round__(), grid)
        least = Fraction(1, grid >> 24)
        if abs(root - near) > width or not has_one_root(polynomial, root, least):
            raise ValueError("the root is not found")
        return NumberField(tuple(polynomial), root, least)

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

    def enclosed(self) -> tuple[Fraction, Fraction]:
        """Return a rational number, and what it is off by at most."""
        r, width = self.field.root, self.field.width
        # |a(θ) − a(r)| is at most |θ − r| times the largest |a′| between them.
        slope = sum(
            i * abs(x) * (abs(r) + 1) ** (i - 1) for i, x in enumerate(self.numerators) if i
        )
        return value_at(self.numerators, r) / self.denominator, slope * width / self.denominator

    def __float__(self) -> float:
        return float(self.enclosed()[0])

    @property
    def sign(self) -> int:
        """1, 0 or −1, proved; or raise ValueError."""
        value, off = self.enclosed()
        if self and abs(value) <= off:
            raise ValueError("a number is not told from zero")
        return (value > 0) - (value < 0) if self else 0


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
