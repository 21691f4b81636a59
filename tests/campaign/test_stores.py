"""Stores of earlier versions and of other machines become part of one study."""

import json
import shutil
import sqlite3
from pathlib import Path

import pytest
import typer.testing

from formulations.campaign.campaign import Declaration, declaration, run
from formulations.campaign.records import SCHEMA, TIMES, Cell
from formulations.commands.app import app
from formulations.solving.setup import Setup
from nlp.errors import FileError, InputError
from nlp.processes import Processes, end_idle_processes
from nlp.store import Store
from nlp.store_schema import condition

# Made by version 0.1.0 as of November 2026: two cells of planar 3R, four starts each.
OLD = Path(__file__).parent / "stores" / "version_1.db"
PLANAR = {
    "starts": 20,
    "formulations": ["residual", "max-min"],
    "models": ["free"],
    "joints": [3],
    "task_dimensions": [2],
}


def rows(path):
    with Store(path, SCHEMA) as store:
        kept = [{k: v for k, v in row.items() if k not in TIMES} for row in store.rows()]
    return sorted(map(repr, kept))


def command(*arguments):
    return typer.testing.CliRunner().invoke(app, list(map(str, arguments)))


@pytest.fixture
def old(tmp_path):
    return Path(shutil.copy(OLD, tmp_path / "old.db"))


def test_an_old_store_is_shown_and_joined_as_it_is(old, tmp_path):
    before = old.read_bytes()
    assert command("show", old).exit_code == 0
    said = command("show", old, "--check").output
    assert said == "8 records of an older version, without checksums; the file is whole.\n"
    done = command("join", tmp_path / "new.db", old)
    assert done.output.startswith("8 records of"), done.output
    assert command("show", tmp_path / "new.db", "--check").output == "8 records, all intact.\n"
    assert rows(tmp_path / "new.db") == rows(old)
    assert old.read_bytes() == before


def test_an_old_store_keeps_every_record_and_goes_on(old):
    database = sqlite3.connect(old)
    before = database.execute("SELECT start, merit, jacobian FROM record ORDER BY cell, start")
    before = before.fetchall()
    database.close()
    assert len(before) == 8
    declared = declaration({**PLANAR, "starts": 6, "formulations": ["max-min"]})
    with Store(old, SCHEMA, writable=True) as store:
        kept = [(r["start"], r["merit"], r["jacobian"]) for r in store.rows()]
        assert kept == before
        assert {row["ran_compiled"] for row in store.rows()} == {None}, "it is not known"
        assert run(declared, store, Processes(1)).added == 2
        assert [row["ran_compiled"] for row in store.rows()][-2:] == [0, 0]
    assert command("show", old).exit_code == 0


def test_a_study_split_over_machines_is_joined(tmp_path):
    for name, starts, names in (
        ("whole", 20, PLANAR["formulations"]),
        ("one", 12, ["residual"]),
        ("two", 20, ["max-min", "residual"]),
    ):
        part = declaration({**PLANAR, "starts": starts, "formulations": names})
        with Store(tmp_path / f"{name}.db", SCHEMA, writable=True) as store:
            run(part, store, Processes(1))
    done = command("join", *(tmp_path / f"{name}.db" for name in ("new", "one", "two")))
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[1].endswith("two.db are new, 12 were there already.")
    assert rows(tmp_path / "new.db") == rows(tmp_path / "whole.db")
    told = json.loads(
        command("join", tmp_path / "new.db", tmp_path / "one.db", "--json").output
    )
    assert told["joined"][0]["already_there"] == 12


def test_a_contradiction_between_machines_is_named(tmp_path):
    for name in "ab":
        with Store(tmp_path / f"{name}.db", SCHEMA, writable=True) as store:
            run(declaration({**PLANAR, "starts": 3}), store, Processes(1))
    with Store(tmp_path / "b.db", SCHEMA) as store:
        row = next(store.rows([condition(SCHEMA, "start=2")]))
    with Store(tmp_path / "c.db", SCHEMA, writable=True) as store:
        cell = store.cell({name: row[name] for name in SCHEMA.settings})
        store.add(cell, [(2, {**row, "merit": row["merit"] + 1e-15})], row["environment"])
    done = command("join", tmp_path / "a.db", tmp_path / "b.db", tmp_path / "c.db")
    assert isinstance(done.exception, InputError)
    assert "start=2" in str(done.exception)


def test_joining_nothing_makes_nothing(tmp_path):
    done = command("join", tmp_path / "new.db", tmp_path / "none.db")
    assert isinstance(done.exception, FileError)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.filterwarnings("ignore:Not compiled:RuntimeWarning")
def test_records_say_whether_they_were_compiled(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    cell = Cell(Setup("residual", "free"), 3, 2, compiled=True)
    made = []
    for name, compiler in (("with", "cc"), ("without", "no-such-cc")):
        monkeypatch.setenv("CC", compiler)
        end_idle_processes()  # workers take their environment over when they start
        with Store(tmp_path / f"{name}.db", SCHEMA, writable=True) as store:
            run(Declaration((cell,), 3), store, Processes(1))
            made.append([(row["compiled"], row["ran_compiled"]) for row in store.rows()])
    end_idle_processes()
    assert made == [[(1, 1)] * 3, [(1, 0)] * 3]
