"""The rows of other tools in the study of speed."""

from types import SimpleNamespace

import numpy as np
import pytest


@pytest.fixture
def speed():
    for needed in ("pinocchio", "coal"):
        pytest.importorskip(needed)
    from results.speed import speed

    return speed


def test_a_tool_that_is_missing_has_a_row_without_times(speed, monkeypatch):
    from results.speed.peers import Peer

    def missing():
        raise ModuleNotFoundError

    made = [
        Peer("one", "of_none", "a task", missing),
        Peer("other", "numpy", "another task", lambda: ("words {}".format, 3)),
    ]
    robot = SimpleNamespace(arm=SimpleNamespace(samples=lambda *_: np.zeros((2, 7))))
    monkeypatch.setattr(speed, "peers", lambda *_: made)
    monkeypatch.setattr(speed, "_in_cell", lambda robot: robot)
    monkeypatch.setattr(speed, "_far_from_singular", lambda *given: given[1])
    effort = SimpleNamespace(seed=0, progress=print)
    absent, there = speed._peers(robot, abs, effort)
    assert (absent.what, absent.found) == ("one", "of_none is not installed")
    assert np.isnan(absent.least_ms)
    assert there.found == "another task; words 0; words 1; words 2"
    assert there.least_ms >= 0
