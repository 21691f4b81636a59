"""The certificate of an exclusion with signs of the columns proves it; changed ones do not."""

import json
from copy import deepcopy
from math import nan

import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import conditions
from lockedjoint.formulations.bounds.moments import (
    unit_revolute_bounds as null_vector_bound,
)
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.moments.conditions import WITH_SIGNS
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from tests.formulations.bounds.moments.changed_certificates import (
    blocks_of,
    change_factor,
    evaluate_once,
    refuses,
)
from tests.formulations.bounds.moments.test_null_vector import FEW

T, IMPOSSIBLE = 0.3265, -0.5
PARTS = ("sectors", "scaled", "spectral", *WITH_SIGNS)


@pytest.fixture(scope="module", autouse=True)
def impossible():
    """With δ₀ < 0, |s|² would be negative: small sums exclude it.

    One basis for all files, and sums that did not change are evaluated once.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(null_vector_bound, "_SAMPLES", 120)
        patch.setattr(null_vector_bound, "_UNSIGNED_SAMPLES", 110)
        patch.setattr(conditions, "null_vector_deviation", lambda _: IMPOSSIBLE)
        evaluate_once(patch)
        yield


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("signed") / "bound.json"
    bound, evidence = null_vector_bound.exclude_with_signs(T, FEW, out=path)
    assert evidence["check"]["margin"] < 0
    found = verify_bound(read_any(path))
    assert bound == found.claimed
    assert path.read_text() == read_any(path).to_json()
    assert found.claimed == found.bound == pytest.approx(np.sqrt(T), abs=1e-12)
    return json.loads(path.read_text())


def test_it_has_all_kinds_of_sums_and_other_points_prove_it_as_well(document, tmp_path):
    assert set(PARTS) < set(document)
    assert all(blocks_of(document, part) for part in ("spectral", "near", "gram"))
    (tmp_path / "bound.json").write_text(json.dumps(document))
    read = read_any(tmp_path / "bound.json")
    first, second = (verify_bound(read, rng=seed).check["margin"] for seed in (0, 1))
    assert first != second
    assert max(first, second) < 0


@pytest.mark.parametrize("part", PARTS)
def test_sums_of_other_sizes_are_rejected(part, document, tmp_path):
    """All blocks of a condition, or single ones; those too small to matter do not count."""
    rng = np.random.default_rng(PARTS.index(part))
    rejected = 0
    for factor in (0.0, 0.5, 1.5, 10.0, 1e4):
        changed = document | {part: deepcopy(document[part])}
        for block in blocks_of(changed, part):
            change_factor(block, lambda matrix, factor=factor: factor * matrix)
        rejected += refuses(tmp_path, changed)
    for _ in range(10):
        changed = document | {part: deepcopy(document[part])}
        blocks = blocks_of(changed, part)
        if blocks:
            change_factor(blocks[rng.integers(len(blocks))], lambda matrix: 1e4 * matrix)
            rejected += refuses(tmp_path, changed)
    assert rejected >= (13 if part in ("spectral", "near", "unsigned") else 5)


@pytest.mark.parametrize("part", PARTS)
def test_what_is_not_in_the_format_is_refused(part, document, patched, tmp_path):
    wrong = {"degree": 9, "charge": -1, "locked": 1, "spin": 0.5}
    changes = [{part: ...}, {part: {}}, {part: lambda sectors: [*sectors, {}]}]
    changes.append({part: lambda sectors: sectors + 1000 * sectors[:1]})
    changes += [{f"{part}.0.{name}": value} for name, value in wrong.items()]
    for change in changes if document[part] else []:
        assert refuses(tmp_path, patched(document, change))


CLAIMS = {
    "bound": [0.5713],
    "constant": [1e3, -1.0],
    "excluded": [0.3, 0.32, 0.5, 0.0, -1.0, 1e-9, 1, "0.3", None, nan],
    "joints": [8],
    "quantity": ["residual"],
    "spectrum": [[0.0, 0.0, 0.0], [-2.0, 1.0], [-2.0, 1.0, -4.0], [1e3, 0.0, 0.0], "none"],
}
CLAIMS["spectrum"].append([nan, 1.0, 4.0])


@pytest.mark.parametrize(("key", "value"), [(k, v) for k, own in CLAIMS.items() for v in own])
def test_other_claims_are_rejected(key, value, document, tmp_path):
    assert refuses(tmp_path, document | {key: value})


def test_rows_of_one_space_are_none_of_the_other(document, tmp_path):
    for first, second in (("sectors", "unsigned"), ("near", "spectral"), ("gram", "deviation")):
        changed = deepcopy(document)
        changed[first], changed[second] = changed[second], changed[first]
        assert refuses(tmp_path, changed)
