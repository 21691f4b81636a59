from dataclasses import replace

import numpy as np
import pytest

from formulations.bounds.so3_moments.localisers import KrylovLocaliser, krylov_vectors
from formulations.bounds.so3_moments.moment_program import margin_program
from formulations.bounds.so3_moments.relaxation import (
    identity_leftover,
    nearest_semidefinite,
    solve_relaxation,
)
from formulations.bounds.so3_moments.row_sectors import RowSector, degree_sectors
from formulations.bounds.so3_moments.worst_case_conditions import (
    CONDITIONS,
    WorstCaseConditions,
    condition_families,
)


def lowest_eigenvalue(families, where):
    return min(
        float(np.linalg.eigvalsh(block[0])[0])
        for family in families
        for block in family.evaluate(where)
    )


def test_without_polynomials_it_is_the_mean_form(so3):
    """The constant row is the mean of j_fᵀ(J_f J_fᵀ − tI)j_f over the joints, over |j_f|²."""
    (where,) = so3.haar_rotations(3, 1, 7)
    jacobian = so3.jacobian(where)
    forms = [
        jacobian[:, f] @ np.delete(jacobian, f, 1) @ np.delete(jacobian, f, 1).T
        @ jacobian[:, f] / 2 - 0.3
        for f in range(7)
    ]  # fmt: skip
    localiser = KrylovLocaliser(RowSector(0, 0, 0, 0, 0), 7, 0.3)
    (block,) = localiser.evaluate(where[None])
    np.testing.assert_allclose(block.ravel(), np.mean(forms))


def test_vectors_are_powers(so3):
    jacobian = so3.jacobian(so3.haar_rotations(3, 1, 7))
    vectors, kept = krylov_vectors(jacobian, 2)
    matrix = jacobian[0] @ jacobian[0].T * 3 / 7
    np.testing.assert_allclose(
        vectors[0, :, 2], matrix @ matrix @ jacobian[0, :, 2] / np.sqrt(2)
    )
    np.testing.assert_allclose(kept[0], np.delete(jacobian[0], 2, axis=1).T @ vectors[0])


def test_the_best_known_jacobian_meets_all_conditions(attained):
    where, t = attained
    assert t == pytest.approx(0.3265928, abs=1e-7)
    # t is a computed singular value: its last digits are uncertain. Plain blocks are squares.
    for family in condition_families(replace(CONDITIONS, plain=()), 7, t - 1e-9):
        for block in family.evaluate(where):
            assert np.linalg.eigvalsh(block[0])[0] > -1e-10


def test_conditions_of_a_larger_worst_case_are_not_met(attained):
    where, t = attained
    sectors = [
        sector
        for degree in (2, 1)
        for parity in (0, 1)
        for sector in degree_sectors(degree, range(1), range(1), parity)
    ]
    families = [
        [family for family in (KrylovLocaliser(s, 7, limit) for s in sectors) if family.rows]
        for limit in (t - 1e-9, t + 0.1)
    ]
    assert lowest_eigenvalue(families[0], where) > -1e-10
    assert lowest_eigenvalue(families[1], where) < -1e-3


class WrongSign(KrylovLocaliser):
    """J_f J_fᵀ + tI instead of J_f J_fᵀ − tI."""

    def evaluate(self, rotations):
        return KrylovLocaliser(self.sector, self.joints, -self.limit).evaluate(rotations)


@pytest.mark.parametrize(("kind", "caught"), [(KrylovLocaliser, False), (WrongSign, True)])
def test_a_wrong_sign_is_caught_by_the_plain_average(kind, caught, so3, plain):
    """The identity holds with the blocks as they are evaluated, right or wrong."""
    family = kind(RowSector(0, 0, 0, 0, 0), 5, 0.3)

    def sums(rotations):
        return np.asarray(family.evaluate(rotations)[0][:, 0, 0])

    where = so3.haar_rotations(7, 2, 5)
    assert identity_leftover([family], [np.eye(1)], 0.0, sums, where) < 1e-12
    leftover = np.abs(sums(where) - plain.plain_condition_sum(family, where, [np.eye(1)])).max()
    assert (leftover > 0.5) == caught


SMALL = WorstCaseConditions(
    plain=tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
    scaled=(RowSector(0, 0, 0, 4),),
    krylov=(RowSector(0, 0, 0, 2, 0), RowSector(1, 0, 0, 2, 1)),
)


def test_the_identity_of_an_exclusion_holds_with_the_plain_average(so3, plain):
    """Plain, scaled and Krylov blocks together, with the multipliers of the solver."""
    families = condition_families(SMALL, 7, 0.3265)
    rng = np.random.default_rng(0)
    solved = solve_relaxation(families, 7, rng, adapt=margin_program, gap=1e-8)
    cleaned = [nearest_semidefinite(x) for x in solved.multipliers]
    multipliers = [x / sum(np.trace(y) for y in cleaned) for x in cleaned]
    where = so3.haar_rotations(8, 1, 7)
    identity = replace(solved.sampled, objective=np.zeros(solved.sampled.moments))
    bound = identity.dual_value(multipliers)
    total, start = np.zeros(1), 0
    for family in families:
        own = multipliers[start : start + len(family.sizes)]
        start += len(own)
        total += plain.plain_condition_sum(family, where, own)
    np.testing.assert_allclose(-bound, total, atol=1e-6)
