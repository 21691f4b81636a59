"""The entry points in one place: all there, the same objects, and imported only when used."""

import ast
import json
import subprocess
import sys
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from formulations import api, residual
from formulations.existence.theorem import verified
from formulations.reproduction.solution_family import local_dimension
from nlp.errors import InputError


@pytest.mark.parametrize("name", api.__all__)
def test_every_name_is_the_object_that_lives_elsewhere(name):
    home, inside = api._HOMES[name]
    module = import_module(home)
    assert getattr(api, name) is (getattr(module, inside) if inside else module)
    assert getattr(api, name).__doc__


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(api.__file__).read_text("utf-8"))
    seen = {
        (one.asname, node.module, one.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module not in ("importlib", "__future__")
        for one in node.names
        if one.asname
    }
    told = set()
    for name, (home, inside) in api._HOMES.items():
        package, _, module = home.rpartition(".")
        told.add((name, home, inside) if inside else (name, package, module))
    assert seen == told


def test_nothing_heavy_is_imported_before_it_is_used():
    code = (
        "import sys, formulations.api as api\n"
        "heavy = ('casadi', 'cvxpy', 'numpy', 'pandas', 'matplotlib', 'yourdfpy')\n"
        "assert not [name for name in heavy if name in sys.modules]\n"
        "api.measures\n"
        "assert 'numpy' in sys.modules and 'casadi' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = api.nothing


def test_solve_in_two_lines():
    outcome = api.solve("max-min", "free", 3, 2, starts=4, workers=1)
    assert outcome.verdict == "solved"
    assert outcome.best.merit == pytest.approx(np.sqrt(1 / 2), abs=1e-7)
    sparing = api.FailureModel.equally_likely(3, never=[0])
    spared = api.solve("max-min", "free", 3, 2, starts=4, workers=1, failures=sparing)
    assert spared.best.merit > outcome.best.merit + 0.1
    with pytest.raises(InputError, match="one of residual, max-min, isotropy"):
        api.solve("nothing")


def test_results_have_plain_values():
    outcome = api.solve("max-min", "free", 3, 2, starts=2, workers=1)
    best = outcome.best
    seven = api.Arm.of(api.UnitRevolute(), 7)
    plain = [
        best.to_dict(),
        best.status.to_dict(),
        api.measures.worst_case(best.jacobian).to_dict(),
        api.certified_bound("isotropy", seven).to_dict(),
        verified().to_dict(),
        local_dimension(seven, seven.sample(np.random.default_rng(0))).to_dict(),
    ]
    for one in plain:
        assert json.loads(json.dumps(one)) == one
    assert plain[0]["return_status"] == "Solve_Succeeded"
    assert plain[0]["merit"] == api.measures.worst_case_sigma(best.jacobian)
    assert plain[3] == {"value": None, "kind": "exact proof"}
    assert plain[4]["joints"] == 7
    assert plain[5]["family"] == plain[5]["angles"] - plain[5]["equations"] - 4


def test_a_solution_has_plain_values():
    arm = api.arm("unit-revolute", 7)
    study = api.multistart(partial(residual.build, arm), arm.sample, starts=1, workers=1)
    plain = study.results[0].solution.to_dict()
    assert json.loads(json.dumps(plain)) == plain
    assert np.shape(plain["outputs"]["jacobian"]) == (6, 7)
    assert plain["status"]["return_status"] == "Solve_Succeeded"
