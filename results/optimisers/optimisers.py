"""Other optimisers on twelve entries of the atlas, as quadratic programs, beside what is known.

Needs PySCIPOpt and maingopy. Each solver has a process of its own, which is ended after three
times its processor time. A solver's Jacobian is moved to the model, which its tolerances allow
it to leave, and t is that Jacobian's squared worst case.
"""

import math
import resource
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations.atlas.collection import atlas
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.measures import trace, worst_case_sigma
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray
from results.optimisers.formats import as_nl
from results.optimisers.quadratic_program import QuadraticConstraint, quadratic_program
from results.script import main, study_of

ENTRIES = (
    "free-mean_2x5_k1",
    "free-mean_2x6_k2",
    "free-mean_2x7_k3",
    *(f"unit-revolute_6x{n}_k{k}" for n in range(7, 11) for k in range(1, min(n - 6, 3) + 1)),
)
_NOTHING = float("nan")
# Bytes that a solver may have.
_MEMORY = 6 << 30
# A J if there is one, a bound of t or NaN, how it ended, and how many nodes or starts it had.
_Answer: TypeAlias = tuple[FloatArray | None, float, str, int]
Solver: TypeAlias = Callable[[Entry, float], _Answer]


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
        found = page.found.cpu_seconds
        yield OptimiserRow(
            *size, "the atlas", known, proved, _gap(known, proved), 0, found, page.mark
        )
        for solver, (solve, seconds, less, most) in SOLVERS.items():
            if program.size > most:
                continue
            effort.progress(f"{name}: {solver}")
            seconds = seconds if program.size < LARGE else less
            (jacobian, bound, ended, steps), used = _apart(solve, name, seconds)
            t = 0.0 if jacobian is None else _checked(page.entry, jacobian)
            yield OptimiserRow(*size, solver, t, bound, _gap(t, bound), steps, used, ended)


def _gap(t: float, bound: float) -> float:
    return 100 * (1 - t / bound)


def _checked(asked: Entry, jacobian: FloatArray) -> float:
    """Return the squared worst case of the Jacobian of the model next to this one."""
    if asked.model == "free-mean":
        jacobian = jacobian * np.sqrt(asked.joints / trace(jacobian))
    else:
        v, w = jacobian[:3], jacobian[3:] / np.linalg.norm(jacobian[3:], axis=0)
        v = v - np.sum(v * w, axis=0) * w
        jacobian = np.vstack([v / np.linalg.norm(v, axis=0), w])
    return worst_case_sigma(jacobian, asked.failures) ** 2


def _apart(solve: Solver, name: str, seconds: float) -> tuple[_Answer, float]:
    """Return a solver's answer and its processor time, from a process with limits."""
    limits = ((resource.RLIMIT_CPU, int(3 * seconds)), (resource.RLIMIT_AS, _MEMORY))
    context = get_context("spawn")
    with ProcessPoolExecutor(1, context, initializer=_limited, initargs=(limits,)) as process:
        try:
            return process.submit(_timed, solve, name, seconds).result()
        except BrokenProcessPool:
            return (None, _NOTHING, "ended by the limit of time or memory", 0), 3 * seconds


def _limited(limits: tuple[tuple[int, int], ...]) -> None:
    for kind, most in limits:
        resource.setrlimit(kind, (most, most))


def _timed(solve: Solver, name: str, seconds: float) -> tuple[_Answer, float]:
    begun = process_time()
    try:
        answer = solve(atlas(name).entry, seconds)
    except MemoryError:
        answer = None, _NOTHING, "out of memory", 0
    return answer, process_time() - begun


def _jacobian(asked: Entry, x: Any) -> FloatArray:
    m, n = asked.task_dimension, asked.joints
    return np.array(x[: m * n], dtype=np.float64).reshape(m, n)


def scip(asked: Entry, seconds: float) -> _Answer:
    """Solve the .nl file by SCIP, as it comes."""
    from pyscipopt import Model

    model = Model()
    model.hideOutput()
    with TemporaryDirectory() as folder:
        (path := Path(folder) / "problem.nl").write_text(as_nl(quadratic_program(asked)))
        model.readProblem(str(path))
    model.setParams({"timing/clocktype": 1, "limits/time": seconds, "limits/memory": 4096})
    model.optimize()
    nodes = int(model.getNTotalNodes())
    variables = sorted(model.getVars(), key=lambda one: int(one.name[1:]))
    x = [model.getVal(one) for one in variables] if model.getNSols() else None
    jacobian = None if x is None else _jacobian(asked, x)
    return jacobian, float(model.getDualbound()), str(model.getStatus()), nodes


def maingo(asked: Entry, seconds: float) -> _Answer:
    """Solve the program by MAiNGO, in the box that the constraints imply."""
    import maingopy

    program, most = quadratic_program(asked), float(np.sqrt(asked.arm.largest_trace))

    class Model(maingopy.MAiNGOmodel):  # type: ignore[misc]
        def get_variables(self) -> list[Any]:
            boxes = [(0.0 if bound else -most, most) for bound in program.not_negative]
            boxes[-1] = 0.0, most**2 / asked.task_dimension
            return [
                maingopy.OptimizationVariable(
                    maingopy.Bounds(*box), maingopy.VT_CONTINUOUS, f"x{i}"
                )
                for i, box in enumerate(boxes)
            ]

        def get_initial_point(self) -> list[float]:
            return list(program.start.tolist())

        def evaluate(self, x: Any) -> Any:
            held = maingopy.EvaluationContainer()
            held.objective = -x[program.size - 1]
            values = [(one, _excess(one, x, maingopy.sqr)) for one in program.constraints]
            held.eq = [value for one, value in values if not one.limit]
            held.ineq = [value for one, value in values if one.limit]
            return held

    model = Model()
    solver = maingopy.MAiNGO(model)
    solver.set_option("maxTime", seconds)
    solver.set_option("loggingDestination", maingopy.LOGGING_NONE)
    solver.set_option("writeResultFile", 0)
    status = solver.solve()
    found = status in (maingopy.RETCODE.FEASIBLE_POINT, maingopy.RETCODE.GLOBALLY_OPTIMAL)
    jacobian = _jacobian(asked, solver.get_solution_point()) if found else None
    words = status.name.lower().replace("_", " ")
    return jacobian, -float(solver.get_final_LBD()), words, int(solver.get_iterations())


def _excess(constraint: QuadraticConstraint, x: Any, square: Callable[[Any], Any]) -> Any:
    """Return the left side of a constraint minus its level, from MAiNGO's variables."""
    products = [
        factor * (square(x[i]) if i == j else x[i] * x[j])
        for (i, j), factor in constraint.products.items()
    ]
    linear = [factor * x[i] for i, factor in constraint.linear.items()]
    return sum([*products, *linear], -constraint.level)


def ipopt(asked: Entry, seconds: float) -> _Answer:
    """Solve the .nl file by Ipopt, from one random start after the other."""
    import casadi

    read = casadi.NlpBuilder()
    with TemporaryDirectory() as folder:
        (path := Path(folder) / "problem.nl").write_text(as_nl(quadratic_program(asked)))
        read.import_nl(str(path), {})
    problem: Any = {"x": casadi.vertcat(*read.x), "f": read.f, "g": casadi.vertcat(*read.g)}
    bounds = {"lbx": read.x_lb, "ubx": read.x_ub, "lbg": read.g_lb, "ubg": read.g_ub}
    begun, best, answer = process_time(), 0.0, None
    quiet = {"print_level": 0, "sb": "yes", "max_cpu_time": seconds, "max_iter": 1000}
    options: Any = {"ipopt": quiet, "print_time": False}
    solver = casadi.nlpsol("s", "ipopt", problem, options)
    for seed in count():
        if process_time() - begun > seconds:
            return answer, _NOTHING, "time limit", seed
        x = solver(x0=quadratic_program(asked, seed).start, **bounds)["x"].full().ravel()
        jacobian = _jacobian(asked, x)
        if np.isfinite(x).all() and (t := _checked(asked, jacobian)) > best:
            best, answer = t, jacobian
    raise AssertionError("the time ends")


#: Seconds of processor time, those from `LARGE` variables on, and the most variables.
SOLVERS: Mapping[str, tuple[Solver, float, float, float]] = {
    "SCIP": (scip, 60.0, 30.0, math.inf),
    "MAiNGO": (maingo, 30.0, 15.0, 300),
    "Ipopt": (ipopt, 30.0, 15.0, math.inf),
}
LARGE = 220


STUDY = study_of(
    __file__,
    compute,
    OptimiserRow,
    title="test problems: other optimisers beside the atlas",
    takes="twenty minutes, PySCIPOpt and maingopy",
    long=True,
    settings={
        "seconds": {name: f"{one:g} s ({two:g})" for name, (_, one, two, _) in SOLVERS.items()},
        "large": LARGE,
        "twelve": ENTRIES,
        "versions": "SCIP 10.0 (PySCIPOpt 6.3.0), maingopy 0.10.3, Ipopt of CasADi 3.8.2",
    },
)

if __name__ == "__main__":
    main(STUDY, __file__)
