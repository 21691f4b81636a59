"""Second statement: the worst case after a failure; also where failures are unequal."""

from functools import partial

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from lockedjoint.formulations import max_min, measures, residual
from lockedjoint.formulations.bounds import unequal_failures
from lockedjoint.formulations.encodings.factors import ENCODINGS
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.formulations.reproduction.reference import planar_4r
from lockedjoint.nlp.multistart import multistart
from lockedjoint.nlp.solver import solve

UNIT_7R = arm("unit-revolute", 7)
PLANAR_4R = arm("free", 4, 2)
TWICE = FailureModel((0.1, 0.2, 0.1, 0.1))
BEST_7R = 0.5714829681


def jacobians(study):
    return [run.solution.outputs["jacobian"] for run in study.results]


def worst_cases(study, count=1):
    return np.array([measures.worst_case_sigma(one, count) for one in jacobians(study)])


def run(built, starts, *, count=1, encoding="", seed=0, sample=None):
    build = partial(max_min.build, built, count, encoding)
    return multistart(build, sample or built.sample, starts=starts, seed=seed)


@pytest.mark.parametrize(("m", "n"), [(2, 3), (2, 5), (3, 4), (3, 6), (6, 7)])
@pytest.mark.parametrize("model", ["free", "free-mean"])
def test_attains_the_bound_where_the_paper_says_so(m, n, model):
    built = arm(model, n, m)
    bound = measures.sigma_bound(m, n, built.largest_trace)
    assert worst_cases(run(built, 3)).max() == pytest.approx(bound, abs=1e-7)


def test_eight_revolute_joints_attain_it_too():
    """Eq. (49): √(2/3)."""
    sigmas = worst_cases(run(arm("unit-revolute", 8), 5))
    assert sigmas == pytest.approx([np.sqrt(2 / 3)] * 5, abs=1e-6)


def test_seven_revolute_joints_improve_on_the_paper():
    """'Slightly improve' (after eq. 46): 0.51986 → 0.57148, below the bound 0.57735."""
    sigmas = worst_cases(run(UNIT_7R, 10))
    assert sigmas.max() == pytest.approx(BEST_7R, abs=2e-9)
    assert np.sum(sigmas > BEST_7R - 1e-6) >= 9
    assert np.all(sigmas < np.sqrt(1 / 3))


def test_from_residual_minima_all_starts_reach_the_best():
    point = residual.minimum(UNIT_7R, np.random.default_rng(0))
    assert residual.score(UNIT_7R.jacobian(point)) == pytest.approx(0.0568265457, abs=1e-8)
    sigmas = worst_cases(run(UNIT_7R, 10, sample=partial(residual.minimum, UNIT_7R), seed=4))
    assert sigmas == pytest.approx([BEST_7R] * 10, abs=1e-6)


@pytest.mark.parametrize("encoding", [*max_min.WITHOUT_FACTORS, *ENCODINGS])
def test_all_encodings_have_the_same_optimum(encoding):
    sigmas = worst_cases(run(UNIT_7R, 3, encoding=encoding, seed=1))
    assert sigmas.max() == pytest.approx(BEST_7R, abs=1e-6)


@pytest.mark.parametrize("model", ["free", "free-mean"])
@pytest.mark.parametrize("encoding", ["shared-factor", "principal-minors"])
def test_two_locked_joints_find_the_square(model, encoding):
    """Planar 4R: two failures are tolerated best at α = π/4 (after eq. 17), with
    √((1 − √½)/2) = 0.38268 for JJᵀ = I, hence √2 times that for columns of norm 1."""
    study = run(arm(model, 4, 2), 5, count=2, encoding=encoding)
    best = np.sqrt(2) * np.sin(np.pi / 8)
    assert worst_cases(study, 2) == pytest.approx([best] * 5, abs=1e-6)
    found = jacobians(study)
    assert len(group_equivalent([*found, np.sqrt(2) * planar_4r(np.pi / 4)[:2]])) == 1
    assert len(group_equivalent([found[0], np.sqrt(2) * planar_4r(0.1)[:2]])) == 2


def test_two_locked_joints_of_six_find_the_icosahedron():
    """Positional 6R attains the bound for two failures."""
    built = arm("free-mean", 6, 3)
    sigmas = worst_cases(run(built, 3, count=2), count=2)
    bound = measures.sigma_bound(3, 6, built.largest_trace, 2)
    assert sigmas == pytest.approx([bound] * 3, abs=1e-7)


def test_a_mix_of_joints():
    """A configuration better than any of many random ones, and within the model."""
    mixed = Arm((LeverRevolute(),) * 6 + (Prismatic(),) * 2)
    jacobian = max(jacobians(run(mixed, 3)), key=measures.worst_case_sigma)
    mixed.variables(jacobian)
    rng = np.random.default_rng(0)
    random = [measures.worst_case_sigma(mixed.jacobian(mixed.sample(rng))) for _ in range(300)]
    assert measures.worst_case_sigma(jacobian) > max(random)


def test_no_small_step_improves_the_optimum():
    """First-order check from J alone: random directions on the joints' manifold."""
    study = run(UNIT_7R, 1)
    point = study.results[0].solution.variables[: UNIT_7R.size]
    best = measures.worst_case_sigma(UNIT_7R.jacobian(point))
    rng = np.random.default_rng(0)
    for _ in range(300):
        step = rng.normal(size=point.size) * 1e-3
        assert measures.worst_case_sigma(UNIT_7R.jacobian(point + step)) <= best + 1e-8


def test_the_level_is_the_worst_case_squared():
    solution = solve(max_min.build(UNIT_7R), UNIT_7R.sample(np.random.default_rng(0)))
    sigma = measures.worst_case_sigma(solution.outputs["jacobian"])
    assert np.exp(solution.objective) == pytest.approx(sigma**2, abs=1e-7)


def test_the_floor_is_attained():
    """What bounds the level below must lie below something that exists."""
    attained = max_min.attained_score(UNIT_7R, FailureModel.equally_likely(7))
    assert 0 < attained < BEST_7R


# Unequal failures: reductions to the above, bounds, and another optimiser ---------------------


def score_of(jacobian, failures, goal):
    return max_min.score(jacobian, failures, goal)


def best(built, failures, goal="worst", *, starts=4, encoding=""):
    build = partial(max_min.build, built, failures, encoding, goal)
    found = jacobians(multistart(build, built.sample, starts=starts))
    jacobian = max(found, key=lambda matrix: score_of(matrix, failures, goal))
    built.variables(jacobian)  # within the model, or this raises
    return score_of(jacobian, failures, goal), jacobian


def by_brute_force(failures, goal):
    """The optimum over planar arms with unit columns, by angles and another optimiser."""

    def negative(angles):
        jacobian = np.vstack([np.cos([0, *angles]), np.sin([0, *angles])])
        return -score_of(jacobian, failures, goal)

    turns = [(0, np.pi)] * 3  # a column's sign does not matter
    answer = differential_evolution(negative, turns, rng=0, tol=1e-9, popsize=8, maxiter=70)
    return -answer.fun


@pytest.mark.parametrize("goal", ["worst", "expected"])
@pytest.mark.parametrize(
    "failures",
    [TWICE, FailureModel((0.1, 0.2, 0.1, 0.0)), FailureModel((0.3, 0.2, 0.1, 0.25), 2)],
    ids=["twice", "never", "two locked"],
)
def test_planar_4r_against_brute_force(failures, goal):
    score, _ = best(PLANAR_4R, failures, goal, starts=8)
    assert score == pytest.approx(by_brute_force(failures, goal), abs=2e-5)


@pytest.mark.parametrize("count", [1, 2])
def test_alike_joints_are_max_min(count):
    failures = FailureModel.equally_likely(4, count)
    plain = worst_cases(run(PLANAR_4R, 4, count=count), count).max()
    assert best(PLANAR_4R, failures)[0] == pytest.approx(plain, abs=1e-6)


def test_each_joint_that_never_fails_helps_until_the_bound_is_attained():
    """Unit revolute 7R: 0.571483, 0.629991, … and √(2/3) with three, which the bound allows."""
    failures = [FailureModel.equally_likely(7, never=range(k)) for k in range(4)]
    values = [best(UNIT_7R, one)[0] for one in failures]
    assert values[0] == pytest.approx(0.5714829681, abs=1e-6)
    assert np.all(np.diff(values) > 0.05)
    assert values[3] == pytest.approx(np.sqrt(2 / 3), abs=1e-6)
    bound = unequal_failures.possible_worst_bound(6, [2.0] * 7, failures[3])
    assert bound == pytest.approx(np.sqrt(2 / 3))


def test_each_goal_is_best_at_its_own():
    failures, goals = FailureModel((0.1, 0.13, 0.1, 0.1)), ("worst", "expected")
    answers = [best(PLANAR_4R, failures, goal, starts=8)[1] for goal in goals]
    for goal, own, other in zip(goals, answers, answers[::-1], strict=True):
        assert score_of(own, failures, goal) > score_of(other, failures, goal) + 1e-4


def test_the_expectation_over_alike_joints_exceeds_the_best_worst_case():
    """7R: the mean of σ_f may be better than eq. (5)'s optimum by giving up equality."""
    score, jacobian = best(UNIT_7R, FailureModel.equally_likely(7), "expected", starts=3)
    assert score == pytest.approx(0.57497877, abs=1e-6)
    assert max_min.score(jacobian) < 0.55


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_all_encodings_have_the_same_optimum_where_two_lock(encoding):
    failures = FailureModel((0.1, 0.2, 0.1, 0.1), 2)
    for goal, expected in (("worst", np.sqrt(0.5)), ("expected", 0.694130731)):
        score, _ = best(PLANAR_4R, failures, goal, encoding=encoding, starts=6)
        assert score == pytest.approx(expected, abs=1e-5)
