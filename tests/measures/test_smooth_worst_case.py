"""The smooth worst case: a lower bound, its stated error, and slopes where σ has a kink."""

import numpy as np
import pytest

from formulations import measures
from formulations.existence.rings import optimal_jacobian
from nlp.errors import InputError
from tests.made_robots import real


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
        ahead, behind = (
            float(measures.smooth_worst_case_batch((matrix + t * step)[None], 0.02).value[0])
            for t in (h, -h)
        )
        slope = np.sum(found.gradient[0] * step)
        assert (ahead - behind) / (2 * h) == pytest.approx(slope, abs=1e-6)
        assert (ahead - found.value[0]) / h == pytest.approx(slope, abs=0.05)


def test_no_digits_and_no_jacobians():
    zero = measures.smooth_worst_case_batch(np.zeros((1, 2, 3)), 0.01)
    assert zero.value[0] == pytest.approx(-zero.error)
    assert np.all(np.isfinite(zero.gradient))
    assert measures.smooth_worst_case_batch(np.zeros((0, 2, 3))).gradient.shape == (0, 2, 3)


@pytest.mark.parametrize("width", [0, -1.0, np.nan, "wide", True])
def test_what_is_no_width(width):
    with pytest.raises(InputError, match=r"width is .*allowed"):
        measures.smooth_worst_case_batch(np.ones((1, 2, 3)), width)


@pytest.mark.parametrize(
    ("name", "task"), [("Franka", "all"), ("TIAGo,", "all"), ("UR5", "position")]
)
def test_of_an_arm_its_gradient_is_the_slope(name, task):
    arm, h = real(name, task).arm(), 1e-6
    points = arm.samples(np.random.default_rng(4), 20)
    value, gradient = arm.smooth_worst_case(points, 0.05)
    jacobians = [arm.jacobian(point) for point in points]
    assert value == pytest.approx([by_definition(one, 0.05) for one in jacobians], abs=1e-12)
    for k, axis in enumerate(np.eye(arm.size)):
        ahead, behind = (arm.smooth_worst_case(points + t * axis, 0.05)[0] for t in (h, -h))
        assert gradient[:, k] == pytest.approx((ahead - behind) / (2 * h), abs=1e-5)
    for point, one, slope in zip(points, value, gradient, strict=True):
        alone, same = arm.smooth_worst_case(point, 0.05)
        assert (alone, same) == (pytest.approx(one, abs=1e-12), pytest.approx(slope, abs=1e-8))
