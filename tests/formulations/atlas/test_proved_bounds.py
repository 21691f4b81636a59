"""Bounds of the atlas are proved anew; what is lowered or altered is refused."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from lockedjoint.formulations.atlas import proved_bounds
from lockedjoint.formulations.atlas.collection import page_of, read_atlas
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.export import EVIDENCE
from lockedjoint.formulations.atlas.proved_bounds import BoundProver
from lockedjoint.formulations.bounds import five_levers
from lockedjoint.formulations.bounds.certified import LEVER_CELLS, Bound, two_point_on_record
from lockedjoint.formulations.bounds.two_point_proof import prove_two_point
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import FileError

CERTIFICATES = Path(__file__).parents[3] / "results/bounds/certificates"
PAGES = {page.entry.name: page for page in read_atlas()}
PROVER = BoundProver(CERTIFICATES)


def refused(page, bound, words):
    """Whether a bound is refused in such words."""
    try:
        PROVER.prove(page, bound)
    except CertificateError as error:
        return re.search(words, str(error)) is not None
    return False


def test_closed_forms_hold_and_nothing_lower_does(bounds):
    closed = [name for name, bound in bounds.items() if bound.kind == "closed form"]
    assert len(closed) > 160
    for name in closed:
        page, bound = PAGES[name], bounds[name]
        PROVER.prove(page, bound)
        for lost in (1e-12, 1e-9, 1e-4):
            lower = replace(bound, value=bound.value * (1 - lost))
            assert refused(page, lower, "not proved|above"), (name, lost)


def test_a_bound_below_the_value_is_refused(bounds):
    for name, page in list(PAGES.items())[::3]:
        lower = replace(bounds[name], value=float(page.value) - 2e-9)
        assert refused(page, lower, "above the bound"), name


def test_all_are_proved_bounds(bounds):
    assert bounds.keys() == PAGES.keys()
    assert all(bound.certified for bound in bounds.values())


def test_the_pages_say_of_each_kind_what_proves_it(bounds):
    assert {bound.kind for bound in bounds.values()} == set(EVIDENCE)
    files = [line.split("results/bounds/certificates/")[-1] for line in EVIDENCE.values()]
    held = [path.name for path in CERTIFICATES.iterdir()]
    assert sum(line.startswith(tuple(held)) for line in files) == 3


PLANAR = ("free-mean_2x6_k3", "free-mean_2x6_k2_manipulability", "free-mean_2x6_k2_condition")


@pytest.mark.parametrize("name", PLANAR)
def test_a_planar_bound_is_searched_again(name, monkeypatch):
    page = page_of(entry(name))
    PROVER.prove(page, page.entry.bound)
    monkeypatch.setattr(proved_bounds, "_MOST_NODES", 100)
    with pytest.raises(CertificateError, match="not proved"):
        PROVER.prove(page, page.entry.bound)


@pytest.mark.parametrize(
    "name",
    ["free-mean_3x6_k2_condition", "lever-revolute-5+prismatic-2_6x7_k1_isotropy"],
)
def test_other_bounds_by_a_search_are_refused_if_lower(name, monkeypatch):
    """Of arms in space seen along a column, and of isotropic ones with two prismatic joints."""
    page = page_of(entry(name))
    bound = page.entry.bound
    assert "branch and bound" in bound.kind
    PROVER.prove(page, bound)
    with pytest.raises(CertificateError, match="not proved"):
        PROVER.prove(page, replace(bound, value=bound.value * (1 - 1e-10)))
    monkeypatch.setattr(proved_bounds, "_MOST_NODES", 100)
    monkeypatch.setattr(five_levers, "excludes_share", lambda _: False)
    with pytest.raises(CertificateError, match="not proved"):
        PROVER.prove(page, bound)


@pytest.mark.parametrize("name", ["free-mean_3x7_k2", "free-mean_3x11_k3"])
def test_a_two_point_bound_is_proved_from_its_multipliers(name):
    page = page_of(entry(name))
    bound = page.entry.bound
    assert bound.kind == "proved (two-point)"
    PROVER.prove(page, bound)
    with pytest.raises(CertificateError, match="not proved"):
        PROVER.prove(page, replace(bound, value=bound.value * (1 - 1e-12)))


@pytest.mark.parametrize(
    ("place", "change"),
    [
        ("trace_limit", lambda limit: limit - 1e-6),
        ("violation", lambda most: most / 2),
        ("violation", lambda most: most + 1e-6),
        ("joints", lambda joints: joints + 1),
        ("task_dimension", 2),
        ("lift.0", lambda value: value - 1e-4),
        ("lift.0", lambda value: value + 1e-4),
        ("lift.3", lambda value: -value),
        ("blocks.0.0.0", 0.0),
        ("blocks.1.0.0", lambda value: 2 * value),
        ("blocks.2.0.1", 1.0),
        ("blocks", lambda blocks: blocks[::-1]),
    ],
)
def test_altered_multipliers_are_refused(patched, place, change):
    known = two_point_on_record(3, 7)
    names = ("task_dimension", "joints", "violation", "trace_limit", "lift", "blocks")
    altered = patched({name: known[name] for name in names}, {place: change})
    with pytest.raises(CertificateError, match="two-point"):
        prove_two_point(**altered)


@pytest.mark.parametrize(
    ("name", "stated"),
    [
        ("lever-revolute_6x7_k1", 0.05682542),
        ("unit-revolute_6x7_k1", 0.3275**0.5),
    ],
)
def test_a_rigorous_bound_needs_its_certificate(name, stated, monkeypatch):
    page = page_of(entry(name))
    verified = []
    monkeypatch.setattr(proved_bounds, "verify_bound", lambda one, **_: verified.append(one))
    prover = BoundProver(CERTIFICATES)
    for _ in range(2):
        prover.prove(page, page.entry.bound)
    assert [one.bound for one in verified] == pytest.approx([stated], abs=1e-15)
    lower = replace(page.entry.bound, value=page.entry.bound.value * (1 - 1e-12))
    with pytest.raises(CertificateError, match="not proved"):
        prover.prove(page, lower)

    def refuse(one, **_):
        raise CertificateError("altered")

    monkeypatch.setattr(proved_bounds, "verify_bound", refuse)
    with pytest.raises(CertificateError, match="altered"):
        BoundProver(CERTIFICATES).prove(page, page.entry.bound)


def test_the_bound_on_isotropic_lever_arms_needs_its_certificate(monkeypatch):
    page = page_of(entry("lever-revolute_6x7_k1_isotropy"))
    assert page.entry.bound.kind == LEVER_CELLS
    verified = []
    monkeypatch.setattr(proved_bounds, "verify_levers", lambda one, **_: verified.append(one))
    prover = BoundProver(CERTIFICATES)
    for _ in range(2):
        prover.prove(page, page.entry.bound)
    assert [one.bound for one in verified] == [page.entry.bound.value]
    lower = replace(page.entry.bound, value=page.entry.bound.value * (1 - 1e-12))
    with pytest.raises(CertificateError, match="not proved"):
        prover.prove(page, lower)

    def refuse(one, **_):
        raise CertificateError("altered")

    monkeypatch.setattr(proved_bounds, "verify_levers", refuse)
    with pytest.raises(CertificateError, match="altered"):
        BoundProver(CERTIFICATES).prove(page, page.entry.bound)


def test_a_numerical_bound_is_compared_only():
    page = page_of(entry("unit-revolute_6x7_k1"))
    PROVER.prove(page, Bound(0.572, "numerical"))


def test_without_certificates_nothing_begins(tmp_path):
    with pytest.raises(FileError, match="--certificates"):
        BoundProver(tmp_path)
