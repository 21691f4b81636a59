"""The figures as a study: each drawn anew, with the numbers that it shows beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from formulations.figures import FIGURES
from formulations.figures.picture import Request
from formulations.files.figure import content, figure_class
from formulations.files.provenance import header
from formulations.files.rows import read_rows
from formulations.studies.figure_captions import CAPTIONS
from formulations.studies.study import Effort, Study
from nlp.files import write_bytes, write_text

TABLE, PAGE = "figures.csv", "README.md"
# Below this a defect is the solver's tolerance and no number.
_NOTHING = 1e-6
_MODELS = {"unit-revolute": "unit lever arms", "lever-revolute": "free lever arms"}


@dataclass(frozen=True)
class FigureRow:
    """A line of ``figures.csv``: a figure, its numbers, and what makes both by itself."""

    figure: str
    file: str
    data: str
    lines: int
    starts: int
    command: str


@dataclass(frozen=True)
class TradeOffRow:
    """What is read of ``trade-off.csv``."""

    model: str
    isotropy_defect: float
    worst_case_sigma: float


def study() -> Study:
    """Return the figures."""
    return Study(
        name="figures",
        title="Figs. 1 and 3 from computed robots, the 7R optimum, trade-off, optima",
        page=PAGE,
        table=TABLE,
        command="lockedjoint report --only figures --out results",
        takes="under a minute, and matplotlib",
        long=False,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / "trade-off.csv", TradeOffRow)),
    )


def finding(rows: Sequence[TradeOffRow]) -> str:
    """Return what the trade-off shows, as a paragraph; empty if there is nothing to say."""
    said = []
    for model, words in _MODELS.items():
        points = [row for row in rows if row.model == model]
        if points:
            near = min(points, key=lambda row: row.isotropy_defect)
            best = max(points, key=lambda row: row.worst_case_sigma)
            said.append(
                f"Seven revolute joints with {words}: the most isotropic Jacobian, defect "
                f"½‖JJᵀ − (T/m)I‖² {_defect(near)}, leaves σ = "
                f"{near.worst_case_sigma:.5f} in the worst case; the largest worst case, "
                f"{best.worst_case_sigma:.5f}, has defect {_defect(best)}."
            )
    return " ".join(said)


def _defect(row: TradeOffRow) -> str:
    small = row.isotropy_defect < _NOTHING
    return f"below {_NOTHING:g}" if small else f"{row.isotropy_defect:.4f}"


def markdown(rows: Sequence[FigureRow], seed: int, said: str) -> str:
    """Return the page: where it came from, what it shows, the figures, the table."""
    figures = "\n\n".join(_section(row) for row in rows)
    return (
        f"# Figures\n\n{header({'seed': seed})}\n{said}\n\n"
        "Each is drawn from what its command computes anew; nothing is taken from the paper's\n"
        f"formulas.\n\n{figures}\n\n## Numbers\n\n{markdown_table(rows)}\n"
    )


def markdown_table(rows: Sequence[FigureRow]) -> str:
    """Return the rows as a Markdown table."""
    frame = pd.DataFrame([asdict(row) for row in rows])
    return str(frame.to_markdown(index=False, disable_numparse=True))


def _run(folder: Path, effort: Effort) -> str:
    figure_class()  # matplotlib is better missed now than after a minute
    rows = []
    for name, kind in FIGURES.items():
        effort.progress(name)
        starts = effort.starts_or(kind.starts)
        request = Request(starts=starts, seed=effort.seed, workers=effort.workers)
        picture = kind.make(request)
        write_bytes(folder / f"{name}.svg", content(picture.figure, "svg"))
        numbers = picture.table.to_csv(index=False, lineterminator="\n")
        write_text(folder / f"{name}.csv", numbers)
        rows.append(_row(name, starts, len(picture.table)))
    write_text(folder / TABLE, pd.DataFrame([asdict(row) for row in rows]).to_csv(index=False))
    said = finding(read_rows(folder / "trade-off.csv", TradeOffRow))
    write_text(folder / PAGE, markdown(rows, effort.seed, said))
    return ""


def _row(name: str, starts: int, lines: int) -> FigureRow:
    where = f"results/figures/{name}"
    command = f"lockedjoint figure {name} --out {where}.svg --data {where}.csv"
    usual = FIGURES[name].starts == starts
    return FigureRow(
        figure=name,
        file=f"{name}.svg",
        data=f"{name}.csv",
        lines=lines,
        starts=starts,
        command=command if usual else f"{command} --starts {starts}",
    )


def _section(row: FigureRow) -> str:
    caption = CAPTIONS[row.figure]
    return (
        f"## {caption.title}\n\n`{row.command}`\n\n![{caption.seen}]({row.file})\n\n"
        f"{caption.text.format(starts=row.starts)}"
    )
