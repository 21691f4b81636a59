"""Several and unequal failures: the best found beside the bound, over a list of cases."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from formulations import max_min, measures
from formulations.bounds import unequal_failures
from formulations.bounds.certified import sharpest_worst_case
from formulations.comparison import counted, solve_case
from formulations.io.study import Effort, write_json
from formulations.io.table import Table, column
from formulations.joints.arm import Arm
from formulations.joints.models import arm
from formulations.measures.unequal_failures import (
    FailureModel,
    expected_sigma,
    possible_worst_case_sigma,
)
from formulations.solving.case import Case
from formulations.solving.outcome import Outcome
from nlp.arrays import FloatArray
from results.script import main, study_of

STARTS = 100
_ALIKE = "all alike"


# Model, m, n, k. The planar 4R with two failures is the paper's α = π/4 (after eq. 17).
_SEVERAL = (
    ("free-mean", 2, 4, 2),
    ("free-mean", 2, 5, 2),
    ("free-mean", 2, 5, 3),
    ("free-mean", 3, 5, 2),
    ("free-mean", 3, 6, 2),
    ("free-mean", 3, 6, 3),
    ("unit-revolute", 6, 8, 2),
    ("unit-revolute", 6, 9, 2),
    ("unit-revolute", 6, 9, 3),
    ("unit-revolute", 6, 10, 2),
)
# Three, two and two joints, in the ratio 2 : 4 : 1.
_MIXED = (0.1, 0.1, 0.1, 0.2, 0.2, 0.05, 0.05)


def several() -> tuple[Case, ...]:
    """Return the cases of k > 1 alike joints, with the encodings that have a chance there.

    With no column to spare, principal minors lose most starts, and on six rows random starts
    lose most of what residual minima find.
    """
    cases = []
    for model, m, n, k in _SEVERAL:
        tight = n - m - k == 0
        minima = tight and model == "unit-revolute"
        for encoding in ("shared-factor",) if tight else ("shared-factor", "principal-minors"):
            settings = {"encoding": encoding, "from_residual_minima": minima, "locked": k}
            cases.append(Case(max_min, arm(model, n, m), settings, _ALIKE))
    return tuple(cases)


def unequal() -> tuple[Case, ...]:
    """Return the cases of unequal failures, one joint at a time."""
    never = {"joint 0 never": 1, "joints 0, 1 never": 2, "joints 0, 1, 2 never": 3}
    spared = [
        _unequal("unit-revolute", 6, FailureModel.equally_likely(7, never=range(count)), words)
        for words, count in never.items()
    ]
    alike, mixed = FailureModel.equally_likely(7), FailureModel(_MIXED)
    planar = FailureModel((0.1, 0.2, 0.1, 0.1))
    ratios, twice = "in the ratio 2:2:2:4:4:1:1", "joint 1 twice as likely"
    return (
        *spared,
        _unequal("unit-revolute", 6, alike, "all alike", "expected"),
        _unequal("unit-revolute", 6, mixed, ratios),
        _unequal("unit-revolute", 6, mixed, ratios, "expected"),
        _unequal("free", 2, planar, twice),
        _unequal("free", 2, planar, twice, "expected"),
    )


def _unequal(
    model: str,
    task_dimension: int,
    failures: FailureModel,
    words: str,
    goal: max_min.Goal = "worst",
) -> Case:
    settings = {"locked": failures.locked, "failures": failures, "goal": goal}
    return Case(max_min, arm(model, failures.joints, task_dimension), settings, words)


@dataclass(frozen=True)
class FailureRow:
    """One case's outcome: the columns of ``failures.csv``; NaN where nothing passed the check.

    Attributes
    ----------
    score, bound, gap_percent
        What is maximised, its bound, and the gap between them in percent of the bound.
    worst_case_sigma, expected_sigma
        Over the failures that can happen, of the same Jacobian.
    solved, reached_best
        Starts at which Ipopt said that it succeeded, and whose answer, checked, is the best.
    distinct_optima
        Classes among the starts that reached the best where all joints are alike; 0 elsewhere,
        and if the user interrupted.
    iterations_median, cpu_seconds_per_start
        Processor time, with the drawing of the start, without building the solver.
    """

    model: str
    task_dimension: int = field(metadata=column("m"))
    joints: int = field(metadata=column("n"))
    locked: int = field(metadata=column("k"))
    failing: str
    goal: str
    score: float = field(metadata=column("best", ".7f"))
    bound: float = field(metadata=column(form=".7f"))
    gap_percent: float = field(metadata=column("gap %", "z.3f"))
    worst_case_sigma: float = field(metadata=column("worst σ", ".5f"))
    expected_sigma: float = field(metadata=column("expected σ", ".5f"))
    encoding: str
    starts_from: str = field(metadata=column("from"))
    starts: int
    solved: int
    reached_best: int
    distinct_optima: int = field(metadata=column("optima", empty="–"))
    iterations_median: float = field(metadata=column("iterations", "g"))
    cpu_seconds_per_start: float = field(metadata=column("CPU ms per start", scale=1e3))


def compute(effort: Effort, folder: Path) -> Iterator[FailureRow]:
    """Yield a row for each case, and write the Jacobians."""
    entries = []
    for case in (*several(), *unequal()):
        outcome = solve_case(case, effort, STARTS)
        row = row_of(outcome)
        [plain] = Table(FailureRow, [row]).plain()
        entries.append({**plain, "jacobian": outcome.best.jacobian.tolist()})
        write_json(folder / "jacobians.json", entries)
        yield row
        if not outcome.complete:
            raise KeyboardInterrupt


def row_of(outcome: Outcome) -> FailureRow:
    """Return an outcome of at least one record as a row, measured from the Jacobian alone."""
    case, jacobian = outcome.case, outcome.best.jacobian
    k, settings = case.locked, case.settings
    failures = settings["failures"] or FailureModel.equally_likely(case.arm.shape[1], k)
    value = outcome.case.score(jacobian) if outcome.reached else float("nan")
    bound = _bound(case, jacobian)
    return FailureRow(
        **counted(outcome),
        locked=k,
        failing=case.variant,
        goal=settings["goal"],
        encoding=settings["encoding"],
        starts_from="residual minima" if settings["from_residual_minima"] else "random",
        score=value,
        bound=bound,
        gap_percent=measures.gap_percent(value, bound),
        worst_case_sigma=possible_worst_case_sigma(jacobian, failures),
        expected_sigma=expected_sigma(jacobian, failures),
    )


def _bound(case: Case, jacobian: FloatArray) -> float:
    failures = case.settings["failures"]
    if failures is None:
        assert isinstance(case.arm, Arm)
        return sharpest_worst_case(case.arm, case.locked).value
    norms = np.sum(jacobian**2, axis=0).tolist()
    bounds = {
        "worst": unequal_failures.weighted_worst_bound,
        "expected": unequal_failures.expected_bound,
    }
    return bounds[case.settings["goal"]](case.arm.shape[0], norms, failures)


STUDY = study_of(
    __file__,
    title="several joints locked at once, joints that never fail, unequal probabilities",
    page="failures.md",
    tables={"failures": FailureRow},
    takes="three minutes",
    compute=compute,
)

if __name__ == "__main__":
    main(STUDY, __file__)
