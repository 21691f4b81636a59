"""A study is run part by part: files after every part, and what is done outlives Ctrl-C."""

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from jinja2 import UndefinedError

from formulations.studies import pages
from formulations.studies.study import Effort, Part, Study
from nlp.errors import FileError, InputError


@dataclass(frozen=True)
class Row:
    """A number."""

    number: int


@dataclass(frozen=True)
class Other:
    """A row of another table."""

    name: str


def study(*parts, then=None, **settings):
    """A study with the page of failures' header and rows, whose finding is empty."""

    def compute(effort, folder):
        yield from parts
        if then is not None:
            raise then

    return Study(
        name="numbers",
        title="numbers",
        page="page.md",
        template="page.md.j2",
        tables={"numbers": Row, "others": Other},
        command="",
        takes="",
        compute=compute,
        **settings,
    )


def numbers(folder):
    return (folder / "numbers.csv").read_text().split()[1:]


MISSING = "not all rows are here"


def test_files_are_written_after_every_part_and_in_the_end(tmp_path):
    seen = []

    def each(part):
        page = (tmp_path / "incomplete" / "page.md").read_text()
        seen.append((numbers(tmp_path / "incomplete"), MISSING in page))

    one = study(
        Part([Row(1)], entries=[{"a": 1}], files={"x.json": b"{}"}),
        Part([Row(2), Other("b")], entries=[{"a": 2}]),
        entries="entries.json",
    )
    result = one.run(tmp_path, Effort(seed=5), each)
    assert seen == [(["1"], True), (["1", "2"], True)]
    assert (result.complete, result.complaint) == (True, "")
    assert result.rows == (Row(1), Row(2), Other("b"))
    page = (tmp_path / "page.md").read_text()
    assert MISSING not in page
    assert "- seed: 5" in page
    assert json.loads((tmp_path / "entries.json").read_text()) == [{"a": 1}, {"a": 2}]
    assert one.files == ("numbers.csv", "page.md", "entries.json")
    names = {"numbers.csv", "others.csv", "page.md", "entries.json", "x.json"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert one.read(tmp_path) == {"numbers": [Row(1), Row(2)], "others": [Other("b")]}


def test_files_in_folders_are_moved_too(tmp_path):
    def compute(effort, folder):
        more = folder / "incomplete" / "more"
        more.mkdir()
        (more / "x.json").write_text(str(effort.seed))
        yield Part([Row(effort.seed)])

    for seed in (1, 2):
        assert replace(study(), compute=compute).run(tmp_path, Effort(seed=seed)).complete
        assert (tmp_path / "more" / "x.json").read_text() == str(seed)
    names = {"more", "numbers.csv", "page.md"}
    assert {path.name for path in tmp_path.iterdir()} == names


def test_rows_may_take_the_place_of_the_latest(tmp_path):
    parts = [Part([Row(1)]), Part([Row(2), Row(3)]), Part([Row(4), Row(5)], replaces=2)]
    assert study(*parts).run(tmp_path, Effort()).rows == (Row(1), Row(4), Row(5))
    assert numbers(tmp_path) == ["1", "4", "5"]


@pytest.mark.parametrize(
    ("parts", "then", "kept"),
    [
        ([Part([Row(1)])], KeyboardInterrupt(), ["1"]),
        ([Part([Row(1)]), Part([Row(2)], complete=False), Part([Row(3)])], None, ["1", "2"]),
    ],
)
def test_what_was_done_is_kept_beside_the_result_before(tmp_path, parts, then, kept):
    study(Part([Row(7)])).run(tmp_path, Effort())
    assert not study(*parts, then=then).run(tmp_path, Effort()).complete
    assert numbers(tmp_path / "incomplete") == kept
    assert MISSING in (tmp_path / "incomplete" / "page.md").read_text()
    assert numbers(tmp_path) == ["7"]
    assert MISSING not in (tmp_path / "page.md").read_text()
    assert study(Part([Row(8)])).run(tmp_path, Effort()).complete
    assert sorted(path.name for path in tmp_path.iterdir()) == ["numbers.csv", "page.md"]


@pytest.mark.processes
def test_a_result_is_complete_or_says_that_it_is_not_wherever_the_run_is_killed(tmp_path):
    words = [sys.executable, Path(__file__).with_name("killed_runs.py")]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 20, "the number of changes before which it was killed"


def test_a_folder_of_the_user_is_not_removed(tmp_path):
    (tmp_path / "incomplete").mkdir()
    (tmp_path / "incomplete" / "thesis.tex").touch()
    with pytest.raises(FileError, match="an earlier run"):
        study(then=AssertionError("the work")).run(tmp_path, Effort())
    assert (tmp_path / "incomplete" / "thesis.tex").exists()


def test_what_must_not_be_replaced_is_refused_before_the_work(tmp_path):
    (tmp_path / "page.md").mkdir()
    with pytest.raises(FileError, match="not a folder"):
        study(then=AssertionError("the work")).run(tmp_path, Effort())


def test_a_study_that_cannot_be_run_writes_nothing(tmp_path):
    def check():
        raise InputError("package", "missing", "installed")

    with pytest.raises(InputError):
        study(Part([Row(1)]), check=check).run(tmp_path / "new", Effort())
    assert not (tmp_path / "new").exists()


def test_a_complaint_is_made_of_the_rows(tmp_path):
    one = study(Part([Row(1)]), complain=lambda rows: f"{len(rows)} is odd")
    assert one.run(tmp_path, Effort()).complaint == "1 is odd"


def test_a_table_of_another_version_is_refused(tmp_path):
    (tmp_path / "numbers.csv").write_text("digits\n1\n")
    with pytest.raises(FileError):
        study().read(tmp_path)


def test_every_template_refuses_what_is_not_there():
    names = {path.name for path in (Path(pages.__file__).parent / "templates").iterdir()}
    assert len(names) == 13
    for name in names:
        with pytest.raises(UndefinedError):
            pages.page(name, {})


@pytest.mark.parametrize(
    ("text", "shown"),
    [("", ""), ("a\n  b\n", "- a b"), ("\n\na\n\n \nb\nc\n\n", "- a\n- b c")],
)
def test_bullets_are_paragraphs(text, shown):
    assert pages.bullets(text) == shown
