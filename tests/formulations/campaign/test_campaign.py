"""A campaign that is interrupted and run again has the records of an uninterrupted one."""

import json
import os
import signal
import sqlite3
import time
import tracemalloc
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from lockedjoint.formulations import max_min, measures, residual
from lockedjoint.formulations.campaign.campaign import Declaration, declaration, run
from lockedjoint.formulations.campaign.records import (
    TIMES,
    cell_of,
    jacobian_of,
    open_store,
    settings_of,
)
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.formulations.solving.case import Case
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.executors import LocalExecutor

pytestmark = pytest.mark.processes
PLANAR = {"starts": 40, "models": ["free", "free-mean"], "joints": [3], "task_dimensions": [2]}
PLANAR |= {"formulations": ["residual", "max-min", "isotropy"]}
TOML = "\n".join(f"{key} = {json.dumps(value)}" for key, value in PLANAR.items())
RECORDS = 6 * 40


WORDS = ("campaign", "campaign.toml", "study.db")


@pytest.fixture
def launch(lockedjoint, tmp_path):
    """Return what starts the campaign; what still runs after the test is killed."""
    (tmp_path / "campaign.toml").write_text(TOML)
    started = []

    def launch():
        started.append(lockedjoint.start(*WORDS, "--workers", 2, cwd=tmp_path))
        return started[-1]

    yield launch
    for process in started:
        process.kill()
        process.wait(timeout=120)


def records(path):
    """All records of a store, apart from times, by what they are records of."""
    with open_store(path) as study:
        table = study.frame().drop(columns=list(TIMES)).to_dict("records")
    rows = [tuple((k, repr(v)) for k, v in row.items()) for row in table]
    assert len(set(rows)) == len(rows)
    return sorted(rows)


def count(path):
    """Return how many records a store has, none while it is made.

    After a kill in the middle of a transaction only a reader that may write can undo it.
    """
    for _ in range(100):
        try:
            with closing(sqlite3.connect(f"file:{path}?mode=rw", uri=True)) as database:
                return database.execute("SELECT count(*) FROM record").fetchone()[0]
        except sqlite3.OperationalError as error:
            if not Path(path).exists() or "no such table" in str(error):
                return 0
            time.sleep(0.05)  # in use
    return 0


def until(path, number, process):
    """Wait for so many records, two minutes at most."""
    deadline = time.monotonic() + 120
    while count(path) < number:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)


def workers_of(process):
    children = psutil.Process(process.pid).children()
    return [child for child in children if "popen_loky" in " ".join(child.cmdline())]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The records of a campaign that nothing interrupted."""
    path = tmp_path_factory.mktemp("whole") / "study.db"
    with open_store(path, writable=True) as store, ThreadPoolExecutor(1) as one:
        run(declaration(PLANAR), store, one)
    found = records(path)
    assert len(found) == RECORDS
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "number"), [("SIGKILL", 0), ("SIGKILL", 60), ("SIGINT", 100), ("SIGTERM", 100)]
)
def test_interrupted_and_run_again_it_equals_the_uninterrupted(
    launch, lockedjoint, tmp_path, whole, how, number
):
    store = tmp_path / "study.db"
    process = launch()
    until(store, number, process)
    workers = workers_of(process)
    (os.killpg if how == "SIGINT" else os.kill)(process.pid, getattr(signal, how))
    _, err = process.communicate(timeout=120)
    if how != "SIGKILL":
        assert process.returncode == 130
        assert err == "Interrupted: run the same command again to go on.\n"
    _, alive = psutil.wait_procs(workers, timeout=120)
    assert not alive, "no worker outlives its campaign"
    assert number <= count(store) < RECORDS
    again = lockedjoint.here(*WORDS, "--workers", 1, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert f"{RECORDS} of {RECORDS} records of 6 cases" in again.stdout
    assert records(store) == whole


def test_more_starts_and_cells_extend_a_study(tmp_path):
    small = declaration({**PLANAR, "starts": 12, "formulations": ["residual"]})
    more = declaration({**PLANAR, "starts": 25, "formulations": ["residual", "isotropy"]})
    with open_store(tmp_path / "s.db", writable=True) as store, ThreadPoolExecutor(1) as one:
        assert run(small, store, one).added == 2 * 12
        report = run(more, store, one)
    assert (report.asked, report.added, report.missing) == (4 * 25, 2 * 25 + 2 * 13, 0)


def test_records_hold_what_the_jacobian_says(tmp_path):
    with open_store(tmp_path / "s.db", writable=True) as store, ThreadPoolExecutor(1) as one:
        run(declaration({**PLANAR, "starts": 10}), store, one)
        for row in store.frame().to_dict("records"):
            jacobian = jacobian_of(row["jacobian"], 2, 3)
            assert row["worst_case_sigma"] == measures.worst_case_sigma(jacobian)
            assert row["isotropy_defect"] == measures.isotropy_defect(jacobian)
            assert "casadi" in row["environment"]
            assert row["cpu_seconds"] > 0


def test_memory_does_not_grow_with_starts(tmp_path):
    """What is stored is not kept in this process, where three times the starts would show."""
    case, peaks = Case(residual, arm("free", 3, 2)), []
    with open_store(tmp_path / "s.db", writable=True) as store, LocalExecutor(2) as two:
        tracemalloc.start()
        for starts in (50, 150, 450):
            tracemalloc.reset_peak()
            run(Declaration((case,), starts), store, two)
            peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] - peaks[1] < 300 * 400, "a record is 2 kB and more as Python objects"


def test_variants_of_max_min_do_not_multiply_the_others():
    grid = {"encodings": ["shared-factor", "factor-per-deletion"]}
    cases = declaration({**PLANAR, **grid, "from_residual_minima": [False, True]}).cases
    names = [case.formulation.NAME for case in cases]
    assert Counter(names) == {"residual": 2, "max-min": 8, "isotropy": 2}


def test_a_setting_that_is_none_is_read_again():
    """A user's formulation may have one whose default is another."""
    own = SimpleNamespace(NAME="own", SETTINGS={"failures": 1, "width": 1.0})
    case = SimpleNamespace(
        formulation=own,
        arm=arm("free", 3, 2),
        model="free",
        settings={"failures": 1, "width": None},
        solver="ipopt",
        all_options={},
    )
    assert settings_of(cell_of(case, 0))["width"] is None


def test_refuses_a_failure_model_that_no_setting_would_identify():
    """Two failure models would share one cell, and the second get the records of the first."""
    case = Case(max_min, arm("free", 3, 2), {"failures": FailureModel((0.5, 0.25, 0.25))})
    with pytest.raises(InputError, match="failures is given; allowed: left out in a campaign"):
        cell_of(case, 0)
