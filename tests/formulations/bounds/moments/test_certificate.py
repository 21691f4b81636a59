"""The certificate of a bound proves what it states; whatever is done to it proves no more."""

import json
from base64 import b64decode, b64encode
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import (
    sampled_blocks,
    unit_revolute_bounds,
    verification,
)
from lockedjoint.formulations.bounds.moments.certificate_reader import FILE_BYTES, read_any
from lockedjoint.formulations.bounds.moments.moment_program import (
    MomentProgram,
    refined_multipliers,
)
from lockedjoint.formulations.bounds.moments.relaxation import (
    search_certificate,
    solve_relaxation,
)
from lockedjoint.formulations.bounds.moments.rotations import random_rotations
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector, degree_sectors
from lockedjoint.formulations.bounds.moments.sampled_blocks import sector_families
from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import residual_bound
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import FileError

Changes = dict[str, Any]


@pytest.fixture(scope="module")
def certificate():
    """Six joints, rows of degree 4: ρ ≥ −1.6e-5, where 0 is attained."""
    families = sector_families(degree_sectors(4, range(1), range(1)), 6)
    solved = solve_relaxation(families, 6, np.random.default_rng(0), gap=1e-6)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    constant = solved.program.dual_value(multipliers)
    stated = round(constant - 1.5e-5, 8)
    return search_certificate(families, multipliers, constant, stated, 6)


@pytest.fixture
def document(certificate):
    loaded: dict[str, Any] = json.loads(certificate.to_json())
    return loaded


@pytest.fixture(scope="module", autouse=True)
def one_basis():
    """The basis does not depend on the file, and takes most of the time: made once."""
    made: dict[bytes, Any] = {}
    basis = verification.invariant_basis

    def once(candidates, *arguments):
        key = candidates.astype(float).tobytes()
        if key not in made:
            made[key] = basis(candidates, *arguments)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verification, "invariant_basis", once)
        yield


def written(path, document):
    path.write_text(json.dumps(document))
    return path


def test_it_is_read_as_it_was_written_and_proves_its_bound(certificate, tmp_path):
    path = tmp_path / "bound.json"
    path.write_text(certificate.to_json())
    read = read_any(path)
    assert read.to_json() == certificate.to_json()
    found = verify_bound(read)
    assert -1.6e-5 < found.claimed <= found.bound < 0
    assert found.claimed == certificate.bound
    blocks = [block for _, blocks in certificate.sums["sectors"] for block in blocks]
    assert found.squares == sum(block.factor.shape[1] for block in blocks)


def test_the_proof_holds_at_other_points(certificate):
    first, second = (verify_bound(certificate, rng=seed).bound for seed in (1, 2))
    assert first != second
    assert min(first, second) >= certificate.bound


def test_the_verifier_samples_no_blocks_and_finds_no_bases(certificate, monkeypatch, tmp_path):
    def searched(*_, **__):
        raise AssertionError("the verifier must not sample blocks or find bases")

    monkeypatch.setattr(sampled_blocks, "adapted_rows", searched)
    monkeypatch.setattr(sampled_blocks.BlockFamily, "evaluate", searched)
    path = tmp_path / "bound.json"
    path.write_text(certificate.to_json())
    assert verify_bound(read_any(path)).bound >= certificate.bound


def matrix_of(text):
    return np.frombuffer(b64decode(text), dtype="<f8").copy()


def text_of(matrix):
    return b64encode(matrix.astype("<f8").tobytes()).decode()


def setting(place, value):
    """Change an entry of a matrix."""

    def changed(text):
        matrix = matrix_of(text)
        matrix[place] = value
        return text_of(matrix)

    return changed


def scaled(factor):
    return lambda text: text_of(factor * matrix_of(text))


def twice(items):
    return [*items, items[0]]


BLOCK = "sectors.0.blocks.0"
ROWS = f"{BLOCK}.rows.0"
# How keys, lists and integers are read is tested in formulations/existence/test_reading.py too.
ILL_FORMED: dict[str, Changes] = {
    "no format": {"format": ...},
    "the other quantity": {"quantity": "max-min"},
    "key of the other quantity": {"krylov": []},
    "ten joints": {"joints": 10},
    "bound NaN": {"bound": float("nan")},
    "constant NaN": {"constant": float("nan")},
    "a sector twice": {"sectors": twice},
    "very many sectors": {"sectors": lambda sectors: 1000 * sectors},
    "degree 8": {"sectors.0.degree": 8},
    "no such shape": {f"{BLOCK}.shapes": [[7], []]},
    "no such labels": {f"{ROWS}.labels": [[[1, 1]], []]},
    "a pivot twice": {f"{ROWS}.pivots": twice},
    "no pivots": {f"{ROWS}.pivots": []},
    "rows empty": {f"{BLOCK}.rows": []},
    "no squares": {f"{BLOCK}.squares": 0},
    "more squares than columns": {f"{BLOCK}.squares": 10_000},
    "factor not base64": {f"{BLOCK}.factor": lambda text: "?" + text[1:]},
    "factor NaN": {f"{BLOCK}.factor": setting(0, float("nan"))},
    "factor huge": {f"{BLOCK}.factor": setting(0, 1e200)},
}


def require_refused(path):
    with pytest.raises((CertificateError, FileError)) as refused:
        read_any(path)
    assert len(str(refused.value)) < 400
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("changes", ILL_FORMED.values(), ids=ILL_FORMED)
def test_ill_formed_files_are_refused_in_one_sentence(changes, document, patched, tmp_path):
    require_refused(written(tmp_path / "bound.json", patched(document, changes)))


def test_a_file_that_is_too_large_or_too_deep_is_refused(certificate, tmp_path):
    path = tmp_path / "bound.json"
    path.write_text('{"quantity": 1}' + " " * FILE_BYTES)
    require_refused(path)
    nested = "[" * 900 + "]" * 900
    for start in ('"quantity": ', '"joints": ', '"bound": ', '"labels": ', '"factor": '):
        before, after = certificate.to_json().split(start, 1)
        path.write_text(f'{before}{start}{nested}, "rest": {after}')
        require_refused(path)


# The block that matters most: the residual is nearly its square.
MAIN = "sectors.1.blocks.4.factor"


def all_factors(change):
    """Change the factors of all blocks of some sectors."""

    def changed(sectors):
        return [
            {**one, "blocks": [{**b, "factor": change(b["factor"])} for b in one["blocks"]]}
            for one in sectors
        ]

    return changed


def reverse(items):
    return items[::-1]


def other_pivots(sectors):
    """Take the row before each, where that is free."""
    sectors = deepcopy(sectors)
    for rows in (rows for one in sectors for block in one["blocks"] for rows in block["rows"]):
        for place, pivot in enumerate(rows["pivots"]):
            if pivot and pivot - 1 not in rows["pivots"]:
                rows["pivots"][place] = pivot - 1
    return sectors


FALSE: dict[str, Changes] = {
    "a larger bound": {"bound": 1e-3},
    "a larger constant": dict.fromkeys(("bound", "constant"), lambda value: value + 0.01),
    "a smaller constant": {"constant": lambda value: value - 0.01},
    "other pivots": {"sectors": other_pivots},
    "one entry of a factor": {MAIN: setting(0, 1.0)},
    "a factor of a factor": {MAIN: scaled(0.99)},
    "a large factor": {MAIN: scaled(1e4)},
    "factors reversed": {"sectors": all_factors(lambda text: text_of(matrix_of(text)[::-1]))},
    "a sector missing": {"sectors.1": ...},
    "no sectors": {"sectors": []},
    "no blocks": {"sectors.1.blocks": []},
}
STILL_TRUE: dict[str, Changes] = {
    "a smaller bound": {"bound": -0.5},
    "signs of a factor": {MAIN: scaled(-1.0)},
    "the last digits": {MAIN: scaled(1 + 1e-13)},
    "sectors in another order": {"sectors": reverse},
    "blocks in another order": {"sectors.1.blocks": reverse},
}


def require_unproved(path, document):
    with pytest.raises(CertificateError, match=r"prove only residual ≥ -?[0-9]") as rejected:
        verify_bound(read_any(written(path, document)))
    assert rejected.value.exit_status == 1


@pytest.mark.parametrize("changes", FALSE.values(), ids=FALSE)
def test_sums_that_do_not_prove_the_bound_are_rejected(changes, document, patched, tmp_path):
    require_unproved(tmp_path / "bound.json", patched(document, changes))


@pytest.mark.parametrize("changes", STILL_TRUE.values(), ids=STILL_TRUE)
def test_changes_that_prove_it_as_well_are_accepted(changes, document, patched, tmp_path):
    changed = patched(document, changes)
    found = verify_bound(read_any(written(tmp_path / "bound.json", changed)))
    assert changed["bound"] == found.claimed <= found.bound


def test_random_changes_never_prove_too_much(document, tmp_path):
    """Isotropic 6R Jacobians exist: ρ ≥ c is false for every c > 0."""
    rng = np.random.default_rng(4)
    for _ in range(4):
        sector = document["sectors"][rng.integers(len(document["sectors"]))]
        block = sector["blocks"][rng.integers(len(sector["blocks"]))]
        size = rng.choice([-1, 1]) * 10.0 ** rng.integers(-9, 3)
        block["factor"] = setting(int(rng.integers(block["squares"])), size)(block["factor"])
        document["constant"] += float(rng.uniform(0, 0.01))
        document["bound"] = 1e-9
        require_unproved(tmp_path / "b.json", document)


def test_verify_and_bound_on_the_command_line(lockedjoint, document, tmp_path):
    written(tmp_path / "true.json", document)
    done = lockedjoint.here("verify", "true.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    stated = f"proved: ½‖JJᵀ − (n/3)I‖_F² ≥ {document['bound']} for every unit revolute 6R"
    assert stated in done.stdout
    written(tmp_path / "false.json", document | {"bound": 0.01})
    done = lockedjoint.here("verify", "false.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("Error: the file states residual ≥ 0.01, but its squares")
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_bound_is_what_its_certificate_states(monkeypatch, tmp_path):
    few = degree_sectors(4, range(1), range(1))
    monkeypatch.setattr(unit_revolute_bounds, "RESIDUAL", few)
    path = tmp_path / "folder" / "bound.json"
    found = residual_bound(6, out=path)
    verified = verify_bound(read_any(path))
    assert verified.bound == found["check"]["verified"]
    assert -1e-5 < verified.claimed < verified.bound < found["check"]["constant"]
    assert (found["kind"], found["bound"]) == ("rigorous", max(0.0, verified.claimed))
    assert json.loads(json.dumps(found)) == found
    with pytest.raises(FileError):
        residual_bound(6, out=tmp_path)
    # With a constant that is 1 too large the solver claims ρ ≥ 1, where 0 is attained.
    value = MomentProgram.dual_value
    monkeypatch.setattr(MomentProgram, "dual_value", lambda *given: value(*given) + 1)
    with pytest.raises(CertificateError, match="prove only"):
        residual_bound(6, out=tmp_path / "bound.json")
    assert not (tmp_path / "bound.json").exists()


def test_errors_are_as_small_as_the_certificate_on_record_needs():
    """Of one sector; where all are three times as large the bound is not proved any more."""
    record = Path(__file__).parents[4] / "results/bounds/certificates/residual_tight.json"
    certificate = read_any(record)
    sector = RowSector(2, 0, 0, 6)
    blocks = dict(certificate.sums["sectors"])[sector]
    rotations = random_rotations(np.random.default_rng(0), 2, 7, extended=True)
    alone = replace(certificate, sums={})
    _, found = verification._sector_sum(alone, rotations, 0, "sectors", (sector, blocks))
    assert np.all(found.errors < 2.5e-12 * found.sizes)
