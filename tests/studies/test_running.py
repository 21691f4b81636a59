"""Studies run one after another: whole folders or nothing, and nobody stops the others."""

import pytest

from formulations.studies.running import State, run_all
from formulations.studies.studies import STUDIES, chosen
from formulations.studies.study import Effort, Study
from nlp.errors import FileError, InputError


def study(name, run):
    return Study(
        name=name,
        title="",
        page="page.md",
        table="table.csv",
        command="",
        takes="",
        long=False,
        run=run,
        finding=lambda _: "",
    )


def writes(text, complaint=""):
    def run(folder, effort):
        (folder / "table.csv").write_text(f"{text} {effort.seed}")
        return complaint

    return run


def raises(error):
    def run(folder, effort):
        (folder / "table.csv").write_text("half")
        raise error

    return run


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
    assert (tmp_path / "third" / "table.csv").read_text() == "new 5"
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
    assert (tmp_path / "one" / "table.csv").read_text() == "new 0"


def test_a_study_may_write_and_complain(tmp_path):
    one = study("one", writes("new", "a row is an unexplained mismatch"))
    [outcome] = run_all([one], tmp_path, Effort())
    assert outcome.state is State.QUESTIONED
    assert "mismatch" in outcome.reason
    assert (tmp_path / "one" / "table.csv").exists()


def test_a_run_killed_while_renaming_loses_nothing(tmp_path):
    (tmp_path / ".one.before").mkdir()
    (tmp_path / ".one.before" / "long.json").write_text("took hours")
    (tmp_path / ".one.part").mkdir()
    (tmp_path / ".one.part" / "half.csv").write_text("half")
    list(run_all([study("one", writes("new"))], tmp_path, Effort()))
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == ["long.json", "table.csv"]
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


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
    assert usual == set(STUDIES) - {"robots", "benchmark"}
    assert {one.name for one in chosen(None, long=True)} == set(STUDIES)
    assert [one.name for one in chosen(["robots", "comparison"], long=False)] == [
        "comparison",
        "robots",
    ]
    with pytest.raises(InputError, match="study is comparisons; allowed: one of reproduction"):
        chosen(["comparisons"], long=False)
