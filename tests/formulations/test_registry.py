"""Formulations by name: a new one works everywhere by its protocol, with its own bound."""

import re
from math import comb
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.formulations import max_min
from lockedjoint.formulations.joints.models import model_of
from lockedjoint.formulations.registry import FORMULATIONS, meaning_of_score

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "add_a_formulation.md"


@pytest.fixture
def volume(monkeypatch):
    """The formulation of the how-to page, as the page states it, listed for one test."""
    monkeypatch.setattr("lockedjoint.formulations.registry.FORMULATIONS", dict(FORMULATIONS))
    cells = re.findall(r"```{code-cell} ipython3\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    namespace = {}
    exec(next(cell for cell in cells if "class Volume" in cell), namespace)
    lj.register(namespace["Volume"])
    return namespace["Volume"]


def test_a_new_formulation_is_solved_and_judged_by_its_own_score(volume):
    outcome = lj.solve("volume", "unit-revolute", joints=7, starts=4, workers=1)
    assert outcome.verdict == "solved"
    assert outcome.best.score == volume.score(outcome.best.jacobian)
    bound = lj.bound("volume", outcome.arm)
    assert (bound.value, bound.kind, bound.certified) == (1 / 7, "closed form", True)
    assert bound.gap_percent(outcome.best.score) < 1e-4


@pytest.mark.parametrize(("joints", "failures"), [(8, 1), (8, 2), (10, 3)])
def test_its_bound_holds_for_random_arms(volume, joints, failures):
    arm = lj.arm("unit-revolute", joints)
    bound = volume.bound(arm, failures).value
    assert bound == comb(joints - failures, 6) / comb(joints, 6)
    rng = np.random.default_rng(0)
    scores = [volume.score(arm.jacobian(arm.sample(rng)), failures) for _ in range(20)]
    assert 0 < max(scores) < bound


def test_what_has_no_bound_of_its_own_is_refused(volume, monkeypatch):
    monkeypatch.setattr(volume, "bound", staticmethod(lambda *_, **__: None))
    with pytest.raises(lj.InputError, match="residual, max-min, isotropy"):
        lj.bound("volume", lj.arm("unit-revolute", 7))


def test_a_table_says_what_a_score_is(volume, monkeypatch):
    assert meaning_of_score(volume) == "The least share of volume² that is left, from J alone"
    assert meaning_of_score(max_min) == "worst-case σ"
    monkeypatch.setattr(volume, "score", staticmethod(lambda _: 0.0))
    assert meaning_of_score(volume) == "what it maximises"


def test_what_is_incomplete_or_has_a_name_already_is_refused():
    with pytest.raises(lj.InputError, match="without SETTINGS, build, score, bound"):
        lj.register(SimpleNamespace(NAME="half", SENSE="minimise"))
    own = FORMULATIONS["residual"]
    lj.register(own)
    with pytest.raises(lj.InputError, match="a name that no other formulation has"):
        lj.register(SimpleNamespace(**vars(own)))


@pytest.mark.parametrize(
    "model", ["lever-revolute(length=0.3):6,prismatic(speed=0.5):2", "unit-revolute:7"]
)
def test_an_arm_and_its_models_name_are_the_same(model):
    arm = lj.arm(model)
    assert lj.arm(model_of(arm), arm.shape[1]) == arm
    by_name = lj.solve("residual", model, starts=1, workers=1)
    by_arm = lj.solve("residual", arm, starts=1, workers=1)
    by_joints = lj.solve("residual", list(arm.joints), starts=1, workers=1)
    assert by_name.arm == by_arm.arm == by_joints.arm == arm
    assert by_name.best.score == by_arm.best.score == by_joints.best.score


def test_lengths_are_those_in_the_brackets():
    half = lj.arm("lever-revolute(length=0.5):6,prismatic(speed=2):1,free(norm=3):1")
    assert [joint.largest_norm_squared for joint in half.joints] == [1.25] * 6 + [4, 9]
