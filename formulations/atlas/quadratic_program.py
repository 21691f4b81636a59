"""The question of an entry as a quadratic program, and its AMPL .nl file.

    maximise   t        over J, a lower triangular L_F for every set F of k joints, and t
    subject to JJᵀ − J_F J_Fᵀ − t I = L_F L_Fᵀ,   diagonals of L_F and t not negative,
               the model's own conditions on the columns of J

Its optimum is the squared worst case; the start, J drawn with seed 0 and t = 0, is feasible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from formulations import max_min
from formulations.atlas.entry import Entry
from formulations.atlas.local_optimality import model_conditions
from formulations.measures import locked_sets
from nlp.arrays import FloatArray
from nlp.errors import InputError


@dataclass(frozen=True)
class Row:
    """A constraint Σ products[i, j] x_i x_j + Σ linear[i] x_i = level; ≤ level if a limit."""

    products: Mapping[tuple[int, int], float]
    linear: Mapping[int, float]
    level: float = 0.0
    limit: bool = False


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """A quadratic program in x, which maximises the last variable."""

    name: str
    #: The constraints, those without products last.
    rows: Sequence[Row]
    #: Which variables have the lower bound 0; the others have none.
    not_negative: np.ndarray[Any, np.dtype[np.bool_]]
    #: A feasible x, shape (size,).
    start: FloatArray

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.start)


def quadratic_program(asked: Entry) -> QuadraticProgram:
    """State an entry on the worst case; InputError for others."""
    if asked.formulation != max_min.NAME:
        raise InputError("entry", asked.name, f"one of {max_min.NAME}: without a further word")
    m, n = asked.task_dimension, asked.joints
    jacobian = asked.arm.jacobian(asked.arm.sample(np.random.default_rng(0)))
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
    rows += _of_model(asked)
    not_negative = np.tile([a == b for a, b in lower], len(sets))
    return QuadraticProgram(
        asked.name,
        sorted(rows, key=lambda row: not row.products),
        np.concatenate([np.zeros(m * n, dtype=bool), not_negative, [True]]),
        np.concatenate([*start, [0.0]]),
    )


def _of_model(asked: Entry) -> Iterator[Row]:
    for condition in model_conditions(asked):
        places = np.argwhere(np.triu(condition.form)).tolist()
        products = {
            (i, j): float(condition.form[i, j]) * (0.5 if i == j else 1.0) for i, j in places
        }
        linear = {int(i): float(condition.linear[i]) for i in np.flatnonzero(condition.linear)}
        yield Row(products, linear, float(condition.level), condition.limit)


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
