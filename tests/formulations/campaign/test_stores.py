"""Stores of earlier versions and of other machines become part of one study."""

import json
import shutil
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner

from lockedjoint.commands.app import app
from lockedjoint.figures.optima import make, stored
from lockedjoint.figures.style import NothingFoundError
from lockedjoint.formulations.campaign.campaign import declaration, run
from lockedjoint.formulations.campaign.records import COLUMNS, TIMES, open_store
from lockedjoint.formulations.campaign.store import _digest
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.errors import FileError, LockedJointError, StoreError

PLANAR = {"starts": 20, "models": ["free"], "joints": [3], "task_dimensions": [2]}
PLANAR |= {"formulations": ["residual", "max-min"]}


def rows(path):
    with open_store(path) as store:
        table = store.frame().drop(columns=list(TIMES))
    return sorted(map(repr, table.to_dict("records")))


def made(path, part):
    with open_store(path, writable=True) as store, ThreadPoolExecutor(1) as executor:
        run(declaration({**PLANAR, **part}), store, executor)
    return path


def command(*arguments):
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_a_study_split_over_machines_is_joined(tmp_path):
    for name, starts, names in (
        ("whole", 20, PLANAR["formulations"]),
        ("one", 12, ["residual"]),
        ("two", 20, ["max-min", "residual"]),
    ):
        made(tmp_path / f"{name}.db", {"starts": starts, "formulations": names})
    done = command("join", *(tmp_path / f"{name}.db" for name in ("new", "one", "two")))
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[1].endswith("two.db are new, 12 were there already.")
    assert rows(tmp_path / "new.db") == rows(tmp_path / "whole.db")
    again = command("join", tmp_path / "new.db", tmp_path / "one.db", "--json")
    told = json.loads(again.output)
    assert told["joined"][0]["already_there"] == 12


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return made(tmp_path_factory.mktemp("stores") / "study.db", {"starts": 3})


def in_one_sentence(done):
    """Exit status and sentence of a command that ended with neither a traceback nor 0."""
    if isinstance(done.exception, StoreError):
        return done.exception.exit_status, str(done.exception)
    assert isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stderr


def test_commands_name_a_damaged_record_and_go_on_without_it(study, tmp_path):
    bad = Path(shutil.copy(study, tmp_path / "bad.db"))
    with closing(sqlite3.connect(bad)) as database, database:
        which = "cell LIKE '%max-min%' AND start = 1"
        database.execute(f"UPDATE record SET score = score + 1e-9 WHERE {which}")
        [cell] = database.execute(f"SELECT cell FROM record WHERE {which}").fetchone()
    new = tmp_path / "new.db"
    for words in (("show", bad), ("show", bad, "--rows", "records"), ("join", new, bad)):
        done = command(*words)
        assert done.stdout == ""
        status, sentence = in_one_sentence(done)
        assert status == 1
        assert f"1 damaged records, first start 1 of {cell}" in sentence
    assert not new.exists()
    with pytest.raises(StoreError, match="1 damaged records"):
        stored(bad)  # of `figure optima STORE`
    statement = sentence[sentence.index("DELETE") : sentence.index(" takes them out")]
    with closing(sqlite3.connect(bad)) as database, database:
        database.execute(statement)
    done = command("join", bad, study)
    assert done.output == f"1 records of {study} are new, 5 were there already.\n"
    assert rows(bad) == rows(study)


@pytest.mark.parametrize(
    "how",
    [
        lambda raw: raw[:8192],
        lambda raw: b"X" + raw[1:],
        lambda raw: raw[:16] + b"X" + raw[17:],
        lambda raw: raw.replace(b'"score" REAL', b'"\xf7core" REAL'),
        lambda raw: raw[:4096] + bytes(range(256)) * 32 + raw[12288:],
    ],
)
@pytest.mark.parametrize("name", ["show", "join"])
def test_a_damaged_structure_is_one_sentence(study, tmp_path, how, name):
    bad = tmp_path / "bad.db"
    bad.write_bytes(how(study.read_bytes()))
    done = command(name, *([tmp_path / "new.db"] if name == "join" else []), bad)
    assert isinstance(done.exception, FileError), done.exception
    assert done.stdout == ""
    assert not (tmp_path / "new.db").exists()


@pytest.mark.parametrize(
    "change",
    [
        *(f"UPDATE record SET jacobian = {value}" for value in ("x'00'", "NULL")),
        "UPDATE record SET jacobian = CAST(x'000000000000f87f' || jacobian AS BLOB)",
        "UPDATE record SET score = 'abc'",
        "UPDATE record SET worst_case_sigma = NULL",
        "UPDATE record SET start = -1 - start, earlier = '{'",
        "UPDATE record SET status = CAST(x'ff' AS TEXT)",
        *(f"UPDATE OR REPLACE record SET cell = '{cell}'" for cell in ("{", "[3]")),
        "UPDATE record SET cell = replace(cell, '\"joints\": 3', '\"joints\": -3')",
        "UPDATE record SET cell = replace(cell, '\"joints\": 3', '\"joints\": 1000000000')",
        "UPDATE record SET cell = replace(cell, 'free', 'other')",
        "UPDATE record SET cell = replace(cell, '\"failures\": 1', '\"failures\": 99')",
        "UPDATE record SET cell = replace(cell, 'residual', 'else')",
        "CREATE TRIGGER more AFTER INSERT ON record BEGIN DELETE FROM record; END",
        "CREATE VIEW more AS SELECT * FROM record",
        "ALTER TABLE record ADD COLUMN more TEXT",
    ],
)
def test_a_hostile_store_with_right_digests_is_no_traceback(study, tmp_path, change):
    path = Path(shutil.copy(study, tmp_path / "bad.db"))
    with closing(sqlite3.connect(path)) as database, database:
        database.text_factory = lambda raw: raw.decode(errors="surrogateescape")
        database.execute(change)
        names = ", ".join(("cell", "start", *COLUMNS, "environment"))
        for number, *row in database.execute(f"SELECT rowid, {names} FROM record").fetchall():
            update = "UPDATE record SET digest = ? WHERE rowid = ?"
            database.execute(update, (_digest(row), number))  # it is no secret
    commands = (
        ("show",),
        ("show", "--rows", "records", "--json"),
        ("show", "--rows", "optima"),
    )
    for name, *options in (*commands, ("join", tmp_path / "new.db")):
        done = command(name, *options, path)
        if done.exit_code != 0:
            assert isinstance(done.exception, SystemExit | LockedJointError), done.exception
    if "sigma" in change:
        with pytest.raises(NothingFoundError):
            make(Effort(starts=1), path)
