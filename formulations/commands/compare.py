"""``lockedjoint compare``: the formulations from common starts, in one table."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    Compiled,
    Ipopt,
    Joints,
    Json,
    Out,
    Seed,
    Starts,
    TaskDimension,
    Workers,
    ipopt_options,
)
from formulations.commands.output import run_study


def compare(
    joints: Joints = 7,
    task_dimension: TaskDimension = 6,
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    out: Out = Path("comparison"),
    ipopt: Ipopt = None,
    compiled: Compiled = False,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL",
            help="A column model, see docs/howto/add_a_column_model.md. May be repeated.",
            show_default="unit-revolute and lever-revolute in six dimensions",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare residual minimisation, max-min and isotropy from common random starts.

    Solves each on two column models (for six task dimensions: unit revolute joints, and
    revolute joints with free lever arms of mean square at most 1), with variants of max-min
    and the formulations of a plugin beside them. Every answer is recomputed from its Jacobian,
    independently of the solver. Writes comparison.csv, comparison.md and jacobians.json into
    the output folder; until all rows are there they are in its subfolder incomplete, where
    Ctrl-C leaves what is done.
    """
    from formulations.comparison import study
    from formulations.io.study import Effort
    from nlp.executors import default_workers

    run_study(
        study(joints, task_dimension, ipopt_options(ipopt), compiled, model or ()),
        out,
        as_json,
        effort=Effort(seed, starts, workers or default_workers(), bars=True),
        note="score: ½‖JJᵀ − (T/m)I‖² for residual, worst-case σ for the others; gap: "
        "100·|bound − score|/bound.",
    )
