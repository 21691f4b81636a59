"""Bounds beside what was found: they hold, and say what kind of proof they have."""

import json
from fractions import Fraction
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import (
    LEVER_CELLS,
    NONE_EXISTS,
    Bound,
    best_known,
)
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.relaxed import relaxed
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.registry import bound

ROOT = Path(__file__).parents[3]
SEVEN = Arm.of(UnitRevolute(), 7)


def test_the_record_is_what_the_commands_wrote_and_certificates_state():
    """Nothing is sharper than a certificate that `verify` accepts."""
    record = json.loads((ROOT / "formulations/bounds/record.json").read_text("utf-8"))
    assert [one["quantity"] for one in record] == ["residual", "max-min"]
    names = ("residual_tight.json", "max_min_null_vector.json", "isotropy_turned.json")
    for one, name in zip_longest(record, names):
        written = json.loads((ROOT / "results/bounds" / name).read_text("utf-8"))
        stated = read_any(ROOT / "results/bounds/certificates" / name)
        for same in ("quantity", "joints", "bound"):
            assert written[same] == getattr(stated, same)
            assert one is None or one[same] == written[same]
        assert one is None or written["size"] == one["size"]


def test_isotropic_lever_arms_are_those_of_the_certificate():
    [known] = json.loads(
        (ROOT / "formulations/bounds/isotropic_levers.json").read_text("utf-8")
    )
    written = json.loads((ROOT / "results/bounds/isotropic_levers.json").read_text("utf-8"))
    assert known == written
    stated = read_any(ROOT / "results/bounds/certificates/isotropic_levers.json")
    assert (known["bound"], known["limit"]) == (stated.bound, str(stated.limit))
    assert known["size"]["centres"] == len(stated.frames)
    found = bound("isotropy", arm("lever-revolute", 7))
    assert (found.value, found.kind) == (stated.bound, LEVER_CELLS)
    assert best_known("isotropy", "lever-revolute", 7) < found.value < 0.5034


def test_seven_unit_revolute_joints():
    least = best_known("residual", "unit-revolute", 7)
    residual = bound("residual", SEVEN)
    assert residual.kind == "proved (tight)"
    assert 0.05682 < residual.value < least
    assert residual.gap_percent(least) < 4e-3
    worst = bound("max-min", SEVEN)
    assert worst.kind == "proved (null-vector)"
    largest = best_known("max-min", "unit-revolute", 7)
    assert largest < worst.value < measures.sigma_bound(6, 7, 14)
    none = bound("isotropy", SEVEN)
    assert none.kind == "exact proof"
    assert np.isnan(none.value)


def test_the_best_known_7r_are_those_that_the_comparison_found():
    found = pd.read_csv(ROOT / "results/comparison/comparison.csv")
    best = found[found.joints == 7].groupby(["formulation", "model"]).worst_case_sigma.max()
    for key in (
        ("max-min", "unit-revolute"),
        ("max-min", "lever-revolute"),
        ("isotropy", "lever-revolute"),
    ):
        assert best_known(*key, 7) == pytest.approx(best[key], abs=1e-9)


BY_ROWS = [
    ("lever-revolute(length=0.3):7", 0.22333, 0.22317),
    ("lever-revolute(length=3):7", 0.73992, 0.73782),
    ("unit-revolute:4,prismatic:4", np.sqrt(1 / 3), 0),
    ("unit-revolute:3,prismatic:5", 0, 0),
    ("unit-revolute:3,lever-revolute(length=0.5):4", 0.48939, 0),
]


@pytest.mark.parametrize(("spec", "expected", "reached"), BY_ROWS)
def test_bounds_from_linear_and_rotational_rows(spec, expected, reached):
    """Each is sharper than eq. (6), and above what was found (0: nothing was sought)."""
    found = bound("max-min", arm(spec))
    assert found.value == pytest.approx(expected, abs=1e-5)
    assert found.kind == ("proved (relaxation)" if expected else "closed form")
    assert reached <= found.value


@pytest.mark.parametrize(
    "spec", ["lever-revolute(length=0.3):6,prismatic(speed=0.1):3", *(s for s, _, _ in BY_ROWS)]
)
def test_a_bound_never_grows_with_the_number_of_locked_joints(spec):
    values = [bound("max-min", arm(spec), k).value for k in range(1, 6)]
    assert values == sorted(values, reverse=True)


@pytest.mark.parametrize("seed", range(5))
def test_bounds_hold_for_random_jacobians(seed):
    rng = np.random.default_rng(seed)
    names = [spec for spec, _, _ in BY_ROWS]
    arms = [SEVEN, Arm.of(UnitRevolute(), 9), arm("free", 4, 3), arm("free-mean", 5, 3)]
    names += [f"unit-revolute:{n},prismatic:{k}" for n in range(6, 10) for k in (1, 2)]
    for built in (*arms, *map(arm, names)):
        matrix = built.jacobian(built.sample(rng))
        assert measures.isotropy_defect(matrix) > bound("residual", built).value
        for failures in (1, 2):
            if failures <= built.shape[1] - built.shape[0]:
                worst = measures.worst_case_sigma(matrix, failures)
                assert worst <= bound("max-min", built, failures).value + 1e-12


def test_the_record_is_for_unit_revolute_joints_only():
    eight = bound("max-min", Arm.of(UnitRevolute(), 8))
    assert eight.kind == "closed form"
    assert eight.value == pytest.approx(np.sqrt(2 / 3))
    assert bound("residual", Arm.of(UnitRevolute(), 8)).value == 0
    assert bound("residual", Arm.of(LeverRevolute(), 7)) == Bound(0.0, "closed form")
    # Rows with the traces 7 and 6: 6/2 · (1/6)².
    mixed = bound("residual", Arm((*[UnitRevolute()] * 6, Prismatic())))
    assert mixed.kind == "proved (relaxation)"
    assert mixed.value == pytest.approx(1 / 12, rel=1e-9)


@pytest.mark.parametrize("joints", [7, 8, 11])
@pytest.mark.parametrize("kind", ["unit-revolute", "lever-revolute", "lever-revolute-each"])
def test_where_the_relaxation_is_left_out_it_says_no_more(kind, joints):
    for failures in range(1, min(joints - 6, 3) + 1):
        sharper = relaxed(arm(kind, joints), failures).value
        assert bound("max-min", arm(kind, joints), failures).value <= sharper
    known = bound("isotropy", arm(kind, joints))
    assert known is NONE_EXISTS or known.value <= relaxed(arm(kind, joints)).value
    assert relaxed(arm(kind, joints), 1, "residual").value < 1e-9


@pytest.mark.parametrize("joints", range(8, 17))
def test_equation_6_is_rounded_up(joints):
    for kind, trace in (("unit-revolute", 2 * joints), ("free", joints), ("free-mean", joints)):
        found = Fraction(bound("max-min", arm(kind, joints)).value)
        square = Fraction(trace) * (joints - 6) / (6 * joints)
        assert square <= found**2 < square * (1 + Fraction(1, 2**51))


def test_gap_in_percent_of_the_bound():
    bound = Bound(0.5, "closed form")
    assert bound.gap_percent(0.4) == pytest.approx(20)
    assert bound.gap_percent(0.5) == 0
    assert np.isnan(Bound(0.0, "closed form").gap_percent(1e-20))
    assert np.isnan(bound.gap_percent(float("nan")))
