"""The rooms are in order: imports go down only, never in a circle (pyproject.toml)."""

from pathlib import Path

from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports


def test_imports_go_down_only(monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[1])  # what it finds the packages in
    monkeypatch.syspath_prepend(Path.cwd())
    assert lint_imports(no_cache=True) == EXIT_STATUS_SUCCESS
