"""The studies by name, and how several are run: one that fails does not stop the others."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

from formulations.studies import (
    atlas,
    bounds,
    comparison,
    existence,
    failures,
    figures,
    paths,
    reproduction,
    robots,
    workspaces,
)
from formulations.studies.benchmark import study as benchmark
from formulations.studies.study import Effort, Study
from nlp.errors import InputError, LockedJointError
from nlp.files import prepare_folder

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
            paths.study(),
            workspaces.study(),
            atlas.study(),
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
class StudyOutcome:
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
) -> Iterator[StudyOutcome]:
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
        yield StudyOutcome(study, state, reason, time.perf_counter() - started)
        if state is State.INTERRUPTED:
            return


def _attempt(study: Study, out: Path, effort: Effort) -> tuple[State, str]:
    folder = out / study.name
    try:
        result = study.run(folder, effort)
    except LockedJointError as error:
        return State.FAILED, str(error)
    except Exception as error:  # the other studies still run
        return State.FAILED, f"{type(error).__name__}: {error}"
    finally:
        with suppress(LockedJointError, OSError):
            study.discard(folder)
            folder.rmdir()  # only if nothing is in it
    if not result.complete:
        return State.INTERRUPTED, "interrupted"
    return (State.QUESTIONED if result.complaint else State.MADE), result.complaint
