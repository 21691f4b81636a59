"""The existence of an isotropic Jacobian with equal columns, tested by its moments.

A relaxation: `infeasible` excludes such Jacobians (numerically), `feasible` says nothing.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from threadpoolctl import threadpool_limits

from formulations.existence.equations import Frame
from formulations.existence.relaxation.edge_multisets import edge_multisets
from formulations.existence.relaxation.linear_moments import (
    LinearMoments,
    solve_moment_equations,
)
from formulations.existence.relaxation.margin_certificate import moment_limits
from formulations.existence.relaxation.margin_sdp import Margin, solve_margin
from formulations.existence.relaxation.moment_blocks import (
    MomentBlock,
    moment_blocks,
    row_bases,
)
from formulations.existence.relaxation.moment_table import moment_table
from formulations.existence.relaxation.outcome import ExistenceRelaxation
from formulations.existence.relaxation.row_sectors import RowSector
from nlp.errors import InputError


def existence_relaxation(
    order: int,
    joints: int = 7,
    *,
    task_dimension: int | None = None,
    diagonal: bool = False,
    solver: str = "CLARABEL",
    options: Mapping[str, Any] | None = None,
) -> ExistenceRelaxation:
    """Test whether isotropic Jacobians with equal columns can exist, by moments.

    The columns are as in eq. (21): two halves of equal norm, at right angles. The Jacobian is
    square, or has one redundant joint and is then optimally failure tolerant.

    Parameters
    ----------
    order
        1, 2 or 3: moments of up to 2·order factors are used.
    joints
        Number n of columns, 2 to 7.
    task_dimension
        Number m of rows, even, n − 1 or n; by default whichever is even.
    diagonal
        Let the halves of a column be arbitrary: keep W_ii as unknowns.
    solver, options
        Conic solver known to cvxpy, and its own options.

    Returns
    -------
    ExistenceRelaxation
        Also when the solver fails: see the status of its `margin`.

    Raises
    ------
    InputError
        If an argument is out of range.

    Notes
    -----
    The equations are those of Maciejewski and Roberts (1995), eqs. (23)–(43), with the columns
    scaled so that JJᵀ = I.
    """
    frame = _frame(order, joints, task_dimension, diagonal)
    clock = [time.perf_counter()]
    moments = solve_moment_equations(frame, order)
    clock.append(time.perf_counter())
    with threadpool_limits(limits=1, user_api="blas"):  # many small matrices: threads only wait
        blocks, doubt = _blocks(moments) if moments.consistent else ((), 0.0)
    clock.append(time.perf_counter())
    margin: Margin | None = None
    alone: list[Margin] = []
    if blocks:
        limits = moment_limits(moments)
        margin = solve_margin(blocks, limits, solver=solver, options=options)
        alone += [
            solve_margin([block], limits, solver=solver, options=options) for block in blocks
        ]
    clock.append(time.perf_counter())
    stages = ("equations", "blocks", "solver")
    seconds = {
        stage: end - start
        for stage, start, end in zip(stages, clock[:-1], clock[1:], strict=True)
    }
    return ExistenceRelaxation(moments, blocks, margin, tuple(alone), doubt, solver, seconds)


def _frame(order: int, joints: int, task_dimension: int | None, diagonal: bool) -> Frame:
    if order not in (1, 2, 3):
        raise InputError("order", order, "1, 2, 3")
    if joints not in range(2, 8):
        raise InputError("joints", joints, "an integer from 2 to 7")
    even = joints - joints % 2
    if task_dimension not in (None, even):
        raise InputError("task_dimension", task_dimension, f"{even}, for {joints} joints")
    return Frame(joints, even, diagonal)


def _blocks(moments: LinearMoments) -> tuple[tuple[MomentBlock, ...], float]:
    """Return all blocks of charge 0 and up, and the doubt about their sizes."""
    frame = moments.frame
    multisets = edge_multisets(frame.joints, moments.order, loops=frame.diagonal)
    table = moment_table(moments.classes, multisets)
    coefficients = moments.coefficients()
    blocks: list[MomentBlock] = []
    doubt = 0.0
    for charge in range(moments.order + 1):
        sector = RowSector(multisets, charge, moments.order)
        bases = row_bases(sector, frame)
        doubt = max(doubt, *(basis.doubt for basis in bases))
        blocks += moment_blocks(bases, sector, table, coefficients)
    return tuple(blocks), doubt
