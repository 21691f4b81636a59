"""The figures: each drawn anew, with the numbers that it shows beside it.

Out come, for each figure of `lockedjoint.figures.figures.FIGURES`, ``NAME.svg`` and
``NAME.csv``, and ``figures.csv``, a `FigureRow` each. A new figure is listed in `FIGURES`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from lockedjoint.figures.figures import FIGURES
from lockedjoint.formulations.io.escaping import rows_csv
from lockedjoint.formulations.io.files import write_text
from lockedjoint.formulations.solving.effort import Effort
from results.script import main, save, study_of


@dataclass(frozen=True)
class FigureRow:
    """A line of ``figures.csv``: a figure, its numbers, and the command that makes both.

    `file` is the picture's, `data` that of its numbers, which has so many `lines` below its
    head; `starts` is the number of random starts.
    """

    figure: str
    file: str
    data: str
    lines: int
    starts: int
    command: str


@dataclass(frozen=True)
class TradeOffRow:
    """What is read of ``trade-off.csv``, which holds the numbers of that figure."""

    model: str
    isotropy_defect: float
    worst_case_sigma: float


def compute(effort: Effort, folder: Path) -> Iterator[FigureRow]:
    """Draw each figure and write the numbers that it shows beside it."""
    for name, kind in FIGURES.items():
        effort.progress(name)
        starts = effort.starts or kind.starts
        picture = kind.make(replace(effort, starts=starts))
        files = f"{name}.svg", f"{name}.csv"
        save(picture.figure, folder / files[0])
        write_text(folder / files[1], rows_csv(picture.rows))
        where = f"results/figures/{name}"
        command = f"lockedjoint figure {name} --out {where}.svg --out {where}.csv"
        if starts != kind.starts:
            command += f" --starts {starts}"
        yield FigureRow(name, *files, len(picture.rows), starts, command)


STUDY = study_of(
    __file__,
    compute,
    title="Figs. 1 and 3 from computed robots, the 7R optimum, trade-off, optima",
    page="README.md",
    tables={"figures": FigureRow, "trade-off": TradeOffRow},
    takes="under a minute, and matplotlib",
)

if __name__ == "__main__":
    main(STUDY, __file__)
