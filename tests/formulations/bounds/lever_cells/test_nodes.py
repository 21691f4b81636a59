"""Nodes: cut and halved, they still hold their frames, and what is known of these holds."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.bounds.lever_cells import charts
from lockedjoint.formulations.bounds.lever_cells.boxes import boxes
from lockedjoint.formulations.bounds.lever_cells.nodes import ANY, BATCH, Nodes, batches
from tests.formulations.bounds.lever_cells.tight_frames import exact, random_chart

SEEDS = st.integers(0, 2**32 - 1)
#: Boxes that are drawn at once.
COUNT = 40


def ball(greatest):
    """A chart of which only the ball of t matters."""
    nothing = np.zeros((0, 0))
    return charts.Chart(nothing, nothing, nothing, nothing, greatest, 1.0)


def around(rng, places, longest):
    """Random boxes that hold these places, one each, of which something is known."""
    N = len(places)
    h = longest * rng.uniform(0.02, 1, (N, 6))
    # the place may be on a face
    tau = np.clip(rng.uniform(-1.3, 1.3, (N, 6)), -1, 1)
    return Nodes(
        t=places - h * tau,
        h=h,
        z=rng.normal(size=(N, 6)),
        tilt=rng.normal(size=(N, 6, 6)),
        near=rng.uniform(0, 1, N),
        signs=rng.integers(-1, 64, N),
        inherited=rng.normal(size=(N, 89)),
        wait=np.arange(N),
    )


def places_within(rng, greatest, number=COUNT):
    """Random places in the ball, some on its surface."""
    t = rng.normal(size=(number, 6)) * rng.uniform(0, 1, (number, 6)) ** 2
    lengths = greatest * np.minimum(rng.uniform(0, 1.5, (number, 1)), 1)
    return lengths * t / np.linalg.norm(t, axis=1, keepdims=True)


def known(nodes, places):
    """What is known of z at places: the middle of where it is."""
    tau = (places - nodes.t) / nodes.h
    return nodes.z + np.einsum("nk,nkm->nm", tau, nodes.tilt)


def hold(nodes, places):
    """Whether nodes hold places, one each."""
    return (np.abs(places - nodes.t) <= nodes.h + 1e-12).all(1)


@given(SEEDS, st.floats(0.05, 0.5), st.floats(0.01, 0.6))
def test_cut_boxes_hold_the_ball_and_know_the_same(seed, greatest, longest):
    rng, chart = np.random.default_rng(seed), ball(greatest)
    places = places_within(rng, greatest)
    nodes = around(rng, places, longest)
    assert not nodes.outside(chart).any()
    cut = nodes.cut_to(chart)
    assert hold(cut, places).all()
    assert (cut.h > 0).all()
    assert known(cut, places) == pytest.approx(known(nodes, places), abs=1e-9)
    # the function is the same in all of the cut box, and so are its other facts
    anywhere = cut.t + cut.h * rng.uniform(-1, 1, cut.t.shape)
    assert known(cut, anywhere) == pytest.approx(known(nodes, anywhere), abs=1e-9)
    # the radius of where z is covers rounding
    assert (cut.near >= nodes.near).all()
    assert cut.near == pytest.approx(nodes.near, abs=1e-11)
    for name in ("signs", "inherited", "wait"):
        assert (getattr(cut, name) == getattr(nodes, name)).all()


@given(SEEDS, st.floats(0.05, 0.5), st.floats(0.01, 0.6))
def test_cut_boxes_are_the_least(seed, greatest, longest):
    rng = np.random.default_rng(seed)
    nodes = around(rng, places_within(rng, greatest), longest)
    cut = nodes.cut_to(ball(greatest))
    for sign in (1, -1):
        before, face = nodes.t + sign * nodes.h, cut.t + sign * cut.h
        assert (sign * (before - face) >= -1e-12).all()
        # a face that has moved touches the ball, at the least values of the other t_i
        least = np.maximum(np.abs(nodes.t) - nodes.h, 0) ** 2
        touching = face**2 + least.sum(1, keepdims=True) - least
        moved = sign * (before - face) > 1e-9
        assert touching[moved] == pytest.approx(greatest**2, abs=1e-5)
        # one that has not cannot be moved
        beyond = ~moved & (sign * face > 0)
        assert (touching[beyond] <= greatest**2 + 1e-5).all()


def test_cut_box_by_hand():
    nodes = dataclasses.replace(
        Nodes.cube(0.4, 5), t=np.array([[0.4, 0, 0, 0, 0, 0.7]]), z=np.full((1, 6), 2.0)
    )
    # 0 ≤ t_1, 0.3 ≤ t_6 ≤ 0.5, and all others within ±0.4
    cut = nodes.cut_to(ball(0.5))
    assert cut.t == pytest.approx(np.array([[0.2, 0, 0, 0, 0, 0.4]]))
    assert cut.h == pytest.approx(np.array([[0.2, 0.4, 0.4, 0.4, 0.4, 0.1]]))
    assert (cut.signs == 5).all()


@given(SEEDS, st.floats(0.05, 0.5))
def test_boxes_are_outside_where_all_their_corners_nearest_to_the_centre_are(seed, greatest):
    rng = np.random.default_rng(seed)
    nodes = around(rng, places_within(rng, 2 * greatest), 0.1)
    nearest = np.clip(0.0, nodes.t - nodes.h, nodes.t + nodes.h)
    lengths = np.linalg.norm(nearest, axis=1)
    clear = np.abs(lengths - greatest) > 1e-9
    assert (nodes.outside(ball(greatest)) == (lengths > greatest))[clear].all()


@given(SEEDS)
def test_halves_are_a_partition(seed):
    rng = np.random.default_rng(seed)
    nodes = around(rng, rng.normal(size=(COUNT, 6)), 0.3)
    axis = rng.integers(0, 6, COUNT)
    halves = nodes.halves(None, axis)
    assert len(halves) == 2 * COUNT
    assert np.prod(halves.h, 1).sum() == pytest.approx(np.prod(nodes.h, 1).sum())
    assert np.isinf(halves.near).all()
    for name in ("signs", "inherited", "wait"):
        assert (getattr(halves, name) == np.tile(getattr(nodes, name).T, 2).T).all()
    both = [halves.take(slice(None, COUNT)), halves.take(slice(COUNT, None))]
    for half in both:
        assert (np.abs(half.t - nodes.t) + half.h <= nodes.h + 1e-12).all()
    place = nodes.t + nodes.h * rng.uniform(-1, 1, (COUNT, 6))
    lower, upper = (hold(half, place) for half in both)
    assert (lower | upper).all()
    rows = np.arange(COUNT)
    middle = np.abs(place[rows, axis] - nodes.t[rows, axis]) < 1e-9
    assert (lower ^ upper | middle).all()


@pytest.mark.parametrize("side", [-1, 1])
def test_halves_know_where_the_frames_are(side):
    rng = np.random.default_rng(7)
    chart, N = random_chart(rng), 48
    t, h = rng.uniform(-0.1, 0.1, (N, 6)), 0.06 * rng.uniform(0.5, 1.3, (N, 6))
    z = charts.middles(chart, t, np.zeros((N, 6)))[0]
    nodes = Nodes(
        t, h, z, np.zeros((N, 6, 6)), np.full(N, 0.15), *np.zeros((3, N))
    )  # the last three do not matter
    c = boxes(chart, t, h, z, nodes.tilt, nodes.near)
    assert c.ok.all()
    axis = np.arange(N) % 6
    halves = nodes.halves(c, axis)
    half = halves.take(slice(None, N) if side < 0 else slice(N, None))
    greatest = 0.0
    for _ in range(40):
        tau = np.sign(rng.normal(size=(N, 6)))
        tau[np.arange(N), axis] = side * rng.integers(0, 2, N)
        frames = exact(chart, t, h, tau, c.z0)
        place = t + h * tau
        assert hold(half, place).all()
        share = np.linalg.norm(frames.z - known(half, place), axis=1) / half.near
        assert (share[frames.found] <= 1 + 1e-9).all()
        greatest = max(greatest, share[frames.found].max())
    assert greatest > 0.3


def test_halves_of_boxes_without_bounds_know_nothing():
    chart = random_chart(np.random.default_rng(8))
    nodes = dataclasses.replace(Nodes.cube(0.6), t=np.full((1, 6), 0.4), near=np.full(1, 0.1))
    c = boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, np.full(1, np.inf))
    assert not c.ok.any()
    assert np.isinf(nodes.halves(c, np.zeros(1, int)).near).all()


def test_cube_holds_the_ball_and_nothing_is_known_of_it():
    cube = Nodes.cube(0.3)
    assert len(cube) == 1
    assert (np.abs(cube.t) + cube.h == 0.3).all()
    assert np.isinf(cube.near).all()
    assert np.isnan(cube.inherited).all()
    assert (cube.signs == ANY).all()
    assert (cube.wait == 0).all()


@given(SEEDS)
def test_joined_are_both(seed):
    rng = np.random.default_rng(seed)
    one, other = (around(rng, rng.normal(size=(number, 6)), 0.3) for number in (3, 5))
    both = one.joined(other)
    assert len(both) == 8
    for name, values in vars(both).items():
        assert (values[:3] == getattr(one, name)).all()
        assert (values[3:] == getattr(other, name)).all()


def numbered(numbers):
    """Nodes that are known by numbers."""
    some = Nodes.cube(0.1).take(np.zeros(len(numbers), int))
    return dataclasses.replace(some, wait=np.array(numbers, int))


@given(
    st.lists(st.integers(0, 3 * BATCH), max_size=6),
    st.lists(st.integers(0, 3 * BATCH), max_size=8),
)
def test_batches_have_every_node_once_also_if_the_stack_grows(sizes, later):
    count = 0

    def some(number):
        nonlocal count
        count += number
        return numbered(range(count - number, count))

    stack = [some(number) for number in sizes]
    more, seen = iter(later), []
    for nodes in batches(stack):
        assert 1 <= len(nodes) <= BATCH
        seen.extend(nodes.wait)
        stack.extend(some(number) for number, _ in zip(more, range(2), strict=False))
    assert not stack
    assert sorted(seen) == list(range(count if any(sizes) else sum(sizes)))


def test_batches_are_full():
    sizes = (BATCH, 30, 0, BATCH - 40)
    stack = [numbered([k] * size) for k, size in enumerate(sizes)]
    assert [len(nodes) for nodes in batches(stack)] == [BATCH, BATCH - 10]
