"""The bound for k locked joints: other formulas, other proofs' ingredients, no violation."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.special import roots_jacobi

from lockedjoint.formulations import manipulability, max_min, measures
from lockedjoint.formulations.atlas.collection import atlas, read_atlas
from lockedjoint.formulations.bounds.several_failures import (
    least_ratio,
    proves_ratio,
    several_locked_bound,
)
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.reproduction.reference import planar_4r

sizes = [
    (m, m + more, k) for m in range(1, 5) for more in range(1, 5) for k in range(1, more + 1)
]
shapes = st.sampled_from(sizes)


def random_jacobian(m, n, seed):
    """Columns of very different lengths, rows too: far from isotropic."""
    rng = np.random.default_rng(seed)
    stretch = rng.choice([0.1, 1.0, 3.0], size=(m, 1)) * rng.choice([0.1, 1.0, 3.0], size=n)
    return stretch * rng.normal(size=(m, n))


def mean_polynomial(jacobian, failures):
    """The mean of the characteristic polynomials, one set of columns after the other."""
    n = jacobian.shape[1]
    sets = combinations(range(n), failures)
    kept = [np.delete(jacobian, columns, axis=1) for columns in sets]
    return np.mean([np.poly(np.linalg.eigvalsh(one @ one.T)) for one in kept], axis=0)


def jacobi_bound(n, m, failures, trace=None):
    """The bound by Rodrigues' formula, as the least zero of a Jacobi polynomial."""
    zeros, _ = roots_jacobi(min(failures, m), abs(m - failures), n - m - failures)
    return (m if trace is None else trace) / m * (1.0 + zeros[0]) / 2.0


@given(shapes, st.integers(0, 10_000))
def test_no_jacobian_beats_any_of_the_bounds(shape, seed):
    m, n, failures = shape
    jacobian = random_jacobian(m, n, seed)
    size = measures.trace(jacobian)
    level = measures.worst_case_sigma(jacobian, failures) ** 2
    squares = measures.singular_values(jacobian) ** 2
    spectral = measures.averaged_spectrum(squares, n, failures)[0]
    assert level <= spectral + 1e-9 * size
    assert spectral <= jacobi_bound(n, m, failures, trace=size) + 1e-9 * size
    assert level <= several_locked_bound(m, n, size, failures) + 1e-9 * size
    ratio = manipulability.bound(models.arm("free-mean", n, m), failures).value
    assert manipulability.score(jacobian, failures) <= ratio + 1e-9


@given(shapes, st.integers(0, 10_000))
def test_the_averaged_spectrum_is_that_of_the_mean_polynomial(shape, seed):
    """And the derivative of the Gram matrix's polynomial is the mean polynomial."""
    m, n, failures = shape
    jacobian = np.random.default_rng(seed).normal(size=(m, n))
    eigenvalues = np.linalg.eigvalsh(jacobian @ jacobian.T)
    mean = mean_polynomial(jacobian, failures)
    roots = measures.averaged_spectrum(eigenvalues, n, failures)
    scale = np.abs(np.poly(-eigenvalues))
    assert np.all(np.abs(np.poly(roots) - mean) <= 1e-8 * scale)
    gram = Polynomial(np.poly(np.linalg.eigvalsh(jacobian.T @ jacobian))[::-1])
    derivative = gram.deriv(failures).coef[::-1]
    padded = np.concatenate([mean, np.zeros(n - failures - m)])
    scale = np.abs(np.poly(-np.linalg.eigvalsh(jacobian.T @ jacobian)))[: padded.size]
    assert np.all(np.abs(derivative / derivative[0] - padded) <= 1e-8 * (1 + scale))


@given(shapes, st.floats(0.1, 100))
def test_the_judge_has_the_same_bound(shape, trace):
    m, n, failures = shape
    bound = jacobi_bound(n, m, failures, trace)
    assert measures.sigma_bound(m, n, trace, failures) ** 2 == pytest.approx(bound, rel=1e-9)
    if failures == 1:
        assert bound == pytest.approx(trace * (n - m) / (m * n), rel=1e-12)


@given(st.integers(1, 8), st.integers(2, 10))
def test_two_failures_in_closed_form(m, more):
    n = m + more
    expected = 1 - m / n - np.sqrt(m * (n - m) / (n - 1)) / n
    level = measures.eigenvalue_bound(m, n, m, 2)
    assert level == pytest.approx(expected, rel=1e-9, abs=1e-12)


@given(st.lists(st.floats(0, 5), min_size=2, max_size=5), st.integers(1, 3), st.data())
def test_the_least_root_is_concave_and_hence_largest_at_isotropy(values, failures, data):
    m = len(values)
    other = data.draw(st.lists(st.floats(0, 5), min_size=m, max_size=m))
    n = m + failures + data.draw(st.integers(0, 3))

    def least(spectrum):
        return measures.averaged_spectrum(spectrum, n, failures)[0]

    middle = least((np.array(values) + np.array(other)) / 2)
    assert middle >= (least(values) + least(other)) / 2 - 1e-9
    assert least(values) <= least(np.full(m, np.mean(values))) + 1e-9


def test_the_icosahedron_attains_it_for_two_failures_and_the_square_does_not():
    """Planar 4R: 0.38268 of 0.45970."""
    golden = (1 + np.sqrt(5)) / 2
    diagonals = [[0, 1, golden], [0, 1, -golden], [1, golden, 0], [1, -golden, 0]]
    jacobian = np.array([*diagonals, [golden, 0, 1], [-golden, 0, 1]]).T
    sigma = measures.worst_case_sigma(jacobian, 2)
    assert sigma == pytest.approx(measures.sigma_bound(3, 6, measures.trace(jacobian), 2))
    jacobian = planar_4r(np.pi / 4)[:2]
    bound = measures.sigma_bound(2, 4, measures.trace(jacobian), 2)
    assert bound == pytest.approx(np.sqrt((1 - np.sqrt(1 / 3)) / 2))
    assert measures.worst_case_sigma(jacobian, 2) == pytest.approx(np.sin(np.pi / 8))
    assert measures.sigma_bound(3, 5, 1.0, failures=3) == 0  # too few joints are left


def two_to_spare(m):
    """The optimum of n = m + 2 and k = 2: JᵀJ is circulant, up to signs of columns."""
    n = m + 2
    steps = np.subtract.outer(np.arange(n), np.arange(n))
    modes = np.pi * (2 * np.arange(n) + 1) / n
    distance = 2 - 2 * np.cos(modes)
    weights = np.sqrt(distance)
    kept = np.ones(n, dtype=bool)
    kept[[0, -1]] = False  # the null space: the two lowest modes
    scale = 2 * distance[0] / np.sum(weights[kept])
    spectrum = np.where(kept, 1 + weights / scale, 0.0)
    gram = np.real(np.exp(1j * np.multiply.outer(steps, modes)) @ spectrum) / n
    values, vectors = np.linalg.eigh(gram)
    return (vectors[:, 2:] * np.sqrt(values[2:])).T


@pytest.mark.parametrize("m", range(1, 11))
def test_two_joints_to_spare_of_which_both_lock_attain_the_bound(m):
    jacobian = two_to_spare(m)
    n, size = m + 2, measures.trace(jacobian)
    level = measures.worst_case_sigma(jacobian, 2) ** 2
    assert level == pytest.approx(several_locked_bound(m, n, size, 2), rel=1e-9)
    if m > 1:
        assert level < measures.eigenvalue_bound(m, n, size, 2) * 0.75
    ratio = manipulability.bound(models.arm("free-mean", n, m), 2).value
    assert manipulability.score(jacobian, 2) == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("n", range(3, 11))
def test_lines_at_equal_angles_attain_the_bound_if_two_are_left(n):
    angles = np.pi * np.arange(n) / n
    jacobian = np.array([np.cos(angles), np.sin(angles)])
    level = measures.worst_case_sigma(jacobian, n - 2) ** 2
    assert level == pytest.approx(several_locked_bound(2, n, n, n - 2), rel=1e-9)
    if n > 3:
        ratio = manipulability.bound(models.arm("free-mean", n, 2), n - 2).value
        assert manipulability.score(jacobian, n - 2) == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize("m", [4, 5, 6, 9])
@pytest.mark.parametrize("seed", range(8))
def test_the_steps_of_the_null_space_bound(m, seed):
    """Of docs/several_failures.md, on random columns, and on those of the atlas."""
    jacobian = random_jacobian(m, m + 3, seed)
    if m == 6 and seed < 2:
        model = ("unit-revolute", "lever-revolute")[seed]
        jacobian = atlas(f"{model}_6x9_k2").jacobian
    whole, size = jacobian @ jacobian.T, measures.trace(jacobian)
    t = measures.worst_case_sigma(jacobian, 2) ** 2 * (1 - 1e-9)
    epsilon = np.sort(t / (np.linalg.eigvalsh(whole) - t))
    free = np.eye(m + 3) - jacobian.T @ np.linalg.inv(whole) @ jacobian
    held = np.eye(m + 3) - jacobian.T @ np.linalg.inv(whole - t * np.eye(m)) @ jacobian
    a, h = np.diag(free), np.diag(held)
    roots = (a * h) ** 0.25
    matrix = free * held / np.outer(roots, roots)
    beta, rho, alpha = sum(epsilon), sum(epsilon[: m - 3]), 3 / sum(np.sqrt(a * h))
    assert size / t == pytest.approx(m + sum(1 / epsilon), rel=1e-6)
    assert alpha >= 1 / np.sqrt(1 - beta / 3) - 1e-9
    square = np.sum(matrix**2)
    assert square <= (3 - beta) * (1 + 1e-6)
    least = alpha**2 + (3 / alpha - alpha + rho) ** 2 / 5 + rho**2 / (m - 3)
    assert least <= square * (1 + 1e-6)


def test_nine_joints_of_which_two_lock_have_a_sharper_bound_than_the_mean():
    ratio = least_ratio(6)
    assert ratio == pytest.approx(45.513672558, rel=1e-9)
    assert several_locked_bound(6, 9, 18, 2) == pytest.approx(18 / ratio, rel=1e-12)
    assert measures.eigenvalue_bound(6, 9, 18, 2) == pytest.approx(0.5)
    assert proves_ratio(6, Fraction(ratio))
    assert not proves_ratio(6, Fraction(ratio) * (1 + Fraction(1, 10**12)))


def test_nothing_in_the_atlas_is_above_any_bound():
    checked = 0
    for page in read_atlas():
        asked = page.entry
        if asked.failures > 1 and asked.formulation == max_min.NAME:
            bound = max_min.bound(asked.arm, asked.failures)
            assert float(page.value) <= bound.value * (1 + 1e-12)
            checked += 1
    assert checked > 60
