from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from formulations.bounds.so3_moments.blocks.krylov_localisers import (
    KrylovLocaliser,
    KrylovSector,
    krylov_sectors,
    krylov_vectors,
)
from formulations.bounds.so3_moments.blocks.matrix_localisers import (
    LocaliserSector,
    MatrixLocaliser,
)
from formulations.bounds.so3_moments.blocks.plain_localisers import (
    averaged_krylov_sum,
    plain_condition_sum,
)
from formulations.bounds.so3_moments.fixed_worst_case import (
    Conditions,
    condition_families,
    exclude_worst_case,
)
from formulations.bounds.so3_moments.max_min_bound import CONDITIONS
from formulations.bounds.so3_moments.programs.identity_check import check_identity
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import rotations_of_jacobian
from nlp.errors import InputError

SECTORS = [(0, 0, 0, 4, 0), (2, 0, 1, 4, 0), (1, 2, 1, 4, 1), (2, 1, 2, 3, 1)]
ATTAINED = Path(__file__).parents[3] / "results" / "comparison" / "jacobians.json"


@pytest.fixture(scope="module")
def attained() -> tuple[Floats, float]:
    """Return the rotations of the best known 7R and its squared worst case, by SVD."""
    records = json.loads(ATTAINED.read_text(encoding="utf-8"))
    jacobians = [
        np.array(record["jacobian"])
        for record in records
        if record["formulation"] == "max-min" and record["model"] == "unit-revolute"
    ]

    def worst(jacobian: Floats) -> float:
        kept = [np.delete(jacobian, f, axis=1) for f in range(7)]
        return min(float(np.linalg.svd(j, compute_uv=False)[-1]) for j in kept)

    best = max(jacobians, key=worst)
    return rotations_of_jacobian(best)[None], worst(best) ** 2


def lowest_eigenvalue(families: list[KrylovLocaliser], where: Floats) -> float:
    return min(
        float(np.linalg.eigvalsh(block[0])[0])
        for family in families
        for block in family.evaluate(where)
    )


@pytest.mark.parametrize("sector", SECTORS)
def test_blocks_do_not_change_under_any_symmetry(
    sector: tuple[int, int, int, int, int], so3: SimpleNamespace
) -> None:
    localiser = KrylovLocaliser(KrylovSector(*sector), 7, 0.3)
    here = so3.haar_rotations(1, 1, 7)
    there = so3.moved(here[0], 2)[None]
    for a, b in zip(localiser.evaluate(here), localiser.evaluate(there), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11)


@pytest.mark.parametrize("sector", SECTORS)
def test_the_longer_road_leads_to_the_same_sum(
    sector: tuple[int, int, int, int, int], so3: SimpleNamespace
) -> None:
    family = KrylovLocaliser(KrylovSector(*sector), 5, 0.3)
    rng = np.random.default_rng(4)
    roots = [rng.standard_normal((size, size)) for size in family.sizes]
    multipliers = [root @ root.T for root in roots]
    where = so3.haar_rotations(5, 2, 5)
    short = sum(
        np.tensordot(block, x, axes=2)
        for x, block in zip(multipliers, family.evaluate(where), strict=True)
    )
    np.testing.assert_allclose(averaged_krylov_sum(family, where, multipliers), short)


def test_without_polynomials_it_is_the_mean_form(so3: SimpleNamespace) -> None:
    """The constant row is the mean of j_fᵀ(J_f J_fᵀ − tI)j_f over the joints, over |j_f|²."""
    (where,) = so3.haar_rotations(3, 1, 7)
    jacobian = so3.jacobian(where)
    forms = [
        jacobian[:, f] @ np.delete(jacobian, f, 1) @ np.delete(jacobian, f, 1).T
        @ jacobian[:, f] / 2 - 0.3
        for f in range(7)
    ]  # fmt: skip
    localiser = KrylovLocaliser(KrylovSector(0, 0, 0, 0, 0), 7, 0.3)
    (block,) = localiser.evaluate(where[None])
    np.testing.assert_allclose(block.ravel(), np.mean(forms))


def test_vectors_are_powers(so3: SimpleNamespace) -> None:
    jacobian = so3.jacobian(so3.haar_rotations(3, 1, 7))
    found = krylov_vectors(jacobian, 2)[0]
    matrix = jacobian[0] @ jacobian[0].T * 3 / 7
    np.testing.assert_allclose(found[:, 2], matrix @ matrix @ jacobian[0, :, 2] / np.sqrt(2))


def test_the_best_known_jacobian_meets_all_conditions(
    attained: tuple[Floats, float],
) -> None:
    where, t = attained
    assert t == pytest.approx(0.3265928, abs=1e-7)
    # t is a computed singular value: room for its last digits. Plain blocks are squares.
    for family in condition_families(replace(CONDITIONS, plain=()), 7, t - 1e-9):
        for block in family.evaluate(where):
            assert np.linalg.eigvalsh(block[0])[0] > -1e-10


def test_conditions_of_a_larger_worst_case_are_not_met(attained: tuple[Floats, float]) -> None:
    where, t = attained
    sectors = krylov_sectors(2, range(1), range(1))
    families = [
        [family for family in (KrylovLocaliser(s, 7, limit) for s in sectors) if family.rows]
        for limit in (t - 1e-9, t + 0.1)
    ]
    assert lowest_eigenvalue(families[0], where) > -1e-10
    assert lowest_eigenvalue(families[1], where) < -1e-3


class WrongSign(KrylovLocaliser):
    """J_f J_fᵀ + tI instead of J_f J_fᵀ − tI."""

    def evaluate(self, rotations: Floats) -> list[Floats]:
        weighted, unit = self.parts(rotations)
        return [a + self.limit * b for a, b in zip(weighted, unit, strict=True)]


@pytest.mark.parametrize(("kind", "caught"), [(KrylovLocaliser, False), (WrongSign, True)])
def test_a_wrong_sign_is_caught_by_the_second_way(
    kind: type[KrylovLocaliser], caught: bool, so3: SimpleNamespace
) -> None:
    """The identity holds with the blocks as they are evaluated, right or wrong."""
    family = kind(KrylovSector(0, 0, 0, 0, 0), 5, 0.3)

    def sums(rotations: Floats) -> Floats:
        return np.asarray(family.evaluate(rotations)[0][:, 0, 0])

    where = so3.haar_rotations(7, 2, 5)
    check = check_identity([family], [np.eye(1)], 0.0, sums, where, where, plain_condition_sum)
    assert check.leftover < 1e-12
    assert check.plain_leftover is not None
    assert (check.plain_leftover > 0.5) == caught
    assert (check.checked_bound < -0.5) == caught


def test_a_second_way_is_not_claimed_where_there_is_none() -> None:
    family = MatrixLocaliser(LocaliserSector(0, 1, 1, 0, 0), 7, ((1, 0.3),))
    with pytest.raises(TypeError):
        plain_condition_sum(family, np.broadcast_to(np.eye(3), (1, 7, 3, 3)), [np.eye(1)])


def test_what_is_attained_is_not_excluded() -> None:
    conditions = Conditions(
        plain=tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
        scaled=(RowSector(0, 0, 0, 4),),
        krylov=(KrylovSector(0, 0, 0, 2, 0), KrylovSector(1, 0, 0, 2, 1)),
    )
    result = exclude_worst_case(0.3265, conditions, 7)
    assert not result.excluded
    assert result.check["plain_average_configurations"] == 1
    assert result.check["plain_average_leftover"] < 1e-6


@pytest.mark.parametrize("values", [(0, 1, 0, 4, 0), (1, 0, 0, 4, 0), (0, 0, 0, 4, 2)])
def test_impossible_sectors_are_refused(values: tuple[int, int, int, int, int]) -> None:
    with pytest.raises(InputError):
        KrylovSector(*values)
