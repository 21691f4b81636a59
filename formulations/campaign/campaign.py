"""A campaign: a grid of cells that a TOML file declares, checked whole, then run.

::

    starts = 1000                      # of each cell
    formulations = ["residual", "max-min", "isotropy"]
    models = ["unit-revolute"]
    joints = [7, 8]
    # and, where the defaults are not what is wanted:
    seed = 0
    task_dimensions = [6]
    encodings = ["two-stage"]          # of max-min
    from_residual_minima = [false]     # of max-min
    locked = [1]                       # of max-min and manipulability
    solver = "ipopt"
    compiled = false
    [options]                          # of the solver, over the formulations' own
    max_iter = 1000
"""

import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from tqdm import tqdm

from formulations.campaign.records import Cell
from formulations.catalogue import formulation
from formulations.solving.setup import Setup
from nlp.arrays import whole_number
from nlp.errors import FileError, InputError, LockedJointError
from nlp.files import read_bytes
from nlp.interrupts import interrupt_answered
from nlp.options import check_options
from nlp.spread import Pool, spread
from nlp.store import Store
from nlp.task import Chunk, packed

# A campaign file is small.
_MOST_BYTES = 1_000_000
_DOTTED = re.compile(r"(?<![\w\"'-])[\w\"'-]++(?:\s*+\.\s*+[\w\"'-]++){10}")
# Starts of a chunk: enough that sending it costs little, few enough to run again.
CHUNK = 20
MOST_STARTS = 10**9
REQUIRED = ("starts", "formulations", "models", "joints")
# Keys that a cell has too, and keys of lists: what is in them, and the setting that it is.
_OF_CELLS = ("seed", "solver", "compiled", "options")
_LISTS = {
    "formulations": (str, "formulation"),
    "models": (str, "model"),
    "joints": (int, "joints"),
    "task_dimensions": (int, "task_dimension"),
    "encodings": (str, "encoding"),
    "from_residual_minima": (bool, "from_residual_minima"),
    "locked": (int, "locked"),
}
_KINDS = {str: "strings", int: "whole numbers", bool: "true or false"}


@dataclass(frozen=True)
class Declaration:
    """The cells of a campaign and how many starts each has."""

    cells: tuple[Cell, ...]
    starts: int


def read(path: Path) -> Declaration:
    """Read a campaign's file and check all of it, every cell included.

    Raises
    ------
    FileError
        If it cannot be read or is not TOML.
    InputError
        If a key is unknown or missing, or a value, a combination of values or a solver
        option is not allowed.
    """
    raw = read_bytes(path, "campaign file", _MOST_BYTES)
    try:
        text = raw.decode()
        _check_keys(text)
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as reason:
        why = "it is nested too deeply" if isinstance(reason, RecursionError) else reason
        raise FileError("campaign file", str(path), f"TOML ({why})") from None
    return declaration(content)


def _check_keys(text: str) -> None:
    """Refuse keys of many parts, over which tomllib takes minutes: no key here has two."""
    if _DOTTED.search(re.sub(r"(?m)^\s*#.*$", "", text)):
        raise ValueError("a key of over ten parts")


def declaration(content: Mapping[str, Any]) -> Declaration:
    """Return the campaign that a file's content declares; see `read`."""
    known = ("starts", *_LISTS, *_OF_CELLS)
    for key in content:
        if key not in known:
            raise InputError("key of the campaign file", key, "one of " + ", ".join(known))
    for key in REQUIRED:
        if key not in content:
            raise InputError("campaign file", f"without {key}", "all of " + ", ".join(REQUIRED))
    for key, (kind, _) in _LISTS.items():
        entries = content.get(key, [kind()])
        if not isinstance(entries, list) or {type(one) for one in entries} != {kind}:
            raise InputError(key, entries, f"a list of {_KINDS[kind]}, not empty")
    if not isinstance(content.get("options", {}), dict):
        raise InputError("options", content["options"], "a table of solver options")
    taken = {name for one in content["formulations"] for name in formulation(one).SETTINGS}
    for key in ("encodings", "from_residual_minima", "locked"):
        if key in content and _LISTS[key][1] not in taken:
            raise InputError(key, content[key], "left out: no formulation of the file takes it")
    solver = content.get("solver", "ipopt")
    if not isinstance(solver, str):
        raise InputError("solver", solver, "a string")
    check_options(content.get("options", {}), solver)
    starts = whole_number("starts", content["starts"], 1, MOST_STARTS)
    if not isinstance(content.get("compiled", False), bool):
        raise InputError("compiled", content["compiled"], "true or false")
    seed = whole_number("seed", content.get("seed", 0), 0)
    cells = _cells({**content, "seed": seed})
    unique = {tuple(cell.settings().items()): cell for cell in cells}
    for cell in unique.values():  # every error is found before hours of work
        try:
            cell.task().solver()
        except LockedJointError as error:
            one = f"{cell.setup.formulation} on {cell.joints} joints {cell.setup.model}"
            allowed = "combinations that can all be stated"
            raise InputError(f"{one} in the campaign file", str(error), allowed) from None
    return Declaration(tuple(unique.values()), starts)


def _cells(content: Mapping[str, Any]) -> Iterator[Cell]:
    shared = {key: content[key] for key in _OF_CELLS if key in content}
    variants = {name: content[key] for key, (_, name) in _LISTS.items() if key in content}
    sizes = list(product(content["joints"], content.get("task_dimensions", [6])))
    for name, model in product(content["formulations"], content["models"]):
        taken = [one for one in variants if one in formulation(name).SETTINGS]
        for (n, m), values in product(sizes, product(*(variants[one] for one in taken))):
            setup = Setup(name, model, **dict(zip(taken, values, strict=True)))
            yield Cell(setup, n, m, **shared)


@dataclass(frozen=True)
class Report:
    """How a campaign stands.

    Attributes
    ----------
    asked, added, missing
        Records that were asked for, that this run added, and that are still missing.
    lost
        Cell, start and reason of those that raised an exception, ended their process or
        exceeded the time limit.
    """

    asked: int
    added: int
    missing: int
    lost: tuple[tuple[Cell, int, str], ...]


def run(
    declared: Declaration,
    store: Store,
    pool: Pool,
    time_limit: float | None = None,
    chunk: int = CHUNK,
    progress: bool = False,
) -> Report:
    """Solve every start that has no record yet, and keep the records as they arrive.

    Parameters
    ----------
    declared
        The campaign.
    store
        Where its records are, open for writing.
    pool
        The workers.
    time_limit
        Seconds that a start may take, from when it begins; a worker that takes longer for a
        chunk than this for each of its starts is killed, and they run again one by one.
    chunk
        Starts that a worker is sent, and that one transaction keeps, at once.
    progress
        Whether to show a bar, where standard error is a terminal.

    Returns
    -------
    Report
        If the user interrupted with Ctrl-C, `missing` says how much is left.
    """
    cells = {store.cell(cell.settings()): cell for cell in declared.cells}
    added, lost = 0, list[tuple[Cell, int, str]]()
    chunks = _chunks(store, cells, declared.starts, chunk)
    before = _missing(store, cells, declared.starts)
    hidden = not (progress and os.isatty(2))
    with (
        closing(spread(chunks, pool, time_limit)) as arrivals,
        tqdm(total=before, desc="campaign", disable=hidden, dynamic_ncols=True) as bar,
    ):
        try:
            for arrival in arrivals:
                label = arrival.chunk.label
                lost += [(cells[label], one.index, one.why) for one in arrival.lost]
                if arrival.results:
                    made = arrival.results[0].result["environment"]  # one chunk, one process
                    records = [(one.index, one.result) for one in arrival.results]
                    added += store.add(label, records, made)
                bar.update(len(arrival.results) + len(arrival.lost))
        except KeyboardInterrupt:
            interrupt_answered()  # what is kept is kept, and the report says that it is not all
    missing = _missing(store, cells, declared.starts)
    return Report(len(cells) * declared.starts, added, missing, tuple(lost))


def _chunks(store: Store, cells: Mapping[int, Cell], starts: int, size: int) -> Iterator[Chunk]:
    for number, cell in cells.items():
        payload = packed(cell.task())
        for gap in store.missing(number, starts):
            for first in range(0, len(gap), size):
                yield Chunk(payload, cell.seed, gap[first : first + size], number)


def _missing(store: Store, cells: Mapping[int, Cell], starts: int) -> int:
    return sum(len(gap) for number in cells for gap in store.missing(number, starts))
