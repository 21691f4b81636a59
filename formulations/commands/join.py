"""``lockedjoint join``: stores of one study from several machines become one store."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json
from formulations.commands.output import show


def join(
    store: Annotated[
        Path, typer.Argument(metavar="DB", help="Store that takes the records in.")
    ],
    others: Annotated[
        list[Path], typer.Argument(metavar="OTHER...", help="Stores to join to it.")
    ],
    as_json: Json = False,
) -> None:
    """Bring the records of other stores into one, which is made if missing.

    The others stay as they are. Where two stores have the same start of the same problem, the
    records must be equal, apart from the time they took; if one is not, nothing of that store
    is joined.
    """
    from formulations.campaign.records import SCHEMA, TIMES
    from nlp.store import Store

    for other in others:  # before a store is made
        with Store(other, SCHEMA):
            pass
    joined: list[dict[str, object]] = []
    with Store(store, SCHEMA, writable=True) as study:
        for other in others:
            added, known = study.join(other, TIMES)
            joined.append({"store": str(other), "added": added, "already_there": known})
            if not as_json:
                typer.echo(f"{added} records of {other} are new, {known} were there already.")
    if as_json:
        show({"store": str(store), "joined": joined}, as_json)
