"""Optimal Jacobians of 8 joints and more: closed form, certificates, their verification."""

import json
import re
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.exact_jacobian import (
    SIX_REVOLUTE,
    ExactJacobian,
    Number,
    verify_existence,
)
from lockedjoint.formulations.existence.reading import read_certificate
from lockedjoint.formulations.existence.rings import exact_jacobian, optimal_jacobian
from lockedjoint.formulations.measures import worst_case_sigma

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "results" / "existence"
BASES = (8, 9, 10, 11, 12, 13)
DIGITS = 50


def numeric(certificate):
    """Evaluate all columns to 50 digits, the six-joint arms included: a second arithmetic."""
    roots: dict[int, Any] = {}

    def value(number):
        terms = (
            sympy.Rational(c.numerator, c.denominator) * sympy.prod(roots[r] for r in used)
            for c, used in number
        )
        return sympy.N(sum(terms), DIGITS)

    for place, under in enumerate(certificate.roots):
        roots[place] = sympy.sqrt(value(under))
    columns = [[value(number) for number in column] for column in certificate.columns]
    columns += list(SIX_REVOLUTE) * certificate.six_joint_arms
    return sympy.Matrix(columns).T


def require_optimal(jacobian, joints, within):
    jacobian = np.array(jacobian)
    assert jacobian.shape == (6, joints)
    v, w = jacobian[:3], jacobian[3:]
    assert abs((v * v).sum(0) - 1).max() < within
    assert abs((w * w).sum(0) - 1).max() < within
    assert abs((v * w).sum(0)).max() < within
    third = sympy.Rational(joints, 3) if jacobian.dtype == object else joints / 3
    assert abs(jacobian @ jacobian.T - third * np.eye(6, dtype=int)).max() < within


@pytest.mark.parametrize("joints", [*range(8, 26), 101])
def test_the_closed_form_attains_the_bound(joints):
    jacobian = optimal_jacobian(joints)
    require_optimal(jacobian, joints, 1e-14 * joints)
    assert worst_case_sigma(jacobian) == pytest.approx(((joints - 6) / 3) ** 0.5, rel=1e-12)
    signed = np.hstack([jacobian, -jacobian]).T  # the same axis: the same column up to sign
    apart = np.linalg.norm(signed[:, None] - signed[None], axis=2) + 2 * np.eye(2 * joints)
    assert apart.min() > 1e-3


@pytest.mark.parametrize("joints", [*BASES, 14, 20, 27])
def test_certificates_hold_exactly_and_to_fifty_digits(joints):
    certificate = exact_jacobian(joints)
    base = len(certificate.columns)
    assert verify_existence(certificate) == 3 * base + 21 + 18 + 21
    require_optimal(numeric(certificate), joints, 1e-45)


@pytest.mark.parametrize("joints", BASES)
def test_the_committed_certificates_are_the_ones_found(joints):
    file = FOLDER / f"optimal_{joints}.json"
    assert file.read_text() == exact_jacobian(joints).to_json()
    certificate = read_certificate(file)
    assert certificate == exact_jacobian(joints)
    assert isinstance(certificate, ExactJacobian)
    distance = np.array(numeric(certificate), float) - optimal_jacobian(joints)
    assert abs(distance).max() < 1e-12


# Changes of the certificate for 13 joints. Its roots: √2, A, B, √3, √5, sin 72°. How its
# numbers and keys are read is tested in test_reading.py: the same code reads them.
ILL_FORMED: dict[str, dict[str, Any]] = {
    "no arms": {"six_joint_arms": ...},
    "joints too many": {"joints": 14},
    "joints beyond the limit": {"joints": 1003, "six_joint_arms": 165},
    "arms without their joints": {"six_joint_arms": 1},
    "a column less": {"columns.12": ...},
    "a column of five": {"columns.3.5": ...},
    "an entry as a fraction": {"columns.2.0": "1/2"},
    "a root that is not there": {"columns.2.0": [["1", [6]]]},
    "a root twice in a term": {"columns.2.0": [["1", [0, 0]]]},
    "too large a coefficient": {"columns.2.0": [["1/1000000000001", [0]]]},
    "too many terms": {"columns.2.0": [["1", []]] * 5},
    "a root of a later one": {"roots.1": [["1", [2]]]},
}
FALSE: dict[str, dict[str, Any]] = {
    "a root of a negative number": {"roots.0": [["-2", []]]},
    "a root of zero": {"roots.0": []},
    "a root of a sum below zero": {"roots.5": [["5/8", []], ["-3/8", [4]]]},
    "another root": {"roots.3": [["5", []]]},
    "the other golden root": {"roots.5": [["5/8", []], ["-1/8", [4]]]},
    "a root close by": {"roots.2": [["8666666666/10000000000", []]]},
    "a coefficient": {"columns.0.0": [["2", [2]]]},
    "a coefficient close by": {"columns.0.0": [["100000000001/100000000000", [2]]]},
    "a sign of v": {"columns.0.0": [["-1", [2]]]},
    "a sign of ω": {"columns.0.4": [["-1/2", [0]]]},
    "an entry zero": {"columns.0.0": []},
    "a term dropped": {"columns.1.0.-1": ...},
    "a term twice": {"columns.1.0": lambda terms: [*terms, terms[0]]},
    "a column twice": {"columns": lambda columns: [columns[0], *columns[:12]]},
    "v and ω exchanged": {"columns.0": lambda column: [*column[3:], *column[:3]]},
    "a column of zeros": {"columns.12": [[]] * 6},
    "a prismatic column": {"columns.12": [[], [], [["1", []]], [], [], []]},
    "a long lever arm": {"columns.12.2": [["2", []]]},
    "a column less, six more": {"joints": 18, "columns.12": ..., "six_joint_arms": 1},
    "the columns of seven": {"joints": 7, "columns": lambda columns: columns[:7]},
}
TRUE: dict[str, dict[str, Any]] = {
    "another order of columns": {"columns": lambda columns: columns[::-1]},
    "another sign of a column": {"columns.12": lambda column: [*map(negated, column)]},
    "a term in two halves": {"columns.10.2": [["1/2", []], ["1/2", []]]},
    "a term that cancels": {"columns.10.0": [["1/2", [0]], ["-1/2", [0]]]},
    "roots in another order": {"columns.0.2": [["1", [1, 0]]]},
    "six joints more": {"joints": 19, "six_joint_arms": 1},
    "all of v negated": {
        "columns": lambda columns: [[*map(negated, c[:3]), *c[3:]] for c in columns]
    },
    "rows exchanged in both halves": {
        "columns": lambda columns: [[c[k] for k in (1, 0, 2, 4, 3, 5)] for c in columns]
    },
}


def negated(entry):
    return [[str(-Fraction(coefficient)), roots] for coefficient, roots in entry]


@pytest.fixture
def judged(patched, tmp_path):
    """Return the changed certificate as it is read from its file."""

    def read_changed(changes):
        document = json.loads((FOLDER / "optimal_13.json").read_text())
        changed = patched(document, changes)
        assert changed != document
        (tmp_path / "changed.json").write_text(json.dumps(changed))
        return read_certificate(tmp_path / "changed.json")

    return read_changed


def require_one_sentence(refused):
    sentence = str(refused)
    assert sentence.endswith(".")
    assert "\n" not in sentence
    assert len(sentence) < 300


@pytest.mark.parametrize("name", ILL_FORMED)
def test_ill_formed_files_are_refused(name, judged):
    with pytest.raises(CertificateError) as refused:
        judged(ILL_FORMED[name])
    require_one_sentence(refused.value)


@pytest.mark.parametrize("name", FALSE)
def test_false_certificates_are_refused(name, judged):
    certificate = judged(FALSE[name])
    with pytest.raises(CertificateError, match=r" is not \d|shown to be positive") as refused:
        verify_existence(certificate)
    require_one_sentence(refused.value)


def isotropic(condition):
    """Return twelve columns with J Jᵀ = 4I that violate this condition alone."""
    one: Number = ((Fraction(1), ()),)
    long, short = ((Fraction(1), (0,)),), ((Fraction(1), (1,)),)  # √(3/2) and √(1/2)
    columns = []
    for place, (shift, other), sign in product(range(3), ((1, long), (2, short)), (1, -1)):
        column: list[Number] = [()] * 6
        sizes = {"v·ω": (one, one), "|v|²": (other, one), "|ω|²": (one, other)}
        column[place], w = sizes[condition]
        along = place if condition == "v·ω" else (place + shift) % 3
        column[3 + along] = tuple((sign * c, roots) for c, roots in w)
        columns.append(tuple(column))
    under = (((Fraction(3, 2), ()),), ((Fraction(1, 2), ()),))
    return ExactJacobian(12, 0, under, tuple(columns))


@pytest.mark.parametrize("condition", ["|v|²", "|ω|²", "v·ω"])
def test_isotropic_columns_that_are_not_unit_revolute_are_refused(condition):
    certificate = isotropic(condition)
    jacobian = np.array(numeric(certificate), float)
    assert abs(jacobian @ jacobian.T - 4 * np.eye(6)).max() < 1e-12
    with pytest.raises(CertificateError, match=re.escape(f"{condition} of column 0")):
        verify_existence(certificate)


@pytest.mark.parametrize("name", TRUE)
def test_true_certificates_pass(name, judged):
    certificate = judged(TRUE[name])
    verify_existence(certificate)
    require_optimal(numeric(certificate), certificate.joints, 1e-45)


def test_records_refuse_floating_point():
    half: Any = 0.5
    columns = exact_jacobian(8).columns
    first = (((half, ()),), *columns[0][1:])
    with pytest.raises(CertificateError, match=r"0\.5 is not a Fraction"):
        ExactJacobian(8, 0, (), (first, *columns[1:]))


def test_the_program_on_the_page_proves_existence(lockedjoint):
    page = (ROOT / "docs" / "existence.md").read_text()
    said = lockedjoint.python(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1])
    assert said.startswith("Optimally failure-tolerant Jacobians of 8 to 13 revolute")
