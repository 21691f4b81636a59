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

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from formulations.campaign.records import Kept, keep
from formulations.catalogue import arm, formulation
from formulations.solving.setup import Setup, solver_options
from nlp.arrays import whole_number
from nlp.errors import FileError, InputError, LockedJointError
from nlp.files import read_bytes
from nlp.store_schema import Value
from nlp.task import Task

REQUIRED = ("starts", "formulations", "models", "joints")
# Keys that a cell has too, and keys of lists: of settings that a setup has too, and others.
_OF_CELLS = ("seed", "solver", "compiled", "options")
_OF_SETUPS = {
    "encodings": "encoding",
    "from_residual_minima": "from_residual_minima",
    "locked": "locked",
}
_LISTS = {
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
class Cell:
    """One problem and how it is solved: all that decides its records.

    Attributes
    ----------
    setup
        The formulation on its column model.
    joints, task_dimension
        n and m.
    seed
        Seed of the starts.
    options
        Solver options, over the formulation's own.
    solver, compiled
        See `nlp.solver.Solver`.

    Raises
    ------
    InputError
        If the setup has a failure model, which the settings of a cell do not contain.
    """

    setup: Setup
    joints: int
    task_dimension: int
    seed: int = 0
    options: Mapping[str, object] = field(default_factory=dict)
    solver: str = "ipopt"
    compiled: bool = False

    def __post_init__(self) -> None:
        if self.setup.failures is not None:
            # Cells with different failure models would have the same settings.
            raise InputError("failure model", "given", "left out in a campaign")

    def task(self) -> Task[Kept]:
        """Return what workers do at each start.

        Raises
        ------
        InputError
            If the arm, a setting or an option is not allowed.
        """
        one = self.setup
        built = arm(one.model, self.joints, self.task_dimension)
        return Task(
            one.build(self.joints, self.task_dimension),
            one.sample(built),
            self._all_options(),
            partial(keep, arm=built, merit=one.merit(), locked=one.locked),
            self.solver,
            self.compiled,
        )

    def settings(self) -> dict[str, Value]:
        """Return what identifies this cell in a store."""
        one, stated = self.setup, formulation(self.setup.formulation)
        return {
            "formulation": one.formulation,
            "model": one.model,
            "joints": self.joints,
            "task_dimension": self.task_dimension,
            "locked": one.locked,
            "encoding": one.encoding if "encoding" in stated.SETTINGS else "",
            "from_residual_minima": int(one.from_residual_minima),
            "solver": self.solver,
            "compiled": int(self.compiled),
            "options": json.dumps(self._all_options(), sort_keys=True),
            "seed": self.seed,
        }

    def _all_options(self) -> Mapping[str, object]:
        return solver_options(self.setup.formulation, self.solver, self.options)


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
    raw = read_bytes(path, "campaign file")
    try:
        content = tomllib.loads(raw.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as reason:
        raise FileError("campaign file", str(path), f"TOML ({reason})") from None
    return declaration(content)


def declaration(content: Mapping[str, Any]) -> Declaration:
    """Return the campaign that a file's content declares; see `read`."""
    known = ("starts", *_LISTS, *_OF_CELLS)
    for key in content:
        if key not in known:
            raise InputError("key of the campaign file", key, "one of " + ", ".join(known))
    for key in REQUIRED:
        if key not in content:
            raise InputError("campaign file", f"without {key}", "all of " + ", ".join(REQUIRED))
    for key, kind in _LISTS.items():
        entries = content.get(key, [kind()])
        if not isinstance(entries, list) or {type(one) for one in entries} != {kind}:
            raise InputError(key, entries, f"a list of {_KINDS[kind]}, not empty")
    if not isinstance(content.get("options", {}), dict):
        raise InputError("options", content["options"], "a table of solver options")
    starts = whole_number("starts", content["starts"], 1)
    seed = whole_number("seed", content.get("seed", 0), 0)
    cells = _cells({**content, "seed": seed})
    unique = {tuple(cell.settings().items()): cell for cell in cells}
    for cell in unique.values():
        _check(cell)
    return Declaration(tuple(unique.values()), starts)


def _cells(content: Mapping[str, Any]) -> Iterator[Cell]:
    shared = {key: content[key] for key in _OF_CELLS if key in content}
    variants = {name: content[key] for key, name in _OF_SETUPS.items() if key in content}
    sizes = list(product(content["joints"], content.get("task_dimensions", [6])))
    for name, model in product(content["formulations"], content["models"]):
        taken = [one for one in variants if one in formulation(name).SETTINGS]
        for (n, m), values in product(sizes, product(*(variants[one] for one in taken))):
            setup = Setup(name, model, **dict(zip(taken, values, strict=True)))
            yield Cell(setup, n, m, **shared)


def _check(cell: Cell) -> None:
    """Build the cell's problem, so that every error is found before hours of work."""
    try:
        cell.task().solver()
    except LockedJointError as error:
        one = cell.setup
        where = f"{one.formulation} on {cell.joints} joints {one.model} in the campaign file"
        raise InputError(where, str(error), "combinations that can all be stated") from None
