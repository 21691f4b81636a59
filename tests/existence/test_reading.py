"""A file that is no certificate is refused with one sentence, whatever is wrong with it."""

import copy
import json
import re
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from formulations.existence.certificate import CertificateError
from formulations.existence.reading import FILE_BYTES, read
from nlp.errors import FileError

TERM = ("squares", 0, "terms", 0)
DELETE = object()

ILL_FORMED: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "pair out of range": (
        (*TERM, "w"),
        [[0, 7]],
        r"squares: \[0\]: terms: \[0\]: joint 7 is not one of 0 to 6",
    ),
    "negative joint": ((*TERM, "w"), [[-1, 2]], "joint -1 is not one of 0 to 6"),
    "diagonal pair": ((*TERM, "wbar"), [[4, 4]], r"pair \[4, 4\] is on the diagonal"),
    "triple": ((*TERM, "w"), [[0, 1, 2]], "a list of 3 joints is not a pair"),
    "joint as a string": ((*TERM, "w"), [["0", 1]], '"0" is not a whole number'),
    "joint as a truth value": ((*TERM, "w"), [[True, 2]], "true is not a whole number"),
    "joint as a float": ((*TERM, "w"), [[0.0, 1]], "0.0 is not a whole number"),
    "long monomial": ((*TERM, "w"), [[0, 1]] * 4, "of 5 factors is longer than 3"),
    "coefficient as a float": ((*TERM, "coefficient"), 1.0, "1.0 is not a rational number"),
    "coefficient as an integer": ((*TERM, "coefficient"), 1, "1 is not a rational number"),
    "decimal string": ((*TERM, "coefficient"), "0.5", '"0.5" is not a rational number'),
    "power string": ((*TERM, "coefficient"), "1e9", "is not a rational number"),
    "zero denominator": ((*TERM, "coefficient"), "1/0", "is not a rational number"),
    "other digits": ((*TERM, "coefficient"), "٣", "is not a rational number"),
    "trailing newline": ((*TERM, "coefficient"), "1\n", "is not a rational number"),
    "huge number": ((*TERM, "coefficient"), "9" * 100_000, "at most 40 digits"),
    "zero coefficient": ((*TERM, "coefficient"), "0", "a coefficient is zero"),
    "missing coefficient": ((*TERM, "coefficient"), DELETE, "'coefficient' is missing"),
    "unknown key": ((*TERM, "comment"), "mine", 'the key "comment" is unknown'),
    "negative weight": (("squares", 0, "weight"), "-108", "weight -108 is not positive"),
    "zero weight": (("squares", 0, "weight"), "0", "weight 0 is not positive"),
    "no terms": (("squares", 0, "terms"), [], "the list of terms is empty"),
    "no squares": (("squares",), [], "the list of squares is empty"),
    "no multipliers": (("multipliers",), [], "the list of multipliers is empty"),
    "squares as an object": (("squares",), {}, "squares: an object is not a list"),
    "term as null": (TERM, None, "null is not an object with coefficient, w, wbar"),
    "too many squares": (("squares",), "×5", "10 squares are more than 4"),
    "negative constant": (("constant",), "-1", "constant -1 is not positive"),
    "zero constant": (("constant",), "0", "constant 0 is not positive"),
    "constant as a float": (("constant",), 32.3, "constant: 32.3 is not a rational"),
    "infinite constant": (("constant",), float("inf"), "Infinity is not a rational"),
    "six joints": (("joints",), 6, "joints is 6, but the theorem is about 7"),
    "seven as a float": (("joints",), 7.0, r"7\.0 is not a whole number"),
    "seven as a string": (("joints",), "7", '"7" is not a whole number'),
    "unknown equation": (
        ("multipliers", 0, "equation"),
        {"kind": "wish", "entry": [0, 1]},
        'multipliers: .0.: equation kind "wish" is unknown',
    ),
    "equation kind as a list": (
        ("multipliers", 0, "equation"),
        {"kind": [], "entry": [0, 1]},
        "equation kind a list is unknown",
    ),
    "row out of range": (
        ("multipliers", 0, "equation"),
        {"kind": "row-sum", "row": 7},
        "joint 7 is not one of 0 to 6",
    ),
    "row-sum with an entry": (
        ("multipliers", 0, "equation"),
        {"kind": "row-sum", "entry": [0, 1]},
        "'row' is missing",
    ),
    "entry of one index": (
        ("multipliers", 0, "equation"),
        {"kind": "square", "entry": [3]},
        "a square equation has 2 indices",
    ),
}


@pytest.fixture(scope="module")
def document(committed):
    loaded: dict[str, Any] = json.loads(committed.read_text())
    return loaded


def refusal(path, expected):
    with pytest.raises(expected) as caught:
        read(path)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert len(sentence) < 300
    return sentence


@pytest.mark.parametrize("name", ILL_FORMED)
def test_ill_formed_certificates(name, document, tmp_path):
    path, value, sentence = ILL_FORMED[name]
    changed: Any = copy.deepcopy(document)
    target = changed
    for step in path[:-1]:
        target = target[step]
    if value is DELETE:
        del target[path[-1]]
    else:
        target[path[-1]] = target[path[-1]] * 5 if value == "×5" else value
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(changed))
    refused = refusal(file, CertificateError)
    assert re.search(sentence, refused), refused


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[]", "a list is not an object"),
        ("7", "7 is not an object"),
        ("NaN", "NaN is not an object"),
        ('"certificate"', '"certificate" is not an object'),
        ("{}", "'joints' is missing"),
        ('{"joints": 7, "joints": 7}', "a key is given twice"),
        ('{"joints": ' + "7" * 5000 + "}", "an integer of 5000 digits"),
    ],
)
def test_json_that_is_no_certificate(text, sentence, tmp_path):
    file = tmp_path / "other.json"
    file.write_text(text)
    assert sentence in refusal(file, CertificateError)


def test_denominators_without_a_small_common_multiple(document, tmp_path):
    """Their sums would have millions of digits."""
    changed = copy.deepcopy(document)
    for place, multiplier in enumerate(changed["multipliers"]):
        multiplier["coefficient"] = f"1/{10**39 + place}"
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(changed))
    assert "the denominators have no small multiple" in refusal(file, CertificateError)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "not JSON"),
        (b'{"joints": 7,', "not JSON"),
        (b"\xff\xfe{}", "not in UTF-8"),
        (b"[" * 100_000, "nested too deeply"),
        (b" " * (FILE_BYTES + 1), "of at most"),
    ],
)
def test_unreadable_files(content, sentence, tmp_path):
    file = tmp_path / "other.json"
    file.write_bytes(content)
    assert sentence in refusal(file, FileError)


def test_missing_file_folder_and_impossible_name(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.json", FileError)
    assert "directory" in refusal(tmp_path, FileError)
    assert "null" in refusal(tmp_path / "a\0b", FileError)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.99, 0.9999])
def test_truncated_certificates_are_unreadable(share, committed, tmp_path):
    content = committed.read_bytes()
    file = tmp_path / "truncated.json"
    file.write_bytes(content[: int(share * len(content))])
    assert "not JSON" in refusal(file, FileError)


@settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.floats(0, 1, exclude_max=True), st.binary(min_size=1, max_size=3))
def test_a_few_other_bytes_anywhere_never_give_a_traceback(committed, tmp_path, share, noise):
    content = committed.read_bytes()
    place = int(share * len(content))
    file = tmp_path / "noisy.json"
    file.write_bytes(content[:place] + noise + content[place + len(noise) :])
    try:
        read(file)
    except (CertificateError, FileError) as error:
        sentence = str(error)
    else:
        sentence = ""
    assert "\n" not in sentence


def test_writing_and_reading_are_inverse(committed, tmp_path):
    certificate = read(committed)
    certificate.write(tmp_path / "copy.json")
    assert (tmp_path / "copy.json").read_bytes() == committed.read_bytes()
    assert read(tmp_path / "copy.json") == certificate
    assert len(list(tmp_path.iterdir())) == 1


def test_writing_replaces_and_never_leaves_a_part(committed, tmp_path):
    certificate = read(committed)
    target = tmp_path / "certificate.json"
    target.write_text("old")
    certificate.write(target)
    assert read(target) == certificate
    with pytest.raises(FileError, match="a path to write to"):
        certificate.write(tmp_path / "none" / "certificate.json")
    with pytest.raises(FileError, match="a file to write to"):
        certificate.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["certificate.json"]
