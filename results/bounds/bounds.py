"""The bounds: JSON files as the command prints them, and tables made from them."""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from formulations.io.pages import outward
from formulations.io.study import Effort, write_json
from formulations.io.table import HIDDEN, column, provenance, row_from, versions
from results.script import main, study_of

#: The folder of the certificates, within that of the study.
CERTIFICATES = "certificates"
NAN = float("nan")


@dataclass(frozen=True)
class Source:
    """The JSON file that has everything of a bound, and what made it, on what and when."""

    file: str
    command: str = field(metadata=HIDDEN)
    versions: str = field(metadata=HIDDEN)
    machine: str = field(metadata=HIDDEN)
    date: str


@dataclass(frozen=True, kw_only=True)
class BoundRow(Source):
    """The columns of ``bounds.csv``, after the source; NaN where a column does not apply.

    `preset` is the choice of rows, `closed_form` the value of eq. (6) where the bound is that,
    `best_known` the best value known to be reached. The gap is in percent of the bound. The
    semidefinite program has `moments` unknowns, 0 where it is none on SO(3)ⁿ.
    """

    quantity: str
    joints: int = field(metadata=column("n"))
    kind: str
    preset: str = field(default="", metadata=column(empty="–"))
    bound: float = field(
        metadata=column(
            form=lambda row: outward(row.bound, 9, lower=row.quantity == "residual")
        )
    )
    closed_form: float = field(default=NAN, metadata=column("eq. (6)", ".9g"))
    best_known: float = field(default=NAN, metadata=column("best known", ".9g"))
    gap_percent: float = field(default=NAN, metadata=column("gap %"))
    moments: int = 0
    largest_block: int
    seconds: float = field(metadata=column("wall time (s)", ".1f"))


def sharpest(rows: Sequence[BoundRow], quantity: str, kind: str) -> BoundRow | None:
    """Return the sharpest bound of a kind on seven unit revolute joints, if there is one."""
    same = [row for row in rows if (row.quantity, row.kind, row.joints) == (quantity, kind, 7)]
    pick = max if quantity == "residual" else min
    return pick(same, key=lambda row: row.bound, default=None)


def row_of(plain: Mapping[str, Any], source: Source) -> BoundRow:
    """Return the row of a bound's JSON."""
    same, seconds = SimpleNamespace(**plain), plain["seconds"]
    if "quantity" in plain:
        size = plain["size"] or {}
        return row_from(
            BoundRow,
            *(source, same),
            best_known=_number(plain["best_known"]),
            gap_percent=_number(plain["gap_percent"]),
            moments=size.get("moments", 0),
            largest_block=size.get("largest_block", 0),
            seconds=sum(seconds.values()),
        )
    columns = "revolute" if plain["facts"] else "free columns"
    return row_from(
        BoundRow,
        *(source, same),
        quantity=f"worst case, {columns}, ‖J‖² ≤ {plain['trace']:g}",
        bound=_number(plain["singular_value_bound"]),
        closed_form=_number(plain["closed_form_singular_value_bound"]),
        largest_block=2 * plain["task_dimension"],
    )


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)


#: Options of `lockedjoint bound` by the file that what it prints goes to.
RUNS: Mapping[str, str] = {
    "worst_case_7_6.json": "worst-case --trace 6",
    "worst_case_7r_lever_arm_1.json": "worst-case --lever-arm 1",
    "residual_compact.json": "residual --preset compact",
    "residual_tight.json": "residual --preset tight",
    "residual_compact_rigorous.json": "residual --preset compact --rigorous",
    "residual_tight_rigorous.json": "residual --preset tight --rigorous",
    "max_min_localised_rigorous.json": "max-min --preset localised --rigorous",
    "max_min_null_vector_rigorous.json": "max-min --preset null-vector --rigorous",
}


def command_of(file: str) -> str:
    """Return the command that prints a file of `RUNS`."""
    return f"lockedjoint bound {RUNS[file]} --json"


def certificate_of(file: str) -> str:
    """Return the name of the certificate of a rigorous bound's JSON file, in `CERTIFICATES`."""
    return file.replace("_rigorous", "")


def printed(file: str, *more: str) -> dict[str, Any]:
    """Run the command of a file, with more options, and return what it prints."""
    call = [
        sys.executable,
        "-m",
        *command_of(file).replace("lockedjoint", "formulations").split(),
    ]
    result: dict[str, Any] = json.loads(subprocess.check_output([*call, *more]))
    return result


def compute(effort: Effort, folder: Path) -> Iterator[BoundRow]:
    """Compute the bounds, each into a file of its own."""
    now = provenance()
    used = f"{now['versions']}, {versions(['cvxpy', 'clarabel'])}"
    for file, options in RUNS.items():
        effort.progress(file)
        more = ["--seed", str(effort.seed)] if "--preset" in options else []
        if "--rigorous" in options:
            more += ["--out", str(folder / CERTIFICATES / certificate_of(file))]
        plain = printed(file, *more)
        write_json(folder / file, plain)
        source = Source(file, command_of(file), used, now["machine"], now["date"])
        yield row_of(plain, source)


STUDY = study_of(
    __file__,
    compute,
    title="how good any answer could be: eq. (6), the residual, max-min",
    page="README.md",
    tables={"bounds": BoundRow},
    takes="half an hour, and 4 GB of memory",
    long=True,
    settings={"sharpest": sharpest},
)

if __name__ == "__main__":
    main(STUDY, __file__)
