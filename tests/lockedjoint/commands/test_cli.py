"""The command line as a stranger meets it.

In processes of its own where only they show it: signals, pipes, exit statuses. What a command
says and writes is tested in the process of the tests: `lockedjoint.here`.
"""

import json
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import pytest

from lockedjoint.__main__ import main
from lockedjoint.commands.app import GROUPS, app
from lockedjoint.formulations.existence import derive as derivation
from tests import made_robots as made

ROOT = Path(__file__).parents[3]
COMMANDS = {name: app.get_command(click.Context(app), name) for name in app.list_commands(None)}
KINDS = {f"j{k}": {"kind": "continuous"} for k in range(4)}
PLANAR_ARM = made.urdf(made.serial(["1 0 0"] * 4, ["0 0 1"] * 4, **KINDS))
LIKELY = "--failure-probabilities 0.1,0.2,0.1,0"
UNEQUAL = f"--model free --joints 4 --task-dimension 2 --starts 4 {LIKELY}"
PLANAR = "--joints 3 --task-dimension 2 --starts 3"


@pytest.fixture
def run(lockedjoint, tmp_path):
    """Return what runs a command line in this process and in a folder of its own."""
    return lambda line: lockedjoint.here(*shlex.split(line), cwd=tmp_path)


@pytest.fixture
def values(lockedjoint, tmp_path):
    """Return what runs a command line alike, and returns what it says as JSON."""
    return lambda line: lockedjoint.json(*shlex.split(line), cwd=tmp_path)


def test_help_groups_the_commands(run):
    page = run("--help")
    assert page.returncode == 0
    lines = [line.strip() for line in page.stdout.splitlines()]
    for heading, names in GROUPS.items():
        section = lines[lines.index(f"{heading}:") :]
        section = section[: section.index("")] if "" in section else section
        assert set(names) <= {line.split()[0] for line in section}


def _commands(group):
    """Return the words that lead to every command, those within groups too."""
    below = {name: getattr(command, "commands", {}) for name, command in group.items()}
    return [
        *((name,) for name in below),
        *((a, b) for a, names in below.items() for b in names),
    ]


@pytest.mark.parametrize("words", _commands(COMMANDS), ids=" ".join)
def test_every_command_has_help_examples_and_json(run, words, tmp_path, monkeypatch):
    (tmp_path / "pose.json").write_text("[0.4, 0.1, 0.5]")  # which an example names
    monkeypatch.chdir(tmp_path)
    page = run(f"{' '.join(words)} --help")
    assert page.returncode == 0
    assert "--json" in page.stdout
    examples = re.findall("^    lockedjoint (.*)$", page.stdout, re.MULTILINE)
    assert len(examples) >= (2 if len(words) == 1 else 1)
    for example in examples:
        name, *rest = shlex.split(example)
        assert name == words[0]
        here = COMMANDS[name]
        if rest and rest[0] in getattr(here, "commands", {}):
            here = here.commands[rest.pop(0)]
        here.make_context(name, rest)  # raises where an option or a value does not exist


def test_a_shell_completes_commands(lockedjoint, tmp_path):
    asked = {"COMP_WORDS": "lockedjoint mea", "COMP_CWORD": "1"}
    shell = {"_LOCKEDJOINT_COMPLETE": "bash_complete", **asked}
    done = lockedjoint(cwd=tmp_path, env=shell)
    assert (done.returncode, done.stdout.split()) == (0, ["plain,measure"])


def test_help_loads_nothing_heavy(lockedjoint):
    """Start-up stays fast because no solver and no table library is imported for it."""
    lockedjoint.python(
        "import sys; sys.argv = ['lockedjoint', '--help']\n"
        "from lockedjoint.__main__ import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'casadi', 'cvxpy', 'numpy', 'pandas', 'scipy', 'loky', 'matplotlib'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )


def test_compare_prints_and_writes(run, values, tmp_path):
    line = f"compare {PLANAR} --out-dir here --to"
    assert run(f"{line} latex").stdout.startswith("\\begin{tabular}")
    as_csv = run(f"{line} csv").stdout
    assert as_csv == (tmp_path / "here/comparison.csv").read_text("utf-8")
    names = sorted(p.name for p in (tmp_path / "here").iterdir())
    assert names == ["comparison.csv", "comparison.json", "jacobians.json"]
    for one in values("measure here/jacobians.json"):
        isotropic = one["name"] != "residual free-mean, solved"
        assert one["optimally_failure_tolerant"] is isotropic
    found = values(f"compare {PLANAR}")
    assert found["complete"] is True
    assert found["rows"][0]["status_counts"] == {"Solve_Succeeded": 3}
    assert "0.7071068" in run(f"compare {PLANAR}").stdout


def test_solve_writes_what_measure_reads(values):
    solved = values("solve max-min --starts 3 --out best.json")
    assert solved["worst_case_sigma"] == pytest.approx(0.571482968, abs=1e-7)
    assert values("measure best.json")["worst_case_sigma"] == solved["worst_case_sigma"]
    solved = values(f"solve max-min {UNEQUAL} --out unequal.json")
    measured = values(f"measure unequal.json {LIKELY}")
    for name in ("expected_sigma", "overall_expected_sigma", "weighted_worst_sigma"):
        assert measured[name] == solved[name]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("solve residual --starts 1 --ipopt max_iter=1", "Not solved: "),
        ("solve isotropy --starts 2", "Proved infeasible: "),
        ("posture arm.urdf --task vx,vy --starts 1 --ipopt max_iter=1", "Not solved: "),
    ],
)
def test_what_was_not_found_is_no_file_and_status_1(run, tmp_path, command, said):
    (tmp_path / "arm.urdf").write_text(PLANAR_ARM)
    done = run(f"{command} --out x.json --json")
    assert done.returncode == 1
    assert said in done.stderr
    assert not (tmp_path / "x.json").exists()
    counts = json.loads(done.stdout)["status_counts"]
    assert counts in ({"Infeasible_Problem_Detected": 2}, {"Maximum_Iterations_Exceeded": 1})


def test_arms_that_only_slide(run, values, tmp_path):
    """They have no links to derive a voxel from, and σ is the same at every posture."""
    arm = PLANAR_ARM.replace("continuous", "prismatic").replace('xyz="1 0 0"', 'xyz="0 0 0"')
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    axes = iter(("1 0 0", "0 1 0", "0 0 1", "1 1 1"))
    arm = re.sub('xyz="0 0 1"', lambda _: f'xyz="{next(axes)}"', arm)
    (tmp_path / "arm.urdf").write_text(arm.replace("</joint>", limit))
    assert values("workspace arm.urdf")["voxel"] == pytest.approx(8 / 50)
    assert "missed" not in run("posture arm.urdf --task position --starts 1").stderr


def test_no_zero_is_negative(run, tmp_path):
    (tmp_path / "j.csv").write_text("-1,0,0\n0,-1,0\n")
    assert " -0" not in run("measure j.csv").stdout


def test_names_from_files_do_not_reach_the_terminal_raw(run, tmp_path):
    """Colours, forged lines, and text that runs from right to left."""
    wicked = "&#10;\u202e\u009b31mj1\u2028"
    (tmp_path / "arm.urdf").write_text(PLANAR_ARM.replace("j1", wicked), encoding="utf-8")
    (tmp_path / "c.toml").write_text(
        'starts = 1\nformulations = ["residual"]\nmodels = ["free"]\njoints = [7]\n'
        '"\u009b\\u001b[2J\\n" = 1\n',
        encoding="utf-8",
    )
    for line in (
        "measure arm.urdf --task vx,vy",
        "measure arm.urdf --tip '\x1b[31m\nl\u202e'",
        "posture arm.urdf --task vx,vy --starts 2",
        "workspace arm.urdf --effort voxel=0.2 --effort slice_degrees=45",
        "campaign c.toml s.db",
        "measure \x1b[31m.csv",
        "--plugin \x1b[31m.py compare",
    ):
        done = run(line)
        said = done.stdout + done.stderr
        assert all(one.isprintable() or one == "\n" for one in said), said
        assert "\\x" in said or "\\u" in said
        assert not any(line.startswith("\\u202e") for line in said.splitlines())


def test_what_a_singular_jacobian_does_not_have_is_shown_as_missing(run, tmp_path):
    (tmp_path / "a.csv").write_text("1,2,3\n2,4,6\n")
    text = run("measure a.csv").stdout
    assert re.search("^relative manipulability +–  –  –$", text, re.MULTILINE)
    (tmp_path / "a.csv").write_text("0,0,0\n0,0,0\n")
    text = run("measure a.csv --json").stdout
    values = json.loads(text, parse_constant=pytest.fail)  # no NaN, no Infinity
    assert values["relative_manipulability"] == [None] * 3
    assert values["condition_number"] is None


ARM = "--model free-mean --joints 6 --task-dimension 2 --failures 3 --starts 2"
SPATIAL = "5 --task-dimension 3"
NEVER = "measure pairs.csv --failures 2 --failure-probabilities 0=0,2=0"
PROVED = "proved (branch and bound)"


@pytest.mark.parametrize(
    ("command", "name", "value"),
    [
        # The best there is of these, though the mean over failures is larger.
        ("measure two.csv --failures 2", "worst_case_sigma", 0.382683),
        ("measure two.csv --failures 2", "gap_to_sharpest_percent", 0.0),
        ("measure two.csv --failures 2", "sharpest_bound_kind", "closed form"),
        (NEVER, "worst_case_sigma", 0.0),
        (NEVER, "possible_worst_sigma", 1.0),
        ("measure pairs.csv --failure-probabilities 0=0", "overall_expected_sigma", None),
        (f"solve max-min {ARM}", "sharpest_bound_kind", PROVED),
        (f"solve max-min {UNEQUAL} --maximise expected", "expected_sigma", 1.1239167),
        (f"solve max-min {UNEQUAL}", "weighted_worst_sigma", np.sqrt(1.5)),
        (f"solve max-min {UNEQUAL}", "never_failing_joints", [3]),
        ("bound planar 4 --level 0.55", "proved", True),
        ("bound planar 4 --measure manipulability", "measure", "manipulability"),
        (f"bound worst-case {SPATIAL}", "relaxation", np.sqrt(2 / 5)),
        (f"bound worst-case {SPATIAL}", "kind", "proved (relaxation)"),
        ("bound worst-case --lever-arm 1", "relaxation", np.sqrt(1 / 3)),
        # The relaxation is not solved with more than 12 rows; equation (6) is there.
        ("bound worst-case 15 --task-dimension 13", "relaxation", None),
        ("bound worst-case 15 --task-dimension 13", "sharpest", np.sqrt(2 / 15)),
    ],
)
def test_values_of_commands(values, tmp_path, command, name, value):
    half = np.sqrt(0.5)
    two = half * np.array([[1, 0, half, -half], [0, 1, half, half]])
    np.savetxt(tmp_path / "two.csv", two, delimiter=",")
    (tmp_path / "pairs.csv").write_text("1,1,0,0\n0,0,1,1\n")
    near = pytest.approx(value, abs=1e-5) if isinstance(value, float) else value
    assert values(command)[name] == near


def test_max_min_of_another_arm(run):
    elsewhere = "for another arm: lockedjoint bound worst-case --model …"
    refused = run("bound max-min --model free")
    assert (refused.returncode, elsewhere in refused.stderr) == (2, True)
    assert refused.stderr.startswith("Error: No such option '--model'; ")
    assert "Did you mean one of: '--joints'" in run("solve max-min --joint 7").stderr
    page = " ".join(run("bound max-min --help").stdout.split())
    assert "For another arm: `lockedjoint bound worst-case --model …`" in page


def test_verify_says_what_is_proved(run, values):
    text = " ".join(run("verify").stdout.split())
    assert "no Jacobian J with JJᵀ = σ²I and columns of equal length exists" in text
    assert "that is" not in values("verify")


def test_verify_names_the_command_for_a_jacobian(run, tmp_path):
    (tmp_path / "best.json").write_text('{"jacobian": [[1, 0], [0, 1]]}')
    refused = run("verify best.json")
    assert refused.returncode == 1
    assert "best.json is no certificate; it holds a Jacobian" in refused.stderr
    assert "`lockedjoint measure best.json`" in refused.stderr


def test_two_gaps_have_two_names(run, values):
    line = "solve max-min --starts 1"
    text = run(line).stdout
    assert re.search("^bound gap percent ", text, re.MULTILINE)
    assert re.search("^sigma gap percent ", text, re.MULTILINE)
    assert not re.search("^gap percent ", text, re.MULTILINE)
    assert "gap_percent" in values(line)


def test_prove_then_verify(run, values, tmp_path, derived, monkeypatch):
    """tests/formulations/existence compares what is derived with what is committed."""
    monkeypatch.setattr(derivation, "derive", lambda: derived)
    assert "= -33248/1029 < 0" in run("prove --out proof/c.json").stdout
    [written] = (tmp_path / "proof").iterdir()
    assert written.read_bytes() == (ROOT / "results/existence/certificate.json").read_bytes()
    assert values("verify proof/c.json")["verdict"].startswith("proved")
    assert run("prove --out Data.v").returncode == 0
    committed = ROOT / "formulations" / "existence" / "coq" / "Data.v"
    assert (tmp_path / "Data.v").read_bytes() == committed.read_bytes()


def test_prove_existence_then_verify(run, values, tmp_path):
    for joints in (8, 20):
        proved = run(f"prove {joints} --out p/c.json")
        assert f"Optimally failure-tolerant {joints}R Jacobians exist" in proved.stdout
        found = values("verify p/c.json")
        exists = f"proved: an optimally failure-tolerant {joints}R Jacobian exists"
        assert (found["verdict"], found["joints"], found["columns"]) == (exists, joints, 8)
    forged = (tmp_path / "p" / "c.json").read_text().replace('"1/2"', '"1/3"')
    (tmp_path / "forged.json").write_text(forged)
    refused = run("verify forged.json")
    assert (refused.returncode, refused.stdout) == (1, "")


def test_verify_tells_invalid_from_unreadable(run, tmp_path):
    certificate = (ROOT / "results" / "existence" / "certificate.json").read_text()
    (tmp_path / "wrong.json").write_text(certificate.replace("33248", "33249"))
    (tmp_path / "cut.json").write_text(certificate[:1000])
    (tmp_path / "empty.json").write_text("[]")
    for name, status in (("wrong", 1), ("empty", 1), ("cut", 2), ("missing", 2)):
        done = run(f"verify {name}.json")
        assert done.returncode == status, done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        assert done.stdout == ""


def test_bound_without_options_is_that_of_7r_and_what_is_on_record(run, values):
    known = {(row["quantity"], row["model"]): row for row in values("bound record")}
    record = json.loads((ROOT / "formulations/bounds/record.json").read_text("utf-8"))
    [proved] = [one["bound"] for one in record if one["quantity"] == "max-min"]
    row = known["max-min", "unit-revolute"]
    assert row["bound"] == proved
    gap = 100 * (row["bound"] - row["best_known"]) / row["bound"]
    assert row["gap_percent"] == pytest.approx(gap)
    assert known["isotropy", "unit-revolute"]["bound"] is None
    text = run("bound").stdout
    assert "0.57735" in text
    assert "none exists  exact proof" in re.sub("  +", "  ", text)


def test_bad_input_is_status_2_of_the_process(lockedjoint, tmp_path):
    done = lockedjoint("solve", "max-min", "--model", "none", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("Error: ")


@pytest.mark.processes
def test_ctrl_c_keeps_the_rows_that_are_done(lockedjoint, tmp_path):
    arguments = ("compare", "--starts", 60, "--workers", 2)
    process = lockedjoint.start(*arguments, cwd=tmp_path)
    table = tmp_path / "comparison" / "incomplete" / "comparison.csv"
    for _ in range(600):
        if table.exists():
            break
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "residual" in table.read_text()
    assert "Interrupted: what was done is in comparison/incomplete" in err
    assert "residual" in out


LONG = (
    "solve max-min --starts 100000 --workers 1 --out solve.json",
    "compare --starts 10000 --workers 2 --out-dir compare",
    "bound residual --out bound.json",
    "campaign c.toml s.db",
    "path arm.urdf w.csv --effort samples=400 --out-dir path",
    "workspace arm.urdf --optimise lengths --effort voxel=0.02 --out workspace.json",
    "posture arm.urdf --task vx,vy --starts 100000 --out posture.json",
)
CAMPAIGN = """
starts = 100_000
formulations = ["max-min"]
models = ["unit-revolute"]
joints = [8]
"""


@pytest.mark.processes
@pytest.mark.slow
def test_ctrl_c_is_answered_in_one_sentence_at_any_moment(lockedjoint, tmp_path):
    """All are under way at once; each is interrupted at a time of its own."""
    (tmp_path / "arm.urdf").write_text(PLANAR_ARM)
    (tmp_path / "w.csv").write_text("x,y,z\n2.5,0.5,0\n1.5,1.5,0\n")
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    draw = random.Random(12)
    begun = [lockedjoint.start(*words.split(), cwd=tmp_path) for words in LONG]
    for process in begun:
        time.sleep(draw.uniform(0.2, 1.0))
        os.killpg(process.pid, signal.SIGINT)
    for words, process in zip(LONG, begun, strict=True):
        _, err = process.communicate(timeout=120)
        last = err.splitlines()[-1] if err else ""
        assert (process.returncode, last[:11]) == (130, "Interrupted"), (words, err)
        assert "Traceback" not in err
    for path in tmp_path.glob("*.json"):  # the best of the starts that ended
        json.loads(path.read_text())


def test_ctrl_c_while_arguments_are_read_is_answered(monkeypatch, capsys):
    """Click would end with the right status, and without a word."""

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(click.Group, "make_context", interrupted)
    monkeypatch.setattr(sys, "argv", ["lockedjoint", "show", "s.db"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert (ended.value.code, capsys.readouterr().err) == (130, "Interrupted.\n")


def test_a_reader_that_ends_early_is_no_traceback(lockedjoint, tmp_path):
    process = lockedjoint.start("show", "--help", cwd=tmp_path)
    process.stdout.close()
    assert (process.wait(timeout=120), process.stderr.read()) == (1, "")
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize(("to", "words"), [(">/dev/full", "No space left"), (">&-", "closed")])
def test_output_that_cannot_be_written_is_one_sentence(lockedjoint, tmp_path, to, words):
    (tmp_path / "j.csv").write_text("1 2 3\n4 5 7\n")
    command = f"{shlex.quote(sys.executable)} -m lockedjoint measure j.csv {to}"
    done = subprocess.run(
        ["sh", "-c", command],
        **{"cwd": tmp_path, "env": lockedjoint.environment(), "check": False},
        **{"stderr": subprocess.PIPE, "text": True, "timeout": 120},
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
