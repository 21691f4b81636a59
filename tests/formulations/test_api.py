"""The entry points in one place: all there, the same objects, and imported only when used."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from formulations import api
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
