"""Files are written whole or not at all."""

import pytest

from nlp.errors import FileError
from nlp.files import prepare_folder, write_text


def test_replaces_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "one\n")
    write_text(path, "two – 2\n")
    assert path.read_text(encoding="utf-8") == "two – 2\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_failed_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "\ud800")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_refuses_a_folder_that_is_a_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("")
    with pytest.raises(FileError, match=r"a\.txt"):
        prepare_folder(path)
    with pytest.raises(FileError, match=r"b\.txt"):
        write_text(path / "b.txt", "")


def test_makes_missing_folders(tmp_path):
    assert prepare_folder(tmp_path / "x" / "y").is_dir()
