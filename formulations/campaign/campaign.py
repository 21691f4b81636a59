"""A campaign: a grid of cases that a TOML file declares, run start by start into a store.

A file has the keys ``starts``, ``formulations``, ``models`` and ``joints``, and may have
``seed``, ``task_dimensions``, ``solver``, ``options`` and any setting of a formulation as the
name of a list (``encodings`` stands for ``encoding``). Every combination of the lists is a
case. The file is checked whole before any work; docs/campaigns.md shows one.

A *cell* is the text that identifies a case and a seed in the store (`records.cell_of`). Starts
are numbered from 0; the ones that the store has are not run again.
"""

import tomllib
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from lockedjoint.formulations import registry
from lockedjoint.formulations.campaign.records import cell_of, task_of
from lockedjoint.formulations.campaign.store import Store
from lockedjoint.formulations.io.files import read_bytes
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.solving.case import Case
from lockedjoint.nlp.arrays import whole_number
from lockedjoint.nlp.errors import FileError, InputError, of_kind
from lockedjoint.nlp.executors import dispatch
from lockedjoint.nlp.options import check_options, refuse_files
from lockedjoint.nlp.progress import tqdm_class
from lockedjoint.nlp.solver import Solver
from lockedjoint.nlp.starts import Chunk, packed

#: Number of starts of a chunk: enough that sending it costs little, few enough to run again.
CHUNK = 20
# Largest size of a campaign file, in bytes. Files are small; tomllib takes a minute over a key
# of 100 000 bytes.
_MOST_BYTES = 20_000
#: Largest number of starts of a case.
MOST_STARTS = 10**9
# Keys that every file has.
_REQUIRED = ("starts", "formulations", "models", "joints")
# Keys that are lists, and what kind their entries are.
_LISTS: Mapping[str, type] = {
    "formulations": str,
    "models": str,
    "joints": int,
    "task_dimensions": int,
}
# Kinds of entries in words.
_KINDS = {str: "strings", int: "whole numbers", bool: "true or false", float: "numbers"}


@dataclass(frozen=True)
class Declaration:
    """The cases of a campaign, the random seed, and how many starts each case has."""

    cases: tuple[Case, ...]
    starts: int
    seed: int = 0


def read(path: Path) -> Declaration:
    """Read a campaign's file and check all of it, every case included.

    FileError if it cannot be read or is not TOML, InputError if anything else is wrong in it.
    """
    raw = read_bytes(path, "campaign file", _MOST_BYTES)
    try:
        content = tomllib.loads(raw.decode())
    except (ValueError, RecursionError) as reason:
        why = "it is nested too deeply" if isinstance(reason, RecursionError) else reason
        raise FileError("campaign file", str(path), f"TOML ({why})") from None
    return declaration(content)


def declaration(content: Mapping[str, Any]) -> Declaration:
    """Return the campaign that a file's content, its keys and values, declares; see `read`."""
    for key in _REQUIRED:
        if key not in content:
            allowed = "all of " + ", ".join(_REQUIRED)
            raise InputError("campaign file", f"without {key}", allowed)
    for key, kind in _LISTS.items():
        _check_list(key, content.get(key, [kind()]), kind)
    formulations = [registry.formulation_of(name) for name in content["formulations"]]
    settings = {name: default for one in formulations for name, default in one.SETTINGS.items()}
    plurals = {"encodings": "encoding"}
    known = ("starts", "seed", *_LISTS, "solver", "options", *plurals, *settings)
    grid = {}
    for key, value in content.items():
        if key not in known:
            raise InputError("key of the campaign file", key, "one of " + ", ".join(known))
        if (name := plurals.get(key, key)) in settings:
            _check_list(key, value, type(settings[name]))
            grid[name] = value
        elif key in plurals:
            raise InputError(key, value, "left out: no formulation of the file takes it")
    options, solver = content.get("options", {}), content.get("solver", "ipopt")
    of_kind("options", options, dict, "a table of solver options")
    of_kind("solver", solver, str, "a string")
    refuse_files(options)
    shared = {"options": check_options(options, solver), "solver": solver}
    starts = whole_number("starts", content["starts"], 1, MOST_STARTS)
    seed = whole_number("seed", content.get("seed", 0), 0)
    unique = {cell_of(case, seed): case for case in _cases(content, grid, shared)}
    return Declaration(tuple(unique.values()), starts, seed)


def _check_list(key: str, entries: object, kind: type) -> None:
    """Raise InputError unless the value of a key is a list of one kind, not empty."""
    if not isinstance(entries, list) or {type(entry) for entry in entries} != {kind}:
        words = _KINDS.get(kind, "values that a campaign can declare")
        raise InputError(key, entries, f"a list of {words}, not empty")


def _cases(
    content: Mapping[str, Any], grid: Mapping[str, list[Any]], shared: Mapping[str, Any]
) -> Iterator[Case]:
    """Yield every combination of the lists of a file, each stated and set up once as a check.

    `grid` has the values of each setting; `shared` the solver and its options.
    """
    sizes = list(product(content["joints"], content.get("task_dimensions", [6])))
    for name, model in product(content["formulations"], content["models"]):
        formulation = registry.formulation_of(name)
        taken = [setting for setting in grid if setting in formulation.SETTINGS]
        for (n, m), values in product(sizes, product(*(grid[setting] for setting in taken))):
            settings = dict(zip(taken, values, strict=True))
            try:  # every error is found before hours of work
                case = Case(formulation, models.arm(model, n, m), settings, **shared)
                Solver(case.build(), case.options, case.solver)
            except InputError as error:
                which = f"{error.argument} of {name} on {n} joints {model} in the campaign file"
                raise InputError(which, error.value, error.allowed) from None
            yield case


@dataclass(frozen=True)
class CampaignReport:
    """How many records were asked for, were added by a run, and are still missing.

    Failed are case, start and reason of those that raised an exception, ended their process
    or exceeded the time limit.
    """

    asked: int
    added: int
    missing: int
    failed: tuple[tuple[Case, int, str], ...]


def run(
    declared: Declaration,
    store: Store,
    executor: Executor,
    time_limit: float | None = None,
    chunk: int = CHUNK,
    capacity: int | None = None,
    progress: bool = False,
) -> CampaignReport:
    """Solve every start that has no record yet, and keep the records as they arrive.

    A chunk is what a worker is sent, and what one transaction keeps. For executor, time limit
    and capacity see `lockedjoint.nlp.executors.dispatch`. If the user interrupts with Ctrl-C,
    what is missing of the report says how much is left.

    Raises
    ------
    StoreError
        If the store was removed meanwhile.
    """
    cases = list(declared.cases)
    cells = [cell_of(case, declared.seed) for case in cases]
    added, failed = 0, list[tuple[Case, int, str]]()
    before = _missing(store, cells, declared.starts)
    chunks = _chunks(store, dict(zip(cells, cases, strict=True)), declared, chunk)
    with (
        closing(dispatch(chunks, executor, time_limit, capacity)) as results,
        tqdm_class()(total=before, desc="campaign", disable=None if progress else True) as bar,
    ):
        try:
            for result in results:
                case, cell = cases[result.label], cells[result.label]
                failed += [(case, start.index, start.reason) for start in result.failed]
                if result.finished:
                    records = list(result.finished.items())
                    made = records[0][1]["environment"]  # one chunk, one process
                    added += store.add(cell, records, made)
                bar.update(len(result.finished) + len(result.failed))
        except KeyboardInterrupt:
            pass  # what is kept is kept, and the report says that it is not all
    missing = _missing(store, cells, declared.starts)
    return CampaignReport(len(cells) * declared.starts, added, missing, tuple(failed))


def _chunks(
    store: Store, cases: Mapping[str, Case], declared: Declaration, size: int
) -> Iterator[Chunk]:
    """Yield chunks of at most `size` starts without a record; the label is the case's place.

    `cases` are by cell.
    """
    for label, (cell, case) in enumerate(cases.items()):
        payload = packed(task_of(case))
        for gap in store.missing(cell, declared.starts):
            for first in range(0, len(gap), size):
                yield Chunk(payload, declared.seed, gap[first : first + size], label)


def _missing(store: Store, cells: list[str], starts: int) -> int:
    """Return how many records of the starts of these cells are missing."""
    return sum(len(gap) for cell in cells for gap in store.missing(cell, starts))
