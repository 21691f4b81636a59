import numpy as np
import pytest
from scipy.optimize import minimize

from formulations.bounds.closed_form import largest_residual
from formulations.bounds.so3_moments import GlobalBound, conditions, unit_revolute_bounds
from formulations.bounds.so3_moments.conditions import krylov_form, worst_case_conditions
from formulations.bounds.so3_moments.relaxation import solve_relaxation
from formulations.bounds.so3_moments.sampled_blocks import condition_families, sector_families
from formulations.bounds.so3_moments.unit_revolute_bounds import (
    CONDITIONS,
    exclude_worst_case,
    max_min_bound,
)
from formulations.bounds.so3_moments.wigner import RowSector, degree_sectors
from formulations.existence.certificate import CertificateError
from nlp.arrays import nearest_semidefinite
from tests.bounds.so3_moments import made_rotations as so3
from tests.bounds.so3_moments import plain_average as plain

SMALL = {
    "sectors": tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
    "scaled": (RowSector(0, 0, 0, 4), RowSector(2, 0, 0, 4)),
    "krylov": (RowSector(0, 0, 0, 2, 0), RowSector(1, 0, 0, 2, 1)),
}


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
    localisers = {name: own for name, own in CONDITIONS.items() if name != "sectors"}
    for family in condition_families(localisers, 7, worst_case_conditions(7, t - 1e-9)):
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
        sector_families(sectors, 7, krylov_form(limit)) for limit in (t - 1e-9, t + 0.1)
    ]
    assert lowest_eigenvalue(families[0], where) > -1e-10
    assert lowest_eigenvalue(families[1], where) < -1e-3


def test_the_identity_of_an_exclusion_holds_with_the_plain_average():
    """Plain, scaled and Krylov blocks together, with the multipliers of the solver."""
    families = condition_families(SMALL, 7, worst_case_conditions(7, 0.3265))
    rng = np.random.default_rng(0)
    solved = solve_relaxation(families, 7, rng, exclusion=True, gap=1e-8)
    cleaned = [nearest_semidefinite(x) for x in solved.multipliers]
    multipliers = [x / sum(np.trace(y) for y in cleaned) for x in cleaned]
    where = so3.haar_rotations(8, 1, 7)
    bound = solved.identity.dual_value(multipliers)
    total, start = np.zeros(1), 0
    limit = largest_residual(7, 0.3265)
    forms = {"scaled": plain.scaled(limit, 35 / 3), "krylov": plain.krylov(0.3265)}
    for family in families:
        own = multipliers[start : start + len(family.sizes)]
        start += len(own)
        total += plain.plain_condition_sum(family, where, own, forms.get(family.name))
    np.testing.assert_allclose(-bound, total, atol=1e-6)


def test_what_is_attained_is_not_excluded():
    messages: list[str] = []
    margin, evidence = exclude_worst_case(0.3265, SMALL, progress=messages.append)
    assert margin >= 0
    assert evidence["check"]["fresh_configurations"] == 40
    assert messages


def test_limits_of_the_spectrum_against_a_search():
    t, joints = 0.32, 7

    def slack(eigenvalues):
        return (joints - 6) / t - float(np.sum(1 / (eigenvalues - t)))

    best = 0.0
    rng = np.random.default_rng(8)
    for _ in range(10):
        found = minimize(
            lambda x: -0.5 * np.sum((x - joints / 3) ** 2),
            joints / 3 + 0.1 * rng.standard_normal(6),
            constraints=[
                {"type": "ineq", "fun": slack},
                {"type": "eq", "fun": lambda x: np.sum(x) - 2 * joints},
            ],
            bounds=[(t + 0.05, None)] * 6,
            method="SLSQP",
        )
        if found.success and slack(found.x) > -1e-8:
            best = max(best, -found.fun)
    assert largest_residual(joints, t) == pytest.approx(best, rel=1e-5)


def test_a_gap_points_the_right_way():
    below = GlobalBound("residual", 7, "tight", "numerical", 0.05, 0.06)
    above = GlobalBound("max-min", 7, "localised", "numerical", 0.6, 0.5)
    assert below.gap == pytest.approx(0.01)
    assert above.gap == pytest.approx(0.1)
    assert GlobalBound("residual", 7, "tight", "numerical", 0.05, None).gap is None


def test_an_exclusion_needs_a_negative_margin(monkeypatch):
    """With conditions that exclude nothing the plain bound is reported."""
    monkeypatch.setattr(unit_revolute_bounds, "CONDITIONS", SMALL)
    result = max_min_bound("localised")
    assert result.kind == "closed form"
    assert result.bound == pytest.approx(np.sqrt(1 / 3), abs=1e-9)
    assert result.check["margin"] > -1e-6
    assert result.gap is not None
    assert result.gap_percent == pytest.approx(100 * result.gap / result.bound)
    with pytest.raises(CertificateError):
        max_min_bound("localised", rigorous=True)


def test_an_impossible_worst_case_is_excluded(monkeypatch):
    """ρ ≤ 5n²/3 always holds; J_f J_fᵀ ⪰ tI cannot, as |J_fᵀ j_f|²/|j_f|² ≤ 2(n − 1) < t."""
    monkeypatch.setattr(conditions, "largest_residual", lambda *_: 90.0)
    margin, evidence = exclude_worst_case(30.0, SMALL)
    assert margin < -1
    assert evidence["check"]["leftover"] < 1e-6
