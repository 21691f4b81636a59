"""The bounds: JSON files as the command prints them, certificates, and a table of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from lockedjoint.formulations.bounds.moments.unit_revolute_bounds import (
    isotropy_bound,
    max_min_bound,
    residual_bound,
)
from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.io.rounding import outward
from lockedjoint.formulations.io.table import HIDDEN, column, provenance, row_from
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.executors import LocalExecutor
from results.script import main, study_of

#: The folder of the certificates, within that of the study.
CERTIFICATES = "certificates"
#: What makes a bound, and the command that made the one on record, by the name of its files.
#: The study has one seed for all: of isotropy seed 0 proves the same bound as seed 1.
RUNS: Mapping[str, tuple[Callable[..., dict[str, Any]], str]] = {
    "residual_tight.json": (residual_bound, "lockedjoint bound residual --json"),
    "max_min_null_vector.json": (max_min_bound, "lockedjoint bound max-min --json"),
    "isotropy_turned.json": (isotropy_bound, "lockedjoint bound isotropy --seed 1 --json"),
}


@dataclass(frozen=True)
class BoundRow:
    """The columns of ``bounds.csv``: first the JSON file and what made it, on what and when.

    `preset` is the choice of rows, `best_known` the best score known to be reached. The gap is
    in percent of the bound. The semidefinite program has `moments` unknowns.
    """

    file: str
    command: str = field(metadata=HIDDEN)
    versions: str = field(metadata=HIDDEN)
    machine: str = field(metadata=HIDDEN)
    date: str
    quantity: str
    joints: int = field(metadata=column("n"))
    kind: str
    preset: str
    bound: float = field(
        metadata=column(
            form=lambda row: outward(row.bound, 9, lower=row.quantity == "residual")
        )
    )
    best_known: float = field(metadata=column("best known", ".9g"))
    gap_percent: float = field(metadata=column("gap %"))
    moments: int
    largest_block: int
    seconds: float = field(metadata=column("wall time (s)", ".1f"))


def of_quantity(rows: Sequence[BoundRow], quantity: str) -> BoundRow | None:
    """Return the bound on a quantity, if there is one."""
    return next((row for row in rows if row.quantity == quantity), None)


def row_of(plain: Mapping[str, Any], **made: str) -> BoundRow:
    """Return the row of a bound's JSON; `made` are its first columns."""
    size = SimpleNamespace(**plain["size"])
    seconds = sum(plain["seconds"].values())
    return row_from(BoundRow, size, SimpleNamespace(**plain), **made, seconds=seconds)


def compute(effort: Effort, folder: Path) -> Iterator[BoundRow]:
    """Compute the bounds, each into a file of its own."""
    now = provenance()
    made = {name: now[name] for name in ("versions", "machine", "date")}
    with LocalExecutor(effort.workers) as executor:
        for file, (bound, command) in RUNS.items():
            effort.progress(file)
            out, tell = folder / CERTIFICATES / file, effort.progress
            plain = bound(seed=effort.seed, progress=tell, out=out, executor=executor)
            write_json(folder / file, plain)
            yield row_of(plain, file=file, command=command, **made)


STUDY = study_of(
    __file__,
    compute,
    title="how good any answer could be: global bounds on residual, max-min and isotropy",
    page="README.md",
    tables={"bounds": BoundRow},
    takes="20 minutes, and 4 GB of memory",
    settings={"of_quantity": of_quantity},
)

if __name__ == "__main__":
    main(STUDY, __file__)
