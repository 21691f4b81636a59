"""Stores joined are the store of one run; what contradicts is refused and changes nothing."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlp.errors import FileError, InputError
from nlp.store import Store
from nlp.store_schema import Schema

SCHEMA = Schema(7, 1, {"name": "TEXT", "size": "INTEGER"}, {"x": "REAL", "t": "REAL"})


def filled(path, cells, environment="v1", late=0.0):
    """Make a store of the given starts of each cell; x says what the record is of."""
    with Store(path, SCHEMA, writable=True) as store:
        for (name, size), starts in cells.items():
            records = [
                (k, {"x": math.nan if k == 3 else k / 3 + size, "t": late + k}) for k in starts
            ]
            store.add(store.cell({"name": name, "size": size}), records, environment)
    return path


def records(path):
    with Store(path, SCHEMA) as store:
        return sorted(
            (r["name"], r["size"], r["start"], repr(r["x"]), r["environment"])
            for r in store.rows()
        )


def join(store, other, apart_from=()):
    with Store(other, SCHEMA) as source:
        return store.join(source, apart_from)


STARTS = st.sets(st.integers(0, 12))
CELLS = [("a", 1), ("b", 1), ("a", 2)]


@given(st.lists(st.fixed_dictionaries(dict.fromkeys(CELLS, STARTS)), min_size=1, max_size=3))
def test_parts_joined_are_the_whole(tmp_path_factory, parts):
    folder = tmp_path_factory.mktemp("join")
    whole = {cell: set().union(*(part[cell] for part in parts)) for cell in CELLS}
    expected = records(filled(folder / "whole.db", whole))
    seen = 0
    with Store(folder / "joined.db", SCHEMA, writable=True) as store:
        for number, part in enumerate(parts):
            cells = dict(reversed(part.items())) if number % 2 else part
            path = filled(folder / f"{number}.db", cells, late=number)
            before = path.read_bytes()
            added, known = join(store, path, ["t"])
            seen += added
            assert added + known == sum(map(len, part.values()))
            assert path.read_bytes() == before
            assert join(store, path, ["t"]) == (0, added + known), "twice is as once"
    assert seen == len(expected)
    assert records(folder / "joined.db") == expected


def test_what_was_there_stays(tmp_path):
    ours = filled(tmp_path / "a.db", {("a", 1): range(3)}, "old")
    theirs = filled(tmp_path / "b.db", {("a", 1): range(5)}, "new", late=9)
    with Store(ours, SCHEMA, writable=True) as store:
        assert join(store, theirs, ["t"]) == (2, 3)
        rows = list(store.rows())
    assert [row["environment"] for row in rows] == ["old"] * 3 + ["new"] * 2
    assert [row["t"] for row in rows] == [0, 1, 2, 12, 13]


def test_a_contradiction_is_one_sentence_and_adds_nothing(tmp_path):
    ours = filled(tmp_path / "a.db", {("a", 1): range(3)})
    theirs = filled(tmp_path / "b.db", {("a", 1): range(8), ("b", 1): [0]}, late=1.0)
    before = records(ours)
    with Store(ours, SCHEMA, writable=True) as store:
        with pytest.raises(InputError, match="size=1, start=0 is another one in"):
            join(store, theirs)
        assert records(ours) == before
        assert join(store, theirs, ["t"]) == (6, 3), "times may differ"


def test_a_number_that_is_missing_in_one_contradicts(tmp_path):
    ours, theirs = (filled(tmp_path / name, {("a", 1): [0]}) for name in ("a.db", "b.db"))
    with Store(theirs, SCHEMA, writable=True) as store:
        store.add(store.cell({"name": "a", "size": 1}), [(1, {"x": math.nan, "t": 0.0})], "v")
    with Store(ours, SCHEMA, writable=True) as store:
        store.add(store.cell({"name": "a", "size": 1}), [(1, {"x": 0.0, "t": 0.0})], "v")
        with pytest.raises(InputError, match="start=1"):
            join(store, theirs)


def test_refuses_what_cannot_be_joined(tmp_path):
    ours = filled(tmp_path / "a.db", {("a", 1): [0]})
    (tmp_path / "text").write_text("no store")
    foreign = Schema(8, 1, SCHEMA.settings, SCHEMA.values)
    Store(tmp_path / "foreign.db", foreign, writable=True).close()
    with Store(ours, SCHEMA, writable=True) as store:
        for name in ("text", "foreign.db", "none.db"):
            with pytest.raises(FileError, match="the file of a campaign"):
                join(store, tmp_path / name)
        with pytest.raises(FileError, match="another file than the store itself"):
            join(store, ours)
    assert not (tmp_path / "none.db").exists()
