"""The store keeps every bit once, refuses what is not its own, and says so in a sentence."""

import math
import os
import random
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.campaign.store import Store
from lockedjoint.nlp.errors import FileError, InputError, StoreError

COLUMNS = {"x": "REAL", "raw": "BLOB"}
ROOT = Path(__file__).parents[3]


def opened(path, **more):
    return Store(path, COLUMNS, **more)


def record(x, raw=b""):
    return {"x": x, "raw": raw}


def filled(path, starts=5, cell="a", environment="v1"):
    with opened(path, writable=True) as store:
        store.add(cell, [(k, record(k / 3)) for k in range(starts)], environment)
    return path


def rows(path, **more):
    with opened(path, **more) as store:
        return store.frame().to_dict("records")


@given(x=st.floats(), raw=st.binary(max_size=50))
def test_every_bit_comes_back(tmp_path_factory, x, raw):
    path = tmp_path_factory.mktemp("store") / "s.db"
    with opened(path, writable=True) as store:
        store.add("a", [(0, record(x, raw))], "v")
    (row,) = rows(path)
    assert row["raw"] == raw
    assert math.isnan(row["x"]) if math.isnan(x) else row["x"].hex() == x.hex()


def test_what_was_added_is_there_after_a_loss_of_power(tmp_path):
    """With FULL the folder is not synchronised, and a journal can come back that undoes it."""
    filled(tmp_path / "s.db")
    with opened(tmp_path / "s.db", writable=True) as store:
        extra = 3
        assert store._execute("PRAGMA synchronous").fetchone() == (extra,)


def test_a_start_is_kept_once_and_stays_as_it_was(tmp_path):
    path = filled(tmp_path / "s.db")
    with opened(path, writable=True) as store:
        assert store.add("a", [(2, record(99.0)), (5, record(5.0))], "v2") == 1
    found = rows(path)
    assert [row["start"] for row in found] == [0, 1, 2, 3, 4, 5]
    assert found[2]["x"] == 2 / 3
    assert (found[2]["environment"], found[5]["environment"]) == ("v1", "v2")
    assert list(tmp_path.iterdir()) == [path], "one file, nothing beside it"


def test_a_bad_record_keeps_none_of_its_batch(tmp_path):
    with opened(tmp_path / "s.db", writable=True) as store:
        with pytest.raises(KeyError):
            store.add("a", [(0, record(1.0)), (1, {"x": 2.0})], "v")
        assert len(store.frame()) == 0
        store.add("a", [(0, record(1.0))], "w")
        assert list(store.frame()["environment"]) == ["w"]


@given(done=st.sets(st.integers(0, 30)), starts=st.integers(1, 25))
def test_missing_are_the_starts_without_a_record(tmp_path_factory, done, starts):
    path = tmp_path_factory.mktemp("store") / "s.db"
    with opened(path, writable=True) as store:
        store.add("a", [(k, record(0.0)) for k in done], "v")
        missing = [k for gap in store.missing("a", starts) for k in gap]
        assert missing == sorted(set(range(starts)) - done)
        assert store.missing("b", starts) == [range(starts)]


def test_refuses_files_that_are_not_stores(tmp_path):
    (tmp_path / "text").write_text("not a database at all, just some words" * 30)
    with closing(sqlite3.connect(tmp_path / "foreign")) as foreign:
        foreign.execute("CREATE TABLE t (a)")
    Store(tmp_path / "other", {"y": "REAL"}, writable=True).close()
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for name in ("text", "foreign", "other", "missing", ".", "x" * 300):
        with pytest.raises(FileError, match="store is"):
            opened(tmp_path / name)
    for name in ("text", "foreign", "other", ".", "no/folder"):
        with pytest.raises(FileError, match="store is"):
            opened(tmp_path / name, writable=True)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_others_read_while_one_writes(tmp_path):
    path = filled(tmp_path / "s.db")
    with opened(path, writable=True) as writer:
        with opened(path) as reader:
            assert len(reader.frame()) == 5
            writer.add("a", [(7, record(1.0))], "v")
            assert len(reader.frame()) == 6
        writer.add("a", [(8, record(1.0))], "v")
    assert len(rows(path)) == 7


WRITER = """
import sys
sys.path.insert(0, {root!r})
from pathlib import Path
from lockedjoint.formulations.campaign.store import Store
with Store(Path({path!r}), {{"x": "REAL", "raw": "BLOB"}}, writable=True) as store:
    for k in range({last}):
        batch = [(10 * k + i, {{"x": 1.0, "raw": bytes(300)}}) for i in range(10)]
        store.add("a", batch, "v")
        print(k, flush=True)
"""


def test_kill_9_loses_no_batch_that_was_added(tmp_path):
    path = tmp_path / "s.db"
    words = [sys.executable, "-c", WRITER.format(root=str(ROOT), path=str(path), last=10**6)]
    for number in range(5):  # at several moments, within transactions, too
        path.unlink(missing_ok=True)
        writer = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        while int(writer.stdout.readline()) < 3 * number:
            pass
        os.kill(writer.pid, signal.SIGKILL)
        told = [int(line) for line in writer.communicate(timeout=120)[0].split()]
        starts = [row["start"] for row in rows(path)]
        assert len(starts) % 10 == 0, "whole batches"
        assert starts == list(range(len(starts)))
        assert len(starts) >= 10 * (max(told, default=3 * number) + 1)


@pytest.mark.parametrize("limit", ["pages", "file size"])
def test_a_full_disk_is_one_sentence_and_keeps_what_is_there(tmp_path, limit):
    path = filled(tmp_path / "s.db")
    code = WRITER.format(root=str(ROOT), path=str(path), last=10**4)
    if limit == "pages":
        pages = "    store._execute('PRAGMA max_page_count = 30')\n"
        code = code.replace("    for k", pages + "    for k")
    else:
        code = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (10**5,) * 2)" + code
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    assert "lockedjoint.nlp.errors.FileError: store is" in done.stderr
    assert "a file on a disk with room" in done.stderr
    told = len(done.stdout.split())
    assert [row["start"] for row in rows(path)] == list(range(10 * told))
    with opened(path, writable=True) as store:
        assert store.add("a", [(10**6, record(1.0))], "room again") == 1


def test_two_writers_lose_and_double_nothing(tmp_path):
    """Both add the same starts at the same time; a killed one locks nothing."""
    path = filled(tmp_path / "s.db")
    code = WRITER.format(root=str(ROOT), path=str(path), last=30)
    words = [sys.executable, "-c", code]
    both = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    for writer in both:
        told, _ = writer.communicate(timeout=120)
        assert (writer.returncode, len(told.split())) == (0, 30)
    assert [row["start"] for row in rows(path)] == list(range(300))
    assert rows(path)[2]["x"] == 2 / 3, "what was there stays"
    endless = WRITER.format(root=str(ROOT), path=str(path), last=10**6)
    killed = subprocess.Popen(
        [sys.executable, "-c", endless], stdout=subprocess.PIPE, text=True
    )
    killed.stdout.readline()
    killed.kill()
    killed.communicate(timeout=120)
    with opened(path, writable=True) as store:
        assert store.add("a", [(10**7, record(1.0))], "v") == 1


@pytest.mark.parametrize("what", ["removed", "moved"])
def test_a_store_that_is_gone_is_no_success(tmp_path, what):
    path = filled(tmp_path / "s.db")
    with opened(path, writable=True) as store:
        path.unlink() if what == "removed" else path.rename(tmp_path / "elsewhere.db")
        with pytest.raises(StoreError, match="a file that nobody removes"):
            store.add("a", [(9, record(1.0))], "v")


def test_no_flipped_bit_is_silent(tmp_path):
    """Anywhere in the file: refused in one sentence, or the damaged records named."""
    path = filled(tmp_path / "s.db", 30)
    with opened(path, writable=True) as store:
        store.add("b", [(0, record(1.0, bytes(5000)))], "v2")
    whole = rows(path)
    good, draw, outcomes = path.read_bytes(), random.Random(0), []
    for k in range(200):
        page = k % (len(good) // 4096)
        bad = bytearray(good)
        bad[4096 * page + draw.randrange(4096)] ^= 1 << draw.randrange(8)
        path.write_bytes(bad)
        try:
            assert rows(path) == whole
            outcomes.append("same")
        except FileError as reason:
            outcomes.append("named" if "damaged records, first" in str(reason) else "refused")
    assert min(map(outcomes.count, ("named", "same", "refused"))) > 5


@pytest.mark.parametrize(
    ("change", "cell", "start"),
    [
        ("x = x + 1e-15", "a", 2),
        ("x = NULL", "a", 2),
        ("raw = CAST(raw AS TEXT)", "a", 2),
        ("digest = x'00'", "a", 2),
        ("start = 20", "a", 20),
        ("cell = 'c'", "c", 2),
        ("environment = CAST(x'ff' AS TEXT)", "a", 2),
    ],
)
def test_damaged_records_are_named_with_what_takes_them_out(tmp_path, change, cell, start):
    path = filled(tmp_path / "s.db")
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"UPDATE record SET {change} WHERE start = 2")
    for writable in (False, True):
        named = rf"1 damaged records, first start {start} of {cell}; .* rowid IN \(3\)"
        with pytest.raises(StoreError, match=named):
            opened(path, writable=writable)
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("DELETE FROM record WHERE rowid IN (3)")
    with opened(path, writable=True) as store:
        assert list(store.frame()["start"]) == [0, 1, 3, 4]
        assert store.missing("a", 5) == [range(2, 3)]
        assert store.add("a", [(k, record(k / 3)) for k in range(5)], "v1") == 1
        assert store.frame()["x"].tolist() == [k / 3 for k in range(5)]


STARTS = st.sets(st.integers(0, 12))


def joined(store, other, apart_from=()):
    with opened(other) as source:
        return store.join(source, apart_from)


@given(st.lists(st.fixed_dictionaries(dict.fromkeys("abc", STARTS)), min_size=1, max_size=3))
def test_parts_joined_are_the_whole(tmp_path_factory, parts):
    folder = tmp_path_factory.mktemp("join")

    def made(name, cells):
        with opened(folder / name, writable=True) as store:
            for cell, starts in cells.items():
                x = {k: math.nan if k == 3 else k / 3 + ord(cell) for k in starts}
                store.add(cell, [(k, record(x[k])) for k in starts], "v1")
        return folder / name

    def content(path):
        return sorted((r["cell"], r["start"], repr(r["x"])) for r in rows(path))

    union = {cell: set().union(*(part[cell] for part in parts)) for cell in "abc"}
    expected, seen = content(made("whole.db", union)), 0
    with opened(folder / "joined.db", writable=True) as store:
        for number, part in enumerate(parts):
            path = made(f"{number}.db", part)
            before = path.read_bytes()
            added, known = joined(store, path)
            seen += added
            assert added + known == sum(map(len, part.values()))
            assert path.read_bytes() == before
            assert joined(store, path) == (0, added + known), "twice is as once"
    assert seen == len(expected)
    assert content(folder / "joined.db") == expected


def test_a_contradiction_is_one_sentence_and_adds_nothing(tmp_path):
    ours = filled(tmp_path / "a.db", 3)
    theirs = filled(tmp_path / "b.db", 8)
    with opened(theirs, writable=True) as store:
        store.add("b", [(0, record(math.nan))], "v")
    with opened(ours, writable=True) as store:
        store.add("b", [(0, record(1.0, b"same"))], "v")
        with pytest.raises(InputError, match="record of start 0 of 'b' is new in"):
            joined(store, theirs)
        assert len(store.frame()) == 4
        with pytest.raises(InputError, match="'b'"):
            joined(store, theirs, ["x"])  # the other column differs, too
        assert joined(store, theirs, ["x", "raw"]) == (5, 4)
        with pytest.raises(FileError, match="another file than the store itself"):
            joined(store, ours)
