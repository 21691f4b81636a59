"""Exact values are proved, and what is changed is refused."""

from copy import deepcopy
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy

from lockedjoint.formulations.atlas.collection import page_of, problem_of, proved_maximum
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.exact_value import exact_values
from lockedjoint.formulations.atlas.local_maximum import prove_local_maximum
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas.enclosed_matrices import distance_of_roots, has_full_rank, is_definite
from results.atlas.exact import verify
from results.atlas.exact_optimum import active_sets, records
from results.atlas.exact_proof import prove_exact_value
from results.atlas.number_field import NumberField

RECORDS = records()
FIELD = NumberField.of([-2, 0, 0, 1], Fraction(126, 100), Fraction(1, 10))


def proved(name, maximum="proved", jacobian=None, **changed):
    page = page_of(entry(name))
    if maximum == "proved":
        maximum = proved_maximum(page.entry, page.jacobian)
    jacobian = page.jacobian if jacobian is None else jacobian
    return prove_exact_value(page.entry, jacobian, maximum, {**RECORDS[name], **changed})


def test_every_proof_is_of_a_value_that_the_library_shows():
    assert set(RECORDS) == set(exact_values())
    for name, exact in exact_values().items():
        assert RECORDS[name].keys() >= {"polynomial", "near", "proof"}
        if exact.proof == "numerical":
            assert exact.active_sets is None
        else:
            sets = active_sets(RECORDS[name])
            assert list(exact.active_sets) == [tuple(one) for one in sets]


def test_the_script_proves_them_and_says_what_is_wrong(monkeypatch, capsys):
    pages = [page_of(entry(name)) for name in ("free_2x5_k2", "free_2x8_k3", "free_3x12_k3")]
    assert verify(pages) == 0
    shown = capsys.readouterr().out
    assert "maximum: 1, sharp maximum: 1, numerical: 1" in shown
    other = replace(pages[0], value="0.5")
    assert verify([other]) == 1
    assert "no exact value on record" in capsys.readouterr().out
    wrong = {**RECORDS["free_2x5_k2"], "polynomial": [6, -10, 4]}
    monkeypatch.setitem(RECORDS, "free_2x5_k2", wrong)
    assert verify(pages) == 1
    assert "no root at σ²" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name", ["free_2x5_k2", "free-mean_2x5_k2", "free-mean_2x6_k3", "free-mean_3x6_k2"]
)
def test_small_ones_are_proved(name):
    assert proved(name)


def test_sharp_optima_need_no_second_order_and_others_do():
    assert proved("free-mean_2x6_k3", None)
    with pytest.raises(CertificateError, match="no local maximum"):
        proved("free-mean_2x5_k2", None)
    with pytest.raises(CertificateError, match="no sharp maximum"):
        proved("free-mean_2x5_k2", None, proof="sharp maximum")


def test_where_multipliers_are_not_unique_the_exact_proof_decides():
    page = page_of(entry("free_2x8_k3"))
    assert proved_maximum(page.entry, page.jacobian) is None
    assert page.locally_optimal
    assert problem_of(page) == ""
    assert proved("free_2x8_k3", None)
    assert not proved("free-mean_2x8_k2", None, proof="attained")
    with pytest.raises(CertificateError, match="no local maximum"):
        proved("free-mean_2x8_k2", None, proof="maximum")
    with pytest.raises(CertificateError, match="no sharp maximum"):
        proved("free-mean_2x8_k2", None, proof="sharp maximum")


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
        {"squared_scales": record["squared_scales"][1:]},
        {"eigenvectors": record["eigenvectors"][::-1]},
        {"worst_sets": [[0, 0], *record["worst_sets"][1:]]},
        {"worst_sets": [*record["worst_sets"][1:], record["worst_sets"][0]]},
        # All sets at the worst case must be there, as t is to be the least eigenvalue of each.
        {key: record[key][:-1] for key in ("worst_sets", "eigenvectors", "multipliers")},
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
        for name in ("gram", "gram_inverse", "coordinates", "squared_scales")
    }
    x, inverse, t = values["coordinates"], values["gram_inverse"], Fraction(3, 2)
    vectors = []
    for (lost,) in record["worst_sets"]:
        kept = [f for f in range(3) if f != lost]
        left = (values["squared_scales"] * x)[:, kept] @ x[:, kept].T - t * inverse
        vectors.append(left[0, ::-1] * [1, -1] if any(left[0]) else np.array([1, 0]))
        assert not any(left @ vectors[-1])
    values["eigenvectors"] = np.array(vectors)
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
    assert true < distance_of_roots(given, factors, squares) < 3 * true


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
