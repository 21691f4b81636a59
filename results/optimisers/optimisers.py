"""Other optimisers on twelve entries of the atlas, as quadratic programs, beside what is known.

What comes in: names of entries, `ENTRIES`. What goes out: rows of `optimisers.csv`, one for
what the atlas knows of each entry and one for each solver of `solvers`. Each solver has a
process of its own, which is ended after three times its processor time. Needs PySCIPOpt and
maingopy.
"""

import math
import resource
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from time import process_time

from lockedjoint.formulations.atlas.collection import atlas
from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.solving.effort import Effort
from results.optimisers.quadratic_program import quadratic_program
from results.optimisers.solvers import LARGE, SOLVERS, Answer, Solver, squared_worst_case
from results.script import main, study_of

ENTRIES = (
    "free-mean_2x5_k1",
    "free-mean_2x6_k2",
    "free-mean_2x7_k3",
    *(f"unit-revolute_6x{n}_k{k}" for n in range(7, 11) for k in range(1, min(n - 6, 3) + 1)),
)
# Bytes of memory that a solver's process may have.
_MEMORY_BYTES = 6 << 30
# A solver's process is ended after so many times the processor time that the solver was given.
_PATIENCE = 3


@dataclass(frozen=True)
class OptimiserRow:
    """What one solver made of one entry; t is the squared worst case."""

    entry: str
    variables: int
    constraints: int
    solver: str
    t: float = field(metadata=column("best t", ".7f"))
    bound: float = field(metadata=column("bound of t", ".7f"))
    gap_percent: float = field(metadata=column("gap %", "z.2f"))
    steps: int = field(metadata=column("nodes or starts", empty="–"))
    cpu_seconds: float = field(metadata=column("CPU (s)", ".0f"))
    ended: str


def compute(effort: Effort, _: Path) -> Iterator[OptimiserRow]:
    """Yield a row for what is known of each entry, and one for each solver."""
    for name in ENTRIES:
        page = atlas(name)
        program = quadratic_program(page.entry)
        size = name, program.size, len(program.constraints)
        known, proved = float(page.value) ** 2, page.entry.bound.value**2
        gap, seconds_of_search = _gap_percent(known, proved), page.found.cpu_seconds
        yield OptimiserRow(
            *size, "the atlas", known, proved, gap, 0, seconds_of_search, page.mark
        )
        for solver, limits in SOLVERS.items():
            if program.size > limits.most_variables:
                continue
            effort.progress(f"{name}: {solver}")
            answer, used = _apart(limits.solve, name, limits.seconds_for(program.size))
            t = 0.0
            if answer.jacobian is not None:
                t = squared_worst_case(page.entry, answer.jacobian)
            gap = _gap_percent(t, answer.bound)
            yield OptimiserRow(
                *size, solver, t, answer.bound, gap, answer.steps, used, answer.ended
            )


def _gap_percent(t: float, bound: float) -> float:
    return 100 * (1 - t / bound)


def _apart(solve: Solver, name: str, seconds: float) -> tuple[Answer, float]:
    """Return a solver's answer and its processor time, from a process with limits."""
    most_seconds = _PATIENCE * seconds
    context = get_context("spawn")
    with ProcessPoolExecutor(1, context, _limit, (most_seconds,)) as pool:
        try:
            return pool.submit(_timed, solve, name, seconds).result()
        except BrokenProcessPool:
            ended = "ended by the limit of time or memory"
            return Answer(None, math.nan, ended, 0), most_seconds


def _limit(seconds: float) -> None:
    """Limit this process, which is ended when it takes more."""
    for kind, most in (
        (resource.RLIMIT_CPU, int(seconds)),
        (resource.RLIMIT_AS, _MEMORY_BYTES),
    ):
        resource.setrlimit(kind, (most, most))


def _timed(solve: Solver, name: str, seconds: float) -> tuple[Answer, float]:
    """Return a solver's answer and its processor time, in seconds."""
    begin = process_time()
    try:
        answer = solve(atlas(name).entry, seconds)
    except MemoryError:
        answer = Answer(None, math.nan, "out of memory", 0)
    return answer, process_time() - begin


STUDY = study_of(
    __file__,
    compute,
    OptimiserRow,
    title="test problems: other optimisers beside the atlas",
    takes="twenty minutes, PySCIPOpt and maingopy",
    long=True,
    settings={
        "seconds": {
            name: f"{limits.seconds:g} s ({limits.seconds_if_large:g})"
            for name, limits in SOLVERS.items()
        },
        "large": LARGE,
        "twelve": ENTRIES,
        "versions": "SCIP 10.0 (PySCIPOpt 6.3.0), maingopy 0.10.3, Ipopt of CasADi 3.8.2",
    },
)

if __name__ == "__main__":
    main(STUDY, __file__)
