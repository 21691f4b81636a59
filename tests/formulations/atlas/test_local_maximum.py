"""Isolated entries are strict local maxima; what is none is refused."""

from dataclasses import replace

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.atlas import local_maximum
from lockedjoint.formulations.atlas.collection import (
    _problem_of_optimum,
    page_of,
    problem_of,
    read_atlas,
)
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.atlas.local_maximum import Conditions, prove_local_maximum
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas.search import climbed
from results.atlas.symmetric_arm import SymmetricArm

SEVEN = page_of(entry("unit-revolute_6x7_k1"))
# One of each kind: sets left out, k = 1 and 2, limits, prismatic joints, small task dimensions.
PROVED = [f"free-mean_{one}" for one in ("2x5_k2", "2x9_k2", "3x6_k2", "3x7_k2", "6x8_k2")]
PROVED += ["free-mean_3x8_k2_isotropy", "lever-revolute_6x7_k1", "unit-revolute_6x8_k2"]
PROVED += ["unit-revolute-5+prismatic-2_6x7_k1"]
PAGES = read_atlas()
SMALL = [page for page in PAGES if page.entry.task_dimension < 6 and not page.entry.relative]


def test_the_best_known_7r_is_a_strict_local_maximum():
    proved = prove_local_maximum(SEVEN.entry, SEVEN.jacobian)
    assert proved.sigma == pytest.approx(0.5714829682, abs=1e-10)
    assert proved.sets == 7
    assert proved.distance < 1e-13
    assert 1e-5 < proved.uniqueness < 1e-3


@pytest.mark.parametrize("name", PROVED)
def test_every_kind_of_isolated_entry_is_proved(name):
    page = page_of(entry(name))
    assert page.locally_optimal
    assert problem_of(page) == ""
    proved = prove_local_maximum(page.entry, page.jacobian)
    assert 0 < proved.sigma - float(page.value) <= 1e-9
    # Random steps along the model lead to nothing better.
    arm, rng = page.entry.arm, np.random.default_rng(0)
    start = arm.variables(page.jacobian)
    for length in (1e-4, 1e-3, 1e-2):
        for _ in range(10):
            moved = arm.jacobian(start + length * rng.standard_normal(start.size))
            if "free" in name:
                moved *= np.sqrt(arm.largest_trace / measures.trace(moved))
            if "isotropy" in name:  # the nearest isotropic one
                left, _, right = np.linalg.svd(moved, full_matrices=False)
                moved = np.sqrt(arm.largest_trace / len(moved)) * left @ right
            if page.entry.holds(moved):
                assert measures.worst_case_sigma(moved, page.entry.failures) < proved.sigma


@pytest.mark.parametrize(
    ("name", "count"),
    [
        # m(m+1)/2 entries of JJᵀ but its trace, which the lengths of the columns fix.
        ("free_3x9_k2_isotropy", 9 + 6 - 1),
        ("free-mean_3x9_k2_isotropy", 1 + 6 - 1),
        # And the traces of both diagonal blocks, and of the one between.
        ("lever-revolute_6x7_k1_isotropy", 1 + 2 * 7 + 21 - 3),
    ],
)
def test_equations_of_isotropy_that_follow_from_the_others_are_left_out(name, count):
    page = page_of(entry(name))
    conditions = Conditions(page.entry, page.jacobian, 0).model
    assert len(conditions) == count
    gradients = [one.gradient(page.jacobian).ravel() for one in conditions]
    assert np.linalg.matrix_rank(gradients, tol=1e-6) == count


@pytest.mark.parametrize("seed", range(55))
def test_what_is_moved_or_states_less_is_refused(seed):
    """Two mutants of each seed: J moved along the model, and a value below what is proved."""
    known = [page for page in SMALL if page.locally_optimal and page.entry.joints < 8]
    page, rng = known[seed % len(known)], np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-4.5, -1)
    moved = page.jacobian + size * rng.standard_normal(page.jacobian.shape)
    moved *= np.sqrt(page.entry.arm.largest_trace / measures.trace(moved))
    with pytest.raises(CertificateError, match="not proved"):
        prove_local_maximum(page.entry, moved)
    less = f"{float(page.value) - 10.0 ** rng.uniform(-8.5, -3):.15f}"
    assert "locally optimal" in _problem_of_optimum(replace(page, value=less))


FAMILIES = [*(page for page in SMALL if page.family), page_of(entry("unit-revolute_6x8_k1"))]


@pytest.mark.parametrize("page", [*FAMILIES, PAGES[-1]], ids=lambda page: page.entry.name)
def test_families_and_other_formulations_are_refused(page):
    assert not page.locally_optimal
    assert "locally optimal" in _problem_of_optimum(replace(page, locally_optimal=True))


def test_a_page_with_a_mark_that_it_has_not_is_refused():
    assert "locally optimal" in problem_of(replace(PAGES[-1], locally_optimal=True))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", ["free-mean_2x5_k2", "free-mean_2x7_k3"])
def test_saddles_are_refused(name, seed):
    """Optima of Jacobians with a symmetry, which others near them pass."""
    asked, rng = entry(name), np.random.default_rng(seed)
    symmetric = SymmetricArm.drawn(asked.arm, rng)
    saddle = climbed(asked, symmetric, symmetric.sample(rng))
    assert (
        measures.worst_case_sigma(saddle, asked.failures) < float(page_of(asked).value) - 0.01
    )
    with pytest.raises(CertificateError, match="not proved"):
        prove_local_maximum(asked, saddle)


def test_a_limit_that_is_not_attained_is_refused(monkeypatch):
    page = page_of(entry("free-mean_2x5_k2"))
    solution = Conditions.solution

    def changed(conditions):
        x = solution(conditions)
        conditions.parts(x)[2][:] *= -1
        return x

    monkeypatch.setattr(Conditions, "solution", changed)
    with pytest.raises(CertificateError, match="not proved"):
        prove_local_maximum(page.entry, page.jacobian)


def test_a_wrong_second_order_is_noticed(monkeypatch):
    inertia = local_maximum._inertia

    def fewer(matrix, change):
        found = inertia(matrix, change)
        return (found[0] + 1, found[1] - 1) if len(matrix) > 6 else found

    monkeypatch.setattr(local_maximum, "_inertia", fewer)
    with pytest.raises(CertificateError, match="no strict maximum"):
        prove_local_maximum(SEVEN.entry, SEVEN.jacobian)


@pytest.mark.parametrize(
    "name", ["lever-revolute_6x7_k1", "unit-revolute-5+prismatic-2_6x7_k1"]
)
def test_slopes_are_those_of_the_gradient_and_symmetric(name):
    page, rng = page_of(entry(name)), np.random.default_rng(3)
    conditions = Conditions(page.entry, page.jacobian, 0)
    x, step = rng.standard_normal((2, conditions.solution().size))
    slope = conditions.slope(x)
    above, below = (conditions.gradient(x + s * step) for s in (1e-5, -1e-5))
    np.testing.assert_allclose((above - below) / 2e-5, slope @ step, atol=1e-6)
    assert np.array_equal(slope, slope.T)
    radius = 1e-2
    limit = conditions.majorant(x, radius) - conditions.majorant(x, 0.0)
    for _ in range(20):
        moved = conditions.slope(x + radius * rng.choice([-1, 1], x.size))
        assert np.all(np.abs(moved - slope) <= limit + 1e-12)


def test_an_inertia_is_that_of_all_matrices_that_near():
    values = np.array([2.0, 1.0, 0.5, -0.1, -3.0])
    q = np.linalg.qr(np.random.default_rng(4).standard_normal((5, 5)))[0]
    matrix = q @ np.diag(values) @ q.T
    assert local_maximum._inertia(matrix, 1e-3) == (3, 2)
    assert local_maximum._inertia(matrix, 0.1) is None
