"""Exact values on record are roots of their polynomials, and marks rest on proofs."""

from dataclasses import replace
from fractions import Fraction
from math import cos, pi, sqrt

import numpy as np
import pytest
import sympy

from lockedjoint.formulations.atlas import collection
from lockedjoint.formulations.atlas.collection import (
    maximum_is_on_record,
    page_of,
    problem_of,
    proved_maximum,
)
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.exact_value import exact_value, exact_values, has_one_root
from lockedjoint.formulations.atlas.local_maximum import Conditions
from lockedjoint.formulations.existence.certificate import CertificateError

VALUES = exact_values()
SHARP = [name for name, exact in VALUES.items() if exact.proof == "sharp maximum"]


@pytest.mark.parametrize("name", VALUES)
def test_polynomials_are_irreducible_with_one_root_at_the_value(name):
    exact, page = VALUES[name], page_of(entry(name))
    polynomial = exact.polynomial
    assert sympy.Poly(polynomial[::-1], sympy.Symbol("t")).is_irreducible
    assert np.gcd.reduce(np.array(polynomial, dtype=object)) == 1
    assert polynomial[-1] > 0
    assert has_one_root(polynomial, Fraction(exact.near), Fraction(1, 10**15))
    assert exact.has_root()
    assert page.exact == exact
    assert sqrt(float(exact.near)) == pytest.approx(float(page.value), abs=3e-8)
    # A value of the file is proved from below, so it is not above.
    assert float(page.value) <= sqrt(float(exact.near)) + 1e-14


@pytest.mark.parametrize(
    ("name", "square"),
    [
        *((f"free_2x{n}_k2", n / 2 - 1 - cos(pi / n)) for n in range(5, 13)),
        *((f"free-mean_2x{n}_k{n - 2}", 1 - cos(pi / n)) for n in range(3, 7)),
        ("free-mean_3x6_k2", 1 - sqrt(1 / 5)),
        ("free-mean_6x7_k1", 1 / 6),
    ],
)
def test_closed_forms_agree(name, square):
    """Lines at equal angles in the plane, diagonals of the icosahedron, the simplex."""
    exact = VALUES[name]
    assert exact.proof in ("maximum", "sharp maximum")
    assert float(exact.near) == pytest.approx(square, abs=1e-15)


def test_a_page_shows_it_and_is_refused_with_a_wrong_one(monkeypatch):
    page = page_of(entry("free_2x5_k2"))
    text = "t = σ² = 0.6909830056250525759, a root of 4t^2 -10t +5; proved"
    assert str(page.exact) == text
    assert page.facts()["exact"]["polynomial"] == [5, -10, 4]
    assert problem_of(page) == ""
    wrong = replace(VALUES["free_2x5_k2"], polynomial=(6, -10, 4))
    monkeypatch.setitem(VALUES, "free_2x5_k2", wrong)
    assert "exact value" in problem_of(page)
    assert exact_value("free_2x5_k2", "0.8") is None  # of another Jacobian


@pytest.mark.parametrize("name", SHARP)
def test_sharp_maxima_keep_their_mark_with_their_own_jacobian_only(name):
    page = page_of(entry(name))
    assert page.locally_optimal
    assert maximum_is_on_record(page)
    assert collection._problem_of_optimum(page) == ""
    # The library proves none, so that the mark is lost with any other Jacobian or value.
    assert proved_maximum(page.entry, page.jacobian) is None
    turned = replace(page, jacobian=page.jacobian[:, ::-1])
    less = replace(page, value=f"{float(page.value) - 2e-9:.15f}")
    for other in (turned, less):
        assert "locally optimal" in collection._problem_of_optimum(other)


def test_other_marks_are_proved_here():
    assert [name for name in VALUES if maximum_is_on_record(page_of(entry(name)))] == SHARP
    assert "free_2x8_k3" in SHARP
    assert problem_of(page_of(entry("free_2x8_k3"))) == ""


def test_the_active_sets_on_record_are_those_of_the_proof():
    """Of 42 tied sets 22 do, and rounding chose others on another machine."""
    page = page_of(entry("free-mean_2x12_k4"))
    sets = page.exact.active_sets
    maximum = proved_maximum(page.entry, page.jacobian, sets)
    lost = [tuple(np.flatnonzero(row == 0).tolist()) for row in maximum.kept]
    assert sorted(lost) == sorted(sets)
    assert not problem_of(page)
    assert any(exact.active_sets is None for exact in VALUES.values())
    with pytest.raises(CertificateError, match="not at the worst case"):
        Conditions(page.entry, page.jacobian, [*sets, (0, 1, 2, 11)])
