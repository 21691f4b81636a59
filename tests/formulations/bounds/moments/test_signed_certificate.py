"""The certificate of an exclusion with signs of the columns proves it; changed ones do not."""

import json
from base64 import b64decode, b64encode
from copy import deepcopy
from math import nan

import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import conditions, verification
from lockedjoint.formulations.bounds.moments import (
    unit_revolute_bounds as null_vector_bound,
)
from lockedjoint.formulations.bounds.moments.certificate import read_any
from lockedjoint.formulations.bounds.moments.conditions import WITH_SIGNS
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import FileError
from tests.formulations.bounds.moments.test_null_vector import FEW

T, IMPOSSIBLE = 0.3265, -0.5
PARTS = ("sectors", "scaled", "spectral", *WITH_SIGNS)


@pytest.fixture(scope="module", autouse=True)
def impossible():
    """With δ₀ < 0, |s|² would be negative: small sums exclude it.

    One basis for all files, and sums that did not change are evaluated once.
    """
    made = {}
    basis, evaluated = verification.invariant_basis, verification._sector_sum

    def kept(key, make):
        if key not in made:
            made[key] = make()
        return made[key]

    def once(candidates, *arguments):
        key = candidates.astype(float).tobytes(), arguments[:3]
        return kept(key, lambda: basis(candidates, *arguments))

    def sums(certificate, rotations, number, name, squares):
        content = json.dumps([block.to_dict() for block in squares[1]])
        of = certificate.excluded, certificate.spectrum, rotations.astype(float).tobytes()
        key = (*of, name, squares[0], content)
        arguments = certificate, rotations, number, name, squares
        return number, kept(key, lambda: evaluated(*arguments)[1])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(null_vector_bound, "_SAMPLES", 120)
        patch.setattr(null_vector_bound, "_UNSIGNED_SAMPLES", 110)
        patch.setattr(conditions, "null_vector_deviation", lambda _: IMPOSSIBLE)
        patch.setattr(verification, "invariant_basis", once)
        patch.setattr(verification, "_sector_sum", sums)
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


def refuses(tmp_path, document):
    """Whether a file is refused in one sentence, or proves less than it states."""
    path = tmp_path / "bound.json"
    path.write_text(json.dumps(document))
    try:
        verify_bound(read_any(path))
    except (CertificateError, FileError) as error:
        said = str(error)
    else:
        return False
    assert len(said) < 400
    assert "\n" not in said
    return True


def blocks_of(document, part):
    return [block for sector in document[part] for block in sector["blocks"]]


def scale(block, factor, place=slice(None)):
    matrix = np.frombuffer(b64decode(block["factor"])).copy()
    matrix[place] *= factor
    block["factor"] = b64encode(matrix.tobytes()).decode()


def test_it_has_all_kinds_of_sums_and_other_points_prove_it_as_well(document, tmp_path):
    assert set(PARTS) < set(document)
    assert all(blocks_of(document, part) for part in ("spectral", "near", "gram"))
    (tmp_path / "bound.json").write_text(json.dumps(document))
    read = read_any(tmp_path / "bound.json")
    first, second = (verify_bound(read, rng=seed).check["margin"] for seed in (1, 2))
    assert first != second
    assert max(first, second) < 0


@pytest.mark.parametrize("part", PARTS)
def test_sums_of_other_sizes_are_rejected(part, document, tmp_path):
    """All blocks of a condition, or single ones; those too small to matter do not count."""
    rng = np.random.default_rng(PARTS.index(part))
    rejected = 0
    for factor in (0.0, 0.5, 1.5, 10.0, 1e4):
        changed = deepcopy(document)
        for block in blocks_of(changed, part):
            scale(block, factor)
        rejected += refuses(tmp_path, changed)
    for _ in range(10):
        changed = deepcopy(document)
        blocks = blocks_of(changed, part)
        if blocks:
            scale(blocks[rng.integers(len(blocks))], 1e4)
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
