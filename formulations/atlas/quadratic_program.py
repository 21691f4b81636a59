"""The question of an entry as a quadratic program, in the formats of other optimisers.

::

    maximise   t        over J, a lower triangular L_F for every set F of k joints, and t
    subject to JJᵀ − J_F J_Fᵀ − t I = L_F L_Fᵀ,   diagonals of L_F and t not negative,
               the model's own conditions on the columns of J

Its optimum is the squared worst case. All is quadratic and there is one source, the products of
`QuadraticProgram.rows`; the start, a J that is drawn and t = 0, is feasible.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.local_optimality import model_conditions
from lockedjoint.formulations.measures import locked_sets
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError


@dataclass(frozen=True)
class Row:
    """A constraint Σ products[i, j] x_i x_j + Σ linear[i] x_i = level; ≤ level if a limit."""

    products: Mapping[tuple[int, int], float]
    linear: Mapping[int, float]
    level: float = 0.0
    limit: bool = False


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """A quadratic program in x, which maximises the last variable.

    Attributes
    ----------
    name
        That of the entry.
    rows
        The constraints, those without products last.
    not_negative
        Which variables have the lower bound 0, shape (size,); the others have none.
    start
        A feasible x, shape (size,).
    """

    name: str
    rows: Sequence[Row]
    not_negative: np.ndarray[Any, np.dtype[np.bool_]]
    start: FloatArray

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.start)

    @cached_property
    def _terms(self) -> tuple[np.ndarray[Any, Any], ...]:
        """Row, both variables and factor of each term; the second of a linear one is `size`."""
        terms = [
            (r, i, j, factor)
            for r, row in enumerate(self.rows)
            for (i, j), factor in [
                *row.products.items(),
                *(((i, self.size), factor) for i, factor in row.linear.items()),
            ]
        ]
        rows, first, second, factors = zip(*terms, strict=True)
        return np.array(rows), np.array(first), np.array(second), np.array(factors)

    def values(self, x: FloatArray) -> FloatArray:
        """Return the left sides of the constraints at x, shape (len(rows),)."""
        rows, first, second, factors = self._terms
        longer = np.append(x, 1.0)
        terms = factors * longer[first] * longer[second]
        return np.bincount(rows, terms, len(self.rows)).astype(np.float64)

    def jax_values(self) -> Callable[[Any], Any]:
        """Return `values` as a JAX function, to be differentiated and compiled."""
        import jax

        rows, first, second, factors = self._terms

        def values(x: Any) -> Any:
            longer = jax.numpy.append(x, 1.0)
            terms = factors * longer[first] * longer[second]
            return jax.ops.segment_sum(terms, rows, len(self.rows))

        return values


def quadratic_program(asked: Entry, seed: int = 0) -> QuadraticProgram:
    """State an entry on the worst case, with J of the start drawn; InputError for others."""
    if asked.formulation != max_min.NAME:
        raise InputError("entry", asked.name, f"one of {max_min.NAME}: without a further word")
    m, n = asked.task_dimension, asked.joints
    jacobian = asked.arm.jacobian(asked.arm.sample(np.random.default_rng(seed)))
    sets = locked_sets(jacobian, asked.locked)
    lower = [(a, b) for a in range(m) for b in range(a + 1)]
    last = m * n + len(sets) * len(lower)
    rows: list[Row] = []
    start: list[FloatArray] = [jacobian.ravel()]
    for place, failed in enumerate(sets):
        kept = [i for i in range(n) if i not in failed]
        factor = {one: m * n + place * len(lower) + k for k, one in enumerate(lower)}
        for a, b in lower:
            products = {(b * n + i, a * n + i): 1.0 for i in kept}
            products |= {(factor[b, c], factor[a, c]): -1.0 for c in range(b + 1)}
            rows.append(Row(products, {last: -1.0} if a == b else {}))
        root = np.linalg.cholesky(jacobian[:, kept] @ jacobian[:, kept].T)
        start.append(np.asarray(root[np.tril_indices(m)], dtype=np.float64))
    for condition in model_conditions(asked):
        places = np.argwhere(np.triu(condition.form)).tolist()
        products = {
            (i, j): float(condition.form[i, j]) * (0.5 if i == j else 1.0) for i, j in places
        }
        linear = {int(i): float(condition.linear[i]) for i in np.flatnonzero(condition.linear)}
        rows.append(Row(products, linear, float(condition.level), condition.limit))
    not_negative = np.tile([a == b for a, b in lower], len(sets))
    return QuadraticProgram(
        asked.name,
        sorted(rows, key=lambda row: not row.products),
        np.concatenate([np.zeros(m * n, dtype=bool), not_negative, [True]]),
        np.concatenate([*start, [0.0]]),
    )


def as_nl(program: QuadraticProgram) -> str:
    """Return the text of an AMPL .nl file."""
    rows, size = program.rows, program.size
    curved = sum(bool(row.products) for row in rows)
    used = [
        {**dict.fromkeys(i for pair in row.products for i in pair), **row.linear}
        for row in rows
    ]
    # Coefficients of what is linear; products have theirs in the expressions.
    linear = [
        {i: row.linear.get(i, 0.0) for i in sorted(us)}
        for row, us in zip(rows, used, strict=True)
    ]
    counts = np.bincount([i for one in linear for i in one], minlength=size)
    lines = [
        f"g3 1 1 0 # {program.name}",
        f" {size} {len(rows)} 1 0 {sum(not row.limit for row in rows)}",
        f" {curved} 0",
        " 0 0",
        f" {size - 1} 0 0",
        " 0 0 0 1",
        " 0 0 0 0 0",
        f" {counts.sum()} 1",
        " 0 0",
        " 0 0 0 0 0",
    ]
    for r, row in enumerate(rows):
        lines.append(f"C{r}")
        terms = [f"o2\nn{c!r}\no2\nv{i}\nv{j}" for (i, j), c in row.products.items()]
        sum_of = {0: ["n0"], 1: [], 2: ["o0"]}.get(len(terms), ["o54", str(len(terms))])
        lines += [*sum_of, *terms]
    lines += ["O0 1", "n0", f"x{size}"]
    lines += [f"{i} {value!r}" for i, value in enumerate(program.start.tolist())]
    lines += ["r", *(f"{1 if row.limit else 4} {row.level!r}" for row in rows)]
    lines += ["b", *("2 0" if bound else "3" for bound in program.not_negative)]
    lines += [f"k{size - 1}", *map(str, np.cumsum(counts)[:-1])]
    for r, one in enumerate(linear):
        lines += [f"J{r} {len(one)}", *(f"{i} {factor!r}" for i, factor in one.items())]
    return "\n".join([*lines, "G0 1", f"{size - 1} 1", ""])


def as_sif(program: QuadraticProgram) -> str:
    """Return the text of a CUTEst .SIF file, which minimises −t."""
    model, size, locked = program.name.upper().split("_")
    name = f"LJ{model[0]}{size}{locked}"
    pairs = dict.fromkeys(pair for row in program.rows for pair in row.products)
    elements = {pair: f"P{place}" for place, pair in enumerate(pairs)}
    lines = [
        f"* {program.name}: minus the squared worst case is minimised.",
        f"NAME          {name}",
    ]
    lines += ["VARIABLES", *(_card("", f"X{i}") for i in range(program.size))]
    lines += ["GROUPS", _card("N", "OBJ", f"X{program.size - 1}", -1.0)]
    for r, row in enumerate(program.rows):
        kind = "L" if row.limit else "E"
        lines += [_card(kind, f"C{r}", f"X{i}", c) for i, c in row.linear.items()]
        lines += [] if row.linear else [_card(kind, f"C{r}")]
    levels = [
        _card("", name, f"C{r}", row.level) for r, row in enumerate(program.rows) if row.level
    ]
    bounded = np.flatnonzero(program.not_negative)
    lines += ["CONSTANTS", *levels, "BOUNDS", _card("FR", name, "'DEFAULT'")]
    lines += [_card("LO", name, f"X{i}", 0.0) for i in bounded]
    lines += ["START POINT"]
    lines += [_card("", name, f"X{i}", x) for i, x in enumerate(program.start.tolist())]
    lines += ["ELEMENT TYPE", _card("EV", "2PR", "X"), _card("EV", "2PR", "Y")]
    lines += [_card("EV", "SQ", "X"), "ELEMENT USES"]
    for (i, j), element in elements.items():
        kind = "SQ" if i == j else "2PR"
        lines += [_card("T", element, kind), _card("V", element, "X", f"X{i}")]
        lines += [] if i == j else [_card("V", element, "Y", f"X{j}")]
    lines += ["GROUP USES"]
    for r, row in enumerate(program.rows):
        lines += [_card("E", f"C{r}", elements[ij], c) for ij, c in row.products.items()]
    return "\n".join([*lines, "ENDATA", "", _ELEMENTS.format(name=name)])


_ELEMENTS = """\
ELEMENTS      {name}
INDIVIDUALS
 T  2PR
 F                      X * Y
 G  X                   Y
 G  Y                   X
 H  X         Y         1.0
 T  SQ
 F                      X * X
 G  X                   X + X
 H  X         X         2.0
ENDATA
"""


def _card(kind: str, first: str, second: str = "", third: str | float = "") -> str:
    """Return a line of SIF, whose fields have fixed places; numbers have twelve characters."""
    if isinstance(third, float):
        texts = (f"{third:.{digits}g}" for digits in range(12, 0, -1))
        third = next(text for text in texts if len(text) <= 12)
        return f" {kind:<2} {first:<10}{second:<10}{third:>12}"
    return f" {kind:<2} {first:<10}{second:<25}{third}".rstrip()


def as_jump(program: QuadraticProgram) -> str:
    """Return a Julia file with a function that states the problem in JuMP."""
    bounded = ", ".join(str(i + 1) for i in np.flatnonzero(program.not_negative))
    products = [
        f"({r + 1}, {i + 1}, {j + 1}, {c!r})"
        for r, row in enumerate(program.rows)
        for (i, j), c in row.products.items()
    ]
    linear = [
        f"({r + 1}, {i + 1}, {c!r})"
        for r, row in enumerate(program.rows)
        for i, c in row.linear.items()
    ]
    limits = ", ".join(str(row.limit).lower() for row in program.rows)
    return f"""\
# {program.name}: the squared worst case is maximised.
using JuMP

const START = {program.start.tolist()}
const NOT_NEGATIVE = [{bounded}]
const LEVELS = {[row.level for row in program.rows]}
const LIMITS = [{limits}]
const PRODUCTS = [{", ".join(products)}]
const LINEAR = [{", ".join(linear)}]

function problem()
    model = Model()
    @variable(model, x[i = 1:{program.size}], start = START[i])
    set_lower_bound.(x[NOT_NEGATIVE], 0.0)
    @objective(model, Max, x[end])
    left = [zero(QuadExpr) for _ in LEVELS]
    for (row, i, j, factor) in PRODUCTS
        add_to_expression!(left[row], factor, x[i], x[j])
    end
    for (row, i, factor) in LINEAR
        add_to_expression!(left[row], factor, x[i])
    end
    for (row, level) in enumerate(LEVELS)
        if LIMITS[row]
            @constraint(model, left[row] <= level)
        else
            @constraint(model, left[row] == level)
        end
    end
    return model
end
"""


#: By the ending of a file's name.
FORMATS = {"nl": as_nl, "sif": as_sif, "jl": as_jump}
