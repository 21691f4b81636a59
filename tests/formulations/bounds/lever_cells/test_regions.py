"""Regions: no box with a frame nearest to the centre is dropped, and covers are proved."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells import charts, regions
from lockedjoint.formulations.bounds.lever_cells.centres import Centres, HalfSpaces
from lockedjoint.formulations.bounds.lever_cells.nodes import Nodes
from lockedjoint.formulations.bounds.lever_cells.regions import (
    LARGEST_HALF,
    MARGIN,
    End,
    Region,
    Tally,
    longest_edge,
    sphere,
)
from tests.formulations.bounds.lever_cells.tight_frames import (
    images,
    projections,
    surrounded,
    traces,
)

CERTIFICATE = Path(__file__).parents[4] / "results/bounds/certificates/isotropic_levers.json"
#: The centre of the certificate whose sphere has the fewest boxes.
CHEAPEST = 24
#: Frames that are sampled.
COUNT = 1500


@dataclasses.dataclass
class Sample:
    """Tight frames in the chart of centre 0: t and z, 3 − tr P P_c, and P.

    nearest : whether no image of any centre is nearer.
    """

    t: np.ndarray
    z: np.ndarray
    own: np.ndarray
    P: np.ndarray
    nearest: np.ndarray

    @classmethod
    def of(cls, centres, t):
        """Return the frames at coordinates t; all of them are tight."""
        chart = centres.charts[0]
        z, residual = charts.middles(chart, t, np.zeros_like(t))
        found = residual < 1e-13
        t, z = t[found], z[found]
        P = projections(chart, (t @ chart.B + z @ chart.C).reshape(-1, 3, 4))
        own = 3 - (P * centres.P[0]).sum((1, 2))
        # images beyond twice the radius, as seen from the centre, are nearer to no frame
        near = [
            one[traces(chart.W, one) > 3 - 4.5 * centres.radius**2]
            for one in (images(other.W) for other in centres.charts)
        ]
        near = np.concatenate(near)
        near = np.swapaxes(near, 1, 2) @ near
        others = 3 - (P.reshape(-1, 49) @ near.reshape(-1, 49).T).max(1)
        return cls(t, z, own, P, others > own - 1e-12)

    def take(self, which):
        """Return some of the frames."""
        return Sample(*(values[which] for values in vars(self).values()))


@pytest.fixture(scope="module")
def centres():
    """A centre with others around it, which leave some of its sphere to it."""
    return surrounded(np.random.default_rng(10), radius=0.2, away=0.27, number=12)


@pytest.fixture(scope="module")
def region(centres):
    return Region.of(centres, 0)


@pytest.fixture(scope="module")
def within(centres):
    """Frames in the ball around centre 0, and some beyond it."""
    rng = np.random.default_rng(11)
    t = rng.normal(size=(COUNT, 6))
    t *= rng.uniform(0, 1.1 * centres.charts[0].greatest, (COUNT, 1)) / lengths(t)
    return Sample.of(centres, t)


@pytest.fixture(scope="module")
def on_sphere(centres):
    """Frames on the sphere: t is made longer or shorter until they are."""
    t = np.random.default_rng(12).normal(size=(COUNT, 6))
    t *= centres.radius / lengths(t)
    for _ in range(40):
        chart = centres.charts[0]
        z, _ = charts.middles(chart, t, np.zeros_like(t))
        P = projections(chart, (t @ chart.B + z @ chart.C).reshape(-1, 3, 4))
        own = 3 - (P * centres.P[0]).sum((1, 2))
        t *= (centres.radius / np.sqrt(own))[:, None]
    found = Sample.of(centres, t)
    return found.take(np.abs(found.own - centres.radius**2) < 1e-12)


def lengths(t):
    return np.linalg.norm(t, axis=1, keepdims=True)


def boxes_of(rng, sample, longest):
    """Return random boxes, each of which has one of the frames; some know where it is."""
    N = len(sample.t)
    h = longest * rng.uniform(0.1, 1, (N, 6))
    tau = np.clip(rng.uniform(-1.3, 1.3, (N, 6)), -1, 1)
    near = np.where(rng.integers(0, 2, N) > 0, np.inf, rng.uniform(0.01, 0.2, N))
    away = rng.normal(size=(N, 6))
    away *= (
        rng.uniform(0, 1, (N, 1)) * np.where(near < np.inf, near, 0)[:, None] / lengths(away)
    )
    tilt = 0.3 * h[:, :, None] * rng.normal(size=(N, 6, 6))
    z = sample.z - np.einsum("nk,nkm->nm", tau, tilt) + away
    return Nodes(
        t=sample.t - h * tau,
        h=h,
        z=z,
        tilt=tilt,
        near=near,
        signs=np.zeros(N, int),
        inherited=np.zeros((N, 89)),
        wait=np.arange(N),  # which frame
    )


def dropped(region, nodes, sphere):
    """Return which nodes are dropped, (N,) of truth values, the tally and what is left."""
    tally = Tally()
    left, c = region.remaining(nodes, tally, sphere)
    assert tally.nodes == len(nodes) == len(left) + sum(tally.ends.values())
    # bounds are of the boxes that are left
    assert c.K0.reshape(-1, 12) @ region.chart.B.T == pytest.approx(left.t)
    answer = np.ones(len(nodes), bool)
    answer[left.wait] = False
    return answer, tally, left


@pytest.mark.parametrize("longest", [0.004, 0.02, 0.06])
def test_no_box_with_a_frame_nearest_to_the_centre_is_dropped(centres, region, within, longest):
    rng = np.random.default_rng(13)
    some = within.nearest & (within.own <= centres.radius**2)
    assert some.sum() > 300
    gone, tally, left = dropped(region, boxes_of(rng, within, longest), sphere=False)
    assert not (gone & some).any()
    # what is left still has its frame
    inside = np.abs(within.t[left.wait] - left.t) <= left.h + 1e-12
    assert inside.all(1)[some[left.wait]].all()
    assert tally.ends[End.INSIDE] == 0
    if longest < 0.05:
        others = gone & ~some
        assert others.sum() > 0.2 * (~some).sum()
        for end in (End.OUTSIDE, End.BEYOND, End.NEARER):
            assert tally.ends[end] > 0


@pytest.mark.parametrize("longest", [0.004, 0.02, 0.06])
def test_no_box_with_a_nearest_frame_on_the_sphere_is_dropped_there(
    region, within, on_sphere, longest
):
    rng = np.random.default_rng(14)
    assert on_sphere.nearest.sum() > 50
    gone, tally, _ = dropped(region, boxes_of(rng, on_sphere, longest), sphere=True)
    assert not (gone & on_sphere.nearest).any()
    assert longest > 0.05 or tally.ends[End.NEARER] > 50
    # boxes that do not meet the sphere are dropped as well: on it nothing is in them
    gone, tally, _ = dropped(region, boxes_of(rng, within, longest), sphere=True)
    assert longest > 0.05 or tally.ends[End.INSIDE] > 0.2 * len(gone)


def test_along_a_tree_frames_are_kept(centres, region, within, on_sphere):
    """Boxes from the cube on, cut as in a tree: those with one of some frames remain."""
    for sample, sphere_only in ((within, False), (on_sphere, True)):
        some = sample.take(sample.nearest & (sample.own <= centres.radius**2 + 1e-12))
        some = some.take(slice(None, 60))
        assert len(some.t) > 30
        nodes = Nodes.cube(centres.charts[0].greatest)
        for _ in range(24):
            nodes, c = region.remaining(nodes, Tally(), sphere_only)
            nodes = nodes.halves(c, longest_edge(nodes, c))
            tau = (some.t - nodes.t[:, None]) / nodes.h[:, None]
            has = (np.abs(tau) <= 1 + 1e-9).all(2)
            assert has.any(0).all()
            # and what is known of z holds for it
            known = nodes.z[:, None] + np.einsum("nfk,nkm->nfm", tau, nodes.tilt)
            off = np.linalg.norm(some.z - known, axis=2)
            assert (
                off[has] <= np.broadcast_to(nodes.near[:, None], off.shape)[has] + 1e-9
            ).all()
            nodes = nodes.take(has.any(1))
        assert np.isfinite(nodes.near).all()


def test_margins_are_on_the_safe_side(centres, region, within):
    """Tiny boxes around a frame, for levels a little beside its trace."""
    frame = within.take(np.flatnonzero(within.nearest & (within.own < 0.05))[:1])
    h = np.full((1, 6), 1e-9)
    nodes = boxes_of(np.random.default_rng(0), frame, 1e-9)
    nodes = dataclasses.replace(nodes, t=frame.t, h=h, z=frame.z, near=np.full(1, 1e-6))
    nodes = dataclasses.replace(nodes, tilt=np.zeros((1, 6, 6)))
    for off, sphere_only, end in [
        (0.5, False, None),
        (-0.5, True, None),
        (0.5, True, None),
        (2, False, End.BEYOND),
        (2, True, End.BEYOND),
        (-2, True, End.INSIDE),
        (-2, False, None),
    ]:
        moved = dataclasses.replace(region, level=3 - frame.own[0] + off * MARGIN)
        moved = dataclasses.replace(moved, half_spaces=HalfSpaces(np.zeros((0, 7, 7))))
        gone, tally, _ = dropped(moved, nodes, sphere_only)
        assert list(+tally.ends) == ([] if end is None else [end])
        assert gone[0] == (end is not None)
    # half spaces that the frame is in by a share of the margin, or by more
    apart = np.zeros((7, 7))
    apart[0, 1] = apart[1, 0] = frame.P[0, 0, 1]
    for by, end in ((-0.5, None), (0.5, None), (2, End.NEARER)):
        X = apart * by * MARGIN / (apart * frame.P[0]).sum()
        one = dataclasses.replace(region, half_spaces=HalfSpaces(X[None]))
        gone, tally, _ = dropped(one, nodes, sphere=False)
        assert list(+tally.ends) == ([] if end is None else [end])


def test_large_boxes_have_no_bounds_but_are_cut_to_the_chart(region):
    tally = Tally()
    left, c = region.remaining(Nodes.cube(1.1 * LARGEST_HALF), tally, sphere=True)
    assert c is not None
    assert left.h.max() == pytest.approx(region.chart.greatest)
    wide = dataclasses.replace(region, chart=dataclasses.replace(region.chart, greatest=0.5))
    left, c = wide.remaining(Nodes.cube(0.6), tally, sphere=True)
    assert c is None
    assert left.h == pytest.approx(np.full((1, 6), 0.5))
    assert (tally.nodes, sum(tally.ends.values())) == (2, 0)


@pytest.mark.parametrize("sphere_only", [False, True])
def test_boxes_whose_bounds_do_not_hold_are_kept(region, sphere_only):
    wide = dataclasses.replace(region, chart=dataclasses.replace(region.chart, greatest=2.0))
    nodes = dataclasses.replace(Nodes.cube(0.2), t=np.full((1, 6), 0.6))
    gone, _, left = dropped(wide, nodes, sphere_only)
    assert not gone.any()
    assert not wide.remaining(nodes, Tally(), sphere_only)[1].ok.any()
    assert left.h == pytest.approx(nodes.h)


def test_region_is_of_its_centre(centres):
    region = Region.of(centres, 5)
    assert region.chart is centres.charts[5]
    assert np.array_equal(region.P, centres.P[5])
    assert region.level == pytest.approx(3 - 0.2**2)
    assert (region.half_spaces.X == centres.near(5).X).all()


def test_tallies_are_added():
    total = Tally()
    for k, end in enumerate((End.OWN, End.INHERITED, End.OWN, End.NEARER)):
        one = Tally(nodes=10 + k, programs=k, left=2 * k)
        one.ends[end] += 3
        total.add(one)
    assert +total.ends == {End.OWN: 6, End.INHERITED: 3, End.NEARER: 3}
    assert (total.nodes, total.programs, total.left) == (46, 6, 12)
    assert total.certificates == 9


@pytest.fixture(scope="module")
def certified():
    stated = json.loads(CERTIFICATE.read_text("utf-8"))
    return Centres.of_frames(np.array(stated["frames"]), stated["radius"])


def test_the_cheapest_sphere_of_the_certificate_has_no_box_left(certified):
    found = sphere(Region.of(certified, CHEAPEST))
    assert found.left == 0
    # all boxes are dropped or cut in two
    assert found.nodes == 2 * sum(found.ends.values()) - 1
    assert found.ends[End.NEARER] > 1000
    assert found.programs == found.certificates == 0


def test_sphere_cuts_boxes_whose_bounds_do_not_hold(certified, monkeypatch):
    real = regions.boxes

    def unsound(*given):
        c = real(*given)
        return dataclasses.replace(c, ok=np.zeros_like(c.ok))

    monkeypatch.setattr(regions, "boxes", unsound)
    found = sphere(Region.of(certified, CHEAPEST))
    assert found.left > 0
    assert found.ends[End.NEARER] == 0


def test_sphere_without_its_neighbours_has_boxes_left(certified):
    """Half spaces of those nearest to one point of the sphere are left out: it is a hole."""
    region = Region.of(certified, CHEAPEST)
    X = region.half_spaces.X
    nearness = (X @ X[0]).trace(axis1=1, axis2=2) / np.linalg.norm(X, axis=(1, 2))
    rest = HalfSpaces(X[np.argsort(nearness)[:-100]])
    assert sphere(dataclasses.replace(region, half_spaces=rest)).left > 0


def test_sphere_of_a_centre_alone_has_boxes_left():
    alone = surrounded(np.random.default_rng(15), radius=0.15, number=5)
    region = Region.of(Centres.of_frames([alone.charts[0].W], 0.15), 0)
    found = sphere(region)
    assert 0 < found.left < found.nodes
