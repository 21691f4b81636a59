"""The bounds: JSON files as the command prints them, certificates, and a table of them.

A bound is a number that a measure of no Jacobian of unit revolute joints can pass: the residual
(distance from isotropy) of none is less, the worst case or the isotropy of none is larger. A
semidefinite relaxation finds it, and a certificate, checked with all rounding bounded, proves
it.

Out come, in the folder of the study: a JSON file for each entry of `RUNS`, as ``lockedjoint
bound … --json`` prints it; its certificate, in the folder `CERTIFICATES`, under the same name;
``bounds.csv``, a `BoundRow` each. Another bound is another entry of `RUNS`.
"""

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
from results.bounds.lever_centres import lever_bound
from results.script import main, study_of

#: The folder of the certificates, within that of the study.
CERTIFICATES = "certificates"
#: What makes a bound, and the command that made the one on record, by the name of its files.
#: The study has one seed for all: of isotropy seed 0 proves the same bound as seed 1.
RUNS: Mapping[str, tuple[Callable[..., dict[str, Any]], str]] = {
    "residual_tight.json": (residual_bound, "lockedjoint bound residual --json"),
    "max_min_null_vector.json": (max_min_bound, "lockedjoint bound max-min --json"),
    "isotropy_turned.json": (isotropy_bound, "lockedjoint bound isotropy --seed 1 --json"),
    "isotropic_levers.json": (
        lever_bound,
        "lockedjoint verify results/bounds/certificates/isotropic_levers.json --json",
    ),
}


# The table shows so many significant digits of a bound, rounded so that it stays a bound.
_DIGITS = 9


@dataclass(frozen=True)
class BoundRow:
    """The columns of ``bounds.csv``: first the JSON file and what made it, on what and when.

    `quantity` is the measure that is bounded, for `joints` joints. `preset` is the choice of
    rows of the relaxation, `kind` is ``rigorous`` for a bound that is proved. `best_known` is
    the best score known to be reached; the gap to it is in percent of the bound. A
    semidefinite program has `moments` unknowns, and a largest block of `largest_block` rows;
    branch and bound has `boxes`. `versions` and `machine` say what it ran on, `seconds` the
    wall time of all steps.
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
            form=lambda row: outward(row.bound, _DIGITS, lower=row.quantity == "residual")
        )
    )
    best_known: float = field(metadata=column("best known", ".9g"))
    gap_percent: float = field(metadata=column("gap %"))
    moments: int | None = field(metadata=column(empty="–"))
    largest_block: int | None = field(metadata=column(empty="–"))
    boxes: int | None = field(metadata=column(empty="–"))
    seconds: float = field(metadata=column("wall time (s)", ".1f"))


def of_quantity(rows: Sequence[BoundRow], quantity: str) -> BoundRow | None:
    """Return the sharpest bound on a quantity, if there is one."""
    those = [row for row in rows if row.quantity == quantity]
    return min(those, key=lambda row: row.gap_percent, default=None)


def row_of(plain: Mapping[str, Any], **made: str) -> BoundRow:
    """Return the row of a bound's JSON; `made` are the columns up to `date`.

    `plain` has the columns as keys, besides ``size``, a dict of sizes of the program, and
    ``seconds``, a dict of wall times of steps, which are added up.
    """
    sizes = {"moments": None, "largest_block": None, "boxes": None, **plain["size"]}
    size = SimpleNamespace(**sizes)
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
    takes="three hours, and 4 GB of memory",
    long=True,
    settings={"of_quantity": of_quantity},
)

if __name__ == "__main__":
    main(STUDY, __file__)
