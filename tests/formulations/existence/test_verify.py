"""The certificate passes; whatever is done to it does not."""

import json
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import permutations
from math import prod
from typing import Any

import numpy as np
import pytest

import lockedjoint.formulations.existence.verify as verification
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.reading import read_certificate
from lockedjoint.formulations.existence.verify import TheoremReport, verify_nonexistence

RENAMED = cache(verification._renamed)
ORDERS = np.array(list(permutations(range(7))))
SEEDS = 0, 1


def left_hand_sides(w):
    """Return seven times the left-hand sides of the equations of each kind, (…, 7, 7)."""
    product = w @ w.conj()
    return {
        "row-sum": 7 * np.broadcast_to(w.sum(axis=-1, keepdims=True), w.shape),
        "square": 7 * (w @ w),
        "tight-frame": 7 * (product + product.conj()) - 4 * (7 * np.eye(7) - 1),
    }


@cache
def matrices(seed):
    """Return a random matrix of Gaussian integers in all orders of its joints, (7!, 7, 7).

    It violates every equation; all numbers are below 2⁵³, so that double precision is exact.
    """
    upper = np.triu(np.random.default_rng(seed).integers(-3, 4, size=(2, 7, 7)), k=1)
    real, imaginary = (part + part.T for part in upper)
    w = real + 1j * imaginary
    assert all(left.all() for left in left_hand_sides(w).values())
    return w[ORDERS[:, :, None], ORDERS[:, None, :]]


@cache
def equations(seed):
    """Return the left-hand sides at these matrices."""
    return left_hand_sides(matrices(seed))


def monomial(w, wbar, seed):
    """Return the values of a product of entries at these matrices, (7!,)."""
    factors = [matrices(seed)[:, i, j] for i, j in w]
    factors += [matrices(seed)[:, i, j].conj() for i, j in wbar]
    return prod(factors, start=np.ones(len(ORDERS), dtype=complex))


@cache
def products(terms, seed):
    """Return the sums over all orders of Re(t conj(u)) for the products t, u of a square."""
    values = np.stack([monomial(w, wbar, seed) for w, wbar in terms])
    return (values @ values.conj().T).real.astype(int).astype(object)


@cache
def multiple(kind, place, w, wbar, seed):
    """Return the sum over all orders of seven times a multiple of an equation."""
    left = equations(seed)[kind][:, place[0], place[-1]]
    return int((monomial(w, wbar, seed) * left).real.sum())


def evaluated(certificate, seed):
    """Return the identity averaged over S₇ at a random matrix, exactly.

    Products of entries are evaluated once for all certificates: most changes leave them.
    """
    total = len(ORDERS) * certificate.constant
    for square in certificate.squares:
        # Σ |p|² over all orders, from the real inner products of its terms.
        between = products(tuple((term.w, term.wbar) for term in square.terms), seed)
        coefficients = np.array([term.coefficient for term in square.terms], dtype=object)
        total += square.weight * (coefficients @ between @ coefficients)
    for m in certificate.multipliers:
        total -= m.coefficient * multiple(m.kind, m.place, m.w, m.wbar, seed) / 7
    return total


@pytest.fixture(scope="module")
def certificate(committed):
    return read_certificate(committed)


@pytest.fixture
def renamed_once(monkeypatch):
    """Let each product be renamed once for all tests that ask for this.

    The renaming is a function of the product alone and takes most of the time; the changes of
    one certificate leave most products as they are.
    """
    monkeypatch.setattr(verification, "_renamed", RENAMED)


def test_the_committed_certificate_is_a_proof(committed):
    report = verify_nonexistence(read_certificate(committed))
    assert report == TheoremReport(7, Fraction(33248, 1029), 2, 351, report.monomials)
    assert report.monomials > 300


def test_the_identity_holds_at_random_matrices(certificate):
    assert [evaluated(certificate, seed) for seed in SEEDS] == [0, 0]


def negative(text):
    return str(-Fraction(text))


FALSE_IDENTITIES: dict[str, dict[str, Any]] = {
    "coefficient of a multiplier": {"multipliers.17.coefficient": "1/3"},
    "sign of a multiplier": {"multipliers.100.coefficient": negative},
    "coefficient of a term": {"squares.0.terms.3.coefficient": "2"},
    "sign of a term": {"squares.1.terms.20.coefficient": negative},
    "a weight": {"squares.1.weight": "26"},
    "the constant": {"constant": "33247/1029"},
    "constant too good": {"constant": "33249/1029"},
    "deleted multiplier": {"multipliers.42": ...},
    "doubled multiplier": {"multipliers": lambda all_: [*all_, all_[7]]},
    "deleted term": {"squares.0.terms.-1": ...},
    "deleted square": {"squares.1": ...},
    "exchanged squares' weights": {"squares.0.weight": "25", "squares.1.weight": "108"},
    "another equation": {"multipliers.0.equation": {"kind": "square", "entry": [0, 1]}},
    "another row": {"multipliers.0.equation.row": 5},
    "another monomial": {"multipliers.30.w": [[0, 1]]},
    "no factors": {"squares.0.terms.0.w": []},
    "huge coefficient": {"multipliers.3.coefficient": "9" * 40},
}


@pytest.mark.usefixtures("renamed_once")
@pytest.mark.parametrize("name", FALSE_IDENTITIES)
def test_a_false_identity_is_refused_by_verification_and_by_evaluation(
    name, committed, patched, tmp_path
):
    path = tmp_path / "changed.json"
    document = json.loads(committed.read_text())
    path.write_text(json.dumps(patched(document, FALSE_IDENTITIES[name])))
    with pytest.raises(CertificateError, match=r"^the identity does not hold: \d+ of \d+ av"):
        verify_nonexistence(read_certificate(path))
    assert any(evaluated(read_certificate(path), seed) for seed in SEEDS)


def test_the_smallest_change_of_each_multiplier_shows(certificate):
    """Every thirtieth of the multipliers, one at a time: evaluation sees every one of them."""
    for place in range(0, len(certificate.multipliers), 30):
        multipliers = list(certificate.multipliers)
        old = multipliers[place]
        multipliers[place] = replace(old, coefficient=old.coefficient + Fraction(1, 10**9))
        assert evaluated(replace(certificate, multipliers=tuple(multipliers)), SEEDS[0])


@pytest.mark.usefixtures("renamed_once")
def test_other_orders_of_joints_and_records_prove_the_same(certificate):
    """What does not change the average is no error: no true identity may be refused."""
    order, multipliers = (3, 6, 0, 2, 5, 1, 4), []
    for m in reversed(certificate.multipliers):
        w = tuple((order[j], order[i]) for i, j in m.w)
        wbar = tuple((order[i], order[j]) for i, j in m.wbar)
        place = tuple(order[i] for i in m.place)
        multipliers.append(replace(m, place=place, w=w, wbar=wbar))
    renamed = replace(certificate, multipliers=tuple(multipliers))
    assert verify_nonexistence(renamed) == verify_nonexistence(certificate)
    assert evaluated(renamed, SEEDS[0]) == 0


def test_records_refuse_floating_point(certificate):
    for part, name in (
        (certificate, "constant"),
        (certificate.squares[0], "weight"),
        (certificate.squares[0].terms[0], "coefficient"),
        (certificate.multipliers[0], "coefficient"),
    ):
        with pytest.raises(CertificateError, match=r"1\.5 is not a Fraction"):
            replace(part, **{name: 1.5})
    with pytest.raises(CertificateError, match="is not one of"):
        replace(certificate.squares[0].terms[0], w=((0.5, 1),))


def test_a_certificate_that_proves_nothing_is_no_answer(derived, tmp_path, monkeypatch):
    certificate = json.loads(derived.to_json())
    certificate["constant"] = "33247/1029"
    (tmp_path / "certificate.json").write_text(json.dumps(certificate))
    monkeypatch.setattr(verification, "files", lambda _: tmp_path)
    verification.verified.cache_clear()
    try:
        with pytest.raises(CertificateError):
            verification.excludes(7)
    finally:
        verification.verified.cache_clear()
