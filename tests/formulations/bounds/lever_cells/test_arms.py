"""Arms in a region: what trees exclude, that no arm is lost, and that signs are conventions."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.stats import ortho_group

from lockedjoint.formulations.bounds.lever_cells import arms, charts
from lockedjoint.formulations.bounds.lever_cells.arms import arms_excluded
from lockedjoint.formulations.bounds.lever_cells.boxes import boxes
from lockedjoint.formulations.bounds.lever_cells.cells import Cells, no_null_vector
from lockedjoint.formulations.bounds.lever_cells.centres import SIGNS, Centres, HalfSpaces
from lockedjoint.formulations.bounds.lever_cells.equations import MULTIPLIER_COUNT
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.nodes import ANY, BATCH, Nodes
from lockedjoint.formulations.bounds.lever_cells.regions import MARGIN, End, Region, Tally
from results.bounds.lever_centres import TRACELESS, random_frame
from tests.formulations.bounds.lever_cells.made_cells import arm, largest_lever_arm

# Half side of the cubes: small enough for some hundred boxes.
HALF = 0.05
# Radius of a ball that holds the cube.
RADIUS = 0.12
# Signs of the null vector of the arm, which is positive.
PLUS = 0
# Other signs.
OTHER = 21


def alone(W, radius):
    """The whole ball around a frame, as if no other image were near."""
    made = Region.of(Centres.of_frames([W], radius), 0)
    return dataclasses.replace(made, half_spaces=HalfSpaces(np.zeros((0, 7, 7))))


def region():
    """The ball around the axes of the arm."""
    return alone(arm()[:3], RADIUS)


def with_signs(of, signs):
    """A region with signs at the columns of all its frames, in the same coordinates."""
    chart = dataclasses.replace(of.chart, W=of.chart.W * signs, F=of.chart.F * signs)
    return dataclasses.replace(of, chart=chart, P=chart.W.T @ chart.W)


def test_cube_around_the_axes_of_an_arm_is_excluded_below_its_lever_arms():
    found = arms_excluded(region(), 0.0798, Nodes.cube(HALF, PLUS))
    assert found.left == 0
    assert found.certificates > 50
    assert found.programs >= found.ends[End.OWN]


def test_every_box_is_excluded_or_cut_in_two():
    found = arms_excluded(region(), 0.07, Nodes.cube(HALF, PLUS))
    assert found.left == 0
    assert found.nodes == 2 * sum(found.ends.values()) - 1


@pytest.mark.parametrize("number", [PLUS, OTHER])
def test_cube_with_an_arm_is_never_excluded(number):
    assert largest_lever_arm(arm()[6]) < 0.103
    assert (arm()[6] > 0).all()
    calls = iter(range(9))
    found = arms_excluded(
        with_signs(region(), SIGNS[number]),
        0.103,
        Nodes.cube(0.002, number),
        stop=lambda: next(calls) == 8,
    )
    assert found.left > 0


def test_boxes_outside_the_chart_need_no_proof():
    far = dataclasses.replace(Nodes.cube(0.1, PLUS), t=np.full((1, 6), 0.3))
    found = arms_excluded(region(), 0.103, far)
    assert +found.ends == {End.OUTSIDE: 1}
    assert (found.nodes, found.left) == (1, 0)


def test_signs_of_the_columns_change_nothing_if_the_null_vector_has_them():
    # a box with signs is the box of a frame whose columns have these signs
    plain = arms_excluded(region(), 0.07, Nodes.cube(HALF, PLUS))
    signed = with_signs(region(), SIGNS[OTHER])
    assert arms_excluded(signed, 0.07, Nodes.cube(HALF, OTHER)) == plain


def off_centre(rng):
    """A region of which the axes of the arm are no centre, and t and z of the arm in it."""
    around = region().chart
    t = 0.02 * rng.normal(size=(1, 6))
    z, _ = charts.middles(around, t, np.zeros((1, 6)))
    K = (t @ around.B + z @ around.C).reshape(3, 4)
    made = alone(around.W + K @ around.F, 0.2)
    W, chart = arm()[:3], made.chart
    K = np.linalg.solve(W @ chart.W.T, W @ chart.F.T).ravel()
    return made, chart.B @ K, chart.C @ K


@pytest.mark.parametrize("start", ["open", "given"])
@pytest.mark.parametrize("number", [PLUS, OTHER, 63])
def test_boxes_with_an_arm_remain_down_a_tree(start, number):
    made, t, z = off_centre(np.random.default_rng(number))
    of = with_signs(made, SIGNS[number])
    nodes, signed, programs = Nodes.cube(0.1, ANY if start == "open" else number), 0, 0
    for _ in range(34):
        nodes, c = of.remaining(nodes, tally := Tally(), sphere=False)
        parts = arms._looked_at(0.103, nodes, c, tally)
        nodes = functools.reduce(Nodes.joined, parts)
        tau = (t - nodes.t) / nodes.h
        nodes = nodes.take(np.abs(tau).max(1) <= 1)
        # with the signs of the null vector, and with what is known of z
        nodes = nodes.take((nodes.signs == ANY) | (nodes.signs == number))
        tau = (t - nodes.t) / nodes.h
        off = z - nodes.z - np.einsum("nk,nkm->nm", tau, nodes.tilt)
        nodes = nodes.take(np.linalg.norm(off, axis=1) <= nodes.near)
        assert len(nodes) == 1
        signed += int(nodes.signs[0] == number)
        programs += tally.programs
    assert signed > 10
    assert programs > 5


def test_signs_of_null_vectors_stay_open():
    """Random frames in boxes, and their null vectors that are within a large limit."""
    limit, half, rng = 0.3, 0.01, np.random.default_rng(4)
    chart, N = region().chart, 40
    nodes = Nodes.cube(half).take(np.zeros(N, int))
    nodes = dataclasses.replace(
        nodes, t=rng.uniform(-0.1, 0.1, (N, 6)), wait=np.arange(N), near=np.full(N, 0.1)
    )
    nodes = dataclasses.replace(nodes, z=charts.middles(chart, nodes.t, nodes.z)[0])
    c = boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)
    tally = Tally()
    divided = arms._divided(limit, nodes, c, tally)
    remaining = set(zip(divided.wait.tolist(), divided.signs.tolist(), strict=True))
    assert len(remaining) == len(divided)
    least, seen = np.sqrt((1 - 3 * limit) / 7), set()
    for _ in range(20):
        t = nodes.t + half * np.sign(rng.normal(size=(N, 6)))
        z, residual = charts.middles(chart, t, c.z0)
        K = (t @ chart.B + z @ chart.C).reshape(-1, 3, 4)
        F = charts.roots(K)[3] @ (chart.F - np.swapaxes(K, 1, 2) @ chart.W)
        q = rng.normal(size=(N, 500, 4))
        n = q @ F / np.linalg.norm(q, axis=2, keepdims=True)
        which, one = np.nonzero((np.abs(n).min(2) > least) & (residual < 1e-12)[:, None])
        signs = np.sign(n[which, one])
        number = (signs[:, None] * signs[:, :1, None] == SIGNS).all(2).argmax(1)
        seen |= set(zip(which.tolist(), number.tolist(), strict=True))
    assert len(seen) > 300
    assert seen <= remaining
    # many signs are impossible
    assert len(remaining) < 0.7 * N * len(SIGNS)


def scattered(half, number, seed=5):
    """Boxes around the arm's axes, what is known of them, and their chart."""
    rng, chart = np.random.default_rng(seed), region().chart
    nodes = Nodes.cube(half).take(np.zeros(number, int))
    nodes = dataclasses.replace(
        nodes,
        t=rng.uniform(-0.1, 0.1, (number, 6)),
        wait=np.arange(number),
        near=np.full(number, 0.1),
    )
    nodes = dataclasses.replace(nodes, z=charts.middles(chart, nodes.t, nodes.z)[0])
    return rng, chart, nodes, bounds(chart, nodes)


def bounds(chart, nodes):
    return boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)


def test_open_signs_are_those_that_boxes_of_signed_frames_have():
    limit, N = 0.1, 40
    _, chart, nodes, c = scattered(0.03, N)
    divided = arms._divided(limit, nodes, c, Tally())
    closed = np.ones((N, len(SIGNS)), bool)
    closed[divided.wait, divided.signs] = False
    assert 0.3 < closed.mean() < 0.98
    for signs, none in zip(SIGNS, closed.T, strict=True):
        signed = dataclasses.replace(chart, W=chart.W * signs, F=chart.F * signs)
        cells = Cells.of_boxes(bounds(signed, nodes))
        assert (no_null_vector(cells, limit, MARGIN) == none).all()


def test_what_remains_knows_where_its_frames_are():
    """Of many boxes, some with signs, some of which are excluded."""
    N = 120
    rng, chart, nodes, c = scattered(0.02, N)
    signs = np.where(np.arange(N) % 3 > 0, PLUS, ANY)
    nodes = dataclasses.replace(nodes, signs=signs, wait=np.zeros(N, int))
    tally = Tally()
    left = functools.reduce(Nodes.joined, arms._looked_at(0.095, nodes, c, tally))
    assert 0 < tally.ends[End.NO_NULL_VECTOR] < N
    assert tally.ends[End.OWN] > 0
    seen = 0
    for _ in range(10):
        t = nodes.t + nodes.h * np.sign(rng.normal(size=(N, 6)))
        z, residual = charts.middles(chart, t, c.z0)
        t, z = t[residual < 1e-12], z[residual < 1e-12]
        tau = (t - left.t[:, None]) / left.h[:, None]
        has = (np.abs(tau) <= 1 + 1e-9).all(2)
        known = left.z[:, None] + np.einsum("nfk,nkm->nfm", tau, left.tilt)
        off = np.linalg.norm(z - known, axis=2)
        assert (off <= left.near[:, None])[has].all()
        seen += has.sum()
    assert seen > 50


@pytest.mark.parametrize("signs", [ANY, OTHER])
def test_boxes_whose_bounds_do_not_hold_are_halved(signs):
    nodes = dataclasses.replace(Nodes.cube(0.2, signs), t=np.full((1, 6), 0.6))
    chart = dataclasses.replace(region().chart, greatest=2.0)
    c = boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)
    assert not c.ok.any()
    halves = functools.reduce(Nodes.joined, arms._looked_at(0.01, nodes, c, Tally()))
    assert (halves.signs == [signs, signs]).all()
    assert np.prod(halves.h, 1).sum() == pytest.approx(0.2**6)


def test_inherited_multipliers_exclude_the_cells_that_have_them():
    _, _, _, c = scattered(0.02, 30)
    expansion = Expansion.of_cells(Cells.of_boxes(c))
    own = arms._by_own(expansion, 0.095, Tally())
    packed = np.full((30, MULTIPLIER_COUNT), np.nan)
    packed[own.having] = own.packed
    packed[::3] = np.nan
    together = arms._by_inherited(expansion, packed, 0.095, Tally())
    assert 3 < together.sum() < np.isfinite(packed[:, 0]).sum()
    assert (together <= own.excluded).all()
    assert (together == own.excluded)[np.isfinite(packed[:, 0])].all()


def test_boxes_too_large_for_bounds_are_halved():
    wide = dataclasses.replace(region(), chart=dataclasses.replace(region().chart, greatest=1))
    found = arms_excluded(wide, 0.01, Nodes.cube(0.9), stop=lambda: True)
    assert (found.nodes, found.left) == (1, 2)


def test_boxes_without_null_vector_end_where_they_are_divided():
    # the best arm that is known has larger lever arms, and so any null vector
    found = arms_excluded(region(), 0.02, Nodes.cube(0.01))
    assert +found.ends == {End.DIVIDED: 1}
    assert (found.nodes, found.left) == (1, 0)


def test_order_of_the_columns_changes_nothing():
    order = [3, 1, 6, 0, 2, 5, 4]
    plain, chart = region(), region().chart
    chart = dataclasses.replace(chart, W=chart.W[:, order], F=chart.F[:, order])
    P = plain.P[np.ix_(order, order)]
    ordered = dataclasses.replace(plain, chart=chart, P=P)
    cube = Nodes.cube(HALF)
    found = arms_excluded(ordered, 0.07, cube)
    assert found == arms_excluded(plain, 0.07, cube)
    assert found.left == 0


def test_a_rotated_frame_is_excluded_as_well():
    """Multipliers depend on the frame, so that numbers of boxes may differ by some."""
    plain = region()
    R, Q = (ortho_group.rvs(size, random_state=size) for size in (3, 4))
    turned = {
        name: (R @ getattr(plain.chart, name).reshape(6, 3, 4) @ Q.T).reshape(6, 12)
        for name in ("B", "C")
    }
    turned |= {"W": R @ plain.chart.W, "F": Q @ plain.chart.F}
    rotated = dataclasses.replace(plain, chart=dataclasses.replace(plain.chart, **turned))
    found, other = (arms_excluded(one, 0.07, Nodes.cube(HALF)) for one in (plain, rotated))
    assert found.left == other.left == 0
    assert other.nodes == pytest.approx(found.nodes, rel=0.1)


def test_what_is_not_looked_at_is_left():
    cube = Nodes.cube(0.02)
    one = arms_excluded(region(), 0.103, cube, stop=lambda: True)
    assert one.nodes == 1 <= one.left
    many = cube.take(np.zeros(3 * BATCH, int))
    found = arms_excluded(region(), 0.103, many, stop=lambda: True)
    assert found.nodes == BATCH
    assert found.left == 2 * BATCH + one.left * BATCH


def test_random_frames_are_tight_and_weights_vary():
    rng = np.random.default_rng(2)
    frames, weights = zip(*(random_frame(rng) for _ in range(5)), strict=True)
    for frame in frames:
        assert np.abs(frame @ frame.T - np.eye(3)).max() < 1e-12
        assert np.abs((frame**2).sum(0) - 3 / 7).max() < 1e-12
    assert max(weights) > 1.05 * min(weights) > 0


def test_basis_of_traceless_matrices_is_orthonormal():
    flat = TRACELESS.reshape(5, 9)
    assert flat @ flat.T == pytest.approx(np.eye(5))
    assert np.trace(TRACELESS, axis1=1, axis2=2) == pytest.approx(0.0)
