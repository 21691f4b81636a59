"""The search for the best length, on heights that are known."""

import math

import numpy as np
import pytest

from lockedjoint.robots.best_length import Point, highest
from lockedjoint.robots.by_length import LengthScale

# Joints of an arm of which no two axes meet: where they are, and how they are turned.
OFFSETS = ("0.1 0.05 0.3", "0.2 0 0.1", "0 0.15 0.2", "0.1 0 0.25") * 2
AXES = ("0 0 1", "0 1 0") * 4
TURNED = "0.4 0.7 0.2"


def counted(pieces):
    """Return the height as the least of pieces (value, slope), and a list of what is asked."""
    asked = []

    def at(x):
        asked.append(x)
        each = [piece(x) for piece in pieces]
        worst = min(range(len(each)), key=lambda k: each[k][0])
        height, slope = each[worst]
        return Point(x, slope, worst, math.exp(height), 1.0, True)

    return at, asked


def found(pieces, grid):
    at, asked = counted(pieces)
    points = [at(x) for x in grid]
    asked.clear()
    return highest(points, grid[0] - 2, grid[-1] + 2, at), len(asked)


GRID = np.linspace(-1.0, 1.0, 5)


def test_one_smooth_piece():
    def piece(x):
        off = x - 0.2
        return -(off**2) / 2 - off**3 / 30, -off - off**2 / 10

    best, evaluations = found([piece], GRID)
    assert best.log_length == pytest.approx(0.2, abs=1e-6)
    assert evaluations <= 6


@pytest.mark.parametrize("bent", [-1.0, 1.0])
def test_two_pieces_that_cross(bent):
    """A rising piece that bends either way: its tangent is above it, or below it."""

    def rising(x):
        return 0.8 * (x - 0.1) + bent * (x - 0.1) ** 2, 0.8 + 2 * bent * (x - 0.1)

    def falling(x):
        return -0.05 * (x - 0.1), -0.05

    best, evaluations = found([rising, falling], np.array([-0.2, 0.3]))
    assert best.height == pytest.approx(0.0, abs=1e-12)
    assert evaluations <= 20


def test_the_best_is_beyond_the_ends():
    for peak in (-2.5, 2.5):
        best, _ = found([lambda x, peak=peak: (-((x - peak) ** 2), 2 * (peak - x))], GRID)
        assert best.log_length == pytest.approx(peak, abs=1e-6)


def test_where_nothing_is_left_nothing_is_searched():
    at, asked = counted([lambda x: (-36.0 + math.sin(1e9 * x), 1e9 * math.cos(1e9 * x))])
    highest([at(x) for x in GRID], -3.0, 3.0, at)
    assert len(asked) == len(GRID)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("failures", [1, 2])
def test_no_length_is_better(made, kind, failures):
    kinds = {f"j{k}": {"rpy": TURNED} for k in range(8)} | {"j1": {"kind": kind}}
    arm = made.arm(made.urdf(made.serial(OFFSETS, AXES, **kinds)))
    for point in arm.samples(np.random.default_rng(5), 10):
        metric = arm.metric_jacobian(point)
        scale = LengthScale(arm, metric, failures)
        lengths = arm.length_of(metric) * np.logspace(-2, 2, 1001)
        shown, best = scale.around(lengths[250:751:125])
        exact = scale.at(lengths)
        for one, other in zip(shown, exact[250:751:125], strict=True):
            assert one.worst_case_sigma == pytest.approx(other.worst_case_sigma, abs=1e-12)
            assert one.percent_of_bound == pytest.approx(other.percent_of_bound, abs=1e-10)
        assert best.percent_of_bound >= max(one.percent_of_bound for one in exact) - 1e-9
