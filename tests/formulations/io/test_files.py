"""Files are written whole or not at all."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from lockedjoint.formulations.io.files import prepare_file, write_text
from lockedjoint.nlp.errors import FileError


def test_a_failed_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "\ud800")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_link_stays_and_its_target_is_replaced(tmp_path):
    (tmp_path / "deep").mkdir()
    link = tmp_path / "link"
    link.symlink_to("deep/a.txt")
    for text in ("made by a link without a target", "replaced"):
        write_text(prepare_file(link), text)
        assert link.is_symlink()
        assert (tmp_path / "deep" / "a.txt").read_text() == text


def test_devices_and_pipes_are_written_to_and_stay(tmp_path):
    write_text(prepare_file(Path(os.devnull), inputs=[Path(os.devnull)]), "text")
    assert Path(os.devnull).is_char_device()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_text(prepare_file(pipe), "text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert pipe.is_fifo()


@pytest.fixture
def crowded(tmp_path):
    """A folder of what must not be replaced."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "input.csv").write_text("1,2\n")
    (tmp_path / "soft").symlink_to("input.csv")
    (tmp_path / "hard").hardlink_to(tmp_path / "input.csv")
    (tmp_path / "loop").symlink_to("loop")
    with closing(sqlite3.connect(tmp_path / "s.db")) as store, store:
        store.execute("CREATE TABLE record (start)")
    (tmp_path / "to-the-store").symlink_to("s.db")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("folder", "not a folder"),
        ("input.csv", "another file than .*input.csv"),
        ("folder/../input.csv", "another file than .*input.csv"),
        ("soft", "another file than .*input.csv"),
        ("hard", "another file than .*input.csv"),
        ("loop", "a path to write to"),
        ("s.db", "not a store"),
        ("to-the-store", "not a store"),
        ("input.csv/below", "a path to write to"),
        ("n" * 300, "name too long"),
        ("nul\0", "null (byte|character)"),  # Python 3.13 calls it a character
    ],
)
def test_what_must_not_be_replaced_is_refused(crowded, name, said):
    before = {path.name: path.lstat().st_ino for path in crowded.iterdir()}
    with pytest.raises(FileError, match=said) as caught:
        prepare_file(crowded / name, inputs=[None, crowded / "input.csv"])
    assert caught.value.argument == "--out"
    if "another file" not in said:  # what the command reads is known to it alone
        with pytest.raises(FileError):
            write_text(crowded / name, "text")
    assert {path.name: path.lstat().st_ino for path in crowded.iterdir()} == before


def test_two_outputs_may_not_be_one(tmp_path):
    with pytest.raises(FileError, match="another file than"):
        prepare_file(tmp_path / "new", "--data", [tmp_path / "x" / ".." / "new"])
