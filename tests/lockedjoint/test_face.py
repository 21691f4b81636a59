"""The entry points in one place: all there, the same objects, and imported only when used."""

import copy
import json
import pickle
from importlib import import_module

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.formulations.existence.verify import verified
from lockedjoint.nlp.errors import MissingLibraryError


@pytest.mark.parametrize("name", lj.__all__)
def test_every_name_is_the_object_that_lives_elsewhere(name):
    try:
        value = getattr(lj, name)
    except MissingLibraryError as error:  # of an adapter, whose tool is not installed
        pytest.skip(str(error))
    assert value is getattr(import_module(lj._HOMES[name]), name)
    assert value.__doc__
    assert name in dir(lj)


def test_nothing_heavy_is_imported_before_it_is_used(lockedjoint):
    lockedjoint.python(
        "import sys, lockedjoint as lj\n"
        "heavy = ('casadi', 'cvxpy', 'numpy', 'scipy', 'pandas', 'matplotlib', 'yourdfpy')\n"
        "assert not [name for name in heavy if name in sys.modules]\n"
        "lj.measures\n"
        "assert 'numpy' in sys.modules and 'casadi' not in sys.modules\n"
        "lj.solve, lj.Robot, lj.realise\n"
        "import lockedjoint.kinematics.robot_arm\n"
        "late = ('cvxpy', 'scipy', 'pandas', 'matplotlib', 'yourdfpy')\n"
        "assert not [name for name in late if name in sys.modules], late\n"
    )


def test_solve_in_two_lines():
    outcome = lj.solve("max-min", "free", 3, 2, starts=4, workers=1)
    assert outcome.verdict == "solved"
    assert outcome.best.score == pytest.approx(np.sqrt(1 / 2), abs=1e-7)
    sparing = lj.FailureModel.equally_likely(3, never=[0])
    spared = lj.solve("max-min", "free", 3, 2, starts=4, workers=1, failures=sparing)
    assert spared.best.score > outcome.best.score + 0.1


def test_results_have_plain_values():
    best = lj.solve("max-min", "free", 3, 2, starts=2, workers=1).best
    worst, bound = (
        lj.measures.worst_case(best.jacobian),
        lj.bound("isotropy", lj.arm("unit-revolute", 7)),
    )
    plain = [one.to_dict() for one in (best, best.status, worst, bound, verified())]
    for one in plain:
        assert json.loads(json.dumps(one)) == one
    assert plain[0]["return_status"] == "Solve_Succeeded"
    assert plain[0]["score"] == lj.measures.worst_case_sigma(best.jacobian)
    assert plain[3] == {"value": None, "kind": "exact proof"}
    assert plain[4]["joints"] == 7


@pytest.mark.parametrize("again", [lambda o: pickle.loads(pickle.dumps(o)), copy.deepcopy])
def test_an_outcome_is_stored_and_copied_whole(again):
    outcome = lj.solve("residual", "free", 3, 2, starts=1, workers=1)
    other = again(outcome)
    assert repr(other) == repr(outcome)
    assert other.case.formulation is outcome.case.formulation
    assert np.array_equal(other.best.jacobian, outcome.best.jacobian)
