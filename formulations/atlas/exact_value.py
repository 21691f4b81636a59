"""Squared worst cases that are known exactly, as roots of integer polynomials.

The squared worst case of a Jacobian is t = σ², σ the smallest singular value after the worst
failure, in squared units of J. A polynomial is a sequence of its coefficients, that of t⁰
first.

``exact.json`` has them by the names of entries. The script results/atlas/exact.py of a clone
found them and proves them. The library shows them, and checks one thing by itself: that the
polynomial has exactly one root at the number.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from importlib.resources import files
from math import sqrt
from typing import Any, Literal, TypeAlias

Proof: TypeAlias = Literal["maximum", "sharp maximum", "attained", "numerical"]
# Largest difference between the σ of a file and the exact σ that is shown beside it. Files of
# the package are nearer than 1e-9; a file with a larger difference has another Jacobian.
_SAME_SIGMA = 1e-7
#: Radius of the interval around `near` in which the polynomial has one root, in units of t.
ISOLATION_RADIUS = Fraction(1, 10**15)


@dataclass(frozen=True)
class ExactValue:
    """The squared worst case t = σ² of the exact Jacobian that is next to an entry's.

    Attributes
    ----------
    polynomial
        Integer coefficients of t⁰, t¹, … of a polynomial with the root t.
    near
        A decimal number; no other root is within 1e-15 of it.
    proof
        What results/atlas/exact.py proves. ``attained``: an exact Jacobian has this worst case.
        ``maximum``: it is also the strict local maximum that the library proves to be next to
        the entry's Jacobian. ``sharp maximum``: it is a strict local maximum because the worst
        case falls to first order in every direction; the library has no proof of that.
        ``numerical``: nothing is proved, the polynomial is a relation of 300 digits.
    active_sets
        The sets of joints with positive multipliers in that proof, None if they are not known.
    """

    polynomial: tuple[int, ...]
    near: str
    proof: Proof
    active_sets: tuple[tuple[int, ...], ...] | None = None

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

    @property
    def sigma(self) -> float:
        """The worst case σ, to the last digits of a double."""
        return sqrt(float(self.near))

    def has_root(self) -> bool:
        """Whether it is proved that just one root is within 1e-15 of `near`."""
        return has_one_root(self.polynomial, Fraction(self.near), ISOLATION_RADIUS)

    def to_dict(self) -> dict[str, Any]:
        """Return what is shown of it, as plain values."""
        return {"polynomial": list(self.polynomial), "near": self.near, "proof": self.proof}


@lru_cache
def exact_values() -> Mapping[str, ExactValue]:
    """Return the exact values on record, by the names of entries."""
    text = (files("lockedjoint.formulations.atlas") / "exact.json").read_text(encoding="utf-8")
    return {name: _exact_value(**record) for name, record in json.loads(text).items()}


def _exact_value(
    polynomial: Sequence[int],
    near: str,
    proof: Proof,
    active_sets: Sequence[Sequence[int]] | None = None,
) -> ExactValue:
    """Return a record of the file, its lists as tuples."""
    sets = None if active_sets is None else tuple(map(tuple, active_sets))
    return ExactValue(tuple(polynomial), near, proof, sets)


def exact_value(name: str, value: str) -> ExactValue | None:
    """Return the exact value of the entry of a name, None unless `value` is next to its σ."""
    exact = exact_values().get(name)
    if exact is None or abs(exact.sigma - float(value)) > _SAME_SIGMA:
        return None
    return exact


def value_at(polynomial: Sequence[int], x: Fraction) -> Fraction:
    """Return a polynomial's value; the coefficient of x⁰ comes first."""
    total = Fraction(0)
    for coefficient in reversed(polynomial):
        total = total * x + coefficient
    return total


def derivative(polynomial: Sequence[int]) -> list[int]:
    """Return the coefficients of a polynomial's derivative, that of x⁰ first."""
    return [i * coefficient for i, coefficient in enumerate(polynomial)][1:]


def has_one_root(polynomial: Sequence[int], near: Fraction, radius: Fraction) -> bool:
    """Whether it is proved that there is exactly one root within near ± radius.

    The polynomial p changes its sign there, and p′ does not: |p′(near)| is more than `radius`
    times a bound on |p″| over the interval, the value of p″ with absolute coefficients at its
    end.
    """
    slope = derivative(polynomial)
    left, right = value_at(polynomial, near - radius), value_at(polynomial, near + radius)
    largest_bend = value_at([abs(c) for c in derivative(slope)], abs(near) + radius)
    return left * right < 0 and abs(value_at(slope, near)) > radius * largest_bend
