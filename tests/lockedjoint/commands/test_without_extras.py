"""What works without extras: trajectories, proofs, tables, the robot of the library."""

import subprocess
import sys
from importlib.resources import files

import pytest

import lockedjoint as lj
from lockedjoint.nlp.errors import MissingLibraryError
from lockedjoint.synthesis.ranking import rank

WAY = "x,y,z\n0.45,-0.15,0.3\n0.5,0.2,0.35\n"
QUICK = ("--effort", "samples=8", "--effort", "tracks=8", "--effort", "rounds=1")
AT = ("--q", "0,0.6,0,1.4,0,0.6,0", "--locked", "elbow")


@pytest.fixture
def missing(monkeypatch):
    """Make a library look as if it were not installed."""

    def gone(*modules):
        for module in modules:
            monkeypatch.setitem(sys.modules, module, None)

    return gone


def test_a_trajectory_is_written_without_matplotlib(lockedjoint, missing, tmp_path):
    missing("matplotlib", "matplotlib.figure")
    (tmp_path / "way.csv").write_text(WAY)
    done = lockedjoint.here(
        "path", "example", "way.csv", *QUICK, "--out-dir", "plan", cwd=tmp_path
    )
    assert done.returncode == 0
    assert {file.name for file in (tmp_path / "plan").iterdir()} == {"path.csv", "path.json"}
    assert "path.svg is not written: matplotlib is missing" in done.stderr
    style = tmp_path / "a.mplstyle"
    style.write_text("font.size: 8\n")
    asked = ("--figure-style", str(style), "--out-dir", "other")
    refused = lockedjoint.here("path", "example", "way.csv", *asked, cwd=tmp_path)
    assert refused.returncode == 2
    assert "matplotlib is missing" in refused.stderr


def test_a_proof_that_a_goal_is_out_of_reach_needs_no_toppra(lockedjoint, missing, tmp_path):
    missing("toppra")
    goal = ("--at", "3,0,0.5", "--out-dir", "recovery")
    done = lockedjoint.here("recover", "example", *AT, *goal, cwd=tmp_path)
    assert done.returncode == 1
    assert "impossible, proved" in done.stdout
    assert (tmp_path / "recovery" / "proof.json").is_file()


def test_a_trajectory_in_time_asks_for_toppra(lockedjoint, missing, tmp_path):
    missing("toppra")
    (tmp_path / "way.csv").write_text(WAY)
    for words in (
        ("path", "example", "way.csv", "--acceleration", "2"),
        ("recover", "example", *AT, "--at", "0.45,0.2,0.4"),
    ):
        done = lockedjoint.here(*words, cwd=tmp_path)
        assert done.returncode == 2
        assert "toppra is missing" in done.stderr


WITHOUT_TABLES = """
import sys

sys.modules["pandas"] = None  # as if it were not installed
from lockedjoint.__main__ import main

for line in sys.stdin:
    sys.argv = ["lockedjoint", *line.split()]
    try:
        main()
    except SystemExit as ended:
        assert not ended.code, line
"""
COMMANDS = """\
measure example
posture example --starts 2 --out best.json
compare --joints 3 --task-dimension 2 --starts 1 --workers 1 --out-dir compared
compare --joints 3 --task-dimension 2 --starts 1 --workers 1 --to csv
solve max-min --model free --joints 3 --task-dimension 2 --starts 1 --workers 1
atlas --entries few
figure singular-values planar.csv --out values.svg --out values.csv
realise planar.csv --to figure --out planar.svg
campaign study.toml study.db --workers 1
"""
NEED_TABLES = (
    ("show", "study.db"),
    ("figure", "optima", "study.db"),
    ("atlas", "--where", "joints == 7"),
)


def test_only_tables_of_records_and_conditions_need_pandas(lockedjoint, missing, tmp_path):
    """Without it commands print tables, draw, and write CSV and JSON."""
    lines = ["starts = 1", 'formulations = ["residual"]', 'models = ["unit-revolute"]']
    (tmp_path / "study.toml").write_text("\n".join([*lines, "joints = [8]"]))
    (tmp_path / "planar.csv").write_text("1,0.4,-0.5,0.2\n0,1,0.7,-0.6\n")
    (tmp_path / "few").mkdir()  # the bounds of all entries take four seconds
    for name in ("free_2x4_k1", "free-mean_2x6_k3"):
        entry = files("lockedjoint.formulations.atlas") / "entries" / f"{name}.json"
        (tmp_path / "few" / f"{name}.json").write_bytes(entry.read_bytes())
    words, env = [sys.executable, "-c", WITHOUT_TABLES], lockedjoint.environment()
    how = {"capture_output": True, "text": True, "timeout": 300, "input": COMMANDS}
    done = subprocess.run(words, cwd=tmp_path, env=env, check=False, **how)
    assert done.returncode == 0, done.stderr
    names = {"best.json", "planar.svg", "study.db", "values.csv", "values.svg"}
    assert names <= {file.name for file in tmp_path.iterdir()}
    missing("pandas")
    for asked in NEED_TABLES:
        refused = lockedjoint.here(*asked, cwd=tmp_path)
        assert refused.returncode == 2
        assert refused.stderr.count("\n") == 1
        assert "pandas is missing: " in refused.stderr
        assert refused.stderr.endswith("-m pip install pandas\n")


def test_results_without_pandas_are_shown_but_are_no_frames(missing):
    missing("pandas")
    outcome = lj.solve("max-min", "free", 3, 2, starts=2, workers=1)
    robot = lj.realise(lj.optimal_jacobian(8))
    for shown in (outcome, outcome.best, lj.measure(outcome.best.jacobian), robot):
        assert "<table" in shown._repr_html_()
    assert rank(robot, "total-length").rows()[0]["rank"] == 1
    with pytest.raises(MissingLibraryError, match="pip install pandas"):
        outcome.to_frame()


def test_example_is_the_robot_of_the_library_unless_a_file_has_that_name(
    lockedjoint, made, monkeypatch, tmp_path
):
    shipped = lj.Robot("example")
    assert shipped.tip == "tool"
    assert len(shipped.chain.names) == 7
    assert lj.measure("example").worst_case_sigma == pytest.approx(0, abs=1e-12)
    assert "wrist_flex" in lockedjoint.here("measure", "example", cwd=tmp_path).stdout
    monkeypatch.chdir(tmp_path)
    (tmp_path / "example").write_text(made.offset_arm())
    assert lj.Robot("example").tip == "l7"
