"""Jacobians from files, and one sentence for every file that has none."""

import json

import numpy as np
import pytest

from lockedjoint.formulations.measures.read_jacobians import read_jacobians
from lockedjoint.nlp.errors import InputError

MATRIX = np.random.default_rng(0).normal(size=(2, 4))


def text(matrix):
    return "\n".join(",".join(map(repr, row)) for row in matrix.tolist())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", text(MATRIX)),
        ("a.csv", "\ufeff" + text(MATRIX) + "\r\n\n"),
        ("a.CSV", text(MATRIX).replace(",", " , ")),
        ("a.csv", text(MATRIX).replace(",", "; ")),
        ("a.csv", text(MATRIX).replace(",", ";").replace(".", ",")),
        ("a.tsv", text(MATRIX).replace(",", "\t")),
        ("a.txt", "# of numpy.savetxt\n" + text(MATRIX).replace(",", " ")),
        ("a.csv", "joint 1,joint 2,a,b\n" + text(MATRIX)),
        ("a.json", json.dumps(MATRIX.tolist())),
        ("a.json", json.dumps({"jacobian": MATRIX.tolist(), "more": 1})),
    ],
)
def test_reads_every_digit(tmp_path, name, content):
    (tmp_path / name).write_text(content, encoding="utf-8")
    [(_, matrix)] = read_jacobians(str(tmp_path / name))
    np.testing.assert_array_equal(matrix, MATRIX)


@pytest.mark.parametrize("header", ["0,1,2,3", "1,2,3,4", "1; 2; 3; 4"])
def test_numbers_of_columns_are_no_row(tmp_path, header):
    """As pandas' `to_csv(index=False)` writes them; measured, they would be a row of J."""
    (tmp_path / "a.csv").write_text(f"{header}\n{text(MATRIX)}")
    with pytest.raises(InputError, match=r"is [01], [12], .*put # before numbers of columns"):
        read_jacobians(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text(f"# {header}\n{text(MATRIX)}")
    assert read_jacobians(tmp_path / "a.csv")[0][1].shape == MATRIX.shape


@pytest.mark.parametrize(
    "rows", ["0.0,1,2,3\n1,0,1,0.5", "1,0,1\n0,1,2.5", "0,1,3\n1,0,1.5", "1 2 3\n4 5 -7"]
)
def test_rows_that_only_look_like_numbers_of_columns_are_rows(tmp_path, rows):
    (tmp_path / "a.csv").write_text(rows)
    assert len(read_jacobians(tmp_path / "a.csv")[0][1]) == 2


def test_a_refused_header_says_the_rule(tmp_path):
    (tmp_path / "a.csv").write_text(f"q,1,2,3\n{text(MATRIX)}")
    with pytest.raises(
        InputError, match=r"allowed: .*a header has no number, and rows have no"
    ):
        read_jacobians(tmp_path / "a.csv")


def test_reads_npy_and_lists_of_jacobians(tmp_path):
    np.save(tmp_path / "a.npy", MATRIX)
    np.testing.assert_array_equal(read_jacobians(tmp_path / "a.npy")[0][1], MATRIX)
    listed = [
        {"formulation": "max-min", "model": "free", "jacobian": MATRIX.tolist()},
        {"formulation": "isotropy", "verdict": "solved", "jacobian": MATRIX.tolist()},
        {"jacobian": (2 * MATRIX).tolist()},
    ]
    (tmp_path / "b.json").write_text(json.dumps(listed))
    (first, one), (answer, _), (_, two) = read_jacobians(tmp_path / "b.json")
    assert (first, answer) == ("max-min free", "isotropy, solved")
    np.testing.assert_array_equal(2 * one, two)


def test_reads_every_array_of_an_npz(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", first=MATRIX, second=2 * MATRIX)
    (first, one), (second, two) = read_jacobians(tmp_path / "a.npz")
    assert (first, second) == ("first", "second")
    np.testing.assert_array_equal(one, MATRIX)
    np.testing.assert_array_equal(two, 2 * MATRIX)


def test_an_npz_that_is_no_matrix_or_a_bomb_is_refused(tmp_path, monkeypatch):
    bad = {"pickle": np.array([None, 1], dtype=object), "text": np.array([["a", "b"]])}
    for name, array in bad.items():
        np.savez(tmp_path / f"{name}.npz", array)
    np.savez_compressed(tmp_path / "bomb.npz", np.zeros((2, 4000)))
    monkeypatch.setattr("lockedjoint.formulations.measures.read_jacobians.MOST_BYTES", 50_000)
    (tmp_path / "cut.npz").write_bytes((tmp_path / "bomb.npz").read_bytes()[:-30])
    for name in (*bad, "bomb", "cut"):
        with pytest.raises(InputError, match=name):
            read_jacobians(tmp_path / f"{name}.npz")
