"""Exact values are proved, closed forms agree, and what is changed is refused."""

from copy import deepcopy
from fractions import Fraction
from math import cos, pi, sqrt

import numpy as np
import pytest
import sympy

from lockedjoint.formulations.atlas.collection import page_of, problem_of, proved_maximum
from lockedjoint.formulations.atlas.enclosures import distance_bound, has_full_rank, is_definite
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.exact_numbers import (
    NumberField,
    exact_value,
    has_one_root,
    records,
    sets_on_record,
)
from lockedjoint.formulations.atlas.exact_optimum import prove_exact_value
from lockedjoint.formulations.atlas.local_maximum import Conditions, prove_local_maximum
from lockedjoint.formulations.existence.certificate import CertificateError

RECORDS = records()
FIELD = NumberField.of([-2, 0, 0, 1], Fraction(126, 100), Fraction(1, 10))


def proved(name, maximum="proved", jacobian=None, **changed):
    page = page_of(entry(name))
    if maximum == "proved":
        maximum = proved_maximum(page.entry, page.jacobian)
    jacobian = page.jacobian if jacobian is None else jacobian
    return prove_exact_value(page.entry, jacobian, maximum, {**RECORDS[name], **changed})


@pytest.mark.parametrize("name", RECORDS)
def test_polynomials_are_irreducible_with_one_root_at_the_value(name):
    record, page = RECORDS[name], page_of(entry(name))
    polynomial = record["polynomial"]
    assert sympy.Poly(polynomial[::-1], sympy.Symbol("t")).is_irreducible
    assert np.gcd.reduce(np.array(polynomial, dtype=object)) == 1
    assert polynomial[-1] > 0
    assert has_one_root(polynomial, Fraction(record["near"]), Fraction(1, 10**15))
    assert page.exact.near == record["near"]
    assert sqrt(float(record["near"])) == pytest.approx(float(page.value), abs=3e-8)
    # A value of the file is proved from below, so it is not above.
    assert float(page.value) <= sqrt(float(record["near"])) + 1e-14


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
    record = RECORDS[name]
    assert record["proof"] == "maximum"
    assert float(record["near"]) == pytest.approx(square, abs=1e-15)


@pytest.mark.parametrize(
    "name", ["free_2x5_k2", "free-mean_2x5_k2", "free-mean_2x6_k3", "free-mean_3x6_k2"]
)
def test_small_ones_are_proved(name):
    assert proved(name)


def test_sharp_optima_need_no_second_order_and_others_do():
    assert proved("free-mean_2x6_k3", None)
    with pytest.raises(CertificateError, match="no local maximum"):
        proved("free-mean_2x5_k2", None)


def test_where_multipliers_are_not_unique_the_exact_proof_decides():
    page = page_of(entry("free_2x8_k3"))
    assert proved_maximum(page.entry, page.jacobian) is None
    assert page.locally_optimal
    assert problem_of(page) == ""
    assert not proved("free-mean_2x8_k2", None, proof="attained")
    with pytest.raises(CertificateError, match="no local maximum"):
        proved("free-mean_2x8_k2", None, proof="maximum")


@pytest.mark.parametrize("name", ["free_2x5_k2", "free-mean_2x5_k2"])
def test_a_number_that_is_changed_is_refused(name):
    page, rng = page_of(entry(name)), np.random.default_rng(0)
    maximum = prove_local_maximum(page.entry, page.jacobian)
    for place in range(len(RECORDS[name]["numbers"])):
        numbers = deepcopy(RECORDS[name]["numbers"])
        numbers[place][rng.integers(len(numbers[place]) - 1)] += int(rng.choice([-1, 1]))
        with pytest.raises(CertificateError, match="exact value"):
            proved(name, maximum, numbers=numbers)


def test_another_polynomial_field_or_root_is_refused():
    name = "free-mean_2x5_k2"
    record = RECORDS[name]
    for place in range(len(record["polynomial"])):
        wrong = deepcopy(record["polynomial"])
        wrong[place] += 1
        with pytest.raises(CertificateError):
            proved(name, polynomial=wrong)
    with pytest.raises(CertificateError, match="no root"):
        proved(name, near=str(Fraction(record["near"]) + Fraction(1, 10**6)))
    for change in (
        {"field": record["field"][:-1]},
        {"field": [*record["field"][:-1], 2]},
        {"root": ["0", "1/1000"]},
        {"numbers": record["numbers"][:-1]},
        {"numbers": [one[1:] for one in record["numbers"]]},
        {"weights": record["weights"][1:]},
        {"vectors": record["vectors"][::-1]},
        {"sets": [[0, 0], *record["sets"][1:]]},
        {"sets": [*record["sets"][1:], record["sets"][0]]},
        # All sets at the worst case must be there, as t is to be the least eigenvalue of each.
        {key: record[key][:-1] for key in ("sets", "vectors", "multipliers")},
    ):
        with pytest.raises(CertificateError, match="exact value"):
            proved(name, **change)


def test_another_jacobian_or_maximum_is_refused():
    other = page_of(entry("free_2x5_k2"))
    maximum = prove_local_maximum(other.entry, other.jacobian)
    with pytest.raises(CertificateError, match="another Jacobian"):
        proved("free-mean_2x5_k2", None, other.jacobian)
    with pytest.raises(CertificateError, match="exact value"):
        proved("free-mean_2x5_k2", maximum)


@pytest.mark.parametrize("name", ["free_2x5_k2", "free-mean_2x6_k3", "free-mean_3x6_k2"])
def test_a_jacobian_that_is_moved_is_refused_but_not_one_that_is_turned(name):
    page = page_of(entry(name))
    drawn = np.random.default_rng(0).standard_normal(page.jacobian.shape)
    moved = page.jacobian + 1e-6 * drawn / np.linalg.norm(drawn)
    for maximum in (None, proved_maximum(page.entry, page.jacobian)):
        with pytest.raises(CertificateError, match="another Jacobian"):
            prove_exact_value(page.entry, moved, maximum)
    signs = np.where(drawn[0] > 0, 1.0, -1.0)
    turned = np.linalg.qr(drawn @ drawn.T)[0] @ page.jacobian * signs
    assert prove_exact_value(page.entry, turned, proved_maximum(page.entry, turned))


def test_another_root_of_the_polynomial_is_refused():
    # 4t² − 10t + 5 has the roots (5 ± √5)/4.
    other = {"near": "1.8090169943749474241"}
    with pytest.raises(CertificateError, match="another root"):
        proved("free_2x5_k2", **other)
    # With the other root of the field all equations hold, of another matrix.
    field = RECORDS["free_2x5_k2"]["field"]
    sizes = np.roots(field[::-1])
    own = float(Fraction(RECORDS["free_2x5_k2"]["root"][0]))
    conjugate = Fraction(float(sizes[np.argmax(abs(sizes - own))]))
    with pytest.raises(CertificateError, match=r"frame|length|another"):
        proved("free_2x5_k2", root=[str(conjugate), "1/1000000"], **other)


def test_another_eigenvalue_is_refused():
    """Of three lines at equal angles all equations hold at the larger eigenvalue as well."""
    record = RECORDS["free-mean_2x3_k1"]
    numbers = [Fraction(*one) for one in record["numbers"]]
    values = {
        name: np.array(numbers, dtype=object)[np.array(record[name])]
        for name in ("metric", "inverse", "columns", "weights")
    }
    x, inverse, t = values["columns"], values["inverse"], Fraction(3, 2)
    vectors = []
    for (lost,) in record["sets"]:
        kept = [f for f in range(3) if f != lost]
        left = (values["weights"] * x)[:, kept] @ x[:, kept].T - t * inverse
        vectors.append(left[0, ::-1] * [1, -1] if any(left[0]) else np.array([1, 0]))
        assert not any(left @ vectors[-1])
    values["vectors"] = np.array(vectors)
    values["multipliers"] = np.array([1 / (3 * (v @ inverse @ v)) for v in vectors])
    pool = [t]
    for name, value in values.items():
        values[name] = (len(pool) + np.arange(value.size)).reshape(value.shape).tolist()
        pool += [Fraction(one) for one in value.ravel()]
    stated = [[one.numerator, one.denominator] for one in pool]
    with pytest.raises(CertificateError, match="another eigenvalue is as small"):
        proved("free-mean_2x3_k1", polynomial=[-3, 2], near="1.5", numbers=stated, **values)


def test_definite_is_what_is_positive_by_more_than_the_units():
    root = NumberField.of([-2, 0, 1], Fraction(141, 100), Fraction(1, 10))
    one, two, theta = (root.number(c) for c in ([1, 0, 1], [2, 0, 1], [0, 1, 1]))
    tiny, less = (root.number([1, 0, 10**digits]) for digits in (30, 40))
    for corner, definite in ((two, False), (two + tiny, True), (two - tiny, False)):
        matrix = np.array([[one, theta], [theta, corner]])
        assert is_definite(matrix) == definite
        assert has_full_rank(matrix) == (corner is not two)
        assert not has_full_rank(matrix[:1])
    # Where 2⁻¹²⁸ does not show it, it is not claimed.
    assert not is_definite(np.array([[one, theta], [theta, two + less]]))


def test_distances_are_bounded_from_above():
    root = NumberField.of([-2, 0, 1], Fraction(141, 100), Fraction(1, 10))
    zero, one, theta = (root.number(c) for c in ([0, 0, 1], [1, 0, 1], [0, 1, 1]))
    given = np.array([Fraction(3, 2), Fraction(-1, 2), Fraction(1, 100), Fraction(0)])
    factors, squares = np.array([theta, -one, zero, one]), np.array([theta, one, one, theta])
    exact = np.array([2**0.75, -1.0, 0.0, 2**0.25])
    true = np.linalg.norm(given.astype(float) - exact)
    assert true < distance_bound(given, factors, squares) < 3 * true


def test_a_page_shows_it_and_is_refused_with_a_wrong_one(monkeypatch):
    page = page_of(entry("free_2x5_k2"))
    text = "t = σ² = 0.6909830056250525759, a root of 4t^2 -10t +5; proved"
    assert str(page.exact) == text
    assert page.facts()["exact"]["polynomial"] == [5, -10, 4]
    assert problem_of(page) == ""
    wrong = {**RECORDS["free_2x5_k2"], "polynomial": [6, -10, 4]}
    monkeypatch.setitem(records(), "free_2x5_k2", wrong)
    assert "exact value" in problem_of(page)
    assert exact_value("free_2x5_k2", "0.8") is None  # of another Jacobian


@pytest.mark.parametrize("seed", range(5))
def test_sums_and_products_are_those_of_sympy(seed):
    rng, root = np.random.default_rng(seed), sympy.cbrt(2)
    numbers, values = [], []
    for _ in range(2):
        *c, d = (int(v) for v in rng.integers(1, 50, 4))
        numbers.append(FIELD.number([*c, d]))
        values.append(sum(sympy.Rational(v, d) * root**i for i, v in enumerate(c)))
    (a, b), (x, y) = numbers, values
    for found, true in ((a + b, x + y), (a - b, x - y), (a * b, x * y), (-a, -x)):
        value, off = found.enclosed()
        assert off < 1e-250
        assert abs(sympy.Rational(value) - true.evalf(300)) < 1e-250
        assert found.sign == sympy.sign(true)
        assert not found - found
        assert found


def test_a_field_needs_an_isolated_root():
    for wrong, near in (([-2, 0, 2], 1.4), ([-2, 0, 1], 1.0), ([2, 0, 1], 1.0), ([1], 0.0)):
        with pytest.raises(ValueError, match=r"root|monic"):
            NumberField.of(wrong, Fraction(near), Fraction(1, 100))


def test_the_sets_on_record_are_those_of_the_proof():
    """Of 42 tied sets 22 do, and rounding chose others on another machine."""
    page = page_of(entry("free-mean_2x12_k4"))
    sets = sets_on_record(page.entry.name)
    maximum = proved_maximum(page.entry, page.jacobian, sets)
    lost = [tuple(np.flatnonzero(row == 0).tolist()) for row in maximum.kept]
    assert sorted(lost) == sorted(sets)
    assert not problem_of(page)
    numerical = next(name for name, record in RECORDS.items() if "sets" not in record)
    assert sets_on_record(numerical) is None
    with pytest.raises(CertificateError, match="not at the worst case"):
        Conditions(page.entry, page.jacobian, [*sets, (0, 1, 2, 11)])
