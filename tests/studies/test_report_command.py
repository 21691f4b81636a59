"""``lockedjoint report`` as a user meets it."""

import json
import os
import re
import signal
import time
from functools import partial

import pytest

from formulations.io.provenance import read_header
from formulations.studies.running import STUDIES


@pytest.fixture
def report(lockedjoint):
    return partial(lockedjoint.here, "report")


def test_one_study(report, tmp_path):
    kept = tmp_path / "out" / "robots"
    kept.mkdir(parents=True)
    (kept / "robots.md").write_text("# Robots\n\n- date: 2020-02-02\n", encoding="utf-8")
    arguments = ("--only", "comparison", "--starts", 2, "--workers", 1, "--out", "out")
    done = report(*arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "comparison: made in" in done.stderr
    found = json.loads(done.stdout)
    assert [(one["study"], one["state"]) for one in found["studies"]] == [
        ("comparison", "made")
    ]
    assert "benchmark" in {one["study"] for one in found["left_out"]}
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == ["README.md", "comparison", "robots"]
    page = (out / "comparison" / "comparison.md").read_text(encoding="utf-8")
    assert "--only comparison --starts 2" in read_header(page)["command"]
    front = (out / "README.md").read_text(encoding="utf-8")
    assert "| 7R, unit lever arms | max-min       | 0.571483 " in front
    assert "2020-02-02 (kept)" in front
    assert (kept / "robots.md").exists()


def test_the_help_names_every_study(report, tmp_path):
    assert set(STUDIES) <= set(re.findall(r"\w+", report("--help", cwd=tmp_path).stdout))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--only", "nonsense"), "study is nonsense; allowed: one of reproduction"),
        (("--starts", "0"), "a whole number of at least 1"),
        (("--only", "existence", "--out", "file/deeper"), "output folder is file/deeper"),
    ],
)
def test_bad_input_is_one_sentence(report, tmp_path, arguments, said):
    (tmp_path / "file").write_text("in the way")
    done = report(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.processes
def test_ctrl_c_keeps_finished_studies(lockedjoint, tmp_path):
    arguments = ("--only", "comparison,failures", "--starts", 2, "--workers", 1)
    process = lockedjoint.start("report", *arguments, cwd=tmp_path)
    front = tmp_path / "results" / "README.md"
    for _ in range(600):
        if front.exists():
            break
        time.sleep(0.05)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "failures: interrupted" in err
    names = sorted(path.name for path in (tmp_path / "results").iterdir())
    assert names == ["README.md", "comparison"]
    assert "failures: interrupted (nothing is there)" in front.read_text(encoding="utf-8")
