"""An option that a command would not heed is refused in one sentence, before the work."""

import json

import pytest

WAY = "x,y,z\n0.45,-0.15,0.3\n0.5,0.2,0.35\n"
TIMED_WAY = "t,x,y,z\n0,0.45,-0.15,0.3\n3,0.5,0.2,0.35\n"
STUDY = 'starts = 1\nformulations = ["residual"]\nmodels = ["unit-revolute"]\njoints = [7]\n'
# Commands that print tables, and a column of each.
TABLES = {
    "measure example": "locked",
    "posture example --starts 1": "locked",
    "path example way.csv": "joint",
    "bound record": "bound",
    "atlas": "entry",
    "compare": "score",
}
REFUSED = {
    "measure planar.csv --columns locked": "--columns is given; allowed: none of a Jacobian",
    "measure planar.csv --locked elbow=1": "--locked is given; allowed: none of a Jacobian",
    "measure example --relative-tolerance 1e-3": "--relative-tolerance is 0.001; allowed: none",
    "atlas --columns nothing --where 'joints==99'": "--columns is nothing; allowed: all",
    "realise planar.csv --to choice --out x.txt": "--out is x.txt; allowed: none with",
    "realise planar.csv --to ranking --json": "--json is given; allowed: none with",
    "realise planar.csv --figure-style a.mplstyle": "allowed: one with --to figure",
    "path example way.csv --figure-style a.mplstyle": "allowed: one with --out-dir",
    "path example way.csv --corners stop": "corners is stop; allowed: blend, without an accel",
    "path example timed.csv --duration 4": "duration is 4.0; allowed: none where the waypoints",
    "workspace example --figure-style a.mplstyle": "allowed: one with a picture as --out",
    "prove-workspace example --figure-style a.mplstyle": "allowed: one with a picture as --out",
    "figure figure-1 --figure-style way.csv": "a style that matplotlib takes (x,y,z is no sett",
    "show study.db --rows optima --columns canonical_form": "--columns is canonical_form;",
    "show study.db --rows optima --columns canonical_form --to latex": "no matrix without --js",
    "show study.db --rows records --columns jacobian --out t.md": "no matrix without --json",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory, lockedjoint):
    folder = tmp_path_factory.mktemp("ignored")
    (folder / "way.csv").write_text(WAY)
    (folder / "timed.csv").write_text(TIMED_WAY)
    (folder / "planar.csv").write_text("1,-0.5,-0.5\n0,0.866,-0.866\n")
    (folder / "a.mplstyle").write_text("font.size: 8  # points\n\n# done\n")
    (folder / "study.toml").write_text(STUDY)
    done = lockedjoint.here("campaign", "study.toml", "study.db", "--workers=1", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def refused(done):
    assert done.returncode == 2, done.stdout
    assert done.stdout == ""
    (sentence,) = done.stderr.strip().splitlines()
    return sentence


@pytest.mark.parametrize("line", TABLES)
def test_json_has_all_columns(folder, lockedjoint, line):
    words = (*line.split(), "--columns", TABLES[line], "--json")
    sentence = refused(lockedjoint.here(*words, cwd=folder))
    assert sentence == (
        f"Error: --columns is {TABLES[line]}; allowed: none with --json, which has all columns."
    )
    assert not (folder / "comparison").exists()


@pytest.mark.parametrize("line", REFUSED)
def test_what_is_not_heeded_is_refused(folder, lockedjoint, line):
    pytest.importorskip("pandas")
    done = lockedjoint.here(*line.replace("'", "").split(), cwd=folder)
    assert REFUSED[line] in refused(done)
    assert not any((folder / name).exists() for name in ("x.txt", "t.md", "figure-1.svg"))


def test_what_is_heeded_is_done(folder, lockedjoint):
    """Next to those above: options of the same commands that do what they say."""
    pytest.importorskip("pandas")

    def run(line):
        done = lockedjoint.here(*line.split(), cwd=folder)
        assert done.returncode == 0, done.stderr
        return done.stdout

    rows = json.loads(run("show study.db --rows optima --columns canonical_form,joints --json"))
    assert list(rows[0]) == ["canonical_form", "joints"]
    assert "canonical_form" in run(
        "show study.db --rows optima --columns canonical_form --to csv"
    )
    styled = "realise planar.csv --to figure --figure-style a.mplstyle --out a.svg"
    assert "criterion" in run(styled)
    verdicts = [
        json.loads(run(f"measure planar.csv {more} --json"))["optimally_failure_tolerant"]
        for more in ("", "--relative-tolerance 1e-3")
    ]
    assert verdicts == [False, True]  # the entries are rounded
    ended = run("path example way.csv --effort samples=6 --effort tracks=8 --duration 4")
    assert "percent" in ended
