"""Every option means one thing in every command, and what is printed fits a terminal."""

from __future__ import annotations

import io
import os
import select
import sys
from collections import defaultdict
from contextlib import ExitStack
from unittest.mock import patch

import click
import pytest

from lockedjoint.commands.app import app
from lockedjoint.commands.bars import Bar
from lockedjoint.commands.options import described
from lockedjoint.commands.vocabulary import WORDS
from lockedjoint.nlp.progress import Step
from lockedjoint.workspaces import workspace_size
from tests import made_robots as made

# How many options all commands have at most, help and JSON not counted.
MOST = 183
WIDTH = 80


def every_option():
    """All options of all commands, by name, with the words that lead to the command."""
    found = defaultdict(list)

    def walk(command, words):
        for one in command.params:
            if isinstance(one, click.Option) and one.name not in ("as_json", "help"):
                found[one.opts[0]].append((words, one))
        for name in command.list_commands(None) if isinstance(command, click.Group) else ():
            walk(command.get_command(click.Context(command), name), f"{words} {name}".strip())

    walk(app, "")
    return found


OPTIONS = every_option()


def test_there_are_not_many_options():
    # These are options of all robots, which no command declares by itself, as with --json.
    of_all = ("--angles", "--srdf", "--group")
    own = [uses for name, uses in OPTIONS.items() if name not in of_all]
    assert 150 < sum(map(len, own)) <= MOST


def general(name):
    """What the vocabulary says of an option, up to a remark on its default."""
    said = WORDS[name.removeprefix("--").replace("-", "_")].says
    return said.partition(";")[0].rstrip(".:")


@pytest.mark.parametrize("name", [name for name, uses in OPTIONS.items() if len(uses) > 1])
def test_an_option_means_one_thing(name):
    """Its help is the same in all commands, or begins with what the vocabulary says of it."""
    uses = OPTIONS[name]
    helps = {one.help.partition("  [default")[0] for _, one in uses}
    assert len({(one.metavar, one.is_flag) for _, one in uses}) == 1
    if len(helps) > 1:
        assert general(name), [words for words, _ in uses]
        assert all(said.startswith(general(name)) for said in helps), helps


def test_every_option_says_what_it_means():
    for name, uses in OPTIONS.items():
        assert all(len(one.help) > 10 for _, one in uses), name


def test_docstrings_are_read_as_options():
    text = "Do it.\n\nParameters\n----------\na, b\n    Two of\n    them.\nc\n    One.\n"
    assert described(text) == {"a": "Two of them.", "b": "Two of them.", "c": "One."}


PRINTED = (
    "measure arm.urdf",
    "measure arm.urdf --failures 2",
    "measure arm.urdf --failure-probabilities 0.1",
    "measure wide.csv --failures 2",
    "posture arm.urdf --starts 2 --workers 1",
    "path arm.urdf way.csv --effort samples=3 --effort tracks=2 --effort rounds=0",
    "recover arm.urdf --locked j0 --at 9,9,9 --effort starts=10 --effort boxes=1000",
    "workspace arm.urdf --tip l5 --effort voxel=0.5 --effort slice_degrees=45",
    "solve max-min --joints 11 --starts 2 --workers 1",
    "compare --joints 3 --task-dimension 2 --starts 2 --workers 1",
    "realise three.csv",
    "realise three.csv --to dh",
    "realise three.csv --to choice",
    "bound",
    "bound record 9",
    "atlas show unit-revolute_6x8_k2",
    "show s.db",
    "show s.db --rows records",
    "show s.db --rows optima",
)
CAMPAIGN = 'starts = 2\nformulations = ["residual", "max-min"]\nmodels = ["free"]\n'
CAMPAIGN += "joints = [3, 4]\ntask_dimensions = [2]\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory, lockedjoint):
    """A folder with an arm, matrices, a path and a store."""
    place = tmp_path_factory.mktemp("printed")
    long = {f"j{k}": f"a_rather_long_name_of_joint_{k}" for k in range(7)}
    text = made.offset_arm()
    for short, name in long.items():
        text = text.replace(f'name="{short}"', f'name="{name}"')
    (place / "arm.urdf").write_text(text.replace("a_rather_long_name_of_joint_0", "j0"))
    (place / "wide.csv").write_text(
        "\n".join(
            ",".join(f"{k % 7}.5" for k in row)
            for row in (range(13), range(3, 16), range(5, 31, 2))
        )
    )
    (place / "three.csv").write_text("1,-0.5,-0.5\n0,0.8660254037844386,-0.8660254037844386\n")
    (place / "way.csv").write_text("x,y,z\n0.4,0.2,1.2\n0.4,0.25,1.2\n")
    (place / "c.toml").write_text(CAMPAIGN)
    assert (
        lockedjoint.here("campaign", "c.toml", "s.db", "--workers", 1, cwd=place).returncode
        == 0
    )
    return place


@pytest.mark.parametrize("line", PRINTED)
def test_what_is_printed_fits_a_terminal(lockedjoint, folder, line, monkeypatch):
    monkeypatch.setattr(workspace_size, "_SAMPLE_POINTS", 10)
    done = lockedjoint.here(*line.split(), cwd=folder)
    assert done.returncode in (0, 1), done.stderr
    assert done.stdout.strip()
    assert [text for text in done.stdout.splitlines() if len(text) > WIDTH] == []


def test_columns_are_chosen(lockedjoint, folder):
    whole = lockedjoint.here("show", "s.db", "--columns", "all", cwd=folder).stdout
    few = lockedjoint.here("show", "s.db", "--columns", "joints,score", cwd=folder).stdout
    assert max(map(len, whole.splitlines())) > WIDTH
    assert few.split()[:2] == ["joints", "score"]
    wrong = lockedjoint.here("bound", "record", "--columns", "nothing", cwd=folder)
    assert (wrong.returncode, "--columns is nothing" in wrong.stderr) == (2, True)


SEARCH = "--columns nonsense --out-dir never"


@pytest.mark.parametrize(
    "line",
    [
        f"compare --joints 3 --task-dimension 2 {SEARCH}",
        f"path arm.urdf way.csv {SEARCH}",
        "posture arm.urdf --columns nonsense",
        "measure arm.urdf --columns nonsense",
    ],
)
def test_a_wrong_column_is_known_before_the_search(lockedjoint, folder, line):
    searches = (
        "lockedjoint.formulations.comparison.compare_cases",
        "lockedjoint.paths.search.plan_path",
        "lockedjoint.robots.posture.posture",
        "lockedjoint.robots.robot_assessment.measure_robot",
    )
    with ExitStack() as never:
        for name in searches:
            never.enter_context(patch(name, side_effect=AssertionError(name)))
        wrong = lockedjoint.here(*line.split(), cwd=folder)
    assert wrong.returncode == 2
    assert "--columns is nonsense; allowed: all, or some of " in wrong.stderr
    assert not (folder / "never").exists()


def test_columns_by_heading_and_in_every_form(lockedjoint, folder):
    line = "compare --joints 3 --task-dimension 2 --starts 1 --workers 1 --columns"

    def lines(*more):
        done = lockedjoint.here(*line.split(), *more, cwd=folder)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    assert lines("problem,verdict")[0].split() == ["problem", "verdict"]
    latex = lines("problem,verdict", "--to", "latex")
    assert {line.count("&") for line in latex if line.endswith("\\\\")} == {1}
    markdown = lines("verdict", "--to", "markdown")
    assert markdown[0].strip("| ") == "verdict"
    assert lines("problem,solved", "--to", "csv")[0] == "formulation,solved"


class Terminal(io.StringIO):
    """What keeps all that is written, and says that it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("share", [0.25, None])
def test_a_bar_shows_the_share_and_the_time_left(share):
    bar, terminal = Bar(), Terminal()
    with (
        patch.object(sys, "stderr", terminal),
        patch("lockedjoint.commands.bars._DELAY_SECONDS", 0.0),
        patch("lockedjoint.commands.bars._INTERVAL_SECONDS", 0.0),
    ):
        bar(Step("configurations along a path with a very long name", share))
        bar(Step("polish", share))
        bar.close()
    shown = terminal.getvalue().split("\r")
    assert any("polish" in line for line in shown)
    assert any(" 25 %|" in line and " left" in line for line in shown) is (share is not None)
    assert max(map(len, shown)) <= WIDTH


def test_nothing_is_shown_on_a_pipe():
    bar, pipe = Bar(), io.StringIO()
    with patch.object(sys, "stderr", pipe):
        bar(Step("polish", 0.5))
        bar.close()
    assert pipe.getvalue() == ""


def test_a_terminal_without_a_size_has_a_bar():
    # A terminal of a container can say that it has 0 lines.
    pty = pytest.importorskip("pty")
    controller, terminal = pty.openpty()
    bar, shown = Bar(), ""
    with (
        os.fdopen(terminal, "w") as stream,
        patch.object(sys, "stderr", stream),
        patch("lockedjoint.commands.bars._DELAY_SECONDS", 0.0),
    ):
        bar(Step("polish", 0.5))
        stream.flush()
        # What is written arrives in parts.
        while " 50 %|" not in shown and select.select([controller], [], [], 5.0)[0]:
            shown += os.read(controller, 4096).decode(errors="replace")
        bar.close()
    os.close(controller)
    assert " 50 %|" in shown
