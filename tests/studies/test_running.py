"""Studies run one after another: whole folders or nothing, and none stops the others."""

from dataclasses import dataclass

import pytest

from formulations.studies.running import STUDIES, State, chosen, run_all
from formulations.studies.study import Effort, Part, Study
from nlp.errors import FileError, InputError


def study(name, compute, **settings):
    return Study(
        name=name,
        title="",
        page="page.md",
        template="page.md.j2",
        tables={"table": Row},
        command="",
        takes="",
        compute=compute,
        **settings,
    )


@dataclass(frozen=True)
class Row:
    text: str


def writes(text):
    def compute(effort, folder):
        yield Part([Row(f"{text} {effort.seed}")])

    return compute


def raises(error):
    def compute(effort, folder):
        yield Part([Row("half")])
        raise error

    return compute


def states(outcomes):
    return {one.study.name: one.state for one in outcomes}


def test_a_study_that_fails_stops_no_other_and_leaves_its_folder_alone(tmp_path):
    (tmp_path / "second").mkdir()
    (tmp_path / "second" / "table.csv").write_text("before")
    studies = [
        study("first", raises(InputError("matplotlib", "missing", "installed"))),
        study("second", raises(ZeroDivisionError("of all things"))),
        study("third", writes("new")),
    ]
    outcomes = list(run_all(studies, tmp_path, Effort(seed=5)))
    assert states(outcomes) == {
        "first": State.FAILED,
        "second": State.FAILED,
        "third": State.MADE,
    }
    assert outcomes[0].reason == "matplotlib is missing; allowed: installed."
    assert outcomes[1].reason == "ZeroDivisionError: of all things"
    assert (tmp_path / "second" / "table.csv").read_text() == "before"
    assert (tmp_path / "third" / "table.csv").read_text() == "text\nnew 5\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["second", "third"]


def test_an_interrupted_study_is_the_last_and_leaves_nothing(tmp_path):
    studies = [
        study("first", writes("new")),
        study("second", raises(KeyboardInterrupt())),
        study("third", writes("new")),
    ]
    outcomes = list(run_all(studies, tmp_path, Effort()))
    assert states(outcomes) == {"first": State.MADE, "second": State.INTERRUPTED}
    assert [path.name for path in tmp_path.iterdir()] == ["first"]


def test_what_a_study_does_not_compute_again_stays(tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "long.json").write_text("took hours")
    (tmp_path / "one" / "table.csv").write_text("before")
    list(run_all([study("one", writes("new"))], tmp_path, Effort()))
    assert (tmp_path / "one" / "long.json").read_text() == "took hours"
    assert (tmp_path / "one" / "table.csv").read_text() == "text\nnew 0\n"


def test_a_study_may_write_and_complain(tmp_path):
    complaint = "a row is an unexplained mismatch"
    one = study("one", writes("new"), complain=lambda rows: complaint if rows else "")
    [outcome] = run_all([one], tmp_path, Effort())
    assert outcome.state is State.QUESTIONED
    assert "mismatch" in outcome.reason
    assert (tmp_path / "one" / "table.csv").exists()


def test_a_file_in_the_way_is_one_sentence(tmp_path):
    (tmp_path / "one").write_text("a file")
    [outcome] = run_all([study("one", writes("new"))], tmp_path, Effort())
    assert outcome.state is State.FAILED
    assert "output folder" in outcome.reason
    assert (tmp_path / "one").read_text() == "a file"
    with pytest.raises(FileError, match="output folder"):
        list(run_all([], tmp_path / "one" / "deeper", Effort()))


def test_chosen():
    usual = {one.name for one in chosen(None, long=False)}
    assert usual == set(STUDIES) - {"bounds", "robots", "paths", "workspaces", "benchmark"}
    assert {one.name for one in chosen(None, long=True)} == set(STUDIES)
    assert [one.name for one in chosen(["robots", "comparison"], long=False)] == [
        "comparison",
        "robots",
    ]
    with pytest.raises(InputError, match="study is comparisons; allowed: one of reproduction"):
        chosen(["comparisons"], long=False)
