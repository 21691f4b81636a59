"""The worst case of many Jacobians at once: against the one of each, as a cost, and smooth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lockedjoint.formulations import measures
from lockedjoint.formulations.existence.rings import optimal_jacobian
from lockedjoint.formulations.measures import worst_case_sigma_batch

ENTRIES = st.floats(-3, 3, allow_subnormal=False) | st.integers(-1, 1)


@pytest.mark.parametrize("shape", [(1, 2), (2, 3), (3, 7), (6, 7), (6, 12)])
def test_batch_agrees_with_one_by_one(shape):
    stack = np.random.default_rng(1).standard_normal((200, *shape))
    stack[:20] *= 10.0 ** np.arange(-60, 60, 6)[:, None, None]
    agrees(stack, worst_case_sigma_batch(stack), exact=1e-13)


def agrees(stack, found, exact):
    """σ, the pair of singular vectors, and that the joint is one of the worst."""
    for k, matrix in enumerate(stack):
        sigmas, size = measures.locked_singular_values(matrix), np.linalg.norm(matrix, 2)
        near = exact * size
        assert found.sigma[k] == pytest.approx(np.min(sigmas), abs=near)
        assert sigmas[found.joint[k]] == pytest.approx(np.min(sigmas), abs=near)
        left, right = found.left[k], found.right[k]
        assert np.linalg.norm(left) == pytest.approx(1.0, abs=1e-12)
        assert np.linalg.norm(right) == pytest.approx(1.0, abs=1e-12)
        assert right[found.joint[k]] == 0.0
        assert left @ matrix @ right == pytest.approx(found.sigma[k], abs=1e-8 * size)


@given(arrays(np.float64, (3, 3, 4), elements=ENTRIES))
@settings(max_examples=60, deadline=None)
def test_any_matrix_whatever_its_rank(stack):
    """Zeros, repeated columns and singular values, fatal joints."""
    stack[np.max(np.abs(stack), axis=(1, 2)) < 1e-70] = 0.0  # which the others refuse
    agrees(stack, worst_case_sigma_batch(stack), exact=1e-13)


def test_fatal_and_nearly_fatal_joints():
    """What is left is small: the digits that it has are right."""
    matrix = np.random.default_rng(0).standard_normal((6, 7))
    matrix[5, :6] = 0.0  # joint 6 alone moves the last direction
    stack = np.stack([matrix, matrix, np.zeros((6, 7))])
    stack[1, 5, :6] = 1e-11 * np.arange(1, 7)
    found = worst_case_sigma_batch(stack)
    agrees(stack, found, exact=1e-14)
    assert found.joint[:2].tolist() == [6, 6]
    assert 1e-12 < found.sigma[1] < 1e-9


def test_ties_everywhere():
    """Every failure of an optimal J leaves the same; the gradient is that of one of them."""
    matrix = optimal_jacobian(8)
    found = worst_case_sigma_batch(matrix[None])
    agrees(matrix[None], found, exact=1e-13)
    generalised_gradient(matrix, found.gradient[0])


def generalised_gradient(matrix, gradient):
    """Along any direction the slope of σ is at most that of one that attains the least."""
    joint = int(np.flatnonzero(np.all(gradient == 0, axis=0))[0])
    rest = np.delete(matrix, joint, axis=1)
    values = np.linalg.svd(rest, compute_uv=False)
    inner = np.sum(gradient * matrix)
    assert inner == pytest.approx(values[-1], rel=1e-12)  # σ is homogeneous of degree 1
    rng, h = np.random.default_rng(0), 1e-7
    for _ in range(20):
        step = rng.standard_normal(matrix.shape)
        ahead = measures.worst_case_sigma(matrix + h * step)
        assert (ahead - measures.worst_case_sigma(matrix)) / h <= np.sum(gradient * step) + 1e-5


def test_the_gradient_is_the_slope():
    """Central differences, where no other failure and no other singular value is near."""
    rng, h = np.random.default_rng(5), 1e-6
    stack = rng.standard_normal((60, 4, 6))
    sigmas = np.sort([measures.locked_singular_values(one) for one in stack], axis=1)
    stack = stack[sigmas[:, 1] - sigmas[:, 0] > 0.01]
    assert len(stack) > 30
    found = worst_case_sigma_batch(stack)
    step = rng.standard_normal(stack.shape)
    ahead, behind = (worst_case_sigma_batch(stack + t * step).sigma for t in (h, -h))
    slopes = np.sum(found.gradient * step, axis=(1, 2))
    assert slopes == pytest.approx((ahead - behind) / (2 * h), abs=1e-7)


def test_many_at_once_are_fast(cpu_seconds):
    """Measured at 16 times; half of that is the least that is accepted here."""
    stack = np.random.default_rng(0).standard_normal((1000, 6, 7))
    worst_case_sigma_batch(stack)

    batch = min(cpu_seconds(lambda: worst_case_sigma_batch(stack)) for _ in range(3))
    loop = cpu_seconds(lambda: [measures.worst_case(one) for one in stack])
    assert loop > 8 * batch


# The smooth worst case: a lower bound, its stated error, and slopes where σ has a kink -------


def by_definition(matrix, width):
    """−w log Σ exp(−σ/w) with NumPy's singular values of each J without a column."""
    n = matrix.shape[1]
    all_ = [np.linalg.svd(np.delete(matrix, f, 1), compute_uv=False) for f in range(n)]
    return -width * np.logaddexp.reduce(-np.concatenate(all_) / width)


@pytest.mark.parametrize("shape", [(1, 2), (2, 3), (3, 7), (6, 7)])
@pytest.mark.parametrize("width", [1e-3, 0.02, 0.5])
def test_it_is_below_by_no_more_than_its_error(shape, width):
    stack = np.random.default_rng(2).standard_normal((40, *shape))
    stack[0, -1] *= 1e-6  # almost singular: what is left has no digits in JJᵀ
    found = measures.smooth_worst_case_batch(stack, width)
    worst = measures.worst_case_sigma_batch(stack).sigma
    assert np.all(found.value <= worst + 1e-12)
    assert np.all(found.value >= worst - found.error - 1e-12)
    assert found.error == pytest.approx(width * np.log(shape[0] * shape[1]))
    assert found.value == pytest.approx([by_definition(one, width) for one in stack], abs=1e-12)


def test_the_gradient_is_the_slope_where_all_failures_tie():
    """At an optimal 8R, where σ has a kink: differences along any line, both ways alike."""
    matrix, h = optimal_jacobian(8), 1e-5
    found = measures.smooth_worst_case_batch(matrix[None], 0.02)
    for step in np.random.default_rng(3).standard_normal((10, *matrix.shape)):
        both = np.stack([matrix + h * step, matrix - h * step])
        ahead, behind = measures.smooth_worst_case_batch(both, 0.02).value
        slope = np.sum(found.gradient[0] * step)
        assert (ahead - behind) / (2 * h) == pytest.approx(slope, abs=1e-6)
        assert (ahead - found.value[0]) / h == pytest.approx(slope, abs=0.05)
