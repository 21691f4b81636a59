"""The rooms are in order: imports go down only, never in a circle (pyproject.toml)."""

import subprocess
import sys
from pathlib import Path


def test_imports_go_down_only():
    code = "import importlinter.cli as c; raise SystemExit(c.lint_imports(no_cache=True))"
    # A process of its own: the linter silences every logger of the one that it runs in.
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
