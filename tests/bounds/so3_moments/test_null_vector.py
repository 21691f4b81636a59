"""Every condition with the signs of the null vector holds at configurations at their own t."""

from math import comb

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formulations.bounds.so3_moments import null_vector, null_vector_bound
from formulations.bounds.so3_moments.localisers import FormLocaliser
from formulations.bounds.so3_moments.moment_program import (
    MomentProgram,
    joined_program,
    margin_program,
    moment_program,
    penalised_program,
)
from formulations.bounds.so3_moments.null_vector import (
    UnsignedConditions,
    deviation_form,
    gram_form,
    krylov_form,
    null_vector_deviation,
    unsigned_families,
    unsigned_sectors,
)
from formulations.bounds.so3_moments.null_vector_bound import (
    concentrated_rotations,
    concentrating_weights,
    refined_interior_multipliers,
    units,
)
from formulations.bounds.so3_moments.predictor_corrector import solve_with_predictor_corrector
from formulations.bounds.so3_moments.relaxation import refined_multipliers
from formulations.bounds.so3_moments.row_sectors import (
    RowSector,
    UnsignedSector,
    degree_sectors,
)
from formulations.bounds.so3_moments.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.symmetric_rows import PermutedRows
from formulations.bounds.so3_moments.wigner import jacobians_of
from formulations.bounds.so3_moments.worst_case_conditions import (
    CUBIC,
    QUARTIC,
    WorstCaseConditions,
    spectral_distance,
    spectral_limit,
)

SMALL = UnsignedConditions(
    plain=(),
    near=unsigned_sectors(2, range(2)),
    scaled=unsigned_sectors(1, range(2)),
    spectral=unsigned_sectors(1, range(2)),
    gram=unsigned_sectors(2, range(2), locked=True)
    + unsigned_sectors(1, range(2), locked=True),
    krylov=unsigned_sectors(2, range(2), locked=True),
)


def signs_by_null_vector(rotations):
    """Turn the columns (v; ω) of rotations (configurations, 7, 3, 3) to n_f ≥ 0."""
    null = np.linalg.svd(jacobians_of(rotations))[2][:, -1, :]
    turned = rotations.copy()
    turned[..., :2] *= np.where(null < 0, -1.0, 1.0)[..., None, None]
    return turned


def worst_case(rotations):
    """Return the squared worst case of one configuration, by SVD."""
    (jacobian,) = jacobians_of(rotations)
    kept = [np.delete(jacobian, f, axis=1) for f in range(7)]
    return min(float(np.linalg.svd(j, compute_uv=False)[-1]) for j in kept) ** 2


def near(rotations, distance, seed):
    """Turn every joint by a random angle of about the distance, and flip random columns."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(distance * rng.standard_normal((7, 3))).as_matrix()
    turned = turns @ rotations[0]
    turned[..., :2] *= rng.choice([-1.0, 1.0], (7, 1, 1))
    return turned[None]


def configurations(attained, so3):
    """Return random configurations, and some near the best known one."""
    scattered = list(so3.haar_rotations(11, 3, 7)[:, None])
    return scattered + [near(attained, d, k) for k, d in enumerate((0, 1e-3, 0.03, 0.1, 0.3))]


def lowest(where, t, conditions=SMALL):
    return min(
        float(np.linalg.eigvalsh(block[0])[0])
        for family in unsigned_families(conditions, t)
        for block in family.evaluate(where)
    )


def test_all_conditions_hold_at_their_own_worst_case(attained, so3):
    for where in configurations(attained[0], so3):
        assert lowest(signs_by_null_vector(where), worst_case(where) - 1e-9) > -1e-9


def test_other_signs_and_a_larger_worst_case_do_not_meet_them(attained):
    where = signs_by_null_vector(attained[0])
    assert lowest(where, 0.333) < -1e-3
    where[0, 3, :, :2] *= -1
    assert lowest(where, attained[1] - 1e-9) < -0.1


def test_the_deviation_is_bounded_by_the_worst_case(attained, so3):
    """7 − (Σn_f)² = sᵀM⁻¹s ≤ δ₀, and n_f² ≥ t/(2 + t)."""
    for where in configurations(attained[0], so3):
        (jacobian,) = jacobians_of(signs_by_null_vector(where))
        null = np.abs(np.linalg.svd(jacobian)[2][-1])
        total, t = jacobian.sum(axis=1), worst_case(where)
        spread = total @ np.linalg.solve(jacobian @ jacobian.T, total)
        assert spread == pytest.approx(7 - null.sum() ** 2, abs=1e-9)
        assert spread <= null_vector_deviation(t)
        assert null.min() ** 2 >= t / (2 + t) - 1e-12


def test_the_condition_on_the_spectrum_holds_at_each_own_worst_case(attained, so3):
    for where in configurations(attained[0], so3):
        t = worst_case(where)
        for pair in (*CUBIC, *QUARTIC[::5]):
            limit = spectral_limit(t, *pair)
            assert spectral_distance(limit, *pair, where) > -1e-9


@pytest.mark.parametrize(("beta", "gamma"), [(0.1, 0.0), (0.25, 0.0), (0.4, -0.1), (0.0, 0.2)])
def test_the_condition_on_the_spectrum_is_true_and_nearly_sharp(beta, gamma):
    """Spectra scaled to t Σ 1/(λ − t) = 1, by bisection."""
    t = 0.327
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
        values.append(np.sum(0.5 * e**2 - beta * e**3 - gamma * e**4))
    limit = spectral_limit(t, beta, gamma)
    assert 0.9 * limit < max(values) <= limit


def test_samples_are_rotations_and_reach_small_sums():
    found = concentrated_rotations(np.random.default_rng(0), 24, 7)
    np.testing.assert_allclose(
        found @ found.swapaxes(-1, -2), np.tile(np.eye(3), (24, 7, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(found), 1)
    size = np.sum(jacobians_of(found).sum(axis=2) ** 2, axis=1)
    assert np.median(size) < 1
    assert size.min() < 0.01
    assert size.max() > 5
    weights = concentrating_weights(found)
    assert weights[size > 5].max() < 1e-2 < weights.max() <= 1


@pytest.mark.parametrize("semidefinite", [True, False])
def test_units_make_the_mean_size_the_unit_matrix(semidefinite):
    rng = np.random.default_rng(3)
    root = rng.standard_normal((9, 4, 4))
    block = root @ root.swapaxes(1, 2)
    block[:, :, 3] = block[:, 3] = 0
    weights = rng.uniform(size=9)
    signs = 1 if semidefinite else rng.choice([-1, 1], 9)[:, None, None]
    found = units(signs * block, weights, semidefinite=semidefinite)
    assert found.shape == (4, 3)
    mean = np.average(found.T @ block @ found, axis=0, weights=weights)
    np.testing.assert_allclose(mean, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("penalty", [1.0, 100.0])
def test_a_penalised_program_has_the_bound_of_the_program(penalty):
    """Minimise y under 0.5 + y ≥ 0 and −y ≥ 0; the start y = 0 is no interior point."""
    blocks = [np.array([0.5, 1.0])[:, None, None], np.array([0.0, -1.0])[:, None, None]]
    program = MomentProgram(np.array([0.0, 1.0]), tuple(blocks))
    outcome = solve_with_predictor_corrector(penalised_program(program, penalty), gap=1e-10)
    assert outcome.multipliers is not None
    multipliers = [penalty * x for x in outcome.multipliers[:-1]]
    assert np.abs(program.dual_residual(multipliers)).max() < 1e-6
    assert program.dual_value(multipliers) == pytest.approx(-0.5, abs=1e-6)


def test_nearly_dependent_functions_leave_no_residual():
    """Two functions differ by 1e-7 of a third: normal equations lose the difference."""
    rng = np.random.default_rng(6)
    blocks, exact, rough = [], [], []
    for size in (3, 4, 5):
        block = rng.standard_normal((6, size, size))
        block[2] = block[1] + 1e-7 * block[2]
        blocks.append(block + block.swapaxes(1, 2))
        exact.append(np.eye(size))
        rough.append(np.eye(size) + 0.02 * (block[5] + block[5].T))
    zero = MomentProgram(np.zeros(6), tuple(blocks))
    program = MomentProgram(np.append(0.0, -zero.dual_residual(exact)), tuple(blocks))
    fine = refined_interior_multipliers(program, rough)
    assert np.abs(program.dual_residual(fine)).max() < 1e-13
    assert min(np.linalg.eigvalsh(x)[0] for x in fine) > 0.1
    coarse = refined_multipliers(program, rough)
    assert np.abs(program.dual_residual(coarse)).max() > 1e-11


def test_weights_and_congruence_leave_the_bound():
    """The least a with a² ≤ 1 is −1, whatever the weights, and the units of the block."""
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-1, 1, (2, 30))
    block = np.stack([np.stack([1 + 0 * a, a], -1), np.stack([a, 1 + 0 * a], -1)], -1)
    other = np.stack([np.stack([1 + 0 * b, b], -1), np.stack([b, 1 + 0 * b], -1)], -1)
    common = [np.ones((30, 1, 1))]
    for weights in (None, rng.uniform(0.01, 1, 30)):
        program = joined_program([block], [other[:20]], common, weights=weights, objective=a)
        turned = program.congruent([np.array([[2.0, 1], [0, 3]]), np.eye(2)])
        outcome = solve_with_predictor_corrector(turned, gap=1e-9)
        assert outcome.multipliers is not None
        assert turned.dual_value(outcome.multipliers) == pytest.approx(-1, abs=1e-6)


@pytest.mark.parametrize(
    ("form", "written_out"),
    [
        (gram_form(0.3), lambda j, f: (np.delete(j, f, 1).sum(1) ** 2).sum() / 6 - 0.3),
        (
            krylov_form(0.3),
            lambda j, f: ((np.delete(j, f, 1).T @ j[:, f]) ** 2).sum() / 2 - 0.3,
        ),
        (
            deviation_form(0.01),
            lambda j, f: (
                (0.01 * ((j.T @ j[:, f]) ** 2).sum() - (j.sum(1) @ j[:, f]) ** 2) / 0.72
            ),
        ),
    ],
)
def test_without_polynomials_it_is_the_mean_form(form, written_out, so3):
    where = so3.haar_rotations(3, 1, 7)
    (jacobian,) = so3.jacobian(where)
    (block,) = FormLocaliser(UnsignedSector(0, 0, 0, True), 7, form).evaluate(where)
    assert callable(written_out)
    mean = np.mean([written_out(jacobian, f) for f in range(7)])
    np.testing.assert_allclose(block[0, 0, 0], mean)


@pytest.mark.parametrize("sector", [(1, 1, 3, False), (2, 1, 2, True), (1, 2, 3, True)])
def test_blocks_keep_all_symmetries_but_the_sign_of_one_column(sector, so3):
    one = UnsignedSector(*sector)
    family = FormLocaliser(one, 7, gram_form(0.3)) if one.locked else SectorBlocks(one, 7)
    here = so3.haar_rotations(1, 1, 7)
    rng = np.random.default_rng(2)
    frame = so3.haar_rotations(5, 1, 1)[0, 0]
    phase = Rotation.from_rotvec([0, 0, 0.7]).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    there = frame @ here[:, rng.permutation(7)] @ phase
    flipped = there.copy()
    flipped[0, 2, :, :2] *= -1
    changes = []
    for a, b, c in zip(*(family.evaluate(x) for x in (here, there, flipped)), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11)
        changes.append(np.abs(a - c).max())
    assert max(changes) > 1e-3


def test_the_plain_average_is_the_same_sum(so3, plain):
    family = SectorBlocks(UnsignedSector(1, 1, 3), 5)
    roots = [np.random.default_rng(size).standard_normal((size, size)) for size in family.sizes]
    multipliers = [root @ root.T for root in roots]
    where = so3.haar_rotations(5, 2, 5)
    blocks = family.evaluate(where)
    short = sum(np.tensordot(b, x, axes=2) for x, b in zip(multipliers, blocks, strict=True))
    found = plain.averaged_sum_of_squares(family, where, multipliers)
    np.testing.assert_allclose(found, short)


def test_joined_spaces_give_the_bound_of_one_space():
    """Functions 1, a, b and 1, a, c: the joined program distinguishes 1, a, b, c."""
    rng = np.random.default_rng(0)
    a, b, c = rng.uniform(-1, 1, (3, 40))

    def two(x, y):
        """Return [[1 + x, y], [y, 1 − x]], and so x² + y² ≤ 1."""
        return np.stack([np.stack([1 + x, y], -1), np.stack([y, 1 - x], -1)], -1)

    first, second = [two(a, b)], [two(a, c), (a - 1.5)[:, None, None]]
    joined = joined_program(first, second, [(1 + a)[:, None, None]])
    assert joined.moments == 4
    together = moment_program(a, [*first, *second])
    margins = []
    for program in (joined, together):
        outcome = solve_with_predictor_corrector(margin_program(program), gap=1e-9)
        assert outcome.multipliers is not None
        margins.append(margin_program(program).dual_value(outcome.multipliers))
    # a ≤ 1 − s from the blocks, a ≥ 1.5 + s from the last condition: s = −1/4.
    np.testing.assert_allclose(margins, 0.25, atol=1e-6)


def test_unsigned_rows_of_one_parity_pattern_are_those_of_the_signed_sectors():
    """Every row has some number of odd joints, so the numbers of plain rows agree."""

    def rows(sector):
        places = sector.places(7)
        sets = sector.label_sets(7)
        return sum(PermutedRows(labels, places, sector.spin).length for labels in sets)

    signed = sum(comb(7, k) * rows(RowSector(k, 2, 1, 4)) for k in (0, 2, 4))
    assert rows(UnsignedSector(2, 1, 4)) == signed


@pytest.mark.parametrize("deviation", [None, -0.5])
def test_a_small_program_excludes_what_is_impossible_and_not_what_is_attained(
    deviation, monkeypatch
):
    """A negative δ₀ asks for |s|² < 0."""
    monkeypatch.setattr(null_vector_bound, "_SAMPLES", 120)
    monkeypatch.setattr(null_vector_bound, "_UNSIGNED_SAMPLES", 110)
    if deviation is not None:
        monkeypatch.setattr(null_vector, "null_vector_deviation", lambda _: deviation)
    signed = WorstCaseConditions(
        plain=tuple(RowSector(k, c, 0, 4) for k in (0, 2, 4) for c in (0, 2)),
        scaled=tuple(degree_sectors(2, range(3))),
    )
    unsigned = UnsignedConditions(
        plain=unsigned_sectors(2, range(3)) + unsigned_sectors(1, range(2)),
        near=unsigned_sectors(1, range(2)),
        scaled=(UnsignedSector(0, 0, 0),),
        spectral=(UnsignedSector(0, 0, 0),),
        gram=(UnsignedSector(0, 0, 0, True), *unsigned_sectors(1, range(2), locked=True)),
        krylov=(UnsignedSector(0, 0, 0, True),),
    )
    margin, evidence = null_vector_bound.exclude_with_signs(0.3265, signed, unsigned, ())
    assert (evidence.status == "enough") == (deviation is not None)
    assert (margin < 0) == (deviation is not None)
    assert evidence.check["leftover"] < max(1e-5, -0.1 * margin)
