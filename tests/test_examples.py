"""Every public function and class has an example, and what it shows is what it prints.

The examples run in one process of their own: some register formulations, joints and criteria.
"""

import inspect
import json
import types

import pytest

import lockedjoint as lj

pytestmark = [pytest.mark.slow, pytest.mark.long]
# A protocol, of which no example makes a value.
WITHOUT = {"Formulation"}
RUN = """
import doctest, io, json, os, sys, tempfile
from contextlib import redirect_stdout
import lockedjoint as lj

failed = {}
for name in json.loads(sys.argv[1]):
    written = io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        text = getattr(lj, name).__doc__
        example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
        doctest.DocTestRunner().run(example, out=written.write)
        os.chdir("/")
    failed[name] = written.getvalue()
print(json.dumps(failed))
"""


def public(name):
    """A public name, but of a module; None where its tool is not installed."""
    try:
        value = getattr(lj, name)
    except lj.LockedJointError:
        return None
    return None if isinstance(value, types.ModuleType) else value


NAMES = [
    name
    for name in lj.__all__
    if callable(public(name)) and name not in WITHOUT and inspect.getdoc(public(name))
]


@pytest.fixture(scope="module")
def failed(lockedjoint):
    names = json.dumps([name for name in NAMES if ">>>" in public(name).__doc__])
    code = f"import sys; sys.argv = ['', {names!r}]\n{RUN}"
    return json.loads(lockedjoint.python(code).splitlines()[-1])


def test_there_are_public_functions():
    assert len(NAMES) > 60


@pytest.mark.parametrize("name", NAMES)
def test_the_example_is_true(name, failed):
    assert ">>>" in public(name).__doc__
    assert failed[name] == ""
