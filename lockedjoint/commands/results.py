"""``lockedjoint compare``, ``reproduce`` and ``figure``: results that are computed and drawn.

`compare` and `reproduce` compute rows, a result each, which `RowsOfRun` writes into a folder as
they come. `figure` draws a picture of the paper, or of data from a file. The mathematics is in
`formulations`; this file checks the options, calls it and shows the answer.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import ARGUMENT, refuse_columns
from lockedjoint.commands.output import Answer, as_text, end, say
from lockedjoint.commands.shared import PICTURES, Outputs, look_of, looking_like
from lockedjoint.nlp.errors import InputError, one_of

if TYPE_CHECKING:
    from lockedjoint.formulations.reproduction import ReproductionRow

# Forms of the table that `compare --to` can print; a form is a method of `Table`.
_FORMS = ("markdown", "latex", "csv")
# Random seed of `reproduce` and `figure`: with another one the same optima come from other
# starts.
_SEED = 0
# Line below the table of `compare`, which says what its column "gap" is, in percent.
_GAP = "gap: 100·|bound − score|/bound."


def compare(
    joints: int = 7,
    task_dimension: int = 6,
    starts: int = 100,
    seed: int = 0,
    workers: int | None = None,
    model: list[str] | None = None,
    to: str | None = None,
    columns: list[str] | None = None,
    out_dir: Path = Path("comparison"),
    as_json: bool = False,
) -> None:
    """Compare residual minimisation, max-min and isotropy from common random starts.

    Solves each on two column models (for six task dimensions: unit revolute joints, and
    revolute joints with free lever arms of mean square at most 1), with variants of max-min
    and the formulations of a plugin beside them. Every answer is recomputed from its Jacobian,
    independently of the solver. Until all rows are there they are in the folder's subfolder
    incomplete, where Ctrl-C leaves what is done.

    Parameters
    ----------
    model
        May be repeated; by default unit-revolute and lever-revolute in six dimensions.
    to
        The form of what is printed: the table alone, as markdown, latex or csv. Without
        --columns csv has all columns, and markdown and latex those that a terminal shows.
    out_dir
        It gets comparison.csv, comparison.json and jacobians.json.
    """
    from lockedjoint.commands.rows import RowsOfRun
    from lockedjoint.formulations.comparison import ComparisonRow, cases, compare_cases
    from lockedjoint.formulations.io.table import Table, chosen_names
    from lockedjoint.formulations.registry import meaning_of_score
    from lockedjoint.formulations.solving.effort import Effort
    from lockedjoint.nlp.executors import default_workers

    if as_json and to is not None:
        raise InputError("--to", to, "none with --json")
    if as_json:
        refuse_columns(columns)
    form = None if to is None else one_of("--to", to, _FORMS)
    if columns is not None:  # a mistake is better known before the solves
        headings = Table(ComparisonRow, []).columns(every=True)
        columns = chosen_names("--columns", columns, headings)
    wanted = cases(joints, task_dimension, models=model or ())  # formulations on arms
    effort = Effort(seed, starts, workers or default_workers(), progress, bars=True)
    jacobians = []  # of all rows so far: each new row writes the whole file again
    with RowsOfRun(out_dir, "comparison", ComparisonRow, seed, "jacobians.json") as run:
        for compared in compare_cases(wanted, effort):
            jacobians.append(compared.jacobian())
            run.add(compared.row, {"jacobians.json": jacobians})
    scores = {case.formulation.NAME: meaning_of_score(case.formulation) for case in wanted}
    words = "".join(f"score of {name}: {meaning};\n" for name, meaning in scores.items())
    run.show(as_json, form or "", f"{words}{_GAP}", columns)


def reproduce(
    starts: int = 100, out_dir: Path = Path("reproduction"), as_json: bool = False
) -> None:
    """Recompute every numbered example and claim of the paper.

    One row each: equation, quantity, the paper's value, ours, and a verdict computed from the
    two: agrees, misprint, rounded or improved, with the reason. Until all rows are there they
    are in the folder's subfolder incomplete. Exit status 1 if any row is an unexplained
    mismatch.

    Parameters
    ----------
    out_dir
        It gets reproduction.csv and reproduction.json.
    """
    from lockedjoint.commands.rows import RowsOfRun
    from lockedjoint.formulations.reproduction import ReproductionRow, complaint, iterate

    with RowsOfRun(out_dir, "reproduction", ReproductionRow, _SEED) as run:
        for row in iterate(_SEED, starts):
            run.add(row)
            if not as_json:
                _print(row)
    run.show(as_json)
    if wrong := complaint(run.rows):
        end(f"Wrong: {wrong}.")


def _print(row: ReproductionRow) -> None:
    """Print a row on two lines: the verdict, where it is in the paper, and both values."""
    say(f"{row.verdict:<9} {row.equation:<14} {row.quantity}")
    say(f"{'':<10}paper {row.paper}   ours {row.ours}")


def figure(
    name: str,
    data: Annotated[Path | None, ARGUMENT] = None,
    starts: int | None = None,
    out: list[Path] | None = None,
    figure_style: Path | None = None,
) -> Answer:
    """Draw a figure of results that are computed anew, or of data that are given.

    figure-1 and figure-3 are those of the paper, from robots that are computed anew. seven-axes
    shows the best arm of seven revolute joints; singular-values, those of a Jacobian before and
    after each failure; trade-off, the isotropy against the worst case; optima, where random
    starts end. It takes seconds, for trade-off and optima about a minute.

    Parameters
    ----------
    name
        Name of the figure: figure-1, figure-3, seven-axes, singular-values, trade-off or
        optima.
    data
        What is shown instead: for seven-axes and singular-values a Jacobian in CSV, NPY, NPZ or
        JSON, after # its number in a file of several, counted from 0; for optima the store of a
        campaign.
    starts
        By default 5, for figure-3 100, for optima 50.
    out
        The file that is written: the figure in .svg, .png or .pdf (by default NAME.svg), or the
        numbers that are shown in .csv. May be repeated.
    """
    from lockedjoint.figures.figures import FIGURES
    from lockedjoint.figures.style import content, figure_class, kind_of
    from lockedjoint.formulations.io.escaping import rows_csv
    from lockedjoint.formulations.io.files import write_bytes, write_text
    from lockedjoint.formulations.measures.read_jacobians import only_jacobian
    from lockedjoint.formulations.solving.effort import Effort
    from lockedjoint.nlp.executors import default_workers

    wanted = FIGURES[one_of("figure", name, FIGURES)]
    if data is not None and not wanted.takes:
        raise InputError("data", data, f"none with {name}")
    figure_class()  # a missing matplotlib is better known before the computation
    # Without the name of a picture the figure goes to NAME.svg.
    chosen = (
        out
        if out and any(path.suffix != ".csv" for path in out)
        else [
            *(out or []),
            Path(f"{name}.svg"),
        ]
    )
    files = Outputs.checked(chosen, (*PICTURES, ".csv"), [data, figure_style])
    look_of(figure_style)
    given: dict[str, Any] = {}  # the argument of `make` that shows data in place of results
    if data is not None:
        given[wanted.takes] = only_jacobian(data)[1] if wanted.takes == "jacobian" else data
    count = starts or wanted.starts
    effort = Effort(_SEED, count, default_workers(), progress)
    target, table = files.picture, files.of(".csv")
    assert target is not None
    with looking_like(figure_style):
        picture = wanted.make(effort, **given)
        drawn = content(picture.figure, kind_of(target))
    write_bytes(target, drawn)
    if table is not None:
        write_text(table, rows_csv(picture.rows))
    summary: dict[str, object] = {"figure": name, "file": str(target)}
    if not given:
        summary |= {"seed": _SEED, "starts": count}
    return Answer(summary | {"rows": picture.rows}, as_text(summary))
