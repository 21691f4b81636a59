"""Random calls, command lines, damaged stores and false certificates: how they end.

What goes out: ``fuzz.csv``, a `FuzzRow` for each kind of trials, with counts of how they ended.
`trials` makes the trials. Nothing may end raw or wrong: the study then complains.
"""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.solving.effort import Effort
from results.fuzz import trials
from results.script import main, study_of

#: Trials of each kind, if no number is given. More of them find rarer faults, and take longer.
COUNTS = {
    "calls": 50_000,
    "command lines": 1_000,
    "stores": 2_500,
    "certificates": 1_200,
    "two-point certificates": 200,
    "relaxation certificates": 600,
    "lever certificates": 200,
}


@dataclass(frozen=True)
class FuzzRow:
    """Trials of one kind: the columns of ``fuzz.csv``.

    A trial is done, or refused in one sentence. It is raw if an error of Python or of another
    library came out, and wrong if what is not right was accepted, or said in another form.
    """

    kind: str = field(metadata=column("random"))
    trials: int
    done: int
    refused: int
    raw: int
    wrong: int
    seconds: float = field(metadata=column("CPU (s)", ".0f"))


def of_kind(kind: str, seed: int, count: int, folder: Path) -> Iterator[str]:
    """Yield how so many trials of a kind end."""
    if kind == "calls":
        return trials.calls(seed, count)
    if kind == "command lines":
        return trials.lines(seed, count, folder)
    if kind == "stores":
        return trials.stores(seed, count, folder)
    if kind == "two-point certificates":
        return trials.two_point_certificates(seed, count)
    if kind == "relaxation certificates":
        return trials.relaxation_certificates(seed, count)
    if kind == "lever certificates":
        return trials.lever_certificates(seed, count)
    return trials.certificates(seed, count)


def row_of(kind: str, seed: int, count: int) -> FuzzRow:
    """Return the row of so many trials of a kind."""
    began = time.process_time()
    with TemporaryDirectory() as folder:
        ends = Counter(of_kind(kind, seed, count, Path(folder)))
    numbers = {name: ends[name] for name in trials.CLASSES}
    return FuzzRow(kind, count, **numbers, seconds=time.process_time() - began)


def compute(effort: Effort, folder: Path) -> Iterator[FuzzRow]:  # noqa: ARG001
    """Yield a row for each kind of trials."""
    for kind, count in COUNTS.items():
        effort.progress(f"random {kind}")
        yield row_of(kind, effort.seed, effort.starts or count)


def complain(rows: Sequence[FuzzRow]) -> str:
    """Return what is wrong with the rows, or nothing."""
    bad = sum(row.raw + row.wrong for row in rows)
    return f"{bad} trials ended raw or wrong" if bad else ""


STUDY = study_of(
    __file__,
    compute,
    FuzzRow,
    title="random calls, command lines, damaged stores and false certificates",
    takes="five minutes",
    long=True,
    complain=complain,
)

if __name__ == "__main__":
    main(STUDY, __file__)
