"""A study is run row by row: files after every row, and what is done outlives Ctrl-C."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from jinja2 import UndefinedError

from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.errors import FileError, InputError
from results.pages import page
from results.study import Study

RESULTS = Path(__file__).parents[2] / "results"
TEMPLATES = list(RESULTS.rglob("*.j2"))


@dataclass(frozen=True)
class Row:
    """A number."""

    number: int


@dataclass(frozen=True)
class Other:
    """A row of another table."""

    name: str


def study(*rows, then=None, **settings):
    """A study with a file of its own beside its tables, and a page without a finding."""

    def compute(effort, folder):
        for row in rows:
            (folder / "more").mkdir(exist_ok=True)
            write_json(folder / "more" / "x.json", effort.seed)
            yield row
        if then is not None:
            raise then

    texts = {"name": "numbers", "title": "numbers", "page": "page.md", "command": ""}
    template = RESULTS / "page.md.j2"
    tables = {"numbers": Row, "others": Other}
    return Study(
        **texts, template=template, tables=tables, takes="", compute=compute, **settings
    )


def numbers(folder):
    return (folder / "numbers.csv").read_text().split()[1:]


def names(folder):
    return {path.name for path in folder.iterdir()}


MISSING = "not all rows are here"


def test_files_are_written_after_every_row_and_in_the_end(tmp_path):
    seen = []

    def each(row):
        page = (tmp_path / "incomplete" / "page.md").read_text()
        seen.append((numbers(tmp_path / "incomplete"), MISSING in page))

    made = study(Row(1), Row(2), Other("b"))
    result = made.run(tmp_path, Effort(seed=5), each)
    assert seen == [(["1"], True), (["1", "2"], True), (["1", "2"], True)]
    assert (result.complete, result.complaint) == (True, "")
    assert result.rows == (Row(1), Row(2), Other("b"))
    page = (tmp_path / "page.md").read_text()
    assert MISSING not in page
    assert "- seed: 5" in page
    assert names(tmp_path) == {"numbers.csv", "others.csv", "page.md", "more"}
    assert (tmp_path / "more" / "x.json").read_text() == "5\n"
    assert made.read(tmp_path) == {"numbers": [Row(1), Row(2)], "others": [Other("b")]}
    study(Row(3)).run(tmp_path, Effort(seed=6))
    assert numbers(tmp_path) == ["3"]
    assert (tmp_path / "more" / "x.json").read_text() == "6\n"


def test_what_was_done_is_kept_beside_the_result_before(tmp_path):
    study(Row(7)).run(tmp_path, Effort())
    assert not study(Row(1), then=KeyboardInterrupt()).run(tmp_path, Effort()).complete
    assert numbers(tmp_path / "incomplete") == ["1"]
    assert MISSING in (tmp_path / "incomplete" / "page.md").read_text()
    assert numbers(tmp_path) == ["7"]
    assert MISSING not in (tmp_path / "page.md").read_text()
    assert study(Row(8)).run(tmp_path, Effort()).complete
    assert names(tmp_path) == {"numbers.csv", "page.md", "more"}


@pytest.mark.parametrize("moves", range(4))
def test_a_folder_with_a_page_is_of_one_run_wherever_it_is_stopped(
    tmp_path, monkeypatch, moves
):
    study(Row(7)).run(tmp_path, Effort(seed=7))
    replace, done = Path.replace, []

    def stopped(self, target):
        if target.parent in (tmp_path, tmp_path / "more"):
            if len(done) == moves:
                raise KeyboardInterrupt
            done.append(target)
        return replace(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", stopped)
        if moves < 3:
            with pytest.raises(KeyboardInterrupt):
                study(Row(8)).run(tmp_path, Effort(seed=8))
        else:
            study(Row(8)).run(tmp_path, Effort(seed=8))
    assert (tmp_path / "page.md").exists() == (moves == 3)
    assert study(Row(9)).run(tmp_path, Effort(seed=9)).complete
    assert numbers(tmp_path) == ["9"]


def test_a_folder_of_the_user_is_not_removed(tmp_path):
    (tmp_path / "incomplete").mkdir()
    (tmp_path / "incomplete" / "thesis.tex").touch()
    with pytest.raises(FileError, match="an earlier run"):
        study(then=AssertionError("the work")).run(tmp_path, Effort())
    assert (tmp_path / "incomplete" / "thesis.tex").exists()


def test_a_study_that_cannot_be_run_leaves_nothing(tmp_path):
    with pytest.raises(InputError):
        study(then=InputError("package", "missing", "installed")).run(tmp_path, Effort())
    assert not names(tmp_path)
    (tmp_path / "page.md").mkdir()
    with pytest.raises(FileError, match="not a folder"):
        study(then=AssertionError("the work")).run(tmp_path, Effort())


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_every_template_refuses_what_is_not_there(template):
    with pytest.raises(UndefinedError):
        page(template, {})
