"""Campaigns under kills, full disks, damaged stores and dead schedulers: ten minutes.

Not collected with the other tests: ``python -m pytest -n 0 -s tests/stress.py``. Each test
prints how many records were lost or doubled, and how many faults had exit status 0.
"""

import json
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count

import pytest

from formulations.campaign.records import TIMES, open_store
from nlp.errors import LockedJointError

pytestmark = [pytest.mark.slow, pytest.mark.processes]
STARTS, CELLS = 150, 6
TOML = f"""
starts = {STARTS}
formulations = ["residual", "max-min", "isotropy"]
models = ["free", "free-mean"]
joints = [3]
task_dimensions = [2]
"""
CAMPAIGN = ("campaign", "campaign.toml", "--store", "s.db")
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
LIMITED = """
import resource, runpy, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
sys.argv = ["lockedjoint", *sys.argv[2:]]
runpy.run_module("formulations", run_name="__main__")
"""


def records(path):
    """Records of a store without their times, and how often each is there."""
    with open_store(path) as store:
        rows = store.frame().to_dict("records")
        return Counter(
            tuple((name, repr(value)) for name, value in row.items() if name not in TIMES)
            for row in rows
        )


class Tally:
    """What went wrong in a test."""

    def __init__(self, whole):
        self.whole, self.faults = whole, 0
        self.wrong = {"lost": 0, "doubled": 0, "silent": 0, "in more than a sentence": 0}

    def add(self, status, err):
        """Count a fault that a command met: noticed, in one sentence?"""
        self.faults += 1
        self.wrong["silent"] += status == 0
        self.wrong["in more than a sentence"] += "Traceback" in err or err.count("\n") > 3

    def compare(self, path):
        found = records(path)
        self.wrong["lost"] += sum((self.whole - found).values())
        self.wrong["doubled"] += sum((found - self.whole).values())

    def report(self, name):
        print(f"\n{self.faults} {name}: {self.wrong}")
        assert not any(self.wrong.values())


@pytest.fixture(scope="module")
def whole(lockedjoint, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "campaign.toml").write_text(TOML)
    assert lockedjoint(*CAMPAIGN, cwd=folder).returncode == 0
    return folder / "s.db"


@pytest.fixture
def tally(whole):
    found = Tally(records(whole))
    assert sum(found.whole.values()) == STARTS * CELLS
    return found


def campaign_in(folder):
    folder.mkdir()
    (folder / "campaign.toml").write_text(TOML)
    return folder


def wait_for_work(process, folder):
    """Wait until a campaign has opened its store, or ended."""
    while process.poll() is None and not (folder / "s.db").exists():
        time.sleep(0.02)


def test_kills(lockedjoint, tmp_path, tally):
    draw, at_work = random.Random(1), 0
    for number in count():
        if tally.faults >= 50:
            break
        folder = campaign_in(tmp_path / str(number))
        status = None
        while status != 0:
            process = lockedjoint.start(*CAMPAIGN, "--workers", 2, cwd=folder)
            try:
                # At least one in five runs is left alone, so that also slow machines end.
                spared = tally.faults >= 50 or draw.random() < 0.2
                if not spared and draw.random() < 0.8:
                    wait_for_work(process, folder)
                timeout = None if spared else draw.uniform(0, 1)
                _, err = process.communicate(timeout=timeout)
                status = process.returncode
                assert status == 0, err
            except subprocess.TimeoutExpired:
                process.kill()
                tally.add(process.wait(), process.communicate()[1])
                at_work += (folder / "s.db").exists()
        tally.compare(folder / "s.db")
    print(f"\n{at_work} of the kills came after the store was made")
    tally.report("kills")


def test_full_disks(lockedjoint, tmp_path, tally, whole):
    resource = pytest.importorskip("resource")
    assert resource.RLIMIT_FSIZE
    draw = random.Random(2)
    for number in range(10):
        folder = campaign_in(tmp_path / str(number))
        limit = int(whole.stat().st_size * draw.uniform(0.05, 0.8))
        full = subprocess.run(
            [sys.executable, "-c", LIMITED, str(limit), *CAMPAIGN],
            **{"cwd": folder, "env": lockedjoint.environment()},
            **{"capture_output": True, "text": True, "check": False},
        )
        tally.add(full.returncode, full.stderr)
        assert lockedjoint(*CAMPAIGN, cwd=folder).returncode == 0
        tally.compare(folder / "s.db")
    tally.report("full disks")


def test_damaged_stores(lockedjoint, tmp_path, tally, whole):
    if "--check" not in lockedjoint("show", "--help", cwd=tmp_path).stdout:
        pytest.skip("needs show --check")
    draw = random.Random(3)
    content = whole.read_bytes()

    def damaged(number):
        path = tmp_path / f"{number}.db"
        shutil.copy(whole, path)
        if number % 5 == 0:
            path.write_bytes(content[: draw.randrange(len(content))])
        else:
            changed = bytearray(content)
            for _ in range(draw.choice([1, 8, 200])):
                changed[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
            path.write_bytes(changed)
        return path

    def tried(path):
        commands = (("show", path, "--check"), ("show", path))
        commands += (("join", path.with_suffix(".joined.db"), path),)
        return path, [lockedjoint(*command, cwd=tmp_path) for command in commands]

    harmless = 0
    with ThreadPoolExecutor(2) as two:
        for path, done in two.map(tried, [damaged(number) for number in range(50)]):
            try:
                same = records(path) == tally.whole
            except LockedJointError:
                same = False
            harmless += same
            check, shown, joined = done
            # Damage of what holds no record, such as a free page, may go unnoticed.
            tally.add(check.returncode or same, check.stderr)
            for one in (shown, joined):
                tally.wrong["in more than a sentence"] += "Traceback" in one.stderr
            if joined.returncode == 0:
                merged = records(path.with_suffix(".joined.db"))
                tally.wrong["silent"] += merged != tally.whole
    print(f"\n{harmless} of the damages changed no record")
    tally.report("damaged stores")


@contextmanager
def cluster(folder, env):
    """Yield the address and the processes of a Dask scheduler and a worker without nanny."""
    dask = [sys.executable, "-m", "dask"]
    words = "scheduler --port 0 --host 127.0.0.1 --no-dashboard --scheduler-file f.json"
    processes = [subprocess.Popen([*dask, *words.split()], cwd=folder, env=env, **QUIET)]
    while not (file := folder / "f.json").exists() or not file.read_text():
        time.sleep(0.05)
    words = "worker --scheduler-file f.json --no-nanny --nthreads 1 --no-dashboard"
    processes += [subprocess.Popen([*dask, *words.split()], cwd=folder, env=env, **QUIET)]
    try:
        yield json.loads(file.read_text())["address"], processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_dead_schedulers(lockedjoint, tmp_path, tally):
    pytest.importorskip("distributed")
    draw = random.Random(4)
    for number in range(4):
        folder = campaign_in(tmp_path / str(number))
        with cluster(folder, lockedjoint.environment()) as (address, [scheduler, _]):
            process = lockedjoint.start(*CAMPAIGN, "--scheduler", address, cwd=folder)
            wait_for_work(process, folder)
            time.sleep(draw.uniform(0, 1))
            scheduler.kill()
            err = process.communicate(timeout=120)[1]
        tally.add(process.returncode, err)
        assert lockedjoint(*CAMPAIGN, cwd=folder).returncode == 0
        tally.compare(folder / "s.db")
    tally.report("dead schedulers")
