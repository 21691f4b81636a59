"""Stores of earlier versions and of other machines become part of one study."""

import json
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
import typer.testing

from formulations.campaign.campaign import Declaration, declaration, run
from formulations.campaign.records import SCHEMA, TIMES, Cell
from formulations.commands.app import app
from formulations.plot.optima import make, stored
from formulations.plot.picture import NothingFoundError, Request
from formulations.solving.setup import Setup
from nlp.errors import FileError, InputError, LockedJointError, StoreError
from nlp.processes import Processes, end_idle_processes
from nlp.store import Store
from nlp.store_checks import Checksum
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
    asked = {"starts": 6, "formulations": ["max-min"], "encodings": ["shared-factor"]}
    declared = declaration({**PLANAR, **asked})
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


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "study.db"
    with Store(path, SCHEMA, writable=True) as store:
        run(declaration({**PLANAR, "starts": 3}), store, Processes(1))
    return path


def in_one_sentence(done):
    """Exit status and sentence of a command that ended with neither a traceback nor 0."""
    if isinstance(done.exception, StoreError):
        return done.exception.exit_status, str(done.exception)
    assert isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stderr


def test_commands_name_damaged_records_and_use_the_others(study, tmp_path):
    bad = Path(shutil.copy(study, tmp_path / "bad.db"))
    with closing(sqlite3.connect(bad)) as database, database:
        database.execute("UPDATE record SET merit = merit + 1e-9 WHERE cell = 2 AND start = 1")
    named = (
        f"Left out of {bad}: 1 damaged record: start 1 of cell 2 (formulation=max-min, "
        "model=free, joints=3, task_dimension=2, locked=1, encoding=two-stage, "
        "from_residual_minima=0, solver=ipopt, compiled=0, seed=0).\n"
    )
    shown = command("show", bad, "--records", "--to", "csv")
    assert in_one_sentence(shown) == (1, named)
    assert len(shown.stdout.splitlines()) == 1 + 5
    assert in_one_sentence(command("show", bad)) == (1, named)
    checked = command("show", bad, "--check")
    assert (checked.stdout, *in_one_sentence(checked)) == ("5 records are intact.\n", 1, named)
    joined = command("join", tmp_path / "new.db", bad)
    assert joined.stdout == f"5 records of {bad} are new, 0 were there already.\n"
    assert in_one_sentence(joined) == (1, named)
    told = json.loads(command("join", tmp_path / "new.db", bad, "--json").stdout)
    assert [one["starts"] for one in told["joined"][0]["damaged"]] == [[1]]
    assert command("show", tmp_path / "new.db", "--check").output == "5 records, all intact.\n"
    with pytest.raises(StoreError, match="1 damaged record"):
        stored(bad)  # of `figure optima --store`

    done = command("join", bad, study)
    assert done.output == f"1 records of {study} are new, 5 were there already.\n"
    assert rows(bad) == rows(study), "an intact record takes the place of a damaged one"


@pytest.mark.parametrize(
    ("how", "said"),
    [
        (lambda raw: raw[:8192], "one that is intact (database disk image is malformed)"),
        (lambda raw: b"X" + raw[1:], "the file of a campaign"),
        (lambda raw: raw[:68] + b"X" + raw[69:], "the file of a campaign"),
        (lambda raw: raw.replace(b", merit REAL", b", \xf7erit REAL"), "one that is intact"),
        (lambda raw: raw[:4096] + bytes(range(256)) * 32 + raw[12288:], "one that is intact"),
    ],
)
@pytest.mark.parametrize("name", ["show", "join"])
def test_a_damaged_structure_is_one_sentence(study, tmp_path, how, said, name):
    bad = tmp_path / "bad.db"
    bad.write_bytes(how(study.read_bytes()))
    done = command(name, *([tmp_path / "new.db"] if name == "join" else []), bad)
    status, sentence = in_one_sentence(done)
    assert (status, done.stdout) == (1, "")
    assert said in sentence
    assert not (tmp_path / "new.db").exists()


def signed(database):
    """Compute all checksums anew: they are no secret."""
    settings, values = list(SCHEMA.settings), list(SCHEMA.values)
    select = f"SELECT id, {', '.join(settings)} FROM cell"
    cells = {key: line for key, *line in database.execute(select)}
    environments = dict(database.execute("SELECT id, environment FROM environment"))
    select = f"SELECT rowid, cell, environment, start, {', '.join(values)} FROM record"
    for row, cell, environment, start, *line in database.execute(select).fetchall():
        made = Checksum(cells[cell], environments[environment])(start, values, line)
        database.execute("UPDATE record SET checksum = ? WHERE rowid = ?", (made, row))


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE record SET jacobian = x'00'",
        "UPDATE record SET jacobian = NULL",
        "UPDATE record SET jacobian = CAST(x'000000000000f87f' || jacobian AS BLOB)",
        "UPDATE record SET merit = 'abc'",
        "UPDATE record SET worst_case_sigma = NULL",
        "UPDATE record SET start = -1 - start, earlier = '{'",
        "UPDATE record SET status = CAST(x'ff' AS TEXT)",
        "UPDATE cell SET joints = -3",
        "UPDATE cell SET task_dimension = 1000000000, joints = 1000000000",
        "UPDATE cell SET model = 'other', locked = 99, options = '{'",
        "UPDATE cell SET locked = 99",
        "UPDATE cell SET formulation = formulation || 'x'",
        "CREATE TRIGGER more AFTER INSERT ON record BEGIN DELETE FROM record; END",
        "CREATE VIEW more AS SELECT * FROM record",
        "ALTER TABLE record ADD COLUMN more TEXT",
    ],
)
def test_a_hostile_store_with_right_checksums_is_no_traceback(study, tmp_path, change):
    path = Path(shutil.copy(study, tmp_path / "bad.db"))
    with closing(sqlite3.connect(path)) as database, database:
        database.text_factory = lambda raw: raw.decode(errors="surrogateescape")
        database.execute(change)
        signed(database)
    commands = (("show",), ("show", "--records", "--json"), ("show", "--optima"))
    for name, *options in (*commands, ("join", tmp_path / "new.db")):
        done = command(name, *options, path)
        if done.exit_code != 0:
            assert isinstance(done.exception, SystemExit | LockedJointError), done.exception
    if "sigma" in change:
        with pytest.raises(NothingFoundError):
            make(Request(starts=1, store=path))


def test_a_second_campaign_on_a_store_is_refused(study, tmp_path):
    path = Path(shutil.copy(study, tmp_path / "s.db"))
    lists = "\n".join(f"{key} = {json.dumps(value)}" for key, value in PLANAR.items())
    (tmp_path / "c.toml").write_text(lists)
    with Store(path, SCHEMA, writable=True):
        for words in (
            ("campaign", tmp_path / "c.toml", "--store", path),
            ("join", path, study),
        ):
            done = command(*words)
            assert in_one_sentence(done)[0] == 1
            assert f"it is being written by process {os.getpid()}." in str(done.exception)
        assert command("show", path).exit_code == 0


def test_joined_to_a_new_store_is_a_copy_with_what_is_in_the_log(study, tmp_path):
    path = Path(shutil.copy(study, tmp_path / "s.db"))
    with Store(path, SCHEMA) as reader, Store(path, SCHEMA, writable=True) as store:
        row = next(store.rows())
        store.add(1, [(99, row)], row["environment"])
        shutil.copy(path, tmp_path / "file-alone.db")
        assert reader.count() == 7
        assert command("join", tmp_path / "copy.db", path).exit_code == 0
    assert len(rows(tmp_path / "file-alone.db")) == 6, "as documented"
    assert rows(tmp_path / "copy.db") == rows(path)


def test_a_campaign_makes_damaged_records_again(study, tmp_path):
    path = Path(shutil.copy(study, tmp_path / "s.db"))
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE record SET violation = 0 WHERE start = 1")
    with Store(path, SCHEMA, writable=True, salvage=True) as store:
        report = run(declaration({**PLANAR, "starts": 3}), store, Processes(1))
        assert (report.asked, report.added, report.missing) == (6, 2, 0)
        assert not store.damaged
    assert rows(path) == rows(study)
