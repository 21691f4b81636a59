"""``lockedjoint compare`` and ``reproduce``: the formulations and the paper, computed anew."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from formulations.commands import arguments as cli
from formulations.commands.arguments import option
from formulations.commands.output import run_study, say

if TYPE_CHECKING:
    from formulations.reproduction import ReproductionRow


def compare(
    joints: cli.Joints = 7,
    task_dimension: cli.TaskDimension = 6,
    starts: cli.Starts = 100,
    seed: cli.Seed = 0,
    workers: cli.Workers = None,
    out: cli.Out = Path("comparison"),
    ipopt: cli.Ipopt = None,
    compiled: cli.Compiled = False,
    model: list[str] | None = option(
        "MODEL",
        "A column model, see docs/howto/add_a_column_model.md. May be repeated; by default "
        "unit-revolute and lever-revolute in six dimensions.",
    ),
    as_json: cli.Json = False,
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
        study(joints, task_dimension, cli.ipopt_options(ipopt), compiled, model or ()),
        out,
        as_json,
        effort=Effort(seed, starts, workers or default_workers(), bars=True),
        note="score: ½‖JJᵀ − (T/m)I‖² for residual, worst-case σ for the others; gap: "
        "100·|bound − score|/bound.",
    )


def reproduce(
    starts: cli.Starts = 100,
    seed: cli.Seed = 0,
    out: cli.Out = Path("reproduction"),
    as_json: cli.Json = False,
) -> None:
    """Recompute every numbered example and claim of the paper.

    One row each: equation, quantity, the paper's value, ours, and a verdict computed from the
    two: agrees, misprint, rounded or improved, with the reason. Writes reproduction.csv and
    reproduction.md into the output folder; until all rows are there they are in its subfolder
    incomplete. Exit status 1 if any row is an unexplained mismatch.
    """
    from formulations.io.study import Effort
    from formulations.reproduction import study

    run_study(study(), out, as_json, effort=Effort(seed, starts), each=_print)


def _print(row: ReproductionRow) -> None:
    say(f"{row.verdict:<9} {row.equation:<14} {row.quantity}")
    say(f"{'':<10}paper {row.paper}   ours {row.ours}")
