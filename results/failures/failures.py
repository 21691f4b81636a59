"""Several and unequal failures: the best found beside the bound, over a list of cases.

A case is an arm of n joints in m task directions, and what may fail: k joints at once, all sets
of them alike (`several`), or one joint, with a probability for each joint (`unequal`). What is
maximised is the worst σ, the smallest singular value of J after a failure, or the expected one.
What goes out: ``failures.csv``, a `FailureRow` for each case, and ``jacobians.json``, the same
with the best Jacobian, shape (m, n).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.bounds.certified import largest_worst_case
from lockedjoint.formulations.bounds.unequal_failures import (
    expected_bound,
    weighted_worst_bound,
)
from lockedjoint.formulations.comparison import counted, solve_case
from lockedjoint.formulations.io.files import write_json
from lockedjoint.formulations.io.table import Table, column
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures import gap_percent, unequal_failures
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.nlp.errors import InputError
from results.script import main, study_of

# The words of the table for joints that fail alike.
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
# Joints that never fail, by number from 0, and the words of the table.
_NEVER = {(0,): "joint 0 never", (0, 1): "joints 0, 1 never", (0, 1, 2): "joints 0, 1, 2 never"}
# Probabilities that a joint locks: three, two and two joints, in the ratio 2 : 4 : 1.
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
            settings = {"encoding": encoding, "from_residual_minima": minima, "failures": k}
            cases.append(Case(max_min, arm(model, n, m), settings, _ALIKE))
    return tuple(cases)


def unequal() -> tuple[Case, ...]:
    """Return the cases of unequal failures, one joint at a time."""
    alike, mixed = FailureModel.equally_likely(7), FailureModel(_MIXED)
    planar = FailureModel((0.1, 0.2, 0.1, 0.1))
    ratios, twice = "in the ratio 2:2:2:4:4:1:1", "joint 1 twice as likely"
    listed: tuple[tuple[str, int, FailureModel, max_min.Goal, str], ...] = (
        *(
            ("unit-revolute", 6, FailureModel.equally_likely(7, never=never), "worst", words)
            for never, words in _NEVER.items()
        ),
        ("unit-revolute", 6, alike, "expected", _ALIKE),
        ("unit-revolute", 6, mixed, "worst", ratios),
        ("unit-revolute", 6, mixed, "expected", ratios),
        ("free", 2, planar, "worst", twice),
        ("free", 2, planar, "expected", twice),
    )
    return tuple(
        Case(
            max_min,
            arm(model, failures.joints, m),
            {"failures": failures, "maximise": maximise},
            words,
        )
        for model, m, failures, maximise, words in listed
    )


@dataclass(frozen=True)
class FailureRow:
    """One case's outcome: the columns of ``failures.csv``.

    `score` is what is maximised, from J alone; both σ are over the failures that can happen.
    Where nothing passed the check `score` and `gap_percent` are NaN, and both σ are those of
    the best start that did not pass. At `solved` starts Ipopt said that it succeeded.
    `distinct_optima` is 0 where joints are not all alike, and if the user interrupted.
    """

    model: str
    task_dimension: int = field(metadata=column("m"))
    joints: int = field(metadata=column("n"))
    failures: int = field(metadata=column("k"))
    failing: str
    maximise: str
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
        outcome = solve_case(case, effort)
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
    settings, maximise = case.settings, case.settings["maximise"]
    m, n = jacobian.shape
    given = settings["failures"]
    alike = not isinstance(given, FailureModel)
    failures = FailureModel.equally_likely(n, case.failures) if alike else given
    value = case.score(jacobian) if outcome.reached else float("nan")
    if alike:
        assert isinstance(case.arm, Arm)
        bound = largest_worst_case(case.arm, case.failures).value
    else:
        bounded = weighted_worst_bound if maximise == "worst" else expected_bound
        bound = bounded(m, np.sum(jacobian**2, axis=0).tolist(), failures)
    return FailureRow(
        **counted(outcome),
        failures=case.failures,
        failing=case.variant,
        maximise=maximise,
        encoding=settings["encoding"],
        starts_from="residual minima" if settings["from_residual_minima"] else "random",
        score=value,
        bound=bound,
        gap_percent=gap_percent(value, bound),
        worst_case_sigma=unequal_failures.possible_worst_case_sigma(jacobian, failures),
        expected_sigma=unequal_failures.expected_sigma(jacobian, failures),
    )


def _gap_in_atlas(name: str) -> float:
    """Return by how many percent the atlas's Jacobian of an entry is below its bound."""
    page = page_of(entry(name))
    if page is None:
        raise InputError("entry", name, "one that the atlas has a Jacobian of")
    return page.gap_percent


STUDY = study_of(
    __file__,
    compute,
    FailureRow,
    title="several joints locked at once, joints that never fail, unequal probabilities",
    takes="one minute",
    settings={"gap_in_atlas": _gap_in_atlas},
)

if __name__ == "__main__":
    main(STUDY, __file__)
