"""A campaign that is interrupted and run again has the records of an uninterrupted one."""

import json
import os
import signal
import time

import numpy as np
import psutil
import pytest

from formulations import max_min, measures, residual
from formulations.campaign.campaign import Declaration, declaration, run
from formulations.campaign.records import TIMES, cell_of, jacobian_of, open_store
from formulations.campaign.tables import frame
from formulations.joints.models import arm
from formulations.measures.unequal_failures import FailureModel
from formulations.solving.case import Case
from nlp.errors import FileError, InputError
from nlp.executors import LocalExecutor

pytestmark = pytest.mark.processes
PLANAR = {
    "starts": 150,
    "formulations": ["residual", "max-min", "isotropy"],
    "models": ["free", "free-mean"],
    "joints": [3],
    "task_dimensions": [2],
}
TOML = "\n".join(f"{key} = {json.dumps(value)}" for key, value in PLANAR.items())
RECORDS = 6 * 150


CAMPAIGN = ("campaign", "campaign.toml")


@pytest.fixture(scope="module")
def launch(lockedjoint):
    def launch(folder, *more, store="study.db"):
        where = () if "--scheduler" in more else ("--workers", 2)
        return lockedjoint.start(*CAMPAIGN, "--store", store, *where, *more, cwd=folder)

    return launch


@pytest.fixture(scope="module")
def finish(launch):
    def finish(folder, *more, **keywords):
        process = launch(folder, *more, **keywords)
        out, err = process.communicate(timeout=120)
        return process.returncode, out, err

    return finish


def records(path):
    """All records of a store, apart from times, by what they are records of."""
    with open_store(path) as study:
        rows = [
            tuple((k, repr(v)) for k, v in row.items() if k not in TIMES)
            for row in study.frame().to_dict("records")
        ]
    assert len(set(rows)) == len(rows)
    return sorted(rows)


def count(path):
    if not path.exists():
        return 0
    try:
        with open_store(path) as study:
            return len(study.frame([]))
    except FileError:  # just being made
        return 0


def until(path, number, process):
    while count(path) < number:
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def workers_of(process):
    children = psutil.Process(process.pid).children()
    return [child for child in children if "popen_loky" in " ".join(child.cmdline())]


@pytest.fixture(scope="module")
def whole(finish, tmp_path_factory):
    """The records of a campaign that nothing interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "campaign.toml").write_text(TOML)
    status, out, err = finish(folder)
    assert status == 0, err
    assert f"{RECORDS} of {RECORDS} records of 6 cases" in out
    found = records(folder / "study.db")
    assert len(found) == RECORDS
    return found


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "campaign.toml").write_text(TOML)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    "how",
    [
        "SIGKILL",
        pytest.param("SIGINT", marks=pytest.mark.long),
        pytest.param("SIGTERM", marks=pytest.mark.long),
    ],
)
def test_interrupted_and_run_again_it_equals_the_uninterrupted(
    launch, finish, folder, whole, how
):
    store = folder / "study.db"
    for number in (100, 500):
        process = launch(folder)
        until(store, number, process)
        workers = workers_of(process)
        os.kill(process.pid, getattr(signal, how))
        _, err = process.communicate(timeout=120)
        if how == "SIGINT":
            assert process.returncode == 130
            assert err == "Interrupted: run the same command again to go on.\n"
        _, alive = psutil.wait_procs(workers, timeout=120)
        assert not alive, "no worker outlives its campaign"
        assert number <= count(store) < RECORDS
    status, _, err = finish(folder)
    assert status == 0, err
    assert records(store) == whole
    assert finish(folder)[1].endswith("0 of them new.\n")


def test_a_worker_killed_mid_run_costs_nothing(launch, folder, whole):
    process = launch(folder)
    until(folder / "study.db", 100, process)
    victim = workers_of(process)[0]
    victim.kill()
    _, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    assert records(folder / "study.db") == whole


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:Port .* is already in use:UserWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_dask_gives_the_same_records(launch, folder, whole):
    distributed = pytest.importorskip(
        "distributed", reason='Dask is missing: pip install ".[cluster]"'
    )
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        process = launch(folder, "--scheduler", cluster.scheduler_address)
        until(folder / "study.db", 100, process)
        next(iter(cluster.workers.values())).process.process.kill()
        _, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert records(folder / "study.db") == whole


def test_more_starts_and_cells_extend_a_study(tmp_path):
    small = declaration({**PLANAR, "starts": 12, "formulations": ["residual"]})
    more = declaration({**PLANAR, "starts": 25, "formulations": ["residual", "isotropy"]})
    with open_store(tmp_path / "s.db", writable=True) as store, LocalExecutor(2) as two:
        assert run(small, store, two).added == 2 * 12
        report = run(more, store, two)
    assert (report.asked, report.added, report.missing) == (4 * 25, 2 * 25 + 2 * 13, 0)


def test_records_hold_what_the_jacobian_says(tmp_path):
    with open_store(tmp_path / "s.db", writable=True) as store, LocalExecutor(2) as two:
        run(declaration({**PLANAR, "starts": 10}), store, two)
        for row in store.frame().to_dict("records"):
            jacobian = jacobian_of(row["jacobian"], 2, 3)
            assert row["worst_case_sigma"] == measures.worst_case_sigma(jacobian)
            assert row["isotropy_defect"] == measures.isotropy_defect(jacobian)
            assert "casadi" in row["environment"]
            assert row["cpu_seconds"] > 0


@pytest.mark.long
def test_memory_does_not_grow_with_starts(tmp_path):
    """Ten times the starts must not need more memory: results are not kept in this process."""
    case = Case(residual, arm("free", 3, 2))
    process, used = psutil.Process(), []
    with open_store(tmp_path / "s.db", writable=True) as store, LocalExecutor(2) as two:
        for starts in (400, 800, 4000):
            run(Declaration((case,), starts), store, two)
            used.append(process.memory_info().rss)
    assert used[2] - used[1] < 4e6, "3200 records would be 6 MB and more as Python objects"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"startz": 3}, "key of the campaign file is startz; allowed: one of starts"),
        ({"starts": 0}, "starts is 0"),
        ({"starts": "many"}, "starts is many"),
        ({"seed": -1}, "seed is -1"),
        ({"joints": []}, "joints is"),
        ({"joints": 7}, "a list of whole numbers"),
        ({"joints": [True]}, "a list of whole numbers"),
        ({"formulations": ["other"]}, "formulation is other"),
        ({"models": ["unit-revolute"]}, "6 for the model unit-revolute"),
        ({"encodings": ["other"]}, "encoding is other"),
        ({"locked": [2]}, "at most the degree of redundancy"),
        ({"solver": "other"}, "one of ipopt, fatrop"),
        ({"solver": "fatrop"}, "without constraints or bounds"),
        ({"compiled": 1}, "true or false"),
        ({"options": {"tolerance": 1}}, "Ipopt option is tolerance"),
        ({"options": 3}, "a table of solver options"),
    ],
)
def test_refuses_a_campaign_before_any_work(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        declaration({**PLANAR, **change})


def test_a_missing_key_is_named():
    with pytest.raises(InputError, match="without models"):
        declaration({key: value for key, value in PLANAR.items() if key != "models"})


@pytest.mark.parametrize(
    ("text", "store"),
    [
        (None, "study.db"),
        ("starts = ", "study.db"),
        ("starts = 3", "study.db"),
        (TOML, "campaign.toml"),
        (TOML, "no/folder.db"),
    ],
)
def test_bad_files_are_one_sentence_and_leave_nothing(finish, tmp_path, text, store):
    if text is not None:
        (tmp_path / "campaign.toml").write_text(text)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    status, out, err = finish(tmp_path, store=store)
    assert (status, out) == (2, "")
    assert err.startswith("Error: ")
    assert len(err.splitlines()) == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_variants_of_max_min_do_not_multiply_the_others():
    grid = {"encodings": ["shared-factor", "factor-per-deletion"]}
    cases = declaration({**PLANAR, **grid, "from_residual_minima": [False, True]}).cases
    names = [case.formulation.NAME for case in cases]
    assert {name: names.count(name) for name in names} == {
        "residual": 2,
        "max-min": 8,
        "isotropy": 2,
    }


def test_refuses_a_failure_model_that_no_setting_would_identify():
    """Two failure models would share one cell, and the second get the records of the first."""
    case = Case(max_min, arm("free", 3, 2), {"failures": FailureModel((0.5, 0.25, 0.25))})
    with pytest.raises(InputError, match="failures is given; allowed: left out in a campaign"):
        cell_of(case, 0)


def test_compiled_cells_are_cells_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    seven = arm("unit-revolute", 7)
    plain, fast = (Case(residual, seven, solver="fatrop", compiled=c) for c in (False, True))
    with open_store(tmp_path / "s.db", writable=True) as store, LocalExecutor(2) as two:
        run(Declaration((plain, fast), 10), store, two)
        table = frame(store)
    assert list(table["compiled"]) == [False] * 10 + [True] * 10
    np.testing.assert_allclose(table["score"], 0.0568265, atol=1e-6)


def test_a_store_that_is_removed_meanwhile_is_no_success(launch, folder):
    """The records that it was asked for are in no file of that name."""
    process = launch(folder)
    until(folder / "study.db", 100, process)
    (folder / "study.db").unlink()
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (1, "")
    assert "a file that nobody removes or replaces" in err


def test_an_interrupt_ends_it_within_seconds(launch, folder):
    process = launch(folder)
    until(folder / "study.db", 100, process)
    began = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert time.monotonic() - began < 5, "1.5 s on a machine without other work"
    assert (process.returncode, err) == (
        130,
        "Interrupted: run the same command again to go on.\n",
    )
