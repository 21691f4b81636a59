"""The existence of an isotropic Jacobian with equal columns, tested by its moments.

A relaxation: `infeasible` excludes such Jacobians (numerically), `feasible` proves nothing.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, TypeAlias

from threadpoolctl import threadpool_limits

from formulations.existence.equations import Frame
from formulations.existence.relaxation.linear_moments import (
    LinearMoments,
    solve_moment_equations,
)
from formulations.existence.relaxation.margin import Margin, solve_margin
from formulations.existence.relaxation.moment_matrix import (
    MomentBlock,
    class_tables,
    moment_blocks,
)
from formulations.existence.relaxation.numbered_monomials import EdgeMultisets, RowSector
from formulations.existence.relaxation.row_bases import row_bases
from formulations.existence.relaxation.tableaux import dimension
from nlp.conic import check_solver
from nlp.errors import InputError

Verdict: TypeAlias = Literal["inconsistent", "infeasible", "feasible", "undecided"]


@dataclass(frozen=True, eq=False)
class ExistenceRelaxation:
    """Outcome of the moment relaxation of one order.

    Parameters
    ----------
    moments
        Exact solution of the linear equations between the moments.
    blocks
        The blocks of the moment matrix; none if the equations are inconsistent.
    margin
        The largest possible smallest eigenvalue over all blocks, and its check; or None.
    alone
        The same for each block by itself.
    rank_doubt
        Largest singular value taken for zero, over the smallest taken for nonzero, where rows
        that the equations send to zero were taken out.
    solver
        Name of the conic solver.
    seconds
        Wall time of each stage.
    """

    moments: LinearMoments
    blocks: tuple[MomentBlock, ...]
    margin: Margin | None
    alone: tuple[Margin, ...]
    rank_doubt: float
    solver: str
    seconds: Mapping[str, float]

    @property
    def verdict(self) -> Verdict:
        """The conclusion for these moments.

        ``"inconsistent"``: the linear equations contradict each other (exact arithmetic).
        ``"infeasible"``: no solution's moments make all blocks positive semidefinite, and
        ``"feasible"``: the moments found do (both numerical). ``"undecided"``: neither was
        shown.
        """
        if self.margin is None:
            return "inconsistent"
        if self.margin.certificate.infeasible:
            return "infeasible"
        return "feasible" if self.margin.certificate.feasible else "undecided"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON."""
        moments, margin = self.moments, self.margin
        return {
            "kind": "exact" if self.verdict == "inconsistent" else "numerical",
            "verdict": self.verdict,
            "order": moments.order,
            "joints": moments.frame.joints,
            "task_dimension": moments.frame.task_dimension,
            "diagonal": moments.frame.diagonal,
            "classes": len(moments.classes),
            "equations": moments.equations,
            "rank": moments.rank,
            "consistent": moments.consistent,
            "free_moments": [{"w": graph.w, "wbar": graph.wbar} for graph in moments.free],
            "largest_block": max((block.size for block in self.blocks), default=0),
            "margin": None if margin is None else margin.value,
            "certificate": None if margin is None else margin.certificate.to_dict(),
            "blocks": [
                {
                    "charge": block.charge,
                    "representation": block.shape,
                    "dimension": dimension(block.shape),
                    "copies": block.copies,
                    "size": block.size,
                    "margin_alone": alone.value,
                    "infeasible_alone": alone.certificate.infeasible,
                }
                for block, alone in zip(self.blocks, self.alone, strict=True)
            ],
            "rank_doubt": self.rank_doubt,
            "solver": self.solver,
            "status": None if margin is None else margin.status,
            "seconds": dict(self.seconds),
        }


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
        If an argument is out of range or there is no such solver, before any computation.

    Notes
    -----
    The equations are those of Maciejewski and Roberts (1995), eqs. (23)–(43), with the columns
    scaled so that JJᵀ = I.
    """
    even = joints - joints % 2
    if order not in (1, 2, 3):
        raise InputError("order", order, "1, 2, 3")
    if joints not in range(2, 8):
        raise InputError("joints", joints, "an integer from 2 to 7")
    if task_dimension not in (None, even):
        raise InputError("task_dimension", task_dimension, f"{even}, for {joints} joints")
    check_solver(solver)
    clock = [time.perf_counter()]
    moments = solve_moment_equations(Frame(joints, even, diagonal), order)
    clock.append(time.perf_counter())
    with threadpool_limits(limits=1, user_api="blas"):  # many small matrices: threads only wait
        blocks, doubt = _blocks(moments) if moments.consistent else ((), 0.0)
    clock.append(time.perf_counter())
    margin: Margin | None = None
    alone: list[Margin] = []
    if blocks:
        margin, *alone = (
            solve_margin(chosen, moments.limits(), solver=solver, options=options)
            for chosen in (blocks, *((block,) for block in blocks))
        )
    clock.append(time.perf_counter())
    times = (end - start for start, end in pairwise(clock))
    seconds = dict(zip(("equations", "blocks", "solver"), times, strict=True))
    return ExistenceRelaxation(moments, blocks, margin, tuple(alone), doubt, solver, seconds)


def _blocks(moments: LinearMoments) -> tuple[tuple[MomentBlock, ...], float]:
    """Return all blocks of charge 0 and up, and the doubt about their sizes."""
    frame = moments.frame
    multisets = EdgeMultisets(frame.joints, moments.order, frame.diagonal)
    tables = class_tables(moments.classes, multisets)
    coefficients = moments.coefficients()
    blocks: list[MomentBlock] = []
    doubt = 0.0
    for charge in range(moments.order + 1):
        sector = RowSector(multisets, charge)
        bases = row_bases(sector, frame)
        doubt = max(doubt, *(basis.doubt for basis in bases))
        blocks += moment_blocks(bases, sector, tables, coefficients)
    return tuple(blocks), doubt
