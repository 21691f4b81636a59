"""The certificate of a bound proves what it states; whatever is done to it proves no more."""

import json
import subprocess
import sys
from base64 import b64decode, b64encode
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formulations.bounds.closed_form import root_above
from formulations.bounds.so3_moments import certificate as format_module
from formulations.bounds.so3_moments import (
    residual_bound,
    sampled_blocks,
    verification,
    worst_case_conditions,
)
from formulations.bounds.so3_moments.certificate import (
    BoundCertificate,
    IllFormedError,
    read_any,
)
from formulations.bounds.so3_moments.certifying import search_certificate
from formulations.bounds.so3_moments.enclosed_sums import enclosed_residuals
from formulations.bounds.so3_moments.max_min_bound import (
    EXCLUDED,
    prove_exclusion,
    solve_exclusion,
    without_objective,
)
from formulations.bounds.so3_moments.moment_program import MomentProgram
from formulations.bounds.so3_moments.relaxation import refined_multipliers, solve_relaxation
from formulations.bounds.so3_moments.residual_bound import RESIDUAL_PRESETS
from formulations.bounds.so3_moments.row_sectors import RowSector, degree_sectors
from formulations.bounds.so3_moments.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.verification import verify_bound
from formulations.bounds.so3_moments.wigner import random_rotations
from formulations.bounds.so3_moments.worst_case_conditions import (
    CONDITIONS,
    WorstCaseConditions,
    condition_families,
)
from formulations.bounds.so3_moments.young_basis import (
    first_tableau,
    projected_tableaux,
    young_bases,
)
from formulations.existence.certificate import Certificate, CertificateError
from formulations.existence.exact_jacobian import ExactJacobian
from nlp.errors import FileError

ROOT = Path(__file__).parents[3]
Change = Callable[[dict[str, Any]], object]


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
        key = candidates.tobytes()
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
    assert found.squares == sum(
        block.factor.shape[1] for _, blocks in certificate.sectors for block in blocks
    )


def test_the_proof_holds_at_other_points(certificate):
    first, second = (verify_bound(certificate, rng=seed).bound for seed in (1, 2))
    assert first != second
    assert min(first, second) >= certificate.bound


def test_other_factors_and_orders_prove_the_same(certificate):
    """L is replaced by LQ, and the rows of a block by another order."""
    rng = np.random.default_rng(3)

    def turned(block):
        squares = block.factor.shape[1]
        q = np.linalg.qr(rng.standard_normal((squares, squares)))[0]
        parts = [block.factor[place.start : place.stop] @ q for place in block.columns]
        factor = np.vstack(parts[::-1])
        return replace(block, rows=block.rows[::-1], factor=factor)

    other = replace(
        certificate,
        sectors=tuple((s, tuple(map(turned, blocks))) for s, blocks in certificate.sectors),
    )
    bounds = [verify_bound(one).bound for one in (certificate, other)]
    assert bounds[0] == pytest.approx(bounds[1], abs=1e-10)


@pytest.mark.parametrize("sector", [RowSector(2, 0, 1, 4), RowSector(4, 2, 0, 4)])
def test_projectors_are_those_of_the_bases(sector):
    """P from eigenvectors and P from averages over permutations are the same."""
    for entry in SectorBlocks(sector, 6).rows:
        places = entry.places
        exchanges = {j: entry.exchange(j) for place in places for j in place[:-1]}
        for shapes, bases in young_bases(exchanges, places).items():
            start = first_tableau(shapes)
            columns = range(min(3, entry.length))
            found = projected_tableaux(columns, exchanges, places, shapes)
            for own, basis in zip(found, bases, strict=True):
                assert own == pytest.approx(basis @ bases[start].T[:, list(columns)], abs=1e-12)


def test_nothing_is_shared_with_the_search(certificate, monkeypatch, tmp_path):
    code = (
        "import sys, formulations.bounds.so3_moments.verification;"
        "print(*(m for m in sys.modules if m.startswith(('cvxpy', 'clarabel', 'casadi')) or"
        " m.startswith('formulations.')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT
    )
    loaded = {name.removeprefix("formulations.") for name in done.stdout.split()}
    room = "bounds.so3_moments"
    assert f"{room}.verification" in loaded
    for name in ("relaxation", "residual_bound", "certifying", "programs"):
        assert not any(one.startswith(f"{room}.{name}") for one in loaded)
    assert not any(one.startswith(("cvxpy", "clarabel", "casadi")) for one in loaded)

    def searched(*_, **__):
        raise AssertionError("the verifier must not sample blocks or find bases")

    monkeypatch.setattr(sampled_blocks, "adapted_rows", searched)
    monkeypatch.setattr(sampled_blocks.RowBlocks, "mean_squares", searched)
    path = tmp_path / "bound.json"
    path.write_text(certificate.to_json())
    assert verify_bound(read_any(path)).bound >= certificate.bound


def matrix_of(text):
    return np.frombuffer(b64decode(text), dtype="<f8").copy()


def text_of(matrix):
    return b64encode(matrix.astype("<f8").tobytes()).decode()


def at(document, *way):
    for step in way:
        document = document[step]
    return document


def put(*way_and_value):
    *way, key, value = way_and_value

    def change(document):
        at(document, *way)[key] = value

    return change


def without(*way):
    *before, key = way
    return lambda document: at(document, *before).pop(key)


def twice(*way, times=1):
    return lambda document: at(document, *way).extend(at(document, *way)[:1] * times)


def entries(*way_and_change):
    """Change the entries of a matrix."""
    *way, key, changed = way_and_change

    def change(document):
        matrix = matrix_of(at(document, *way)[key])
        changed(matrix)
        at(document, *way)[key] = text_of(matrix)

    return change


def setting(place, value):
    def change(matrix):
        matrix[place] = value

    return change


def scaled(factor):
    def change(matrix):
        matrix *= factor

    return change


BLOCK = ("sectors", 0, "blocks", 0)
ROWS = (*BLOCK, "rows", 0)
ILL_FORMED: dict[str, Change] = {
    **{f"no {name}": without(name) for name in ("format", "joints", "bound", "sectors")},
    **{f"no {name} of a block": without(*BLOCK, name) for name in ("shapes", "factor", "rows")},
    **{f"no {name} of rows": without(*ROWS, name) for name in ("labels", "pivots")},
    "no constant": without("constant"),
    "unknown key": put("solver", "CLARABEL"),
    "unknown key of a sector": put("sectors", 0, "locked", 1),
    "other format": put("format", "lockedjoint bound 1"),
    "other quantity": put("quantity", "worst-case"),
    "the other quantity": put("quantity", "max-min"),
    "key of the other quantity": put("krylov", []),
    "quantity is a list": put("quantity", []),
    "five joints": put("joints", 5),
    "ten joints": put("joints", 10),
    "joints not whole": put("joints", 6.0),
    "joints true": put("joints", True),
    "bound NaN": put("bound", float("nan")),
    "bound infinite": put("bound", -float("inf")),
    "bound huge": put("bound", -1e300),
    "bound a text": put("bound", "-1.0"),
    "constant NaN": put("constant", float("nan")),
    "sectors an object": put("sectors", {}),
    "a sector twice": twice("sectors"),
    "very many sectors": twice("sectors", times=10_000),
    "negative charge": put("sectors", 0, "charge", -2),
    "degree 8": put("sectors", 0, "degree", 8),
    "spin 4": put("sectors", 0, "spin", 4),
    "parity": put("sectors", 0, "odd", 1),
    "a block three times": twice("sectors", 0, "blocks", times=2),
    "no such shape": put(*BLOCK, "shapes", [[7], []]),
    "shape not whole": put(*BLOCK, "shapes", 1, [6.0]),
    "no such labels": put(*ROWS, "labels", [[[1, 1]], []]),
    "labels a number": put(*ROWS, "labels", 1),
    "pivot negative": put(*ROWS, "pivots", 0, -1),
    "pivot far away": put(*ROWS, "pivots", 0, 9_999),
    "pivot not whole": put(*ROWS, "pivots", 0, 0.0),
    "pivot true": put(*ROWS, "pivots", 0, True),
    "a pivot twice": twice(*ROWS, "pivots"),
    "no pivots": put(*ROWS, "pivots", []),
    "very many pivots": twice(*ROWS, "pivots", times=10_000),
    "pivots a number": put(*ROWS, "pivots", 10**12),
    "unknown key of rows": put(*ROWS, "basis", ""),
    "rows empty": put(*BLOCK, "rows", []),
    "rows twice": twice(*BLOCK, "rows"),
    "no squares": put(*BLOCK, "squares", 0),
    "more squares than columns": put(*BLOCK, "squares", 10_000),
    "factor cut": lambda d: put(*BLOCK, "factor", at(d, *BLOCK, "factor")[:-4])(d),
    "factor longer": lambda d: put(*BLOCK, "factor", at(d, *BLOCK, "factor") + "AAAA")(d),
    "factor not base64": lambda d: put(*BLOCK, "factor", "?" + at(d, *BLOCK, "factor")[1:])(d),
    "factor not ASCII": lambda d: put(*BLOCK, "factor", "é" + at(d, *BLOCK, "factor")[1:])(d),
    "factor a list": put(*BLOCK, "factor", [0.0]),
    "factor NaN": entries(*BLOCK, "factor", setting(0, float("nan"))),
    "factor infinite": entries(*BLOCK, "factor", setting(0, float("inf"))),
    "factor huge": entries(*BLOCK, "factor", setting(0, 1e200)),
}


@pytest.mark.parametrize("name", ILL_FORMED)
def test_ill_formed_files_are_refused_in_one_sentence(name, document, tmp_path):
    ILL_FORMED[name](document)
    with pytest.raises((IllFormedError, FileError)) as refused:
        read_any(written(tmp_path / "bound.json", document))
    assert refused.value.exit_status == 2
    assert len(str(refused.value)) < 400
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "text",
    [
        '{"quantity": 1',
        '{"quantity": 1, "quantity": 1}',
        "[" * 10**6,
        '{"quantity": [1' + ",1" * 10**6,
    ],
)
def test_what_is_no_json_or_too_complex_is_refused(text, tmp_path):
    path = tmp_path / "bound.json"
    path.write_text(text)
    with pytest.raises((IllFormedError, FileError)):
        read_any(path)


@pytest.mark.parametrize("depth", range(100, 1000, 100))
def test_deeply_nested_parts_are_refused(depth, certificate, tmp_path):
    path = tmp_path / "bound.json"
    nested = "[" * depth + "]" * depth
    for start in ('"joints": ', '"labels": '):
        before, after = certificate.to_json().split(start, 1)
        path.write_text(f'{before}{start}{nested}, "rest": {after}')
        with pytest.raises((IllFormedError, FileError)):
            read_any(path)


def test_too_large_a_file_is_refused(certificate, monkeypatch, tmp_path):
    path = tmp_path / "bound.json"
    path.write_text(certificate.to_json())
    monkeypatch.setattr(format_module, "FILE_BYTES", path.stat().st_size - 1)
    with pytest.raises(FileError, match="of at most"):
        read_any(path)


# The block that matters most: the residual is nearly its square.
MAIN = ("sectors", 1, "blocks", 4)


def reverse_factors(document):
    for sector in document["sectors"]:
        for block in sector["blocks"]:
            block["factor"] = text_of(matrix_of(block["factor"])[::-1])


def claim_more(document):
    document["bound"] += 0.01
    document["constant"] += 0.01


def other_pivots(document):
    """Take the row before each, where that is free."""
    for sector in document["sectors"]:
        for block in sector["blocks"]:
            for rows in block["rows"]:
                for place, pivot in enumerate(rows["pivots"]):
                    if pivot and pivot - 1 not in rows["pivots"]:
                        rows["pivots"][place] = pivot - 1


FALSE: dict[str, Change] = {
    "a larger bound": put("bound", 1e-3),
    "a larger constant": claim_more,
    "a smaller constant": lambda d: put("constant", d["constant"] - 0.01)(d),
    "other pivots": other_pivots,
    "one entry of a factor": entries(*MAIN, "factor", setting(0, 1.0)),
    "a factor of a factor": entries(*MAIN, "factor", scaled(0.99)),
    "a large factor": entries(*MAIN, "factor", scaled(1e4)),
    "factors reversed": reverse_factors,
    "a sector missing": without("sectors", 1),
    "no sectors": put("sectors", []),
    "no blocks": put("sectors", 1, "blocks", []),
}
STILL_TRUE: dict[str, Change] = {
    "a smaller bound": put("bound", -0.5),
    "signs of a factor": entries(*MAIN, "factor", scaled(-1.0)),
    "the last digits": entries(*MAIN, "factor", scaled(1 + 1e-13)),
    "sectors in another order": lambda d: d["sectors"].reverse(),
    "blocks in another order": lambda d: at(d, "sectors", 1, "blocks").reverse(),
}


@pytest.mark.parametrize("name", FALSE)
def test_squares_that_do_not_prove_the_bound_are_rejected(name, document, tmp_path):
    FALSE[name](document)
    read = read_any(written(tmp_path / "bound.json", document))
    with pytest.raises(CertificateError, match=r"prove only residual ≥ -?[0-9]") as rejected:
        verify_bound(read)
    assert rejected.value.exit_status == 1


@pytest.mark.parametrize("name", STILL_TRUE)
def test_changes_that_prove_it_as_well_are_accepted(name, document, tmp_path):
    STILL_TRUE[name](document)
    found = verify_bound(read_any(written(tmp_path / "bound.json", document)))
    assert found.claimed == document["bound"] <= found.bound <= 0


def test_random_changes_never_prove_too_much(document, tmp_path):
    """Isotropic 6R Jacobians exist: ρ ≥ c is false for every c > 0."""
    rng = np.random.default_rng(4)
    for _ in range(4):
        sector = document["sectors"][rng.integers(len(document["sectors"]))]
        block = sector["blocks"][rng.integers(len(sector["blocks"]))]
        size = rng.choice([-1, 1]) * 10.0 ** rng.integers(-9, 3)
        entry = int(rng.integers(block["squares"]))
        entries("factor", lambda m, entry=entry, size=size: m.__setitem__(entry, size))(block)
        document["constant"] += float(rng.uniform(0, 0.01))
        document["bound"] = 1e-9
        with pytest.raises(CertificateError, match="prove only"):
            verify_bound(read_any(written(tmp_path / "b.json", document)))


def committed(name):
    read = read_any(ROOT / "results" / "bounds" / "certificates" / f"{name}.json")
    assert isinstance(read, BoundCertificate)
    return read


@pytest.mark.parametrize("preset", RESIDUAL_PRESETS)
def test_committed_certificates_of_the_residual_are_well_formed(preset):
    read = committed(f"residual_{preset}")
    assert (read.quantity, read.joints) == ("residual", 7)
    assert 0.0566 < read.bound < read.constant < 0.0568265457
    assert {sector for sector, _ in read.sectors} <= set(RESIDUAL_PRESETS[preset])


def test_the_committed_certificate_of_max_min_is_well_formed():
    read = committed("max_min_localised")
    assert (read.quantity, read.joints, read.excluded) == ("max-min", 7, 0.3279)
    assert Fraction(read.excluded) <= Fraction(read.bound) ** 2 < Fraction(0.3279001)
    assert read.excluded == EXCLUDED["localised"]
    for part, sectors in (
        (read.sectors, CONDITIONS.plain),
        (read.scaled, CONDITIONS.scaled),
        (read.krylov, CONDITIONS.krylov),
    ):
        assert {sector for sector, _ in part} <= set(sectors)


def test_other_certificates_are_read_as_before():
    folder = ROOT / "results" / "existence"
    assert isinstance(read_any(folder / "certificate.json"), Certificate)
    assert isinstance(read_any(folder / "optimal_8.json"), ExactJacobian)


def test_residuals_are_enclosed():
    """Against rational arithmetic; quaternions are doubles."""
    rotations = random_rotations(np.random.default_rng(5), 4, 7, extended=True)
    quaternions = np.random.default_rng(5).standard_normal((4, 7, 4))
    found = enclosed_residuals(rotations)
    for value, error, joints in zip(found.values, found.errors, quaternions, strict=True):
        gram = [[Fraction(-7, 3) * (i == k) for k in range(6)] for i in range(6)]
        for quaternion in joints:
            w, x, y, z = map(Fraction, map(float, quaternion))
            v = (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y))
            omega = (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x))
            column = [c / (w * w + x * x + y * y + z * z) for c in (*v, *omega)]
            for i in range(6):
                for k in range(6):
                    gram[i][k] += column[i] * column[k]
        exact = sum(entry**2 for row in gram for entry in row) / 2
        assert abs(exact - Fraction(float(value))) <= Fraction(float(error))
        assert error < 1e-14 * value


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


def test_a_rigorous_bound_is_what_its_certificate_states(monkeypatch, tmp_path):
    few = degree_sectors(4, range(1), range(1))
    monkeypatch.setattr(residual_bound, "residual_preset", lambda _: few)
    path = tmp_path / "folder" / "bound.json"
    found = residual_bound.residual_bound(rigorous=True, joints=6, out=path)
    verified = verify_bound(read_any(path))
    assert verified.bound == found.check["verified"]
    assert -1e-5 < verified.claimed < verified.bound < found.check["constant"]
    assert (found.kind, found.bound) == ("rigorous", max(0.0, verified.claimed))
    with pytest.raises(FileError):
        residual_bound.residual_bound(rigorous=True, joints=6, out=tmp_path)


def test_nothing_is_reported_that_was_not_verified(monkeypatch, tmp_path):
    """With a constant that is 1 too large the solver claims ρ ≥ 1, where 0 is attained."""
    few = degree_sectors(4, range(1), range(1))
    monkeypatch.setattr(residual_bound, "residual_preset", lambda _: few)
    value = MomentProgram.dual_value
    monkeypatch.setattr(MomentProgram, "dual_value", lambda *given: value(*given) + 1)
    with pytest.raises(CertificateError, match="prove only"):
        residual_bound.residual_bound(rigorous=True, joints=6, out=tmp_path / "bound.json")
    assert not list(tmp_path.iterdir())


# --- max-min -------------------------------------------------------------------------------

IMPOSSIBLE, LIMIT = 30.0, 90.0
SMALL = WorstCaseConditions(
    plain=(RowSector(0, 0, 0, 4), RowSector(2, 0, 0, 4)),
    scaled=(RowSector(0, 0, 0, 2), RowSector(2, 0, 0, 2)),
    krylov=(RowSector(0, 0, 0, 2, 0), RowSector(1, 0, 0, 2, 1)),
)


@pytest.fixture(scope="module")
def exclusion():
    """σ² ≥ 30 is impossible for short columns, so small sums exclude it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worst_case_conditions, "largest_residual", lambda *_: LIMIT)
        families = condition_families(SMALL, 7, IMPOSSIBLE)
    solved = solve_exclusion(families, 7, np.random.default_rng(0))
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    constant = without_objective(solved).dual_value(multipliers)
    bound = root_above(Fraction(IMPOSSIBLE))
    return search_certificate(families, multipliers, constant, bound, 7, IMPOSSIBLE)


@pytest.fixture
def excluding(exclusion, monkeypatch):
    """Return the file of `exclusion`; the reader and the verifier allow so large a t."""
    limit = verification.largest_residual
    monkeypatch.setattr(format_module, "_largest_excluded", lambda _: IMPOSSIBLE)
    monkeypatch.setattr(
        verification, "largest_residual", lambda n, t: LIMIT if t > 1 else limit(n, t)
    )
    loaded: dict[str, Any] = json.loads(exclusion.to_json())
    return loaded


def test_an_exclusion_is_read_as_it_was_written_and_proves_its_bound(
    exclusion, excluding, tmp_path
):
    read = read_any(written(tmp_path / "bound.json", excluding))
    assert read.to_json() == exclusion.to_json()
    found = verify_bound(read)
    assert Fraction(found.claimed) >= Fraction(found.bound)
    assert 30 <= Fraction(found.bound) ** 2 < Fraction(30 + 1e-12)
    assert found.claimed == pytest.approx(30**0.5, abs=1e-8)
    assert -2 * read.constant < found.check["margin"] < -0.9 * read.constant
    assert found.check["excluded"] == IMPOSSIBLE
    assert found.check["defect"] < 1e-5 < 1 < read.constant


PARTS = ("sectors", "scaled", "krylov")
KRYLOV = ("krylov", 0, "blocks", 0)
ILL_FORMED_EXCLUSIONS: dict[str, Change] = {
    **{f"no {name}": without(name) for name in ("excluded", *PARTS)},
    **{f"{name} an object": put(name, {}) for name in PARTS},
    **{f"first of {name} twice": twice(name) for name in PARTS},
    **{f"very many {name}": twice(name, times=100) for name in PARTS},
    **{f"degree of {name}": put(name, 0, "degree", 6) for name in ("scaled", "krylov")},
    **{f"t is {t}": put("excluded", t) for t in (0.0, -1.0, 1e-9, 31.0, 1, "0.3", None)},
    "t NaN": put("excluded", float("nan")),
    "t infinite": put("excluded", float("inf")),
    "six joints": put("joints", 6),
    "the other quantity": put("quantity", "residual"),
    "locked joint of a plain sector": put("sectors", 0, "locked", 0),
    "locked joint of a scaled sector": put("scaled", 0, "locked", 0),
    "no locked joint": without("krylov", 0, "locked"),
    "locked joint null": put("krylov", 0, "locked", None),
    "parity of the locked joint": put("krylov", 0, "locked", 1),
    "locked is true": put("krylov", 0, "locked", True),
    "parity 2": put("krylov", 0, "locked", 2),
    "shapes without the locked joint": lambda d: at(d, *KRYLOV, "shapes").pop(0),
    "labels without the locked joint": lambda d: at(d, *KRYLOV, "rows", 0, "labels").pop(0),
    "too many squares": put(*KRYLOV, "squares", 1000),
    "factor cut": lambda d: put(*KRYLOV, "factor", at(d, *KRYLOV, "factor")[:-4])(d),
    "factor NaN": entries(*KRYLOV, "factor", setting(0, float("nan"))),
    "factor infinite": entries(*KRYLOV, "factor", setting(0, float("inf"))),
    "factor huge": entries(*KRYLOV, "factor", setting(0, 1e200)),
    "pivot far away": put(*KRYLOV, "rows", 0, "pivots", 0, 10**6),
}


@pytest.mark.parametrize("name", ILL_FORMED_EXCLUSIONS)
def test_ill_formed_exclusions_are_refused_in_one_sentence(name, excluding, tmp_path):
    ILL_FORMED_EXCLUSIONS[name](excluding)
    with pytest.raises((IllFormedError, FileError)) as refused:
        read_any(written(tmp_path / "bound.json", excluding))
    assert refused.value.exit_status == 2
    assert len(str(refused.value)) < 400
    assert "\n" not in str(refused.value)


def everywhere(name, change):
    """Change the factors of all blocks of a part."""

    def changed(document):
        for sector in document[name]:
            for block in sector["blocks"]:
                entries("factor", change)(block)

    return changed


def raised(name, amount):
    return lambda document: document.__setitem__(name, document[name] + amount)


FALSE_EXCLUSIONS: dict[str, Change] = {
    "a smaller bound": raised("bound", -1e-6),
    "a larger constant": raised("constant", 1.0),
    "a smaller constant": raised("constant", -1.0),
    "a negative constant": lambda d: put("constant", -d["constant"])(d),
    "a smaller t": put("excluded", 29.0),
    "a worst case that is attained": put("excluded", 0.3),
    **{f"{name} times 10": everywhere(name, scaled(10.0)) for name in PARTS[1:]},
    **{f"{name} 0": everywhere(name, scaled(0.0)) for name in PARTS[1:]},
    **{f"{name} large": everywhere(name, scaled(1e4)) for name in PARTS},
    **{f"no {name}": put(name, []) for name in PARTS[1:]},
    "nothing at all": lambda d: d.update(sectors=[], scaled=[], krylov=[]),
    "one entry of a factor": entries(*KRYLOV, "factor", setting(0, 9.0)),
    "scaled squares as plain ones": lambda d: d.update(sectors=d["scaled"], scaled=[]),
}


@pytest.mark.parametrize("name", FALSE_EXCLUSIONS)
def test_sums_that_do_not_exclude_the_worst_case_are_rejected(name, excluding, tmp_path):
    FALSE_EXCLUSIONS[name](excluding)
    read = read_any(written(tmp_path / "bound.json", excluding))
    with pytest.raises(CertificateError, match=r"prove only max-min ≤ [0-9.]+\.$") as rejected:
        verify_bound(read)
    assert rejected.value.exit_status == 1


def test_what_is_proved_instead_is_stated(excluding, tmp_path):
    """Eq. (6), or √t if only the claim is too sharp; both rounded up."""
    path, found = tmp_path / "bound.json", []
    for change in (raised("constant", 1.0), raised("bound", -1e-6)):
        document = json.loads(json.dumps(excluding))
        change(document)
        with pytest.raises(CertificateError) as rejected:
            verify_bound(read_any(written(path, document)))
        found.append(Fraction(float(str(rejected.value).split(" ≤ ")[-1].rstrip("."))))
    for square, bound in zip((Fraction(1, 3), Fraction(30)), found, strict=True):
        assert square <= bound**2 < square + Fraction(1, 10**12)


@pytest.mark.parametrize(
    "change",
    [
        raised("bound", 0.5),
        everywhere("krylov", scaled(-1.0)),
        everywhere("scaled", scaled(1 + 1e-12)),
        lambda document: document["krylov"].reverse(),
    ],
)
def test_other_files_prove_the_exclusion_as_well(change, excluding, tmp_path):
    change(excluding)
    found = verify_bound(read_any(written(tmp_path / "bound.json", excluding)))
    assert found.bound <= found.claimed == excluding["bound"]


def test_a_proof_of_exclusion_writes_its_certificate(excluding, monkeypatch, tmp_path):
    """At an attained worst case nothing is excluded, and nothing is written."""
    path = tmp_path / "folder" / "bound.json"
    with pytest.raises(CertificateError, match=r"not excluded|prove only"):
        prove_exclusion(0.3, SMALL, 7, out=path)
    assert not path.exists()
    monkeypatch.setattr(worst_case_conditions, "largest_residual", lambda *_: LIMIT)
    bound, evidence = prove_exclusion(IMPOSSIBLE, SMALL, 7, out=path)
    assert bound == excluding["bound"] == verify_bound(read_any(path)).bound
    assert evidence.check["margin"] < 0
    value = MomentProgram.dual_value
    monkeypatch.setattr(MomentProgram, "dual_value", lambda *given: value(*given) + 100)
    with pytest.raises(CertificateError, match="prove only"):
        prove_exclusion(IMPOSSIBLE, SMALL, 7)
    with pytest.raises(FileError):
        prove_exclusion(IMPOSSIBLE, SMALL, 7, out=tmp_path)
