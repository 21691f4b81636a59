"""A user's own joint and formulation, from one file, in every command."""

import json
import re
from pathlib import Path

import pytest

HOWTO = Path(__file__).parents[1] / "docs" / "howto"
MODEL = "helical(pitch=0.3)"


def _cell(page, word):
    cells = re.findall(
        r"```{code-cell} ipython3\n(.*?)```", (HOWTO / page).read_text("utf-8"), re.DOTALL
    )
    return next(cell for cell in cells if word in cell)


@pytest.fixture
def plugin(tmp_path):
    """The classes of the two how-to pages, registered as the pages say."""
    joint = _cell("add_a_column_model.md", "class Helical")
    volume = _cell("add_a_formulation.md", "class Volume")
    listed = 'lj.register_joint("helical", lambda dimension: Helical())\nlj.register(Volume)'
    (tmp_path / "own.py").write_text(f"import lockedjoint as lj\n{joint}\n{volume}\n{listed}")
    return ("--plugin", "own.py")


def test_solve(lockedjoint, plugin, tmp_path):
    solve = ("solve", "volume", "--model", MODEL, "--joints", 7, "--starts", 4, "--json")
    here = json.loads(lockedjoint(*plugin, *solve, "--workers", 1, cwd=tmp_path).stdout)
    spread = json.loads(lockedjoint(*plugin, *solve, "--workers", 2, cwd=tmp_path).stdout)
    assert here["score"] == spread["score"] == pytest.approx(1 / 7, abs=1e-7)


def test_campaign_and_its_tables(lockedjoint, plugin, tmp_path):
    (tmp_path / "study.toml").write_text(
        f'starts = 3\njoints = [7]\nmodels = ["{MODEL}"]\nformulations = ["volume", "max-min"]'
    )
    done = lockedjoint(*plugin, "campaign", "study.toml", "s.db", cwd=tmp_path)
    assert "6 of 6 records of 2 cases" in done.stdout
    shown = lockedjoint(*plugin, "show", "s.db", "--json", cwd=tmp_path)
    rows = {row["formulation"]: row for row in json.loads(shown.stdout)}
    assert rows["volume"]["score"] == pytest.approx(1 / 7, abs=1e-7)
    assert rows["volume"]["valid"] == rows["max-min"]["valid"] == 3
    assert {row["model"] for row in rows.values()} == {MODEL}


OWN_CRITERION = """
import lockedjoint as lj

def levers(arm):
    return float(abs(arm.points[0]).sum())

lj.register_criterion("levers", levers, larger_is_better=True)
"""


def test_a_criterion_of_realise(lockedjoint, tmp_path):
    (tmp_path / "own.py").write_text(OWN_CRITERION)
    (tmp_path / "j.csv").write_text("1,-0.5,-0.5\n0,0.866,-0.866\n")
    words = ("realise", "j.csv", "--criterion", "levers", "--to", "choice", "--json")
    chosen = json.loads(lockedjoint("--plugin", "own.py", *words, cwd=tmp_path).stdout)
    assert chosen["criterion"] == "levers"
    assert chosen["criteria"]["levers"] > 0
    assert (
        "levers; allowed: one of clearance, total-length, kept"
        in lockedjoint.here(*words, cwd=tmp_path).stderr
    )


def test_a_file_that_registers_nothing(lockedjoint, plugin, tmp_path):
    (tmp_path / "two.py").write_text("class Volume:\n    NAME = 'volume'\n")
    done = lockedjoint("--plugin", "two.py", "compare", "--help", cwd=tmp_path)
    said = "two.py registered nothing; it ends with lj.register(YourClass)."
    assert (done.returncode, said in done.stderr) == (0, True)
    assert (
        "registered nothing"
        not in lockedjoint(*plugin, "compare", "--help", cwd=tmp_path).stderr
    )


def test_a_plugin_after_the_command(lockedjoint, tmp_path):
    done = lockedjoint.here("compare", "--plugin", "own.py", cwd=tmp_path)
    assert done.returncode == 2
    assert "--plugin goes before the command: lockedjoint --plugin FILE.py compare" in (
        done.stderr
    )
