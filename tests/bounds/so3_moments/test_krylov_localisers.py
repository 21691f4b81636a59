from dataclasses import replace

import numpy as np
import pytest

from formulations.bounds.so3_moments.relaxation import (
    solve_relaxation,
)
from formulations.bounds.so3_moments.sampled_blocks import KrylovForm, sector_families
from formulations.bounds.so3_moments.wigner import RowSector, degree_sectors
from formulations.bounds.so3_moments.worst_case_conditions import (
    CONDITIONS,
    WorstCaseConditions,
    condition_families,
)
from nlp.arrays import nearest_semidefinite


def lowest_eigenvalue(families, where):
    return min(
        float(np.linalg.eigvalsh(block[0])[0])
        for family in families
        for block in family.evaluate(where)
    )


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
    families = [sector_families(sectors, 7, KrylovForm(limit)) for limit in (t - 1e-9, t + 0.1)]
    assert lowest_eigenvalue(families[0], where) > -1e-10
    assert lowest_eigenvalue(families[1], where) < -1e-3


SMALL = WorstCaseConditions(
    plain=tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
    scaled=(RowSector(0, 0, 0, 4),),
    krylov=(RowSector(0, 0, 0, 2, 0), RowSector(1, 0, 0, 2, 1)),
)


def test_the_identity_of_an_exclusion_holds_with_the_plain_average(so3, plain):
    """Plain, scaled and Krylov blocks together, with the multipliers of the solver."""
    families = condition_families(SMALL, 7, 0.3265)
    rng = np.random.default_rng(0)
    solved = solve_relaxation(families, 7, rng, exclusion=True, gap=1e-8)
    cleaned = [nearest_semidefinite(x) for x in solved.multipliers]
    multipliers = [x / sum(np.trace(y) for y in cleaned) for x in cleaned]
    where = so3.haar_rotations(8, 1, 7)
    bound = solved.identity.dual_value(multipliers)
    total, start = np.zeros(1), 0
    for family in families:
        own = multipliers[start : start + len(family.sizes)]
        start += len(own)
        total += plain.plain_condition_sum(family, where, own)
    np.testing.assert_allclose(-bound, total, atol=1e-6)
