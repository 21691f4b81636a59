"""Studies run one after another; each folder is replaced whole, or left as it was."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from formulations.studies.study import Effort, Study
from nlp.errors import FileError, LockedJointError
from nlp.files import prepare_folder
from nlp.native import deferred_interrupt


class State(StrEnum):
    """What became of a study.

    MADE: computed and written. QUESTIONED: written, but something is wrong with what was
    found. FAILED: not computed. INTERRUPTED: by the user. Where nothing was written, a folder
    from before is as it was.
    """

    MADE = "made"
    QUESTIONED = "questioned"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Outcome:
    """What became of a study, why in a sentence, and how long it took."""

    study: Study
    state: State
    reason: str
    seconds: float


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
        How.
    begin
        Is told of each study before it runs.

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
        complaint = study.run(part, effort)
        with deferred_interrupt():
            _replace(out / study.name, part)
    except KeyboardInterrupt:
        return State.INTERRUPTED, "interrupted"
    except LockedJointError as error:
        return State.FAILED, str(error)
    except Exception as error:  # whatever is wrong with one study, the others still run
        return State.FAILED, f"{type(error).__name__}: {error}"
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return (State.QUESTIONED, complaint) if complaint else (State.MADE, "")


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
