"""One constant a line, with its own name; no ``*(a, b),`` in lists of arguments."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Folders that hold to it; lockedjoint/ does not yet.
FOLDERS = ("formulations", "nlp", "results")
FILES = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]


def test_no_packed_constants_and_no_starred_tuples():
    for path in FILES:
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            starred = isinstance(node, ast.Starred) and isinstance(
                node.value, ast.Tuple | ast.List
            )
            assert not starred, f"{path}:{node.lineno}: a starred tuple"
        for node in tree.body:
            packed = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple)
            assert not packed, f"{path}:{node.lineno}: constants on one line"
