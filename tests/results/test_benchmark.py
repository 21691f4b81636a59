"""The benchmark counts what is checked, and every peer solves what it claims to."""

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.joints.models import arm
from results.benchmark import other_libraries as hand
from results.benchmark.benchmark import measure
from results.benchmark.other_libraries import NotRunError
from results.benchmark.peers import PEERS, Peer

SEVEN = arm("unit-revolute", 7)
STARTS = np.array([SEVEN.sample(np.random.default_rng(k)) for k in range(2)])


def derivative(function, start, h=1e-6):
    """Central differences, shape (values, variables)."""
    steps = h * np.eye(len(start))
    ends = [[function(start + sign * step) for step in steps] for sign in (1, -1)]
    return np.subtract(*map(np.array, ends)).T / (2 * h)


def test_hand_written_residuals_and_eigenvalues_are_those_of_the_models():
    start = STARTS[0]
    matrix = SEVEN.jacobian(start)
    np.testing.assert_allclose(hand.jacobian(start), matrix, atol=1e-14)
    rows = hand.residuals(start)
    assert rows @ rows == pytest.approx(measures.isotropy_defect(matrix))
    change = derivative(hand.residuals, start)
    np.testing.assert_allclose(hand.derivatives(start), change, atol=1e-8)
    values, slopes = hand.locked_eigenvalues(start)
    sigmas = [np.linalg.svd(np.delete(matrix, f, axis=1))[1] for f in range(7)]
    np.testing.assert_allclose(np.sort(values), np.sort(np.ravel(sigmas) ** 2), atol=1e-12)
    change = derivative(lambda x: hand.locked_eigenvalues(x)[0], start)
    np.testing.assert_allclose(slopes(), change, atol=1e-6)
    least, slope = hand.locked_eigenvalues(start, 1)
    np.testing.assert_array_equal(least, values[::6])
    np.testing.assert_allclose(slope(), change[::6], atol=1e-6)


# JAX's threads make every later fork of the process that imports it a risk.
HERE = [peer for peer in PEERS if "JAX" not in peer.name]


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory):
    """What peers compile is compiled once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def with_marks(peer):
    compiled = "compiled" in peer.name or "written C" in peer.name
    return pytest.param(peer, id=peer.name, marks=[pytest.mark.compiler] * compiled)


@pytest.mark.parametrize("peer", [with_marks(peer) for peer in HERE])
def test_every_peer_reaches_the_known_optimum(peer):
    try:
        solve = peer.prepare(SEVEN)
    except (ImportError, NotRunError) as reason:
        missing = ': pip install ".[peers]"' if isinstance(reason, ImportError) else ""
        pytest.skip(f"{reason}{missing}")
    jacobians = [solve(start) for start in STARTS]
    for jacobian in jacobians:
        SEVEN.variables(jacobian)
    if peer.formulation == "residual":
        best = min(measures.isotropy_defect(jacobian) for jacobian in jacobians)
        assert best == pytest.approx(0.0568265, abs=1e-6)
    else:
        best = max(measures.worst_case_sigma(jacobian) for jacobian in jacobians)
        assert best == pytest.approx(0.571483, abs=2e-5)


def made_up(answer):
    """A peer that answers alike from every start, or cannot be prepared."""

    def prepare(arm):
        if isinstance(answer, Exception):
            raise answer
        return answer

    return Peer("made up", "residual", prepare)


def test_success_is_what_the_jacobian_says_not_the_peer():
    good, *_ = (peer for peer in PEERS if "Fatrop" in peer.name)
    missing = ModuleNotFoundError("No module named 'nothing'", name="nothing")
    zeros, nans = np.zeros((6, 7)), np.full((6, 7), np.nan)
    answers = (SEVEN.jacobian, lambda _: zeros, lambda _: nans, missing)
    others = map(made_up, (*answers, NotRunError("too few residuals")))
    rows = measure([good, *others], joints=7, starts=5, seed=0)
    assert [row.success for row in rows] == [5, 0, 0, 0, 0, 0]
    assert [row.starts for row in rows] == [5, 5, 5, 5, 0, 0]
    assert rows[0].relative == 1
    assert rows[0].cpu_seconds_per_success == rows[0].cpu_seconds_per_start > 0
    assert min(rows[0].rounds) <= rows[0].cpu_seconds_per_success <= max(rows[0].rounds)
    assert np.isnan(rows[1].cpu_seconds_per_success)
    notes = [row.note for row in rows[4:]]
    assert notes == ["not installed: nothing", "too few residuals"]
