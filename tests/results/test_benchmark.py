"""The benchmark counts what is checked, and every peer solves what it claims to."""

import importlib.util
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from formulations import measures
from formulations.io import pages
from formulations.io.study import Effort
from formulations.joints.models import arm
from results.benchmark import benchmark
from results.benchmark import other_libraries as hand
from results.benchmark.benchmark import BenchmarkRow, measure, study
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
    np.testing.assert_allclose(slopes, change, atol=1e-6)


# JAX's threads make every later fork of the process that imports it a risk.
HERE = [peer for peer in PEERS if "JAX" not in peer.name]


@pytest.mark.skipif(not importlib.util.find_spec("jax"), reason="JAX is missing")
def test_jax_reaches_the_known_optimum_in_a_process_of_its_own():
    code = (
        "import numpy as np\n"
        "from formulations import measures\n"
        "from formulations.joints.models import arm\n"
        "from results.benchmark.peers import PEERS\n"
        "seven = arm('unit-revolute', 7)\n"
        "starts = np.array([seven.sample(np.random.default_rng(k)) for k in range(2)])\n"
        "for peer in PEERS:\n"
        "    for jacobian in peer.prepare(seven, 2)(starts) if peer.batched else ():\n"
        "        seven.variables(jacobian)\n"
        "        print(measures.isotropy_defect(jacobian))"
    )
    root = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": root}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    defects = [float(x) for x in done.stdout.split()]
    np.testing.assert_allclose(defects, [0.0568265] * 4, atol=1e-6)


@pytest.mark.parametrize("peer", HERE, ids=lambda peer: peer.name)
def test_every_peer_reaches_the_known_optimum(peer, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
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


def fixed(jacobian_of):
    return Peer("fixed", "residual", lambda _: jacobian_of)


def missing(arm):
    raise ModuleNotFoundError("No module named 'nothing'", name="nothing")


def cannot(arm):
    raise NotRunError("too few residuals")


def test_success_is_what_the_jacobian_says_not_the_peer():
    good, *_ = (peer for peer in PEERS if "Fatrop" in peer.name)
    rows = measure(
        [
            good,
            fixed(SEVEN.jacobian),
            fixed(lambda _: np.zeros((6, 7))),
            fixed(lambda _: np.full((6, 7), np.nan)),
            Peer("missing", "residual", missing),
            Peer("cannot", "residual", cannot),
        ],
        joints=7,
        starts=5,
        seed=0,
    )
    assert [row.success for row in rows] == [5, 0, 0, 0, 0, 0]
    assert [row.starts for row in rows] == [5, 5, 5, 5, 0, 0]
    assert rows[0].relative == 1
    assert rows[0].cpu_seconds_per_success == rows[0].cpu_seconds_per_start > 0
    assert min(rows[0].rounds) <= rows[0].cpu_seconds_per_success <= max(rows[0].rounds)
    assert np.isnan(rows[1].cpu_seconds_per_success)
    notes = [row.note for row in rows[4:]]
    assert notes == ["not installed: nothing", "too few residuals"]


def row(peer, *milliseconds, formulation="residual", joints=7):
    first, second, third = (one / 1e3 for one in milliseconds)
    times = (0.001, second, 1.0, first, second, third)
    return BenchmarkRow(formulation, joints, peer, "", 3, 3, 3, 3, *times, 0.0, "")


def shown(block, rows):
    """A table of the page, without the spaces that align it."""
    values = {**study().settings, "rows": rows}
    return re.sub(" +", " ", pages.block(study().template, block, values))


def test_the_study_writes_its_table_and_its_figure(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "PEERS", [fixed(SEVEN.jacobian)])
    assert benchmark.study([7]).run(tmp_path, Effort(starts=3)).complete
    assert "residual, 7R" in (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    assert len((tmp_path / "benchmark.csv").read_text().splitlines()) == 2
    assert (tmp_path / "cost.svg").exists()


def test_libraries_that_peers_bring_are_held_to_one_thread(monkeypatch):
    from threadpoolctl import threadpool_info, threadpool_limits

    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    seen = []

    def prepare(arm):
        import scipy.linalg  # noqa: F401, brings a library of linear algebra of its own

        def solve(start):
            seen.append({library["num_threads"] for library in threadpool_info()})
            return np.zeros((6, 7))

        return solve

    with threadpool_limits(limits=2, user_api="blas"):
        measure([Peer("threads", "residual", prepare)], joints=7, starts=1, seed=0)
    assert seen[-1] == {1}


def test_who_uses_up_its_time_is_stopped_and_shown():
    def slow(start):
        began = time.process_time()
        while time.process_time() < began + 0.02:
            pass
        return SEVEN.jacobian(start)

    peers = [fixed(SEVEN.jacobian), fixed(slow)]
    quick, stopped = measure(peers, 7, starts=12, seed=0, time_limit=0.058)
    assert (quick.starts, quick.note) == (12, "")
    assert (stopped.asked, stopped.starts) == (12, 3)
    assert stopped.note == "stopped after 0.058 s"
    assert 0.02 <= stopped.cpu_seconds_per_start < 0.2
    assert shown("growth", [stopped]).rstrip().endswith("*")
