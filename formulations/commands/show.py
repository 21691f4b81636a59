"""``lockedjoint show``: the tables of a study, filtered, grouped and exported."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from nlp.store import Store
    from nlp.store_schema import Condition


def show(
    store: Annotated[Path, typer.Argument(metavar="DB", help="Store of a campaign.")],
    where: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COLUMN=VALUE",
            help="Only records with this; also != < <= > >=. May be repeated.",
            show_default=False,
        ),
    ] = None,
    group_by: Annotated[
        str | None,
        typer.Option(
            metavar="SETTING,...",
            help="Settings that make groups.",
            show_default="all that differ",
        ),
    ] = None,
    records: Annotated[
        bool, typer.Option("--records", help="Show the records themselves, not groups.")
    ] = False,
    optima: Annotated[
        bool,
        typer.Option(
            "--optima", help="Show the optima: how many starts reached each, canonical form."
        ),
    ] = False,
    to: Annotated[
        str, typer.Option(metavar="FORMAT", help="csv, parquet, markdown or latex.")
    ] = "markdown",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write there instead of here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead.")] = False,
) -> None:
    """Show what a campaign's store holds, also while the campaign runs.

    By default one row per group of records: starts, how many the solver solved, how many pass
    the independent check, how many reached the best known answer of their problem, and the
    processor time of a start and of a success. Matrices are in the formats csv and parquet
    and in JSON only, with every digit.
    """
    from formulations.campaign.columns import SCHEMA
    from formulations.campaign.export import FORMATS, with_jacobians, write
    from nlp.errors import InputError
    from nlp.files import prepare_folder
    from nlp.store import Store
    from nlp.store_schema import condition

    if to not in FORMATS:
        raise InputError("--to", to, "one of " + ", ".join(FORMATS))
    if sum([records, optima, group_by is not None]) > 1:
        both = "more than one of --records, --optima and --group-by"
        raise InputError("command line", both, "at most one of them")
    if to == "parquet" and out is None and not as_json:
        raise InputError("--out", "missing", "a file, for parquet")
    conditions = [condition(SCHEMA, text) for text in where or ()]
    if out is not None:
        prepare_folder(out.parent, "folder of --out")
    with Store(store, SCHEMA) as study:
        table = _table(study, conditions, group_by, records, optima)
    table = with_jacobians(table)
    content = table.to_json(orient="records", indent=1) if as_json else FORMATS[to](table)
    if out is not None:
        write(content, out)
    else:
        typer.echo(content, nl=as_json)


def _table(
    study: Store,
    conditions: Sequence[Condition],
    group_by: str | None,
    records: bool,
    optima: bool,
) -> pd.DataFrame:
    from formulations.campaign.frame import frame
    from formulations.campaign.groups import grouped
    from formulations.campaign.optima import optima as optima_of

    if records:
        return frame(study, conditions)
    if optima:
        return optima_of(study, conditions)
    by = None if group_by is None else [name.strip() for name in group_by.split(",")]
    return grouped(study, conditions, by)
