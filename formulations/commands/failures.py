"""``lockedjoint failures``: several and unequal failures, the best found beside the bound."""

from __future__ import annotations

from pathlib import Path

from formulations.commands.arguments import Json, Out, Seed, Starts, Workers
from formulations.commands.study import run_study


def failures(
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    out: Out = Path("failures"),
    as_json: Json = False,
) -> None:
    """Maximise what several or unequal failures leave, over a list of cases.

    Two and three joints locked at once on planar, positional and revolute arms; joints that
    never fail; joints that fail with unequal probabilities, by the expected and by the
    probability-weighted worst dexterity. Each beside a proved bound. Writes failures.csv,
    failures.md and jacobians.json after every row; Ctrl-C keeps what is done.
    """
    from formulations.studies.failures import study
    from formulations.studies.study import Effort
    from nlp.multistart import default_workers

    effort = Effort(seed, starts, workers or default_workers(), bars=True)
    run_study(study(), out, effort, as_json)
