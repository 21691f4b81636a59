"""A campaign's file: a grid of cases that TOML declares, checked whole before any work.

docs/campaigns.md shows one. Any setting of a formulation is the name of a list; ``encodings``
stands for ``encoding``.
"""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from formulations import registry
from formulations.campaign.records import cell_of
from formulations.io.files import read_bytes
from formulations.joints import models
from formulations.solving.case import Case
from nlp.arrays import whole_number
from nlp.errors import FileError, InputError, LockedJointError
from nlp.options import check_options, refuse_files
from nlp.solver import Solver

# A campaign file is small; tomllib takes a minute over a key of 100 000 bytes.
_MOST_BYTES = 20_000
MOST_STARTS = 10**9
_REQUIRED = ("starts", "formulations", "models", "joints")
_LISTS: Mapping[str, type] = {
    "formulations": str,
    "models": str,
    "joints": int,
    "task_dimensions": int,
}
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
    """Return the campaign that a file's content declares; see `read`."""
    for key in _REQUIRED:
        if key not in content:
            allowed = "all of " + ", ".join(_REQUIRED)
            raise InputError("campaign file", f"without {key}", allowed)
    for key, kind in _LISTS.items():
        _check_list(key, content.get(key, [kind()]), kind)
    formulations = [registry.formulation_of(name) for name in content["formulations"]]
    settings = {name: default for one in formulations for name, default in one.SETTINGS.items()}
    plurals = {"encodings": "encoding"}
    known = ("starts", "seed", *_LISTS, "solver", "compiled", "options", *plurals, *settings)
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
    if not isinstance(options, dict):
        raise InputError("options", options, "a table of solver options")
    if not isinstance(solver, str):
        raise InputError("solver", solver, "a string")
    compiled = content.get("compiled", False)
    if not isinstance(compiled, bool):
        raise InputError("compiled", compiled, "true or false")
    refuse_files(options)
    shared = {"options": check_options(options, solver), "solver": solver, "compiled": compiled}
    starts = whole_number("starts", content["starts"], 1, MOST_STARTS)
    seed = whole_number("seed", content.get("seed", 0), 0)
    unique = {cell_of(case, seed): case for case in _cases(content, grid, shared)}
    return Declaration(tuple(unique.values()), starts, seed)


def _check_list(key: str, entries: object, kind: type) -> None:
    if not isinstance(entries, list) or {type(entry) for entry in entries} != {kind}:
        words = _KINDS.get(kind, "values that a campaign can declare")
        raise InputError(key, entries, f"a list of {words}, not empty")


def _cases(
    content: Mapping[str, Any], grid: Mapping[str, list[Any]], shared: Mapping[str, Any]
) -> Iterator[Case]:
    sizes = list(product(content["joints"], content.get("task_dimensions", [6])))
    for name, model in product(content["formulations"], content["models"]):
        formulation = registry.formulation_of(name)
        taken = [setting for setting in grid if setting in formulation.SETTINGS]
        for (n, m), values in product(sizes, product(*(grid[setting] for setting in taken))):
            settings = dict(zip(taken, values, strict=True))
            try:  # every error is found before hours of work
                case = Case(formulation, models.arm(model, n, m), settings, **shared)
                Solver(case.build(), case.options, case.solver, case.compiled)
            except LockedJointError as error:
                which = f"{name} on {n} joints {model} in the campaign file"
                allowed = "combinations that can all be stated"
                raise InputError(which, str(error), allowed) from None
            yield case
