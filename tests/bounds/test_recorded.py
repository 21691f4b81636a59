"""Files of many bounds: what `verify` proves of them again, and what it refuses."""

import json
from importlib.resources import files

import pytest

from formulations.bounds.recorded import is_proved_again, read_bounds
from formulations.bounds.so3_moments.certificate import read_any
from formulations.existence.certificate import CertificateError

PLANAR, TWO_POINT = (
    json.loads((files("formulations.bounds") / f"{name}.json").read_text("utf-8"))
    for name in ("planar", "two_point")
)
# The rows whose search is shortest, of both measures.
SHORT = [
    min((row for row in PLANAR if row["measure"] == measure), key=lambda row: row["nodes"])
    for measure in ("manipulability", "max-min")
]


def planar(row, **changes):
    """Return a row of branch and bound with other numbers, and the command for them."""
    new = row | changes
    flag = " --manipulability" if new["measure"] == "manipulability" else ""
    numbers = f"--joints {new['joints']} --locked {new['locked']} --level {new['level']!r}"
    return new | {"command": f"lockedjoint bound planar {numbers}{flag}"}


def two_point(row, limit):
    m, n = row["task_dimension"], row["joints"]
    return row | {
        "trace_limit": limit,
        "singular_value_bound": (n / m * (1 - m / limit)) ** 0.5,
    }


@pytest.mark.slow
def test_what_is_on_file_is_proved_again(tmp_path, lockedjoint):
    file = tmp_path / "some.json"
    file.write_text(json.dumps([SHORT[0], planar(SHORT[0], level=0.99 * SHORT[0]["level"])]))
    done = lockedjoint.here("verify", file, cwd=tmp_path)
    assert done.returncode == 1
    assert "[1] lockedjoint bound planar" in done.stderr
    assert "[0]" not in done.stderr
    file.write_text(json.dumps(TWO_POINT[:1]))
    assert (
        "proved, rounding errors included"
        in lockedjoint.here("verify", file, cwd=tmp_path).stdout
    )


@pytest.mark.parametrize("row", SHORT, ids=["manipulability", "max-min"])
@pytest.mark.parametrize("changes", [{"locked": -1}, {"joints": 1}], ids=["locked", "joints"])
def test_a_sharper_claim_is_not_proved(row, changes):
    """With fewer joints locked, or more joints, more would be left than the level."""
    more = {name: row[name] + change for name, change in changes.items()}
    [bound] = read_bounds([planar(row, nodes=50, **more)])
    assert not is_proved_again(bound)


@pytest.mark.parametrize("row", TWO_POINT[:3], ids=lambda row: row["command"][-24:])
def test_two_point_mutants_are_not_proved(row):
    m = row["task_dimension"]
    excess = row["trace_limit"] - m
    mutants = [two_point(row, m + excess * factor) for factor in (0.5, 0.99, 0.99999)]
    for k, block in enumerate(row["blocks"]):
        turned = [[-value for value in line] for line in block]
        mutants.append(row | {"blocks": [*row["blocks"][:k], turned, *row["blocks"][k + 1 :]]})
    mutants += [
        row | {"violation": 0.0},
        row | {"lift": [0.9 * value for value in row["lift"]]},
    ]
    assert not any(map(is_proved_again, read_bounds(mutants)))


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (SHORT[0] | {"level": 0.1}, "command"),
        (planar(SHORT[0], level=1), "level: 1 is not a decimal number"),
        (planar(SHORT[0], level=-1.0), "level: -1.0 is not above 0"),
        (planar(SHORT[0], locked=0), "locked: 0 is not 1"),
        (planar(SHORT[0], nodes=10**9), "nodes: "),
        (SHORT[0] | {"proved": False}, "proved: "),
        (SHORT[0] | {"kind": "numerical"}, "kind: "),
        (SHORT[0] | {"measure": []}, "measure: a list is not known"),
        (SHORT[0] | {"more": 1}, 'the key "more" is unknown'),
        (two_point(TWO_POINT[0], 1e9), "trace_limit: "),
        (TWO_POINT[0] | {"trace_limit": 5.0}, "singular_value_bound: "),
        (TWO_POINT[0] | {"blocks": [[[1.0, 2.0]]]}, "not square"),
        (TWO_POINT[0] | {"lift": [float("nan")]}, "lift: [0]: "),
        (3, "3 is not an object"),
    ],
)
def test_other_rows_are_refused(tmp_path, row, words):
    with pytest.raises(CertificateError) as caught:
        read_bounds([row])
    assert words in str(caught.value)
    assert str(caught.value).startswith("[0]: ")


def test_an_empty_list_is_refused(tmp_path):
    (tmp_path / "empty.json").write_text("[]")
    with pytest.raises(CertificateError, match="a list of 0 items"):
        read_any(tmp_path / "empty.json")
