"""``lockedjoint show``: the tables of a study, filtered, grouped and exported."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from formulations.commands.arguments import Json, flag, option
from formulations.commands.output import named, refuse_damage, say, shown
from formulations.commands.output import show as show_values
from nlp.errors import InputError, MissingLibraryError, StoreError

if TYPE_CHECKING:
    import pandas as pd


def show(
    store: Annotated[Path, typer.Argument(metavar="DB", help="Store of a campaign.")],
    where: list[str] | None = option(
        "CONDITION", "Only records with this, such as 'joints == 7'. May be repeated."
    ),
    group_by: str | None = option(
        "SETTING,...",
        "Settings that make groups, such as joints,model; by default all that differ.",
    ),
    records: bool = flag("--records", "Show the records themselves."),
    optima: bool = flag(
        "--optima",
        "Show the distinct optima, how many starts reached each, and their canonical form.",
    ),
    to: Literal["csv", "parquet", "markdown", "latex"] = option(
        None, "Format of the table; parquet needs pyarrow.", "markdown"
    ),
    out: Path | None = option("FILE", "Write there instead of printing."),
    check: bool = flag("--check", "Verify the whole store and show nothing of it."),
    as_json: Json = False,
) -> None:
    """Show what a campaign's store holds, also while the campaign runs.

    By default one row per group of records: starts, how many the solver solved, how many pass
    the independent check, how many reached the best known answer of their problem, and the
    processor time of a start and of a success. Matrices are in the formats csv and parquet
    and in JSON only, with every digit. The whole store is verified first: damaged records are
    left out and named, and the exit status is 1.
    """
    from formulations.campaign import tables
    from formulations.campaign.records import open_store
    from formulations.io.files import prepare_file, write_bytes

    if sum([records, optima, check, group_by is not None]) > 1:
        both = "more than one of --records, --optima, --check and --group-by"
        raise InputError("command line", both, "at most one of them")
    if check:
        if where or out is not None or to != "markdown":
            allowed = "left out with --check, which verifies all records"
            raise InputError("--where, --to or --out", "given", allowed)
        _check(store, as_json)
        return
    if as_json and to != "markdown":
        raise InputError("--to", to, "none with --json")
    if to == "parquet" and out is None:
        raise InputError("--out", "missing", "a file, for parquet")
    chosen = " and ".join(f"({text})" for text in where or ())
    prepare_file(out, inputs=[store])
    with open_store(store, salvage=True) as study:
        if records:
            table = tables.frame(study, chosen)
        elif optima:
            table = tables.optima(study, chosen)
        else:
            by = None if group_by is None else [name.strip() for name in group_by.split(",")]
            table = tables.grouped(study, chosen, by)
        content = _as_json(table) if as_json else FORMATS[to](table)
        if out is not None:
            write_bytes(out, content.encode() if isinstance(content, str) else content)
        elif isinstance(content, str):
            say(content, nl=as_json)
        refuse_damage({store: study.damaged})


def _check(store: Path, as_json: bool) -> None:
    from formulations.campaign.records import open_store

    with open_store(store, salvage=True) as study:
        intact = len(study.frame([]))
        values = {
            "store": str(store),
            "intact": intact,
            "damaged": [named(*record) for record in study.damaged],
        }
        text = f"{intact} records{' are' if study.damaged else ', all'} intact."
        show_values(values, as_json, lambda _: text)
        refuse_damage({store: study.damaged})


# Columns that hold JSON as text, and those that hold 0 or 1.
_NESTED = ("jacobian", "canonical_form", "options", "earlier")
_TRUTH = ("valid", "ran_compiled")


def _as_json(table: pd.DataFrame) -> str:
    """Return the rows as JSON: every digit, matrices as lists, null for what is missing."""
    rows = table.astype(object).where(table.notna(), None).to_dict(orient="records")
    for row in rows:
        row |= {name: _parsed(name, row[name]) for name in _NESTED if row.get(name)}
        if "start" in row:  # in groups they are numbers of starts
            row |= {name: bool(row[name]) for name in _TRUTH if row.get(name) in (0, 1)}
    return json.dumps(rows, indent=1)


def _parsed(name: str, text: str) -> object:
    """Return JSON from a store, which may come from anybody."""
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise StoreError(f"{name} of a record", text, "JSON") from None


def as_parquet(table: pd.DataFrame) -> bytes:
    """Return the table as a Parquet file's content.

    Raises
    ------
    MissingLibraryError
        If pyarrow is not installed.
    """
    if find_spec("pyarrow") is None:
        raise MissingLibraryError("pyarrow")
    return table.to_parquet(engine="pyarrow", index=False)


def _to_read(table: pd.DataFrame, style: str, underscore: str = "_") -> str:
    """Return the table as text with few digits, without the matrices."""
    brief = table.drop(columns=["jacobian", "canonical_form"], errors="ignore").astype(object)
    for name in brief:
        digits = 8 if name in ("score", "worst_case_sigma") else 4
        brief[name] = [shown(value, digits) for value in brief[name]]
    brief.columns = brief.columns.str.replace("_", underscore)
    return f"{brief.to_markdown(index=False, tablefmt=style, disable_numparse=True)}\n"


# CSV and Parquet have every digit.
FORMATS: Mapping[str, Callable[[pd.DataFrame], str | bytes]] = MappingProxyType(
    {
        "csv": lambda table: table.to_csv(index=False),
        "parquet": as_parquet,
        "markdown": lambda table: _to_read(table, "pipe"),
        "latex": lambda table: _to_read(table, "latex_booktabs", underscore=" "),
    }
)
