"""The optimisers that are compared: SCIP, MAiNGO and Ipopt, each on one entry of the atlas.

What comes in: an `Entry` and seconds of processor time. What goes out: an `Answer`. A solver
gets the quadratic program of the entry as it comes, and nothing that the library knows. To
compare another one, write a function here, and list it in `SOLVERS` with its time.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.measures import trace, worst_case_sigma
from lockedjoint.nlp.arrays import FloatArray
from results.optimisers.formats import as_nl
from results.optimisers.quadratic_program import QuadraticConstraint, quadratic_program

# Megabytes of memory after which SCIP stops.
_SCIP_MEMORY_MB = 4096
# Iterations of Ipopt from one start.
_IPOPT_ITERATIONS = 1000
# SCIP counts processor time with this setting, not time on the wall.
_CPU_CLOCK = 1


@dataclass(frozen=True, eq=False)
class Answer:
    """What a solver returns for one entry, with t the squared worst case."""

    jacobian: FloatArray | None  #: J, shape (m, n), if the solver found one.
    bound: float  #: The solver's upper bound of t; NaN if it has none.
    ended: str  #: How it ended, in its words.
    steps: int  #: How many nodes, iterations or starts it took.


#: A solver takes an entry and seconds of processor time.
Solver: TypeAlias = Callable[[Entry, float], Answer]


@dataclass(frozen=True)
class Limits:
    """How long a solver is let run, and on which programs."""

    solve: Solver
    seconds: float  #: Of processor time.
    seconds_if_large: float  #: The same for programs of at least `LARGE` variables.
    most_variables: float = math.inf  #: Larger programs are left out.

    def seconds_for(self, variables: int) -> float:
        """Return the processor time for a program with so many variables."""
        return self.seconds if variables < LARGE else self.seconds_if_large


def scip(entry: Entry, seconds: float) -> Answer:
    """Solve the .nl file by SCIP, as it comes."""
    from pyscipopt import Model

    model = Model()
    model.hideOutput()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "problem.nl"
        path.write_text(as_nl(quadratic_program(entry)))
        model.readProblem(str(path))
    model.setParams(
        {
            "timing/clocktype": _CPU_CLOCK,
            "limits/time": seconds,
            "limits/memory": _SCIP_MEMORY_MB,
        }
    )
    model.optimize()
    jacobian = None
    if model.getNSols():
        # SCIP may reorder the variables x0, x1, …
        variables = sorted(model.getVars(), key=lambda variable: int(variable.name[1:]))
        jacobian = _jacobian(entry, [model.getVal(variable) for variable in variables])
    return Answer(
        jacobian=jacobian,
        bound=float(model.getDualbound()),
        ended=str(model.getStatus()),
        steps=int(model.getNTotalNodes()),
    )


def maingo(entry: Entry, seconds: float) -> Answer:
    """Solve the program by MAiNGO, in the box that the constraints imply."""
    import maingopy

    program = quadratic_program(entry)
    # No entry of J or of a factor L_F is larger than ‖J‖_F.
    largest = float(np.sqrt(entry.arm.largest_trace))
    largest_t = largest**2 / entry.task_dimension

    class Model(maingopy.MAiNGOmodel):  # type: ignore[misc]
        def get_variables(self) -> list[Any]:
            boxes = [(0.0 if bound else -largest, largest) for bound in program.not_negative]
            boxes[-1] = 0.0, largest_t
            return [
                maingopy.OptimizationVariable(
                    maingopy.Bounds(*box), maingopy.VT_CONTINUOUS, f"x{i}"
                )
                for i, box in enumerate(boxes)
            ]

        def get_initial_point(self) -> list[float]:
            return list(program.start.tolist())

        def evaluate(self, x: Any) -> Any:
            result = maingopy.EvaluationContainer()
            result.objective = -x[program.size - 1]
            excesses = [
                (constraint.limit, _excess(constraint, x, maingopy.sqr))
                for constraint in program.constraints
            ]
            result.eq = [excess for limit, excess in excesses if not limit]
            result.ineq = [excess for limit, excess in excesses if limit]
            return result

    model = Model()
    solver = maingopy.MAiNGO(model)
    solver.set_option("maxTime", seconds)
    solver.set_option("loggingDestination", maingopy.LOGGING_NONE)
    solver.set_option("writeResultFile", 0)
    status = solver.solve()
    found = status in (maingopy.RETCODE.FEASIBLE_POINT, maingopy.RETCODE.GLOBALLY_OPTIMAL)
    return Answer(
        jacobian=_jacobian(entry, solver.get_solution_point()) if found else None,
        bound=-float(solver.get_final_LBD()),
        ended=status.name.lower().replace("_", " "),
        steps=int(solver.get_iterations()),
    )


def _excess(constraint: QuadraticConstraint, x: Any, square: Callable[[Any], Any]) -> Any:
    """Return the left side of a constraint minus its level, from MAiNGO's variables."""
    products = [
        factor * (square(x[i]) if i == j else x[i] * x[j])
        for (i, j), factor in constraint.products.items()
    ]
    linear = [factor * x[i] for i, factor in constraint.linear.items()]
    return sum([*products, *linear], -constraint.level)


def ipopt(entry: Entry, seconds: float) -> Answer:
    """Solve the .nl file by Ipopt, from one random start after the other."""
    import casadi

    builder = casadi.NlpBuilder()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "problem.nl"
        path.write_text(as_nl(quadratic_program(entry)))
        builder.import_nl(str(path), {})
    problem: Any = {
        "x": casadi.vertcat(*builder.x),
        "f": builder.f,
        "g": casadi.vertcat(*builder.g),
    }
    bounds = {
        "lbx": builder.x_lb,
        "ubx": builder.x_ub,
        "lbg": builder.g_lb,
        "ubg": builder.g_ub,
    }
    own_options = {
        "print_level": 0,
        "sb": "yes",
        "max_cpu_time": seconds,
        "max_iter": _IPOPT_ITERATIONS,
    }
    options: Any = {"ipopt": own_options, "print_time": False}
    begin, best_t, best = process_time(), 0.0, None
    solver = casadi.nlpsol("s", "ipopt", problem, options)
    for seed in count():
        if process_time() - begin > seconds:
            break
        start = quadratic_program(entry, seed).start
        x = solver(x0=start, **bounds)["x"].full().ravel()
        jacobian = _jacobian(entry, x)
        if np.isfinite(x).all():
            t = squared_worst_case(entry, jacobian)
            if t > best_t:
                best_t, best = t, jacobian
    return Answer(jacobian=best, bound=math.nan, ended="time limit", steps=seed)


def _jacobian(entry: Entry, x: Any) -> FloatArray:
    """Return J, which a program's variables begin with, row after row."""
    m, n = entry.task_dimension, entry.joints
    return np.array(x[: m * n], dtype=np.float64).reshape(m, n)


def squared_worst_case(entry: Entry, jacobian: FloatArray) -> float:
    """Return t of the Jacobian of the model that is next to a solver's.

    Tolerances let a solver leave the model by a little.
    """
    if entry.model == "free-mean":
        jacobian = jacobian * np.sqrt(entry.joints / trace(jacobian))
    else:
        linear, rotational = jacobian[:3], jacobian[3:]
        rotational = rotational / np.linalg.norm(rotational, axis=0)
        linear = linear - np.sum(linear * rotational, axis=0) * rotational
        jacobian = np.vstack([linear / np.linalg.norm(linear, axis=0), rotational])
    return worst_case_sigma(jacobian, entry.failures) ** 2


#: A program with so many variables is large.
LARGE = 220
#: The solvers, by their names in the table.
SOLVERS: Mapping[str, Limits] = {
    "SCIP": Limits(scip, seconds=60.0, seconds_if_large=30.0),
    "MAiNGO": Limits(maingo, seconds=30.0, seconds_if_large=15.0, most_variables=300),
    "Ipopt": Limits(ipopt, seconds=30.0, seconds_if_large=15.0),
}
