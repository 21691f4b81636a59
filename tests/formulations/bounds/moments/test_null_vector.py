"""Every condition with the signs of the null vector holds at configurations at their own t."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from lockedjoint.formulations.bounds.moments import (
    conditions,
    sampled_blocks,
    unit_revolute_bounds,
)
from lockedjoint.formulations.bounds.moments.moment_program import (
    moment_program,
    penalised_program,
)
from lockedjoint.formulations.bounds.moments.predictor_corrector import (
    solve_with_predictor_corrector,
)
from lockedjoint.formulations.bounds.moments.rotations import jacobians_of
from lockedjoint.formulations.bounds.moments.row_sectors import (
    RowSector,
    degree_sectors,
    unsigned_sectors,
)
from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import MAX_MIN
from lockedjoint.formulations.bounds.revolute_exclusions import largest_residual
from lockedjoint.formulations.bounds.spectral_limit import (
    CUBIC,
    spectral_limit,
    suggested_spectrum,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.errors import InputError
from tests.formulations.bounds.moments import made_rotations as so3

SMALL = {
    "spectral": (RowSector(1, 1, 1, 3),),
    "near": unsigned_sectors(2, range(2)),
    "unsigned_scaled": unsigned_sectors(1, range(2)),
    "gram": sum((unsigned_sectors(k, range(2), locked=True) for k in (2, 1)), ()),
    "deviation": unsigned_sectors(2, range(2), locked=True),
}


def signs_by_null_vector(rotations):
    """Turn the columns (v; ω) of rotations (configurations, 7, 3, 3) to n_f ≥ 0."""
    null = np.linalg.svd(jacobians_of(rotations))[2][:, -1, :]
    turned = rotations.copy()
    turned[..., :2] *= np.where(null < 0, -1.0, 1.0)[..., None, None]
    return turned


def near(rotations, distance, seed):
    """Turn every joint by a random angle of about the distance, and flip random columns."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(distance * rng.standard_normal((7, 3))).as_matrix()
    turned = turns @ rotations[0]
    turned[..., :2] *= rng.choice([-1.0, 1.0], (7, 1, 1))
    return turned[None]


def configurations(attained):
    """Return random configurations, and some near the best known one."""
    scattered = list(so3.haar_rotations(11, 3, 7)[:, None])
    return scattered + [near(attained, d, k) for k, d in enumerate((0, 1e-3, 0.03, 0.1, 0.3))]


def lowest(where, t):
    known = conditions.worst_case_conditions(7, t, suggested_spectrum(t))
    return min(
        float(np.linalg.eigvalsh(block[0])[0])
        for family in sampled_blocks.condition_families(SMALL, 7, known)
        for block in family.evaluate(where)
    )


def test_all_conditions_hold_at_their_own_worst_case(attained):
    for where in configurations(attained[0]):
        assert lowest(signs_by_null_vector(where), so3.worst_case(where[0]) - 1e-9) > -1e-9


def test_other_signs_and_a_larger_worst_case_do_not_meet_them(attained):
    where = signs_by_null_vector(attained[0])
    assert lowest(where, 0.333) < -1e-3
    where[0, 3, :, :2] *= -1
    assert lowest(where, attained[1] - 1e-9) < -0.1


def test_the_deviation_is_bounded_by_the_worst_case(attained):
    """7 − (Σn_f)² = sᵀM⁻¹s ≤ δ₀, and n_f² ≥ t/(2 + t)."""
    for where in configurations(attained[0]):
        (jacobian,) = jacobians_of(signs_by_null_vector(where))
        null = np.abs(np.linalg.svd(jacobian)[2][-1])
        total, t = jacobian.sum(axis=1), so3.worst_case(where[0])
        spread = total @ np.linalg.solve(jacobian @ jacobian.T, total)
        assert spread == pytest.approx(7 - null.sum() ** 2, abs=1e-9)
        assert spread <= conditions.null_vector_deviation(t)
        assert null.min() ** 2 >= t / (2 + t) - 1e-12


@pytest.mark.parametrize("t", [0.3, 0.327, 0.3275])
def test_the_condition_on_the_spectrum_is_true_and_nearly_sharp(t):
    """Spectra scaled to t Σ 1/(λ − t) = 1, by bisection."""
    mean = 7 / 3 - t
    values = []
    directions = list(np.random.default_rng(4).standard_normal((200, 6)))
    # Two values: k eigenvalues above the mean.
    directions += [np.where(np.arange(6) < k, 1.0, -1.0) for k in range(1, 6)]
    for direction in directions:
        shape = direction - direction.mean()
        low, high = 0.0, mean / -shape.min()
        for _ in range(60):
            middle = (low + high) / 2
            allowed = t * np.sum(1 / (mean + middle * shape)) <= 1
            low, high = (middle, high) if allowed else (low, middle)
        e = low * shape
        values.append(np.sum(0.5 * e**2 - CUBIC * e**3))
    limit = spectral_limit(t, suggested_spectrum(t))
    assert 0.9 * limit < max(values) <= limit


@pytest.mark.parametrize("change", [(-1e-4, 0, 0), (0, -1e-2, 0), (0, 0, -1e-3), (0, 0.5, 0)])
def test_a_condition_on_the_spectrum_that_is_not_true_is_not_proved(change):
    t = 0.3275
    wrong = tuple(x + y for x, y in zip(suggested_spectrum(t), change, strict=True))
    with pytest.raises(InputError, match="spectrum"):
        spectral_limit(t, wrong)
    with pytest.raises(InputError, match="spectrum"):
        spectral_limit(t, (10.0, 0.0, -1e-9))


FEW = {
    "sectors": tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
    "scaled": tuple(degree_sectors(2, range(3))),
    "unsigned": unsigned_sectors(2, range(3)) + unsigned_sectors(1, range(2)),
    "near": unsigned_sectors(1, range(2)),
    "unsigned_scaled": (RowSector(None, 0, 0, 0),),
    "gram": (RowSector(None, 0, 0, 0, 0), *unsigned_sectors(1, range(2), locked=True)),
    "deviation": (RowSector(None, 0, 0, 0, 0),),
}


def test_a_small_program_does_not_exclude_what_is_attained(monkeypatch):
    """tests/…/test_signed_certificate.py excludes what is impossible."""
    monkeypatch.setattr(unit_revolute_bounds, "_SAMPLES", 120)
    monkeypatch.setattr(unit_revolute_bounds, "_UNSIGNED_SAMPLES", 110)
    with pytest.raises(CertificateError, match="is not excluded"):
        unit_revolute_bounds.exclude_with_signs(0.3265, FEW)


def test_joined_spaces_give_the_bound_of_one_space():
    """Functions 1, a, b and 1, a, c: the joined program distinguishes 1, a, b, c."""
    rng = np.random.default_rng(0)
    a, b, c = rng.uniform(-1, 1, (3, 40))

    def two(x, y):
        """Return [[1 + x, y], [y, 1 − x]], and so x² + y² ≤ 1."""
        return np.stack([np.stack([1 + x, y], -1), np.stack([y, 1 - x], -1)], -1)

    first, second = [two(a, b)], [two(a, c), (a - 1.5)[:, None, None]]
    joined = moment_program([first, second], a, common=[(1 + a)[:, None, None]])
    assert joined.moments == 4
    together = moment_program([[*first, *second]], a)
    for program in (joined, together):
        raised = penalised_program(program, 1e3)
        outcome = solve_with_predictor_corrector(raised, gap=1e-9)
        # Blocks ⪰ −v at the price v/shift: a ≤ 1 + v and a ≥ 1.5 − v, so v = 1/4, a = 5/4.
        price = 1e3 / raised.blocks[-2][-1, 0, 0]
        found = 1e3 * raised.dual_value(outcome.multipliers)
        assert found == pytest.approx(1.25 + price / 4, rel=1e-6)


def test_the_sign_of_one_column_matters():
    here = so3.haar_rotations(1, 1, 7)
    flipped = here.copy()
    flipped[0, 2, :, :2] *= -1
    for family in (
        sampled_blocks.BlockFamily(RowSector(None, 1, 1, 3), 7),
        sampled_blocks.BlockFamily(RowSector(None, 2, 1, 2, 0), 7, conditions.gram_form(0.3)),
    ):
        pairs = zip(family.evaluate(here), family.evaluate(flipped), strict=True)
        assert max(np.abs(a - b).max() for a, b in pairs) > 1e-3


def test_limits_of_the_spectrum_against_a_search():
    t, joints = 0.32, 7

    def slack(eigenvalues):
        return (joints - 6) / t - float(np.sum(1 / (eigenvalues - t)))

    def size(eigenvalues):
        return -0.5 * np.sum((eigenvalues - joints / 3) ** 2)

    limits = [{"type": "ineq", "fun": slack}]
    limits.append({"type": "eq", "fun": lambda x: np.sum(x) - 2 * joints})
    best = 0.0
    rng = np.random.default_rng(8)
    for _ in range(10):
        start = joints / 3 + 0.1 * rng.standard_normal(6)
        bounds = [(t + 0.05, None)] * 6
        found = minimize(size, start, constraints=limits, bounds=bounds, method="SLSQP")
        if found.success and slack(found.x) > -1e-8:
            best = max(best, -found.fun)
    assert largest_residual(joints, t) == pytest.approx(best, rel=1e-5)


def test_the_best_known_jacobian_meets_the_conditions_that_are_used(attained):
    where, t = attained
    assert t == pytest.approx(0.3265928, abs=1e-7)
    where = signs_by_null_vector(where)
    # t is a computed singular value: its last digits are uncertain. Plain blocks are squares.
    known = conditions.worst_case_conditions(7, t - 1e-9, suggested_spectrum(t - 1e-9))
    localisers = {name: own for name, own in MAX_MIN.items() if name in known}
    for family in sampled_blocks.condition_families(localisers, 7, known):
        for block in family.evaluate(where):
            assert np.linalg.eigvalsh(block[0])[0] > -1e-9

    # Those of a larger worst case are not met.
    kinds, one = product((2, 1), (0, 1)), range(1)
    sectors = [s for degree, odd in kinds for s in degree_sectors(degree, one, one, odd)]
    families = sampled_blocks.sector_families(sectors, 7, conditions.krylov_form(t + 0.1))
    found = [np.linalg.eigvalsh(b[0])[0] for one in families for b in one.evaluate(where)]
    assert min(found) < -1e-3
