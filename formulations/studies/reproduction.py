"""The reproduction of the paper as a study."""

from collections.abc import Iterator
from pathlib import Path

from formulations.reproduction import ReproductionRow, has_mismatch, iterate
from formulations.studies.study import Effort, Part, Study

STARTS = 100


def study() -> Study:
    """Return the reproduction."""
    return Study(
        name="reproduction",
        title="every numbered example and claim of the paper, computed anew",
        page="reproduction.md",
        template="reproduction.md.j2",
        tables={"reproduction": ReproductionRow},
        command="lockedjoint reproduce --out results/reproduction",
        takes="ten seconds",
        compute=_compute,
        complain=lambda rows: "a row is an unexplained mismatch" if has_mismatch(rows) else "",
    )


def _compute(effort: Effort, _: Path) -> Iterator[Part]:
    for row in iterate(effort.seed, effort.starts or STARTS):
        effort.progress(f"{row.equation} {row.quantity}")
        yield Part(rows=[row])
