"""What the library does without its extras: a trajectory, a proof, the robot that it brings."""

import sys

import pytest

import lockedjoint as lj

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
