"""The answer that other tables show rests on a verification."""

import json
from importlib.resources import files

import pytest

import formulations.existence.verify as theorem
from formulations.existence.certificate import CertificateError


def test_the_packaged_certificate_is_the_derived_one(derived):
    packaged = (files("formulations.existence") / "certificate.json").read_text("utf-8")
    assert packaged == derived.to_json()


def test_seven_joints_are_excluded_and_no_others():
    assert theorem.excludes(7)
    assert not any(theorem.excludes(joints) for joints in (6, 8, 9))


def test_a_certificate_that_proves_nothing_is_no_answer(derived, tmp_path, monkeypatch):
    certificate = json.loads(derived.to_json())
    certificate["constant"] = "33247/1029"
    (tmp_path / "certificate.json").write_text(json.dumps(certificate))
    monkeypatch.setattr(theorem, "files", lambda _: tmp_path)
    theorem.verified.cache_clear()
    try:
        with pytest.raises(CertificateError):
            theorem.excludes(7)
    finally:
        theorem.verified.cache_clear()
