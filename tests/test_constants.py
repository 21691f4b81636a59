"""One constant a line, with its own name; no ``*(a, b),`` in lists of arguments."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("formulations", "nlp", "results", "lockedjoint")
FILES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]


def faults(text):
    """Yield the line of each statement that packs constants, and of each starred tuple."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Starred) and isinstance(node.value, ast.Tuple | ast.List):
            yield node.lineno
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
            yield node.lineno


def test_no_packed_constants_and_no_starred_tuples():
    assert len(FILES) > 200
    found = [f"{path}:{line}" for path in FILES for line in faults(path.read_text("utf-8"))]
    assert not found


@pytest.mark.parametrize("text", ["A, B = 1, 2", "f(*(1, 2), 3)", "f(*[1, 2], 3)"])
def test_faults_are_found(text):
    assert list(faults(text)) == [1]
