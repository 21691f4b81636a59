"""The studies by name, and how several are run: each folder is replaced whole or not at all."""

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

from formulations.studies import (
    bounds,
    comparison,
    existence,
    failures,
    figures,
    reproduction,
    robots,
)
from formulations.studies.benchmark import study as benchmark
from formulations.studies.study import Effort, Study
from nlp.errors import FileError, InputError, LockedJointError
from nlp.files import prepare_folder
from nlp.interrupts import deferred_interrupt

#: In the order in which they run: where a new one is listed.
STUDIES: Mapping[str, Study] = MappingProxyType(
    {
        one.name: one
        for one in (
            reproduction.study(),
            comparison.study(7),
            comparison.study(8),
            existence.study(),
            bounds.study(),
            failures.study(),
            figures.study(),
            robots.study(),
            benchmark.study(),
        )
    }
)


class State(StrEnum):
    """What became of a study.

    MADE: computed and written. QUESTIONED: written, but something is wrong with what was
    found. FAILED: not computed. INTERRUPTED: by the user. Where a study failed or was
    interrupted, a folder from before stays as it was.
    """

    MADE = "made"
    QUESTIONED = "questioned"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Outcome:
    """What became of a study, why in a sentence, and its wall time in seconds."""

    study: Study
    state: State
    reason: str
    seconds: float


def chosen(only: Sequence[str] | None, long: bool) -> tuple[Study, ...]:
    """Return the studies to be run.

    Parameters
    ----------
    only
        Names; None for all that take under ten minutes.
    long
        Whether to run the others as well, where no names are given.

    Raises
    ------
    InputError
        If there is no study of a name.
    """
    for name in only or ():
        if name not in STUDIES:
            raise InputError("study", name, "one of " + ", ".join(STUDIES))
    if only is None:
        return tuple(one for one in STUDIES.values() if long or not one.long)
    return tuple(one for one in STUDIES.values() if one.name in only)


def run_all(
    studies: Sequence[Study],
    out: Path,
    effort: Effort,
    begin: Callable[[Study], None] = lambda _: None,
) -> Iterator[Outcome]:
    """Run studies and yield the outcome of each; after an interrupted one there is no other.

    Parameters
    ----------
    studies
        What to run, in order.
    out
        The folder of all studies' folders.
    effort
        How they are run.
    begin
        Is called with each study before it runs.

    Raises
    ------
    FileError
        If the folder cannot be made or written to.
    """
    prepare_folder(out)
    for study in studies:
        begin(study)
        started = time.perf_counter()
        state, reason = _attempt(study, out, effort)
        yield Outcome(study, state, reason, time.perf_counter() - started)
        if state is State.INTERRUPTED:
            return


def _attempt(study: Study, out: Path, effort: Effort) -> tuple[State, str]:
    part = out / f".{study.name}.part"
    try:
        _copy(out / study.name, part)
        result = study.run(part, effort)
        if not result.complete:
            return State.INTERRUPTED, "interrupted"
        with deferred_interrupt():
            _replace(out / study.name, part)
    except KeyboardInterrupt:
        return State.INTERRUPTED, "interrupted"
    except LockedJointError as error:
        return State.FAILED, str(error)
    except Exception as error:  # the other studies still run
        return State.FAILED, f"{type(error).__name__}: {error}"
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return (State.QUESTIONED if result.complaint else State.MADE), result.complaint


def _copy(folder: Path, part: Path) -> None:
    """Begin with what is there: a study may hold more than one run of it computes."""
    before = _before(folder)
    if folder.exists() and not folder.is_dir():
        raise FileError("output folder", str(folder), "a folder, which a file is in place of")
    try:
        shutil.rmtree(part, ignore_errors=True)  # left over from a run that was killed
        if before.exists() and not folder.exists():
            before.rename(folder)  # killed between the two renamings below
        if folder.is_dir():
            shutil.copytree(folder, part)
        else:
            part.mkdir()
    except OSError as reason:
        raise FileError("folder", str(part), f"one to write to ({reason.strerror})") from None


def _replace(folder: Path, part: Path) -> None:
    before = _before(folder)
    try:
        shutil.rmtree(before, ignore_errors=True)
        if folder.exists():
            folder.rename(before)
        part.rename(folder)
    except OSError as reason:
        raise FileError("folder", str(folder), f"one to write ({reason.strerror})") from None
    shutil.rmtree(before, ignore_errors=True)


def _before(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.before")
