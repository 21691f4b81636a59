"""``lockedjoint join``: stores of one study from several machines become one store."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json
from formulations.commands.output import named, refuse_damage, show


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

    With a new store and one other it is the way to copy a store. The others stay as they are.
    Where two stores have the same start of the same problem, the records must be equal, apart
    from the time they took; if one is not, nothing of that store is joined. Damaged records
    are named and not joined, and the exit status is 1; one that is damaged in the first store
    is replaced by an intact one.
    """
    from formulations.campaign.records import TIMES, open_store

    joined: list[dict[str, object]] = []
    with ExitStack() as opened:
        sources = [opened.enter_context(open_store(other, salvage=True)) for other in others]
        study = opened.enter_context(open_store(store, writable=True, salvage=True))
        for source in sources:
            added, known = study.join(source, TIMES)
            row = {"store": str(source.path), "added": added, "already_there": known}
            joined.append({**row, "damaged": [named(*one) for one in source.damaged]})
            if not as_json:
                text = f"{added} records of {source.path} are new, {known} were there already."
                typer.echo(text)
        if as_json:
            left = [named(*one) for one in study.damaged]
            show({"store": str(store), "joined": joined, "damaged": left}, as_json)
        refuse_damage({one.path: one.damaged for one in (*sources, study)})
