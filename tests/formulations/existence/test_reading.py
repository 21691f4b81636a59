"""A file that is no certificate is refused with one sentence, whatever is wrong with it."""

import json
import re
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.reading import FILE_BYTES, read_certificate
from lockedjoint.nlp.errors import FileError

TERM = "squares.0.terms.0"
EQUATION = "multipliers.0.equation"
# Whatever is not exactly in the format: {path: change}, and what is said where it helps.
ILL_FORMED: list[tuple[dict[str, Any], str]] = [
    ({f"{TERM}.w": [[0, 7]]}, r"squares: \[0\]: terms: \[0\]: joint 7 is not one of 0 to 6"),
    ({f"{TERM}.w": [["0", 1]]}, r'terms: \[0\]: w: \[0\]: \[0\]: "0" is not a whole number'),
    ({f"{TERM}.coefficient": 1.0}, "1.0 is not a rational number"),
    ({f"{TERM}.coefficient": ...}, "'coefficient' is missing"),
    ({f"{TERM}.comment": "mine"}, 'the key "comment" is unknown'),
    ({f"{TERM}.wbar": [[4, 4]]}, r"pair \[4, 4\] is on the diagonal"),
    ({"joints": 6}, "joints is 6, but the theorem is about 7"),
    *(({f"{TERM}.w": pairs}, "") for pairs in ([[-1, 2]], [[0, 1]] * 4)),
    *(({f"{TERM}.coefficient": one}, "") for one in (1, "1e9", "1/0", "9" * 100_000)),
    *(({"constant": one}, "") for one in ("-1", float("inf"))),
    *(({name: []}, "") for name in ("squares", "multipliers")),
    ({"squares.0.weight": "-108"}, ""),
    ({TERM: None}, ""),
    ({"joints": "7"}, ""),
    ({EQUATION: {"kind": "wish", "entry": [0, 1]}}, ""),
    ({EQUATION: {"kind": "row-sum", "row": 7}}, ""),
    ({EQUATION: {"kind": "row-sum", "entry": [0, 1]}}, ""),
    # Denominators without a small common multiple: sums would have millions of digits.
    ({f"multipliers.{k}.coefficient": f"1/{10**39 + k}" for k in range(300)}, ""),
]


@pytest.fixture(scope="module")
def document(committed):
    loaded: dict[str, Any] = json.loads(committed.read_text())
    return loaded


def refusal(path, expected):
    with pytest.raises(expected) as caught:
        read_certificate(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert len(sentence) < 300
    return sentence


@pytest.mark.parametrize(("changes", "sentence"), ILL_FORMED, ids=range(len(ILL_FORMED)))
def test_ill_formed_certificates(changes, sentence, document, patched, tmp_path):
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(patched(document, changes)))
    assert re.search(sentence, refusal(file, CertificateError))


@pytest.mark.parametrize(
    ("content", "error", "sentence"),
    [
        (b"[]", CertificateError, "a list is not an object"),
        (b"NaN", CertificateError, "NaN is not an object"),
        (b"{}", CertificateError, "'joints' is missing"),
        (b'{"jacobian": [[1]]}', CertificateError, "json is no certificate; it holds a Jac"),
        (b'[{"jacobian": [[1]]}]', CertificateError, "which `lockedjoint measure "),
        (b'{"joints": 7, "joints": 7}', FileError, "a key is given twice"),
        (b'{"joints": ' + b"7" * 5000 + b"}", FileError, "a number is too long"),
        (b"", FileError, "valid JSON"),
        (b'{"joints": 7,', FileError, "valid JSON"),
        (b"\xff\xfe{}", FileError, "not in UTF-8"),
        (b"[" * 100_000, FileError, "nested too deeply"),
        (b" " * (FILE_BYTES + 1), FileError, "of at most"),
    ],
)
def test_other_files(content, error, sentence, tmp_path):
    file = tmp_path / "other.json"
    file.write_bytes(content)
    assert sentence in refusal(file, error)


def test_missing_file_folder_and_impossible_name(tmp_path):
    for path in (tmp_path / "none.json", tmp_path, tmp_path / "a\0b"):
        refusal(path, FileError)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.floats(0, 1, exclude_max=True), st.binary(min_size=1, max_size=3), st.booleans())
def test_other_bytes_or_none_anywhere_never_give_a_traceback(
    committed, tmp_path, share, noise, cut
):
    content = committed.read_bytes()
    place = int(share * len(content))
    file = tmp_path / "noisy.json"
    file.write_bytes(content[:place] + noise + (b"" if cut else content[place + len(noise) :]))
    try:
        read_certificate(file)
    except (CertificateError, FileError) as error:
        sentence = str(error)
    else:
        sentence = ""
    assert "\n" not in sentence


def test_reading_and_writing_are_inverse(committed):
    assert read_certificate(committed).to_json().encode() == committed.read_bytes()
