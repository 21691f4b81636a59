"""The figures as a study: each drawn anew, with the numbers that it shows beside it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from formulations.plot.figures import FIGURES
from formulations.plot.picture import Request
from formulations.plot.style import content, figure_class
from formulations.studies.study import Effort, Part, Study


@dataclass(frozen=True)
class FigureRow:
    """A line of ``figures.csv``: a figure, its numbers, and the command that makes both."""

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


def study() -> Study:
    """Return the figures."""
    return Study(
        name="figures",
        title="Figs. 1 and 3 from computed robots, the 7R optimum, trade-off, optima",
        page="README.md",
        template="figures.md.j2",
        tables={"figures": FigureRow, "trade-off": TradeOffRow},
        command="lockedjoint report --only figures --out results",
        takes="under a minute, and matplotlib",
        compute=_compute,
        check=figure_class,
    )


def _compute(effort: Effort, _: Path) -> Iterator[Part]:
    for name, kind in FIGURES.items():
        effort.progress(name)
        starts = effort.starts or kind.starts
        request = Request(starts=starts, seed=effort.seed, workers=effort.workers)
        picture = kind.make(request)
        numbers = picture.table.to_csv(index=False, lineterminator="\n")
        files = {f"{name}.svg": content(picture.figure, "svg"), f"{name}.csv": numbers.encode()}
        where = f"results/figures/{name}"
        command = f"lockedjoint figure {name} --out {where}.svg --data {where}.csv"
        if starts != kind.starts:
            command += f" --starts {starts}"
        row = FigureRow(name, f"{name}.svg", f"{name}.csv", len(picture.table), starts, command)
        yield Part(rows=[row], files=files)
