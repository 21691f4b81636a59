"""What all tests share: their workers, their seeds, expensive results and the command line.

The tests run on all cores, by pytest-xdist with ``--dist loadfile``: tests of one file stay on
one worker, so that the fixtures of a file are made once. Of tests that kill or time processes,
which are marked ``processes``, no two run at the same time: their files stay on one worker, so
that no worker waits for another. Files that take long begin first, so that at the end no worker
has one of these while the others have none.
"""

from __future__ import annotations

import gc
import json
import os
import pickle
import random
import signal
import subprocess
import sys
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from copy import deepcopy
from functools import cache
from pathlib import Path
from shutil import which
from tempfile import TemporaryFile
from time import process_time
from timeit import timeit
from types import ModuleType
from typing import Any
from unittest.mock import patch

import pytest
from filelock import FileLock
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

ROOT = Path(__file__).parents[1]

# The modules that are collected make half a million objects, which stay to the end. To look for
# garbage among them again and again took a tenth of the time of the tests.
gc.disable()
# So many new objects are the least among which garbage is looked for: by default 700.
_NEW_OBJECTS = 10_000


def pytest_collection_finish() -> None:
    """Look for garbage from here on, among what the tests themselves make."""
    gc.freeze()
    gc.set_threshold(_NEW_OBJECTS)
    gc.enable()


# Before NumPy is imported, and inherited by workers and child processes: the cores are busy
# with other tests, and more threads than cores wait for one another.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
# A command has one worker by default: the other cores are busy with other tests.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")

# The same examples everywhere, and no limit on time on shared machines.
settings.register_profile("lockedjoint", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("lockedjoint")


@cache
def has_processes(file: str) -> bool:
    """Whether some tests of a file are marked `processes`."""
    return "mark.processes" in (ROOT / file).read_text(encoding="utf-8")


class _Scheduling(LoadFileScheduling):
    """Give a file to a worker, all files with tests marked `processes` to one."""

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return "processes" if has_processes(file) else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _Scheduling | None:
    """Return what gives files to workers, in the order in which they are collected."""
    if config.getvalue("dist") != "loadfile":
        return None
    config.option.loadscopereorder = False
    return _Scheduling(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the files that take long first, where several workers take them one by one."""
    if not hasattr(config, "workerinput"):
        return
    weights = Counter[str]()
    for item in items:
        file = item.nodeid.partition("::")[0]
        marks = {mark.name for mark in item.iter_markers()}
        weights[file] += 100 if "long" in marks else 20 if "slow" in marks else 1
    for file in weights:
        weights[file] += 10**6 * has_processes(file)
    items.sort(key=lambda item: -weights[item.nodeid.partition("::")[0]])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what cannot run, and seed the global generators by the name of the test."""
    import numpy as np  # not earlier: it reads the number of threads when it is imported

    if item.get_closest_marker("compiler") and not any(map(which, ("cc", "gcc", "clang"))):
        pytest.skip("no C compiler")
    seed = zlib.crc32(f"{item.path.relative_to(ROOT).as_posix()}::{item.name}".encode())
    random.seed(seed)
    np.random.seed(seed)


@pytest.fixture(autouse=True)
def alone(request: pytest.FixtureRequest, common: Path) -> Iterator[None]:
    """Let a test that is marked `processes` wait until no other one of these runs."""
    if request.node.get_closest_marker("processes") is None:
        yield
        return
    with FileLock(common / "processes.lock"):
        yield


@pytest.fixture(scope="session")
def cpu_seconds() -> Callable[[Callable[[], object]], float]:
    """Return what measures the processor seconds of a call, to be compared with another's.

    Without the garbage collector, whose time depends on what other tests have left.
    """
    return lambda work: timeit(work, timer=process_time, number=1)


@pytest.fixture(scope="session")
def common(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the temporary folder that all workers share."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


@pytest.fixture(scope="session")
def once(common: Path) -> Callable[[str, Callable[[], Any]], Any]:
    """Return ``once(name, make)``: the result of `make`, computed by one worker for all."""

    def result(name: str, make: Callable[[], Any]) -> Any:
        file = common / f"{name}.pickle"
        with FileLock(file.with_suffix(".lock")):
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
            return pickle.loads(file.read_bytes())

    return result


@pytest.fixture(scope="session")
def seven(once: Callable[[str, Callable[[], Any]], Any]) -> Any:
    """Return the division by the equations of seven joints, which takes most of `derived`."""
    from lockedjoint.formulations.existence import derive

    return once("rewriting", lambda: derive.rewriting(derive.SEVEN_REVOLUTE, derive.ORDER))


@pytest.fixture(scope="session")
def derived(once: Callable[[str, Callable[[], Any]], Any], seven: Any) -> Any:
    """Return the certificate that no optimal 7R exists, derived anew."""
    from lockedjoint.formulations.existence import derive

    with patch.object(derive, "rewriting", lambda *_: seven):
        return once("certificate", derive.derive)


@pytest.fixture(scope="session")
def bounds(once: Callable[[str, Callable[[], Any]], Any]) -> Any:
    """Return the bound of every entry of the atlas, by name: half a minute's work."""
    from lockedjoint.formulations.atlas.collection import read_atlas

    return once("bounds", lambda: {page.entry.name: page.entry.bound for page in read_atlas()})


@pytest.fixture(scope="session")
def patched() -> Callable[..., Any]:
    """Return ``patched(document, {path: change, …})``: a copy of a JSON document, changed.

    Keys of a path are separated by points. A change is the new value, a function of the old
    one, or ``...``, which takes the value out.
    """

    def changed(document: Any, changes: dict[str, Any]) -> Any:
        copy = deepcopy(document)
        for path, change in changes.items():
            *way, last = (
                int(key) if key.lstrip("-").isdigit() else key for key in path.split(".")
            )
            target = copy
            for key in way:
                target = target[key]
            if change is ...:
                del target[last]
            else:
                target[last] = change(target[last]) if callable(change) else change
        return copy

    return changed


@contextmanager
def _written_to(descriptor: int, target: int) -> Iterator[None]:
    """Let all of this process write to another file than to this descriptor."""
    kept = os.dup(descriptor)
    os.dup2(target, descriptor)
    try:
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)


class CommandLine:
    """The command line of this tree, in processes of its own or, with `here`, in this one."""

    def here(
        self, *arguments: object, cwd: Path, env: dict[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end in this process, which saves the second of the imports.

        For tests of what a command does, reads, says and writes. What is printed is caught at
        the file descriptors, where compiled libraries print too.
        """
        from lockedjoint.__main__ import main  # not earlier: this file sets the threads

        words = ["lockedjoint", *map(str, arguments)]
        with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
            with (
                _written_to(1, out.fileno()),
                _written_to(2, err.fileno()),
                redirect_stdout(out),
                redirect_stderr(err),
                chdir(cwd),
                patch.object(sys, "argv", words),
                patch.dict(os.environ, {"NO_COLOR": "1", **(env or {})}),
                pytest.raises(SystemExit) as ended,
            ):
                main()
            said = [(file.flush(), file.seek(0), file.read())[-1] for file in (out, err)]
        return subprocess.CompletedProcess(words, ended.value.code or 0, *said)

    def __call__(
        self, *arguments: object, cwd: Path, **keywords: Any
    ) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        env = self.environment(**keywords.pop("env", {}))
        how: dict[str, Any] = {"capture_output": True, "text": True, "timeout": 120} | keywords
        return subprocess.run(self.words(*arguments), cwd=cwd, env=env, check=False, **how)

    def json(self, *arguments: object, cwd: Path) -> Any:
        """Run a command in this process, which must succeed; return what it says as JSON."""
        done = self.here(*arguments, "--json", cwd=cwd)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def python(self, code: str, cwd: Path = ROOT, **more: str) -> str:
        """Run a program in a process of its own, which must succeed; return what it prints."""
        how: dict[str, Any] = {"capture_output": True, "text": True, "timeout": 300}
        words, env = [sys.executable, "-c", code], self.unmeasured() | more
        done = subprocess.run(words, cwd=cwd, env=env, check=False, **how)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def start(self, *arguments: object, cwd: Path) -> subprocess.Popen[str]:
        """Start a command in a process group of its own, to be interrupted or killed."""
        return subprocess.Popen(
            self.words(*arguments),
            cwd=cwd,
            env=self.unmeasured(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )

    def words(self, *arguments: object) -> list[str]:
        """Return the words that start a command."""
        return [sys.executable, "-m", "lockedjoint", *map(str, arguments)]

    def environment(self, **more: str) -> dict[str, str]:
        """Return the environment in which this tree is found from every folder."""
        return {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", **more}

    def unmeasured(self) -> dict[str, str]:
        """Return it without measurement of coverage, which swallows a Ctrl-C as it begins."""
        environment = self.environment().items()
        return {name: value for name, value in environment if not name.startswith("COVERAGE_")}


@pytest.fixture(scope="session")
def lockedjoint() -> CommandLine:
    """Return what runs the command line: ``lockedjoint("solve", "residual", cwd=folder)``."""
    return CommandLine()


@pytest.fixture(scope="session")
def made() -> ModuleType:
    """Return what makes robots for the tests."""
    from tests import made_robots  # not earlier: it imports NumPy

    return made_robots


@pytest.fixture(scope="session")
def arm(made: ModuleType) -> Any:
    """Return an arm of seven joints of which no two axes meet."""
    return made.arm(made.offset_arm())
