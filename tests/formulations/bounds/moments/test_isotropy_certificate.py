"""The certificate of isotropic lever arms proves what it states; changed ones do not."""

import json
from copy import deepcopy
from math import nan, sqrt

import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import unit_revolute_bounds, verification
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.lever_conditions import lever_defect
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector, degree_sectors
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.bounds.revolute_exclusions import excludes_isotropic_levers
from tests.formulations.bounds.moments.changed_certificates import (
    blocks_of,
    change_factor,
    evaluate_once,
    refuses,
)

# What is added to the weighted residual, so that small sums have something to prove.
ADDED = 0.06
FEW = {
    "sectors": degree_sectors(4, range(3)),
    "turned": degree_sectors(2, range(2)),
    "aligned": (RowSector(0, 0, 0, 0),),
    "narrow": (RowSector(0, 0, 0, 0),),
}
PARTS = tuple(FEW)


def raised(jacobian):
    return lever_defect(jacobian) + EnclosedMatrix.exact([[ADDED]], jacobian)


@pytest.fixture(scope="module", autouse=True)
def impossible():
    """One basis for all files, and sums that did not change are evaluated once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unit_revolute_bounds, "ISOTROPY", FEW)
        patch.setattr(unit_revolute_bounds, "lever_defect", raised)
        patch.setitem(verification._OBJECTIVES, "isotropy", raised)
        evaluate_once(patch)
        yield


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("isotropy") / "bound.json"
    plain = unit_revolute_bounds.isotropy_bound(out=path)
    found = verify_bound(read_any(path))
    assert plain["bound"] == found.claimed
    assert found.bound <= found.claimed == pytest.approx(0.536, abs=2e-3)
    assert path.read_text() == read_any(path).to_json()
    proved = found.check["lever_defect"]
    assert ADDED - 2e-4 < proved < ADDED
    assert excludes_isotropic_levers(proved, found.bound)
    return json.loads(path.read_text())


def test_other_points_prove_it_as_well(document, tmp_path):
    (tmp_path / "bound.json").write_text(json.dumps(document))
    read = read_any(tmp_path / "bound.json")
    first, second = (verify_bound(read, rng=seed).check["lever_defect"] for seed in (0, 1))
    assert first != second
    assert excludes_isotropic_levers(min(first, second), document["bound"])


@pytest.mark.parametrize("part", PARTS)
def test_sums_of_other_sizes_are_rejected(part, document, tmp_path):
    """All blocks of a condition, or single ones."""
    rng = np.random.default_rng(PARTS.index(part))
    for factor in (0.5, 1.5, 10.0, 1e4):
        changed = document | {part: deepcopy(document[part])}
        for block in blocks_of(changed, part):
            change_factor(block, lambda matrix, factor=factor: factor * matrix)
        assert refuses(tmp_path, changed) or part == "aligned"
    for _ in range(25):
        changed = document | {part: deepcopy(document[part])}
        blocks = blocks_of(changed, part)
        block = blocks[rng.integers(len(blocks))]
        change_factor(block, lambda matrix: matrix + 30 * rng.standard_normal(len(matrix)))
        assert refuses(tmp_path, changed)


@pytest.mark.parametrize("part", PARTS)
def test_what_is_not_in_the_format_is_refused(part, document, patched, tmp_path):
    wrong = {"degree": 9, "charge": -1, "locked": 1, "spin": 0.5, "odd": 7}
    changes = [{part: ...}, {part: {}}, {part: lambda sectors: [*sectors, {}]}]
    changes.append({part: lambda sectors: sectors + 1000 * sectors[:1]})
    changes += [{f"{part}.0.{name}": value} for name, value in wrong.items()]
    for change in changes:
        assert refuses(tmp_path, patched(document, change))


CLAIMS = {
    "bound": [0.53, 0.4, 0.0, -1.0, nan, "0.6", None],
    "constant": [1e3, 0.07, 0.05, 0.0, -1.0, nan, "0.06"],
    "joints": [6, 8, 7.5, None],
    "quantity": ["residual", "max-min", "isotropic", "", None, []],
    "format": ["lockedjoint bound 1", 2],
    "excluded": [0.3],
    "sectors": [[], None],
}


@pytest.mark.parametrize(("key", "value"), [(k, v) for k, own in CLAIMS.items() for v in own])
def test_other_claims_are_rejected(key, value, document, tmp_path):
    assert refuses(tmp_path, document | {key: value})


def test_conditions_do_not_stand_for_each_other(document, tmp_path):
    changed = deepcopy(document)
    changed["turned"], changed["narrow"] = changed["narrow"], changed["turned"]
    assert refuses(tmp_path, changed)


def test_without_a_bound_on_the_residual_eq_6_is_what_is_left(document, tmp_path):
    """No sums prove that all is above a negative number, and eq. (6) needs no sum."""
    path = tmp_path / "bound.json"
    path.write_text(json.dumps(document | {"constant": -1e3, "bound": 0.5774}))
    assert verify_bound(read_any(path)).bound == pytest.approx(sqrt(1 / 3), abs=1e-9)
