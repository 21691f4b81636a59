"""The benchmark beside other solvers as a study."""

from __future__ import annotations

from pathlib import Path

from formulations.files.rows import read_rows
from formulations.studies.benchmark.finding import finding
from formulations.studies.benchmark.measurement import Row, measure
from formulations.studies.benchmark.peers import PEERS, packages
from formulations.studies.benchmark.report import write
from formulations.studies.study import Effort, Study

TABLE = "benchmark.csv"
STARTS, TIME_LIMIT = 100, 20.0
_SIZES = (7, 8, 10, 14, 20)
# Above this size, a fifth of the starts, as the command does.
_SMALL = 8


def study() -> Study:
    """Return the benchmark."""
    return Study(
        name="benchmark",
        title="processor time per start and per success, beside other solvers, 7R to 20R",
        page="benchmark.md",
        table=TABLE,
        command="lockedjoint benchmark --out results/benchmark",
        takes="a quarter of an hour, on a machine that does nothing else",
        long=True,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / TABLE, Row)),
    )


def _run(folder: Path, effort: Effort) -> str:
    starts = effort.starts_or(STARTS)
    rows: list[Row] = []
    for size in _SIZES:
        few = starts if size <= _SMALL else max(1, starts // 5)
        for formulation in dict.fromkeys(peer.formulation for peer in PEERS):
            peers = [peer for peer in PEERS if peer.formulation == formulation]
            rounds = measure(peers, size, few, effort.seed, TIME_LIMIT, effort.progress)
            rows += list(rounds)[-1]  # after the last round
    write(rows, folder, effort.seed, packages(), TIME_LIMIT)
    return ""
