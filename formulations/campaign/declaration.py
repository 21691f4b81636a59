"""A campaign as a TOML file declares it: a grid of cells, checked whole before any work.

::

    starts = 1000                      # of each cell
    formulations = ["residual", "max-min", "isotropy"]
    models = ["unit-revolute"]
    joints = [7, 8]
    # and, where the defaults are not what is wanted:
    seed = 0
    task_dimensions = [6]
    encodings = ["shared-factor"]      # of max-min
    from_residual_minima = [false]     # of max-min
    locked = [1]                       # of max-min
    solver = "ipopt"
    compiled = false
    [options]                          # of the solver, over the formulations' own
    max_iter = 1000
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from formulations import max_min
from formulations.campaign.cell import Cell
from formulations.solving.setup import Setup
from nlp.arrays import whole_number
from nlp.errors import FileError, InputError, LockedJointError

REQUIRED = ("starts", "formulations", "models", "joints")
DEFAULTS: Mapping[str, object] = {
    "seed": 0,
    "task_dimensions": [6],
    "encodings": ["shared-factor"],
    "from_residual_minima": [False],
    "locked": [1],
    "solver": "ipopt",
    "compiled": False,
    "options": {},
}
_LISTS: Mapping[str, type] = {
    "formulations": str,
    "models": str,
    "joints": int,
    "task_dimensions": int,
    "encodings": str,
    "from_residual_minima": bool,
    "locked": int,
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
    try:
        text = path.read_text(encoding="utf-8")
        content = tomllib.loads(text)
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        raise FileError("campaign file", str(path), f"a file to read ({why})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as reason:
        raise FileError("campaign file", str(path), f"TOML ({reason})") from None
    return declaration(content)


def declaration(content: Mapping[str, Any]) -> Declaration:
    """Return the campaign that a file's content declares; see `read`."""
    known = (*REQUIRED, *DEFAULTS)
    for key in content:
        if key not in known:
            raise InputError("key of the campaign file", key, "one of " + ", ".join(known))
    for key in REQUIRED:
        if key not in content:
            raise InputError("campaign file", f"without {key}", "all of " + ", ".join(REQUIRED))
    full = {**DEFAULTS, **content}
    for key, kind in _LISTS.items():
        _check_list(key, full[key], kind)
    if not isinstance(full["options"], dict):
        raise InputError("options", full["options"], "a table of solver options")
    starts = whole_number("starts", full["starts"], 1)
    seed = whole_number("seed", full["seed"], 0)
    cells = tuple(_cells(full, seed))
    for cell in cells:
        _check(cell)
    return Declaration(cells, starts)


def _cells(full: Mapping[str, Any], seed: int) -> list[Cell]:
    shared = (seed, full["options"], full["solver"], full["compiled"])
    cells = []
    for name, model in product(full["formulations"], full["models"]):
        variants = [Setup(name, model)]
        if name == max_min.NAME:
            settings = product(full["encodings"], full["from_residual_minima"], full["locked"])
            variants = [Setup(name, model, "", *one) for one in settings]
        sizes = product(full["joints"], full["task_dimensions"])
        cells += [Cell(one, n, m, *shared) for n, m in sizes for one in variants]
    unique = {tuple(cell.settings().items()): cell for cell in cells}
    return list(unique.values())


def _check(cell: Cell) -> None:
    """State the cell's problem, so that nothing comes to light after hours of work."""
    try:
        cell.task().solver()
    except LockedJointError as error:
        one = cell.setup
        where = f"{one.formulation} on {cell.joints} joints {one.model} in the campaign file"
        raise InputError(where, str(error), "combinations that can all be stated") from None


def _check_list(key: str, value: object, kind: type) -> None:
    fine = isinstance(value, list) and value and all(type(one) is kind for one in value)
    if not fine:
        raise InputError(key, value, f"a list of {_KINDS[kind]}, not empty")
