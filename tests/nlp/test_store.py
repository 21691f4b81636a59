"""The store keeps every bit once, refuses what is not its own, and says so in a sentence."""

import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlp.errors import FileError, InputError, StoreError
from nlp.store import Store
from nlp.store_schema import Schema, condition

SCHEMA = Schema(7, 1, {"name": "TEXT", "size": "INTEGER"}, {"x": "REAL", "raw": "BLOB"})
ROOT = Path(__file__).parents[2]


def record(x, raw=b""):
    return {"x": x, "raw": raw}


def filled(path, starts=5):
    with Store(path, SCHEMA, writable=True) as store:
        cell = store.cell({"name": "a", "size": 3})
        store.add(cell, [(k, record(k / 3)) for k in range(starts)], "v1")
    return path


@given(x=st.floats(), raw=st.binary(max_size=50))
def test_every_bit_comes_back(tmp_path_factory, x, raw):
    path = tmp_path_factory.mktemp("store") / "s.db"
    with Store(path, SCHEMA, writable=True) as store:
        store.add(store.cell({"name": "a", "size": 3}), [(0, record(x, raw))], "v")
    with Store(path, SCHEMA) as store:
        (row,) = store.rows()
    assert row["raw"] == raw
    same = math.isnan(row["x"]) if math.isnan(x) else row["x"].hex() == x.hex()
    assert same


def test_a_start_is_kept_once_and_stays_as_it_was(tmp_path):
    path = filled(tmp_path / "s.db")
    with Store(path, SCHEMA, writable=True) as store:
        cell = store.cell({"name": "a", "size": 3})
        store.add(cell, [(2, record(99.0)), (5, record(5.0))], "v2")
        rows = list(store.rows())
    assert [row["start"] for row in rows] == [0, 1, 2, 3, 4, 5]
    assert rows[2]["x"] == 2 / 3
    assert (rows[2]["environment"], rows[5]["environment"]) == ("v1", "v2")
    database = sqlite3.connect(path)
    with pytest.raises(sqlite3.IntegrityError):
        database.execute("INSERT INTO record (cell, start, environment) VALUES (1, 2, 1)")
    database.close()


def test_a_bad_record_keeps_none_of_its_batch(tmp_path):
    with Store(tmp_path / "s.db", SCHEMA, writable=True) as store:
        cell = store.cell({"name": "a", "size": 3})
        with pytest.raises(KeyError):
            store.add(cell, [(0, record(1.0)), (1, {"x": 2.0})], "v")
        assert list(store.rows()) == []
        store.add(cell, [(0, record(1.0))], "w")
        assert [row["environment"] for row in store.rows()] == ["w"]


@given(done=st.sets(st.integers(0, 30)), starts=st.integers(1, 25))
def test_missing_are_the_starts_without_a_record(tmp_path_factory, done, starts):
    path = tmp_path_factory.mktemp("store") / "s.db"
    with Store(path, SCHEMA, writable=True) as store:
        cell, other = (store.cell({"name": name, "size": 1}) for name in "ab")
        store.add(cell, [(k, record(0.0)) for k in done], "v")
        missing = [k for gap in store.missing(cell, starts) for k in gap]
        assert missing == sorted(set(range(starts)) - done)
        assert store.missing(other, starts) == [range(starts)]


def test_filters_compare_columns_with_values(tmp_path):
    with Store(filled(tmp_path / "s.db"), SCHEMA) as store:
        for text, starts in {
            "start>=3": [3, 4],
            "start != 3": [0, 1, 2, 4],
            "x<0.5": [0, 1],
            "size=4": [],
            "name = a' OR 1=1 --": [],
        }.items():
            found = store.rows([condition(SCHEMA, text)], ["start"])
            assert [row["start"] for row in found] == starts, text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("size", "COLUMN=VALUE"),
        ("nothing=1", "one of name, size, start, x, raw, environment"),
        ("size=many", "a whole number"),
        ("size=99999999999999999999", "a whole number"),
        ("x=nan", "a number"),
        ("raw=1", "a column of numbers or text"),
        ("1=1; DROP TABLE record", "one of name"),
    ],
)
def test_refuses_filters_that_are_none(text, said):
    with pytest.raises(InputError, match=said):
        condition(SCHEMA, text)


def test_refuses_files_that_are_not_stores(tmp_path):
    (tmp_path / "text").write_text("not a database at all, just some words" * 30)
    foreign = sqlite3.connect(tmp_path / "foreign")
    foreign.execute("CREATE TABLE t (a)")
    foreign.close()
    before = (tmp_path / "foreign").read_bytes()
    for name in ("text", "foreign", "missing", "."):
        with pytest.raises(FileError, match="store is"):
            Store(tmp_path / name, SCHEMA)
    for name in ("text", "foreign", ".", "no/folder"):
        with pytest.raises(FileError, match="store is"):
            Store(tmp_path / name, SCHEMA, writable=True)
    assert (tmp_path / "foreign").read_bytes() == before
    assert not (tmp_path / "missing").exists()


def test_migrates_an_older_store_and_refuses_what_it_cannot(tmp_path):
    path = filled(tmp_path / "s.db")
    values = {**SCHEMA.values, "y": "REAL"}
    add = {1: ["ALTER TABLE record ADD COLUMN y REAL"]}
    newer = Schema(7, 2, SCHEMA.settings, values, add)
    with pytest.raises(FileError, match="too old"):
        Store(path, Schema(7, 2, SCHEMA.settings, values), writable=True)
    before = path.read_bytes()
    with Store(path, newer) as store:
        assert all(math.isnan(row["y"]) for row in store.rows())
    assert path.read_bytes() == before, "it was read in a copy"
    with Store(path, newer, writable=True) as store:
        assert all(math.isnan(row["y"]) for row in store.rows())
        assert len(list(store.rows())) == 5
    with pytest.raises(FileError, match="a newer lockedjoint"):
        Store(path, SCHEMA)


def test_a_migration_that_fails_changes_nothing(tmp_path):
    path = filled(tmp_path / "s.db")
    broken = {1: ["ALTER TABLE record ADD COLUMN y REAL", "nonsense"]}
    with pytest.raises(FileError):
        Store(path, Schema(7, 2, SCHEMA.settings, SCHEMA.values, broken), writable=True)
    with Store(path, SCHEMA) as store:
        assert len(list(store.rows())) == 5


def test_two_read_while_one_writes(tmp_path):
    path = filled(tmp_path / "s.db")
    with Store(path, SCHEMA) as one, Store(path, SCHEMA) as two:
        first, second = one.rows(), two.rows()
        next(first), next(second)
        with Store(path, SCHEMA, writable=True) as writer:
            writer.add(1, [(7, record(1.0))], "v")
        assert len(list(first)) == len(list(second)) == 4, "what they saw when they began"
        assert len(list(one.rows())) == 6


WRITER = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from nlp.store import Store
from nlp.store_schema import Schema
schema = Schema(7, 1, {{"name": "TEXT", "size": "INTEGER"}}, {{"x": "REAL", "raw": "BLOB"}})
with Store(Path({path!r}), schema, writable=True) as store:
    cell = store.cell({{"name": "a", "size": 3}})
    for k in range({last}):
        store.add(cell, [(10 * k + i, {{"x": 1.0, "raw": bytes(300)}}) for i in range(10)], "v")
        print(k, flush=True)
"""


def test_kill_9_loses_no_batch_that_was_added(tmp_path):
    path = tmp_path / "s.db"
    code = WRITER.format(root=str(ROOT), path=str(path), last=10**6)
    writer = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    while int(writer.stdout.readline()) < 20:
        pass
    os.kill(writer.pid, signal.SIGKILL)
    told = [int(line) for line in writer.communicate()[0].split()]
    with Store(path, SCHEMA) as store:
        starts = [row["start"] for row in store.rows(columns=["start"])]
    assert len(starts) % 10 == 0, "whole batches"
    assert starts == list(range(len(starts)))
    assert len(starts) >= 10 * (max(told, default=20) + 1)


@pytest.mark.parametrize("limit", ["pages", "file size"])
def test_a_full_disk_is_one_sentence_and_keeps_what_is_there(tmp_path, limit):
    path = filled(tmp_path / "s.db")
    code = WRITER.format(root=str(ROOT), path=str(path), last=10**4)
    if limit == "pages":
        code = code.replace(
            "    cell =",
            "    store._file.execute('PRAGMA max_page_count = 30')\n    cell =",
        )
    else:
        code = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (10**5,) * 2)" + code
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert "nlp.errors.FileError: store is" in done.stderr
    assert "a file on a disk with room" in done.stderr
    told = len(done.stdout.split())
    shutil.copy(path, tmp_path / "copy.db")
    with Store(path, SCHEMA, writable=True) as store:
        starts = [row["start"] for row in store.rows(columns=["start"])]
        assert starts == list(range(10 * told))
        store.add(1, [(10**6, record(1.0))], "room again")


def test_a_second_writer_is_refused_and_a_killed_one_locks_nothing(tmp_path):
    path = filled(tmp_path / "s.db")
    code = WRITER.format(root=str(ROOT), path=str(path), last=10**6)
    writer = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    writer.stdout.readline()
    with pytest.raises(StoreError, match=f"it is being written by process {writer.pid}\\."):
        Store(path, SCHEMA, writable=True)
    with Store(path, SCHEMA) as store:
        assert next(store.rows(columns=["start"])) == {"start": 0}, "others may read"
    writer.kill()
    writer.communicate()
    with Store(path, SCHEMA, writable=True) as store:
        with pytest.raises(StoreError, match=f"process {os.getpid()}"):
            Store(path, SCHEMA, writable=True)
        store.add(1, [(10**7, record(1.0))], "v")
    assert list(tmp_path.iterdir()) == [path], "neither log nor lock is left"


def test_no_flipped_bit_is_silent(tmp_path):
    """Anywhere in the file: refused in one sentence, or the damaged records named."""
    path = filled(tmp_path / "s.db", 30)
    with Store(path, SCHEMA, writable=True) as store:
        store.add(store.cell({"name": "b", "size": 3}), [(0, record(1.0, bytes(5000)))], "v2")
        whole = list(store.rows())
    good, rng, outcomes = path.read_bytes(), random.Random(0), []
    for k in range(200):
        page = k % (len(good) // 4096)
        bad = bytearray(good)
        bad[4096 * page + rng.randrange(4096)] ^= 1 << rng.randrange(8)
        path.write_bytes(bad)
        try:
            with Store(path, SCHEMA, salvage=True) as store:
                rows, lost = list(store.rows()), sum(len(one.starts) for one in store.damaged)
                assert store.count() == len(rows) + lost == len(whole)
                assert all(row in whole for row in rows)
            outcomes.append("named" if lost else "same")
        except FileError:
            outcomes.append("refused")
    assert min(map(outcomes.count, ("named", "same", "refused"))) > 5


@pytest.mark.parametrize(
    ("change", "starts"),
    [
        ("UPDATE record SET x = x + 1e-15 WHERE start = 2", (2,)),
        ("UPDATE record SET x = NULL WHERE start = 2", (2,)),
        ("UPDATE record SET raw = CAST(raw AS TEXT) WHERE start = 2", (2,)),
        ("UPDATE record SET checksum = NULL WHERE start = 2", (2,)),
        ("UPDATE record SET start = 20 WHERE start = 2", (20,)),
        ("UPDATE record SET cell = 7 WHERE start = 2", (2,)),
        ("UPDATE record SET environment = 7 WHERE start = 2", (2,)),
        ("UPDATE cell SET size = 4", (0, 1, 2, 3, 4)),
        ("UPDATE environment SET environment = CAST(x'ff' AS TEXT)", (0, 1, 2, 3, 4)),
        ("DELETE FROM environment", (0, 1, 2, 3, 4)),
    ],
)
def test_damaged_records_are_named_left_out_and_made_again(tmp_path, change, starts):
    path = filled(tmp_path / "s.db")
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(change)
    with pytest.raises(StoreError, match=f"it has {len(starts)} damaged record"):
        Store(path, SCHEMA)
    with Store(path, SCHEMA, writable=True, salvage=True) as store:
        assert [one.starts for one in store.damaged] == [starts]
        intact = {row["start"] for row in store.rows()}
        assert intact == set(range(5)) - {2} - set(starts)
        cell = store.cell({"name": "a", "size": 3})
        missing = [k for gap in store.missing(cell, 5) for k in gap]
        assert set(missing) == set(range(5)) - intact
        assert store.add(cell, [(k, record(k / 3)) for k in range(5)], "v1") == len(missing)
        assert [row["x"] for row in store.rows()] == [k / 3 for k in range(5)]


@contextmanager
def without_privileges():
    """Root may write everywhere; other users may not."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_reading_leaves_no_file_beside_a_store(tmp_path):
    path = filled(tmp_path / "s.db")
    (tmp_path / "link.db").symlink_to(path)
    with Store(tmp_path / "link.db", SCHEMA) as one:
        with Store(path, SCHEMA) as other:
            assert other.count() == 5
        assert (tmp_path / "s.db-shm").exists(), "another one reads"
        assert len(list(one.rows())) == 5
    assert sorted(one.name for one in tmp_path.iterdir()) == ["link.db", "s.db"]
    with Store(path, SCHEMA) as reader:
        with Store(path, SCHEMA, writable=True) as store:
            store.add(1, [(9, record(9.0))], "v1")
            with Store(path, SCHEMA) as another:
                assert another.count() == 6
            store.add(1, [(10, record(9.0))], "v1")
        assert reader.count() == 7
    assert sorted(one.name for one in tmp_path.iterdir()) == ["link.db", "s.db"]


@pytest.mark.skipif(
    not hasattr(os, "seteuid"), reason="this system has no users to become: run it on Unix"
)
@pytest.mark.parametrize("log", [None, b"", b"records"])
def test_a_store_in_a_folder_that_is_not_writable_can_be_read(log):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = filled(folder / "s.db")
        if log is not None:
            (folder / "s.db-wal").write_bytes(log)
        folder.chmod(0o555)
        try:
            with without_privileges():
                with pytest.raises(FileError, match="in a folder to write to"):
                    Store(path, SCHEMA, writable=True)
                if log:
                    with pytest.raises(FileError, match=r"its last records are in s\.db-wal"):
                        Store(path, SCHEMA)
                else:
                    with Store(path, SCHEMA) as store:
                        assert len(list(store.rows())) == 5
        finally:
            folder.chmod(0o755)
