"""The atlas: entries proved from their files, as local maxima, and improved."""

import json
import re
from dataclasses import replace
from fractions import Fraction
from importlib.resources import files
from itertools import product
from urllib.parse import unquote

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import validate

from lockedjoint.formulations import manipulability, max_min, measures
from lockedjoint.formulations.atlas.collection import (
    atlas,
    entry_of,
    improved,
    page_of,
    problem_of,
    read_atlas,
    read_page,
    write_page,
)
from lockedjoint.formulations.atlas.entry import Entry, Found, entries, entry
from lockedjoint.formulations.atlas.improve import SeedResult, after_each_seed, improve
from lockedjoint.formulations.atlas.local_optimality import local_optimality
from lockedjoint.formulations.atlas.proved_value import (
    distance_from_model,
    exceeds,
    proved_value,
    proves,
)
from lockedjoint.formulations.joints import models
from lockedjoint.nlp.errors import FileError, InputError

SEEDS = st.integers(0, 2**32 - 1)
MODELS = ("unit-revolute", "lever-revolute", "unit-revolute:6,prismatic:2", "rotor", "free")
MODELS += ("free-mean",)


def drawn(model, seed, joints=7, dimension=6):
    arm = models.arm(model, joints, dimension)
    return arm, arm.jacobian(arm.sample(np.random.default_rng(seed)))


@given(st.sampled_from(MODELS), SEEDS)
def test_the_proved_value_is_just_below_the_measured_one(model, seed):
    _, jacobian = drawn(model, seed, 8)
    for failures in (1, 2):
        measured = measures.worst_case_sigma(jacobian, failures)
        if measured > 1e-6:
            proved = float(proved_value(Entry(model, 6, 8, failures), jacobian))
            assert measured - 1e-7 <= proved <= measured + 1e-15


@given(st.sampled_from(MODELS), SEEDS, st.sampled_from((max_min, manipulability)))
def test_a_value_is_proved_up_to_the_last_digits(model, seed, statement):
    """Whatever rounding the value was found with: the decision is made in whole numbers."""
    _, jacobian = drawn(model, seed, 8)
    found = statement.score(jacobian)
    asked = Entry(model, 6, 8, 1, statement.NAME)
    if found > 1e-3:
        assert proves(asked, jacobian, f"{found - 1e-13:.15f}")
        assert not proves(asked, jacobian, f"{found + 1e-13:.15f}")


def test_definiteness_is_decided_exactly():
    # 2×3, columns (1, 0), (0, 1), (1, 1) in units of 2^-60: without the last one σ = 1.
    unit = 1 << 60
    columns = [[unit, 0], [0, unit], [unit, unit]]
    golden = Fraction(618033988749, 10**12)  # (√5 − 1)/2 = 0.6180339887498…
    assert exceeds(columns, golden, 1)
    assert not exceeds(columns, golden + Fraction(1, 10**12), 1)
    assert not exceeds(columns, Fraction(1, 10**9), 2)


@pytest.mark.parametrize(
    ("model", "most", "times"),
    [("unit-revolute", 1e-3, 3), ("free", 1e-3, 3), ("rotor", 1e-4, 4)],
)
@given(SEEDS, st.floats(1e-9, 1))
def test_the_distance_from_the_model_is_not_understated(model, most, times, seed, share):
    arm, jacobian = drawn(model, seed)
    off = np.random.default_rng(seed).standard_normal(jacobian.shape)
    moved = jacobian + share * most * off
    if model == "free":
        nearest = moved / np.linalg.norm(moved, axis=0)
    else:
        axis = moved[3:] / np.linalg.norm(moved[3:], axis=0)
        pitch = 0.05 if model == "rotor" else 0.0
        lever = moved[:3] - pitch * moved[3:]
        lever -= np.sum(lever * axis, axis=0) * axis
        least = 1.0 if model == "rotor" else 0.0  # a lever arm of at most 1, or of 1
        lever /= np.maximum(np.linalg.norm(lever, axis=0), least)
        nearest = np.vstack([lever + pitch * axis, axis])
    exact = [[Fraction(value) for value in column] for column in moved.T.tolist()]
    bound = float(distance_from_model(arm, exact))
    actual = float(np.linalg.norm(nearest - moved))
    assert actual <= bound * (1 + 1e-9) <= times * actual + 1e-9


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("unit-revolute_6x7_k1", 0),
        ("unit-revolute_6x8_k1", 3),  # see `reproduction.eight_joints`
        ("free-mean_3x6_k2", 0),  # the equiangular six lines
        ("lever-revolute_6x7_k1_isotropy", 1),
        ("rotor_6x7_k1", 1),
        ("free-mean_2x6_k2_isotropy", 0),
    ],
)
def test_an_entry_is_a_local_maximum(name, family):
    page = page_of(entry(name))
    found = local_optimality(page.entry, page.jacobian)
    assert found.stationarity < 1e-5
    assert found.curvature < 1e-5
    assert (found.family, page.family) == (family, family)


def test_a_jacobian_that_can_be_improved_is_not_stationary():
    asked = entry("unit-revolute_6x7_k1")
    assert local_optimality(asked, drawn("unit-revolute", 0)[1]).stationarity > 0.01


def test_every_kind_of_entry_is_right():
    found = read_atlas()
    assert len(found) >= 150
    assert [page.entry.name for page in found] == [n for n in entries() if page_of(entry(n))]
    assert [problem_of(page) for page in found[::9]] == [""] * len(found[::9])


def test_a_false_entry_is_found_out():
    """A value that is more, a bit more and less; another family; another Jacobian."""
    page = page_of(entry("unit-revolute_6x7_k1"))
    assert problem_of(page) == ""
    changes = [{"value": one} for one in ("0.571482999", "0.571482968133999", "0.571")]
    for change in (*changes, {"family": 2}, {"jacobian": np.ones((6, 7))}):
        assert problem_of(replace(page, **change)) != "", change


def test_files_hold_every_digit_and_damaged_ones_are_refused(tmp_path):
    page = page_of(entry("unit-revolute_6x7_k1"))
    path = write_page(page, tmp_path)
    again = read_page(path)
    assert np.array_equal(again.jacobian, page.jacobian)
    assert again.to_json() == page.to_json()
    text = path.read_text()
    for old, new in (
        ('"joints": 7', '"joints": 8'),
        ('"entry": "unit', '"entry": "no'),
        ('"found"', '"lost"'),
        ('"history": []', '"history": [3]'),
        ('"jacobian": [\n  [', '"jacobian": [\n  [[], '),
        ('"value": "0', '"value": "x'),
        ('"value": "0', '"value": "-0'),
        (f'"value": "{page.value}"', '"value": "nan"'),
        (f'"value": "{page.value}"', '"value": 0.5'),
        ('"starts": 20', '"starts": "20"'),
        ('"starts": 20', '"starts": -20'),
        ('"starts": 20', '"starts": true'),
        ('"history": []', '"history": [{"value": "0.5", "found": {}}]'),
        ('"jacobian": [\n  [1.0', '"jacobian": [\n  [NaN'),
        ('"jacobian": [\n  [1.0', '"jacobian": [\n  ["1.0"'),
        ('"jacobian": [\n  [1.0', '"jacobian": [\n  [true'),
        ('"jacobian": [\n  [1.0', '"jacobian": [\n  [1' + "0" * 400),
        ('"joints": 7', '"joints": 7.0'),
        ('"failures": 1', '"failures": true'),
        ('"joints": 7', '"joints": 7, "more": 1'),
        ('"starts": 20', '"starts": 20, "more": 1'),
        ('"starts": 20', '"starts": 1' + "0" * 400),
        ('"history": []', '"history": {}'),
        (f'"date": "{page.found.date}"', '"date": "9999-99-99"'),
        (f'"date": "{page.found.date}"', '"date": "today"'),
        (f'"date": "{page.found.date}"', '"date": "20261122"'),
    ):
        assert old in text
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(FileError, match="an entry of the atlas"):
            read_page(path)
    path.write_text("[1]")
    with pytest.raises(FileError, match="an entry of the atlas"):
        read_page(path)
    with pytest.raises(InputError, match="the name of an entry"):
        atlas(5)
    path.write_text(text)
    other = path.rename(tmp_path / "unit-revolute_6x8_k1.json")
    with pytest.raises(FileError, match="an entry of the atlas"):
        read_page(other)


def test_the_best_positional_6r_for_two_failures_is_an_equiangular_tight_frame():
    """Coherence 1/√5, that of Welch's bound; the six diagonals of the icosahedron."""
    jacobian = page_of(entry("free-mean_3x6_k2")).jacobian
    columns = jacobian / np.linalg.norm(jacobian, axis=0)
    apart = np.abs(columns.T @ columns)[np.triu_indices(6, 1)]
    np.testing.assert_allclose(apart, 1 / np.sqrt(5), atol=1e-7)
    np.testing.assert_allclose(jacobian @ jacobian.T, 2 * np.eye(3), atol=1e-7)


def test_an_improvement_keeps_what_was_there_before():
    page = page_of(entry("unit-revolute_6x7_k1"))
    worse = drawn("unit-revolute", 3)[1]
    first = improved(page.entry, worse, Found("first", "2026-01-01"), None)
    second = improved(page.entry, page.jacobian, Found("second", "2026-01-02"), first)
    assert second.value == page.value
    assert [one["value"] for one in second.history] == [first.value]
    assert second.history[0]["found"]["by"] == "first"
    third = improved(page.entry, worse, Found("third", "2026-01-03"), second)
    assert (third.value, third.history) == (second.value, second.history)


def test_a_jacobian_finds_the_narrowest_entry():
    unit = drawn("unit-revolute", 1)[1]
    assert entry_of(unit, 1).name == "unit-revolute_6x7_k1"
    for name in ("free_2x9_k3", "rotor_6x8_k2"):
        assert entry_of(page_of(entry(name)).jacobian, entry(name).failures).name == name
    for name in ("free-mean_3x6_k2_condition", "lever-revolute_6x7_k1_isotropy"):
        assert entry_of(page_of(entry(name)).jacobian, name=name).name == name
    with pytest.raises(InputError, match="6×7; allowed: the size of free_2x9_k3"):
        entry_of(unit, name="free_2x9_k3")
    assert entry_of(drawn("lever-revolute", 1)[1], 1).model == "lever-revolute"
    scaled = unit * np.sqrt(7 / measures.trace(unit))
    assert entry_of(scaled, 1).model == "free-mean"
    with pytest.raises(InputError, match="columns of one of the models"):
        entry_of(2 * unit, 1)


def test_a_search_goes_on_after_a_jacobian_too_far_from_the_model():
    page = page_of(entry("lever-revolute-each_6x8_k2"))
    longer = page.jacobian.copy()
    longer[:, 0] *= 1 + 3e-6

    def far_then_known(known, seed):
        found = replace(known.found, starts=known.found.starts + 20)
        return SeedResult(longer if seed == page.found.seeds else page.jacobian, found, 1.0)

    pages = list(after_each_seed(page.entry, page, 1.5 / 60, far_then_known, lambda _: None))
    assert [one.found.starts - page.found.starts for one in pages] == [20, 40]
    assert all(np.array_equal(one.jacobian, page.jacobian) for one in pages)


def test_a_search_goes_on_where_it_stopped():
    asked = entry("free-mean_2x4_k2")
    # The first page may be that of another entry whose Jacobian is one of this, too.
    first = next(page for page in improve(asked, None, 1.0) if page.found.seeds)
    assert first.found.seeds == 1
    fewer = replace(first, found=replace(first.found, reached_best=1))
    second = next(improve(asked, fewer, 1.0))
    assert (second.found.seeds, second.found.starts) == (2, 40)
    assert second.found.reached_best > 1
    assert list(improve(asked, second, 1.0)) == []


@pytest.mark.parametrize(
    ("zeros", "lengths", "squared"), [(0, (5 / 4, 5 / 6), 5 / 3), (1, (8 / 7, 6 / 7), 16 / 7)]
)
def test_two_entries_are_diagonals_of_a_cube_and_its_axes_twice(zeros, lengths, squared):
    """Those of the cube itself, or of its faces, with one coordinate zero."""
    diagonals = [one for one in product((1, 0, -1), repeat=3) if one.count(0) == zeros]
    long = np.array([one for one in diagonals if one > (0, 0, 0)], dtype=float).T
    long *= np.sqrt(lengths[0] / np.sum(long**2, axis=0))
    jacobian = np.hstack([long, *[np.sqrt(lengths[1]) * np.eye(3)] * 2])
    assert measures.worst_case_sigma(jacobian, 2) == pytest.approx(np.sqrt(squared), abs=1e-12)
    page = page_of(entry_of(jacobian, 2))
    assert float(page.value) >= np.sqrt(squared) - 1e-9
    assert float(page.value) == pytest.approx(np.sqrt(squared), abs=1e-9)


def test_commands(lockedjoint, tmp_path):
    rows = lockedjoint.json("atlas", "--where", "model == 'unit-revolute'", cwd=tmp_path)
    assert {row["model"] for row in rows} == {"unit-revolute"}
    page = page_of(entry("unit-revolute_6x7_k1"))
    np.save(tmp_path / "j.npy", page.jacobian[:, ::-1])
    found = lockedjoint.json("atlas", "submit", "j.npy", "--out-dir", "mine", cwd=tmp_path)
    assert (found["entry"], found["improvement"]) == (page.entry.name, False)
    assert list((tmp_path / "mine").iterdir()) == []
    (tmp_path / "old").mkdir()
    worse = improved(page.entry, drawn("unit-revolute", 3)[1], Found("me", "2026-01-01"), None)
    write_page(worse, tmp_path / "old")
    proposal = (
        "atlas",
        "--entries",
        "old",
        "submit",
        "j.npy",
        "--out-dir",
        "mine",
        "--by",
        "you",
    )
    lockedjoint.json(*proposal, cwd=tmp_path)
    written = read_page(tmp_path / "mine" / f"{page.entry.name}.json")
    assert written.found.by == "you"
    assert float(written.value) == pytest.approx(float(page.value), abs=1e-14)
    lockedjoint.json("atlas", "--entries", "mine", "verify", page.entry.name, cwd=tmp_path)
    write_page(replace(written, value="0.9"), tmp_path / "mine")
    verified = lockedjoint.here("atlas", "--entries", "mine", "verify", cwd=tmp_path)
    assert (verified.returncode, "is not proved" in verified.stdout) == (1, True)
    both = lockedjoint.json("atlas", "verify", "free_2x5_k2", "free_2x8_k3", cwd=tmp_path)
    assert both["local_maxima"] == {"proved": 1, "on record": 1}
    assert both["exact_on_record"] == {"proved": 2}


def test_what_only_an_author_says_is_marked_as_reported(lockedjoint, tmp_path):
    """Numbers of starts make an open entry a conjectured one, and no check can contradict."""
    page = next(page for page in read_atlas() if page.mark == "open" and page.entry.joints < 9)
    boast = replace(page.found, starts=100, reached_best=100)
    claimed = replace(page, found=boast, locally_optimal=False)
    write_page(claimed, tmp_path)
    assert (claimed.mark, claimed.reported) == ("conjectured", ("found", "history", "mark"))
    of_folder = ("atlas", "--entries", str(tmp_path))
    verified = lockedjoint.json(*of_folder, "verify", cwd=tmp_path)
    assert verified["reported"] == {"marks": {"conjectured": 1}, "found": 1}
    said = lockedjoint.here(*of_folder, "verify", cwd=tmp_path).stdout
    assert "Marks `conjectured`, reported, not verified: 1." in said
    lockedjoint.json(*of_folder, "export", "site", cwd=tmp_path)
    shown = (tmp_path / "site" / f"{page.entry.name}.html").read_text("utf-8")
    assert "conjectured: by the starts below, reported, not verified" in shown
    assert "100 of 100 random starts ended there: reported, not verified" in shown
    assert "<td>conjectured, reported</td>" in (tmp_path / "site/index.html").read_text("utf-8")
    optimal = page_of(entry("free-mean_2x3_k1"))
    assert (optimal.mark, optimal.reported) == ("optimal", ("found", "history"))


def test_the_schema_knows_every_entry():
    schema = json.loads(
        (files("lockedjoint.formulations.atlas") / "site/schema.json").read_text()
    )
    for page in {page.entry.formulation: page for page in read_atlas()}.values():
        validate(page.facts(), schema)


def test_an_exported_atlas_is_whole_and_read_again(lockedjoint, tmp_path):
    own, out = tmp_path / "own", tmp_path / "site"
    own.mkdir()
    names = ("free-mean_2x3_k1", "free-mean_6x7_k1", "unit-revolute-6+prismatic-1_6x7_k1")
    for name in (*names, "free-mean_2x5_k2_manipulability", "unit-revolute_6x7_k1"):
        page = page_of(entry(name))
        write_page(replace(page, found=Found("<script>me", "2026-01-01")), own)
    lockedjoint.json("atlas", "--entries", "own", "export", "site", cwd=tmp_path)
    again = read_atlas(out)
    assert [page.to_dict() for page in again] == [page.to_dict() for page in read_atlas(own)]
    schema = json.loads((out / "schema.json").read_text("utf-8"))
    for values in json.loads((out / "atlas.json").read_text("utf-8")):
        validate(values, schema)
        alone = json.loads((out / f"{values['entry']}.json").read_text("utf-8"))
        assert alone == {"$schema": "schema.json", **values}
    with pytest.raises(Exception, match="is not of type"):
        validate({**values, "jacobian": 1}, schema)

    graph = json.loads((out / "ro-crate-metadata.json").read_text("utf-8"))["@graph"]
    listed = {one["@id"]: int(one["contentSize"]) for one in graph if one["@type"] == "File"}
    held = {path.name: path.stat().st_size for path in out.iterdir()}
    assert held.pop("ro-crate-metadata.json")
    assert listed == held
    drawn = [name for name in held if name.endswith(".svg")]
    assert len(drawn) == 4  # free columns with m = 6 are those of no joints

    pages = {path.stem: path.read_text("utf-8") for path in out.glob("*.html")}
    assert all("<script>me" not in text for text in pages.values())
    assert "&lt;script&gt;me" in pages[names[0]]
    rows = re.findall(
        r'<tr data-gap="(.*?)" data-model="(.*?)".*?<a href="(.*?)">', pages["index"]
    )
    for (gap, model, link), page in zip(rows, again, strict=True):
        assert (float(gap), model) == (max(page.gap_percent, 0), page.entry.model)
        assert unquote(link) == f"{page.entry.name}.html"
