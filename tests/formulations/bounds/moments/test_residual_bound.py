import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments import plain_values, relaxation
from lockedjoint.formulations.bounds.moments.moment_program import (
    ConicOutcome,
    OutsideSpanError,
    TooFewSamplesError,
    moment_program,
)
from lockedjoint.formulations.bounds.moments.predictor_corrector import (
    solve_with_predictor_corrector,
)
from lockedjoint.formulations.bounds.moments.relaxation import (
    SolverFailureError,
    residual_values,
    solve_relaxation,
)
from lockedjoint.formulations.bounds.moments.row_sectors import DEGREE_4, RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import sector_families
from lockedjoint.formulations.bounds.moments.solvers import solve_moments
from lockedjoint.formulations.existence.rings import optimal_jacobian
from lockedjoint.nlp.arrays import nearest_semidefinite
from tests.formulations.bounds.moments import made_rotations as so3
from tests.formulations.bounds.moments import plain_average as plain

LOW = [RowSector(k, c, spin, 4) for k in (0, 2, 4) for c in (0, 2) for spin in (0, 1)]


def evaluated(families, rotations):
    return [block for family in families for block in family.evaluate(rotations)]


def moments_of(program, blocks):
    """Return the pseudo-moments of one configuration from its blocks, and what is left over."""
    slopes = np.hstack([block[1:].reshape(program.moments - 1, -1) for block in program.blocks])
    here = np.hstack([block.ravel() for block in blocks])
    constant = np.hstack([block[0].ravel() for block in program.blocks])
    y = np.linalg.lstsq(slopes.T, here - constant, rcond=None)[0]
    return y, np.abs(slopes.T @ y + constant - here).max()


def negative_residual(rotations):
    """−ρ, whose smallest value −5n²/3 is reached where all columns are alike."""
    return -residual_values(rotations)


@pytest.fixture(scope="module")
def families():
    return sector_families(LOW, 7)


@pytest.fixture(scope="module")
def samples():
    return so3.haar_rotations(11, 160, 7)


@pytest.fixture(scope="module")
def program(families, samples):
    return moment_program([evaluated(families, samples)], negative_residual(samples))


@pytest.fixture(scope="module")
def answer(program):
    return solve_with_predictor_corrector(program)


def test_both_solvers_find_the_largest_residual(program, answer):
    general = solve_moments(program, "CLARABEL", gap=1e-9)
    assert answer.status == "optimal"
    assert general.status.startswith("optimal")
    for outcome in (answer, general):
        assert program.dual_value(outcome.multipliers) == pytest.approx(-5 * 49 / 3, abs=1e-4)
        assert np.abs(program.dual_residual(outcome.multipliers)).max() < 1e-5


def test_true_configurations_are_feasible_with_their_true_value(program, families):
    alike = np.repeat(so3.haar_rotations(1, 1, 1)[0], 7, axis=0)
    for rotations in (*so3.haar_rotations(2, 3, 7), alike):
        blocks = [block[0] for block in evaluated(families, rotations[None])]
        y, left = moments_of(program, blocks)
        assert left < 1e-7
        value = program.objective[0] + program.objective[1:] @ y
        assert value == pytest.approx(-so3.residual(rotations), abs=1e-6)
        assert min(np.linalg.eigvalsh(block)[0] for block in blocks) > -1e-10


@pytest.mark.parametrize("row", [(1, 1, 1), (1, 1, 2)])
def test_a_wrong_sign_in_a_coupling_is_caught(row, families, samples, monkeypatch):
    right = plain_values.coupling

    def wrong(first, second, total, **precision):
        table = right(first, second, total, **precision).copy()
        if (first, second, total) == row:
            table[0] *= -1
        return table

    monkeypatch.setattr(plain_values, "coupling", wrong)
    with pytest.raises((TooFewSamplesError, OutsideSpanError)):
        moment_program([evaluated(families, samples)], residual_values(samples))


def test_the_identity_holds_with_the_plain_average(program, answer, families):
    multipliers = iter([nearest_semidefinite(x) for x in answer.multipliers])
    where = so3.haar_rotations(9, 1, 7)
    total = np.zeros(1)
    for family in families:
        own = [next(multipliers) for _ in family.sizes]
        total += plain.averaged_sum_of_squares(family, where, own)
    bound = program.dual_value(answer.multipliers)
    np.testing.assert_allclose(negative_residual(where) - bound, total, atol=1e-4)


def test_a_failed_solver_is_reported(families, monkeypatch):
    failed = ConicOutcome(None, "infeasible")
    monkeypatch.setattr(relaxation, "solve_moments", lambda *_, **__: failed)
    solved = solve_relaxation(families, 7, np.random.default_rng(0))
    with pytest.raises(SolverFailureError, match="infeasible"):
        _ = solved.multipliers


def test_too_few_samples_and_an_objective_outside_of_the_span_are_noticed(families, samples):
    few = samples[:20]
    with pytest.raises(TooFewSamplesError):
        moment_program([evaluated(families, few)], negative_residual(few))
    with pytest.raises(OutsideSpanError):
        moment_program([evaluated(families, samples)], residual_values(samples) ** 5)


def test_rows_of_degree_4_prove_nothing():
    rng, said = np.random.default_rng(0), []
    solved = solve_relaxation(sector_families(DEGREE_4, 7), 7, rng, progress=said.append)
    assert any("solving" in line for line in said)
    shares = [line.share for line in said]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    # The solver ends at its gap, where the share of a whole search is that of `SOLVED`.
    assert shares[-1] == pytest.approx(relaxation.SOLVED, abs=0.02)
    assert solved.program.dual_value(solved.multipliers) == pytest.approx(0, abs=1e-5)
    assert solved.program.size["moments"] == 35


def test_isotropic_8r_stays_feasible():
    v, omega = np.split(optimal_jacobian(8).T, 2, axis=1)
    isotropic = np.stack([v, omega, np.cross(v, omega)], axis=-1)
    families = sector_families(LOW, 8)
    samples = so3.haar_rotations(7, 160, 8)
    program = moment_program([evaluated(families, samples)], residual_values(samples))
    blocks = [block[0] for block in evaluated(families, isotropic[None])]
    y, left = moments_of(program, blocks)
    assert left < 1e-7
    assert program.objective[0] + program.objective[1:] @ y == pytest.approx(0, abs=1e-7)
