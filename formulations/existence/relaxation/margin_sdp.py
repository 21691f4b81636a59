"""The largest smallest eigenvalue that free moments can give all blocks (cvxpy)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from formulations.existence.relaxation.margin_certificate import (
    MarginCertificate,
    check_margin,
)
from formulations.existence.relaxation.moment_blocks import MomentBlock
from nlp.conic import run

Matrix: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Margin:
    """The margin that a solver found, and its check.

    Parameters
    ----------
    value
        The solver's optimum, or None.
    status
        The solver's own word.
    free
        The free moments at the optimum, or None.
    multipliers
        One matrix per block, or None.
    certificate
        What these numbers are worth, found without the solver.
    """

    value: float | None
    status: str
    free: NDArray[np.float64] | None
    multipliers: tuple[Matrix, ...] | None
    certificate: MarginCertificate


@dataclass(frozen=True, eq=False)
class MarginProgram:
    """The program in cvxpy, with what is read off afterwards."""

    program: cp.Problem
    free: tuple[cp.Variable, ...]
    semidefinite: tuple[cp.Constraint, ...]


def build_margin_program(blocks: Sequence[MomentBlock]) -> MarginProgram:
    """State, without solving: maximise s ≤ 1 subject to B_b(y) − sI ⪰ 0 for all blocks.

    Parameters
    ----------
    blocks
        The blocks, at least one.
    """
    margin = cp.Variable(name="margin")
    free = tuple(cp.Variable() for _ in range(len(blocks[0].matrices) - 1))
    semidefinite = tuple(
        sum((y * b for y, b in zip(free, block.matrices[1:], strict=True)), block.matrices[0])
        - margin * np.eye(block.size)
        >> 0
        for block in blocks
    )
    program = cp.Problem(cp.Maximize(margin), [*semidefinite, margin <= 1])
    return MarginProgram(program, free, semidefinite)


def solve_margin(
    blocks: Sequence[MomentBlock],
    limits: NDArray[np.float64],
    *,
    solver: str = "CLARABEL",
    options: Mapping[str, Any] | None = None,
) -> Margin:
    """Find the margin of some blocks and check it.

    Parameters
    ----------
    blocks
        The blocks, at least one.
    limits
        Limits of the absolute values of the free moments, from `moment_limits`.
    solver, options
        Conic solver known to cvxpy, and its own options.
    """
    stated = build_margin_program(blocks)
    status = run(stated.program, solver, options)
    values = [y.value for y in stated.free]
    found = stated.program.value is not None and np.isfinite(stated.program.value)
    free = np.array(values, dtype=float).ravel() if found else None
    duals = [constraint.dual_value for constraint in stated.semidefinite]
    multipliers = (
        None
        if any(dual is None for dual in duals)
        else tuple(
            np.array(dual, dtype=float).reshape(block.size, block.size)
            for dual, block in zip(duals, blocks, strict=True)
        )
    )
    return Margin(
        value=float(stated.program.value) if found else None,
        status=status,
        free=free,
        multipliers=multipliers,
        certificate=check_margin(blocks, limits, free, multipliers),
    )
