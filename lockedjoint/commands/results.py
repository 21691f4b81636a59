"""``lockedjoint compare``, ``reproduce`` and ``figure``: what is computed anew, and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from lockedjoint.commands import arguments as cli
from lockedjoint.commands.arguments import argument, option
from lockedjoint.commands.output import Answer, as_text, end, progress, say
from lockedjoint.nlp.errors import InputError, one_of

if TYPE_CHECKING:
    from lockedjoint.formulations.reproduction import ReproductionRow


_SCORE_AND_GAP = (
    "score: ½‖JJᵀ − (T/m)I‖² for residual, worst-case σ for the others; gap: "
    "100·|bound − score|/bound."
)


def compare(
    joints: cli.Joints = 7,
    task_dimension: cli.TaskDimension = 6,
    starts: cli.Starts = 100,
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    out: cli.Out = Path("comparison"),
    ipopt: cli.Ipopt = None,
    model: list[str] | None = option(
        "MODEL",
        "A column model, see docs/howto/add_a_column_model.md. May be repeated; by default "
        "unit-revolute and lever-revolute in six dimensions.",
    ),
    to: Literal["markdown", "latex", "csv"] | None = option(
        None, "Print only the table, with all of its columns."
    ),
    as_json: cli.Json = False,
) -> None:
    """Compare residual minimisation, max-min and isotropy from common random starts.

    Solves each on two column models (for six task dimensions: unit revolute joints, and
    revolute joints with free lever arms of mean square at most 1), with variants of max-min
    and the formulations of a plugin beside them. Every answer is recomputed from its Jacobian,
    independently of the solver. Writes comparison.csv, comparison.json and jacobians.json
    into the output folder; until all rows are there they are in its subfolder incomplete,
    where Ctrl-C leaves what is done.
    """
    from lockedjoint.commands.rows import RowsOfRun
    from lockedjoint.formulations.comparison import ComparisonRow, cases
    from lockedjoint.formulations.comparison import compare as compared_one_by_one
    from lockedjoint.formulations.solving.effort import Effort
    from lockedjoint.nlp.executors import default_workers

    if as_json and to is not None:
        raise InputError("--to", to, "none with --json")
    wanted = cases(joints, task_dimension, cli.ipopt_options(ipopt), model or ())
    effort = Effort(seed, starts, workers or default_workers(), progress, bars=True)
    jacobians = []
    with RowsOfRun(out, "comparison", ComparisonRow, seed, "jacobians.json") as run:
        for compared in compared_one_by_one(wanted, effort):
            jacobians.append(compared.jacobian())
            run.add(compared.row, {"jacobians.json": jacobians})
    run.show(as_json, to or "", _SCORE_AND_GAP)


def reproduce(
    starts: cli.Starts = 100,
    seed: cli.Seed = 0,
    out: cli.Out = Path("reproduction"),
    as_json: cli.Json = False,
) -> None:
    """Recompute every numbered example and claim of the paper.

    One row each: equation, quantity, the paper's value, ours, and a verdict computed from the
    two: agrees, misprint, rounded or improved, with the reason. Writes reproduction.csv and
    reproduction.json into the output folder; until all rows are there they are in its subfolder
    incomplete. Exit status 1 if any row is an unexplained mismatch.
    """
    from lockedjoint.commands.rows import RowsOfRun
    from lockedjoint.formulations.reproduction import ReproductionRow, complaint, iterate

    with RowsOfRun(out, "reproduction", ReproductionRow, seed) as run:
        for row in iterate(seed, starts):
            run.add(row)
            if not as_json:
                _print(row)
    run.show(as_json)
    if wrong := complaint(run.rows):
        end(f"Wrong: {wrong}.")


def _print(row: ReproductionRow) -> None:
    say(f"{row.verdict:<9} {row.equation:<14} {row.quantity}")
    say(f"{'':<10}paper {row.paper}   ours {row.ours}")


def figure(
    *,
    name: Annotated[
        str,
        argument(
            "NAME",
            "figure-1, figure-3: of the paper, from computed robots. seven-axes: the 7R "
            "optimum. singular-values: before and after each failure. trade-off: isotropy "
            "against worst case. optima: where random starts end.",
        ),
    ],
    out: Path = option("FILE", "The figure's file; its name ends in .svg, .png or .pdf.", ...),
    data: Path | None = option("FILE", "Write the numbers that are shown there, as CSV."),
    jacobian: Path | None = option(
        "FILE",
        "For seven-axes and singular-values: the Jacobian to show (CSV, NPY, NPZ or JSON); "
        "by default it is solved for.",
    ),
    pick: cli.Pick = None,
    store: Path | None = option("DB", "For optima: show the starts of this campaign."),
    starts: int | None = option(
        "K",
        "Random starts of each problem; by default 5, figure-3 100, optima 50.",
        low=1,
        high=cli.MOST_STARTS,
    ),
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    look_options: cli.FigureOptions,
) -> Answer:
    """Draw a figure of results that are computed anew, or of data that are given.

    Takes seconds; trade-off and optima about a minute.
    """
    from lockedjoint.figures.figures import FIGURES
    from lockedjoint.figures.style import content, figure_class, kind_of, looking
    from lockedjoint.formulations.io.escaping import frame_csv
    from lockedjoint.formulations.io.files import prepare_file, write_bytes, write_text
    from lockedjoint.formulations.measures.read_jacobians import only_jacobian
    from lockedjoint.formulations.solving.effort import Effort
    from lockedjoint.nlp.executors import default_workers

    wanted, form = FIGURES[one_of("figure", name, FIGURES)], kind_of(out)
    paths = {"jacobian": jacobian, "store": store}
    given: dict[str, Any] = {k: path for k, path in paths.items() if path is not None}
    for option_name, path in given.items():
        if option_name != wanted.takes:
            raise InputError(f"--{option_name}", path, f"none with {name}")
    if pick is not None and jacobian is None:
        raise InputError("--pick", pick, "none without --jacobian")
    figure_class()
    inputs = [jacobian, store, look_options.style]
    prepare_file(out, inputs=inputs)
    prepare_file(data, "--data", [*inputs, out])
    look = look_options.look()
    if jacobian is not None:
        given["jacobian"] = only_jacobian(jacobian, pick)[1]
    count = starts or wanted.starts
    effort = Effort(seed, count, workers or default_workers(), progress)
    with looking(look):
        picture = wanted.make(effort, **given)
        drawn = content(picture.figure, form)
    write_bytes(out, drawn)
    if data is not None:
        write_text(data, frame_csv(picture.table))
    summary: dict[str, object] = {"figure": name, "file": str(out)}
    if not given:
        summary |= {"seed": seed, "starts": count}
    return Answer(summary | {"rows": picture.rows()}, as_text(summary))
