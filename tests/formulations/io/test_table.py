"""One definition of the columns: what is written is what was there, and what is read back."""

import csv
import io
import json
import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import pytest

from lockedjoint.formulations.io import table
from lockedjoint.formulations.io.escaping import rows_csv
from lockedjoint.formulations.io.table import HIDDEN, Table, column, read_rows
from lockedjoint.nlp.errors import FileError


class Colour(StrEnum):
    RED = "red"


@dataclass(frozen=True)
class Row:
    """Every kind of field."""

    name: str
    value: float = field(metadata=column("best", ".3f", brief=True))
    cpu_seconds: float = field(metadata=column("CPU ms", "z.2f", scale=1e3))
    count: int = field(metadata=column(form=lambda row: f"{row.count} of 9", brief=True))
    note: str = field(metadata=column(empty="–"))
    colour: Colour
    counts: Mapping[str, int] = field(metadata=HIDDEN)
    plain: float = 1 / 3
    size: int | None = field(default=None, metadata=HIDDEN)
    sure: bool = field(default=False, metadata=HIDDEN)


ROWS = [
    Row("a|b", 2 / 3, 0.0123456, 3, "", Colour.RED, {"Solved": 2}, size=7),
    Row("c, d", float("nan"), -1e-9, 0, "one\ntwo", Colour.RED, {}, 1e-17),
]


def test_what_is_written_is_read_back_to_the_last_digit(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(Table(Row, ROWS).csv(), encoding="utf-8")
    read = read_rows(path, Row)
    assert len(read) == 2
    assert Table(Row, read).plain() == Table(Row, ROWS).plain()
    assert read[0].value == 2 / 3
    assert read[0].sure is False
    assert read[0].colour is Colour.RED
    assert read[0].counts == {"Solved": 2}
    lines = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))
    assert lines[1]["value"] == ""
    assert json.loads(lines[0]["counts"]) == {"Solved": 2}
    assert [one["size"] for one in lines] == ["7", ""]
    assert list(lines[0]) == list(Row.__dataclass_fields__)


def test_markdown_shows_headings_forms_scales_and_dashes():
    head, _, first, second = Table(Row, ROWS).markdown().splitlines()[:4]
    cells = [cell.strip() for cell in head.strip("|").split("|")]
    assert cells == ["name", "best", "CPU ms", "count", "note", "colour", "plain"]
    assert r"a\|b" in first
    for text in ("0.667", "12.35", "3 of 9", "– ", "red", "0.333"):
        assert text in first
    assert " – |" in second
    assert " 0.00" in second, "no negative zero"
    assert "Solved" not in first


def test_latex_has_commands_for_letters_and_symbols_that_pdflatex_does_not_know():
    names = ("[1pt]", "σ ≤ √π", "[2pt]", "*")
    rows = [replace(ROWS[0], name=name, note="a_b & 50 %") for name in names]
    body = Table(Row, rows).latex()
    assert body.count("{[}") == 2
    assert not re.search(r"(\\\\|rule)\s*[*\[]", body), "no argument of a rule or a row"
    assert r"\ensuremath{\sigma} \ensuremath{\le} \ensuremath{\surd}\ensuremath{\pi}" in body
    assert r"a\_b \& 50 \%" in body
    assert not set(body) & set("σ≤√π")


def test_a_column_of_numbers_with_a_float_in_it_holds_floats():
    rows = [{"x": 1, "y": 1, "z": None}, {"x": 0.5, "y": None, "z": "a"}, {"y": True}]
    text = rows_csv([*rows, {"x": float("nan")}])
    assert text == "x,y,z\n1.0,1,\n0.5,,a\n,True,\n,,\n"
    assert rows_csv([], ["x", "=y"]) == "x,'=y\n"


def test_json_has_null_for_nan():
    plain = Table(Row, ROWS).plain()
    assert plain[1]["value"] is None
    assert plain[0]["counts"] == {"Solved": 2}
    json.dumps(plain, allow_nan=False)


@pytest.mark.parametrize(
    ("old", "new"),
    [("name,v", "title,v"), (",3,", ",many,"), ("red", "blue"), ('"{""Solved"": 2}"', "{")],
)
def test_a_table_of_another_version_is_not_read(tmp_path, old, new):
    path = tmp_path / "table.csv"
    text = Table(Row, ROWS).csv()
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(FileError, match="columns of this version"):
        read_rows(path, Row)
    with pytest.raises(FileError, match="can be read"):
        read_rows(tmp_path / "other.csv", Row)


def test_the_header_names_the_commit_of_a_checkout(tmp_path, monkeypatch):
    for name in ("pyproject.toml", "a/b/table.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    git = ("git", "-c", "user.name=A", "-c", "user.email=a@b", "-C", str(tmp_path))
    for words in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        subprocess.run([*git, *words], check=True)
    told = subprocess.run(
        [*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    )
    monkeypatch.setattr(table, "__file__", str(tmp_path / "a/b/table.py"))
    commit = table._commit.__wrapped__
    assert len(commit()) == 12
    assert told.stdout.startswith(commit())
    (tmp_path / "pyproject.toml").write_text("[project]")
    assert commit() == f"{told.stdout[:12]}, changed"
    monkeypatch.setenv("PATH", "")
    assert commit() == ""
