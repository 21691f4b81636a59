"""What is kept of configurations is what would be computed again."""

import pickle

import numpy as np
import pytest

from lockedjoint.clearance import known_gaps
from lockedjoint.clearance.known_gaps import KnownGaps
from lockedjoint.clearance.read_clearance import read_clearance

BOX = '<box size="0.08 0.08 0.08"/>'


@pytest.fixture
def clearance(made, tmp_path):
    pytest.importorskip("coal")
    path = tmp_path / "robot.urdf"
    path.write_text(made.with_shapes(made.offset_arm(), range(1, 8), BOX))
    arm = made.arm(path.read_text())
    return read_clearance(path, arm.chain, 0.02), arm


def test_kept_distances_are_those_that_are_computed(clearance, monkeypatch):
    """Also where there is room for few, so that all are forgotten now and then."""
    found, arm = clearance
    monkeypatch.setattr(known_gaps, "_KEPT", 60 * len(found.pairs))
    known, rng = KnownGaps(found), np.random.default_rng(1)
    some = arm.samples(rng, 25)
    for _ in range(20):
        fresh = arm.samples(rng, int(rng.integers(0, 90)))
        q = np.vstack([some[rng.integers(0, 25, 20)], fresh]).T
        wanted = rng.random((len(found.pairs), q.shape[1])) < 0.2
        distances = found.distances(q)
        assert known.capsules(q) == pytest.approx(distances, abs=1e-12)
        exact = found.gaps(q, wanted, distances)
        assert known.exact(q, wanted) == pytest.approx(exact, abs=1e-12)


def test_nothing_is_computed_twice(clearance, monkeypatch):
    found, arm = clearance
    known, q = KnownGaps(found), arm.samples(np.random.default_rng(1), 10).T
    wanted = np.ones((len(found.pairs), 10), dtype=bool)
    first = known.exact(q, wanted)

    def never(*_):
        raise AssertionError

    for name in ("distances", "gaps"):
        monkeypatch.setattr(type(found), name, never)
    assert np.array_equal(known.exact(q[:, ::-1], wanted)[:, ::-1], first)


def test_what_is_known_does_not_travel(clearance):
    found, arm = clearance
    known, q = KnownGaps(found), arm.samples(np.random.default_rng(1), 10).T
    distances = known.capsules(q)
    assert len(pickle.dumps(known)) < len(pickle.dumps(found)) + 200
    assert np.array_equal(pickle.loads(pickle.dumps(known)).capsules(q), distances)
