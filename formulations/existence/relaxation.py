"""The existence of an isotropic Jacobian with equal columns, tested by its moments.

W = ZᵀZ is the complex symmetric matrix of `equations`. A solution may be averaged over the
order of the joints, a common phase and conjugation, so its moments depend on a graph only. They
obey linear equations, and matrices of them, by `tableaux` and `moments`, are positive
semidefinite. Where no numbers do both, there is no solution.

The margin is the largest s ≤ 1 for which free moments y make B_b(y) − sI ⪰ 0 for all blocks b,
a semidefinite program. For multipliers X_b ⪰ 0 with Σ tr X_b ≤ 1,

    s ≤ 1 − Σ tr X_b + Σ_b ⟨X_b, B_b(y)⟩,

whose dependence on y should cancel. What is left of it is bounded through |y_k| ≤ Y_k, which
holds for the moments of every solution. A negative right-hand side excludes solutions; an
allowance for the rounding errors of the blocks themselves is added first. cvxpy finds y and
X_b; what they prove is checked in plain NumPy. So `infeasible` excludes such Jacobians
(numerically), but `feasible` proves nothing.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from formulations.conic import SOLVER, run
from formulations.existence.equations import Frame
from formulations.existence.moments import (
    LinearMoments,
    MomentBlock,
    moment_blocks,
    solve_moment_equations,
)
from formulations.existence.tableaux import standard_tableaux
from nlp.arrays import (
    FloatArray,
    finite_or_none,
    nearest_semidefinite,
    one_blas_thread,
    whole_number,
)
from nlp.errors import InputError

# Relative rounding of the blocks, which are products of bases with errors of about 1e-12.
_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class Margin:
    """What free moments attain and multipliers prove of some blocks, and their origin."""

    #: y, and one matrix X_b per block; None where there are none.
    free: FloatArray | None
    multipliers: Sequence[FloatArray] | None
    #: Smallest eigenvalue over all blocks at y; minus infinity without one.
    attained: float
    #: Upper limit of the margin for moments of solutions, 1 if nothing was proved. If it is
    #: negative there are no solutions.
    proved: float = 1.0
    #: Largest coefficient of a free moment that did not cancel.
    residual: float = math.inf
    #: Of the multipliers as they were given.
    smallest_eigenvalue: float = -math.inf
    #: The optimum that a solver found, or None, and what it reported.
    value: float | None = None
    status: str = "not solved"


def solve_margin(blocks: Sequence[MomentBlock], limits: FloatArray) -> Margin:
    """Find the margin of some blocks, where |y_k| is at most `limits`, and check it."""
    norms = [np.linalg.norm(block.matrices[1:], axis=(1, 2)) for block in blocks]
    # Solvers want unknowns that matter equally; some may not occur at all.
    moments = [cp.Variable() / (norm or 1.0) for norm in np.max(norms, axis=0)]
    margin = cp.Variable()
    conditions = [block.at(moments) - margin * np.eye(block.size) >> 0 for block in blocks]
    program = cp.Problem(cp.Maximize(margin), [*conditions, margin <= 1])
    status = run(program)
    value = finite_or_none(program.value)
    free = None if value is None else np.array([float(y.value) for y in moments])
    duals = [np.asarray(condition.dual_value, dtype=float) for condition in conditions]
    multipliers = [np.atleast_2d(dual) for dual in duals]  # NaN where the solver gave none
    return replace(check_margin(blocks, limits, free, multipliers), value=value, status=status)


def check_margin(
    blocks: Sequence[MomentBlock],
    limits: FloatArray,
    free: FloatArray | None,
    multipliers: Sequence[FloatArray] | None,
) -> Margin:
    """Return what free moments attain and multipliers prove, wherever they come from."""
    attained = -math.inf
    if free is not None:
        attained = min(float(np.linalg.eigvalsh(block.at(free))[0]) for block in blocks)
    if multipliers is None or not all(np.isfinite(x).all() for x in multipliers):
        return Margin(free, multipliers, attained)
    positive = [nearest_semidefinite(x) for x in multipliers]
    total = float(sum(np.trace(x) for x in positive))
    pairs = zip(blocks, positive, strict=True)
    products = np.sum([np.tensordot(block.matrices, x) for block, x in pairs], axis=0)
    products /= max(total, 1.0)
    leftover = np.abs(products[1:])
    residual = float(leftover.max(initial=0.0))
    smallest = min(float(np.linalg.eigvalsh(0.5 * (x + x.T))[0]) for x in multipliers)
    # What rounding in the blocks can add to Σ⟨X_b, B_b(y)⟩ with Σ tr X_b ≤ 1.
    largest = np.concatenate([[1.0], limits])
    norms = [np.linalg.norm(block.matrices, axis=(1, 2)) @ largest for block in blocks]
    proved = 1 - min(total, 1.0) + products[0] + leftover @ limits + _ROUNDING * max(norms)
    return Margin(free, multipliers, attained, float(proved), residual, smallest)


@dataclass(frozen=True, eq=False)
class ExistenceRelaxation:
    """Outcome of the moment relaxation of one order."""

    #: Exact solution of the linear equations between the moments, and the blocks of the moment
    #: matrix; none if the equations are inconsistent.
    moments: LinearMoments
    blocks: tuple[MomentBlock, ...]
    #: The largest possible smallest eigenvalue over all blocks, and its check, or None. The
    #: same for each block by itself.
    margin: Margin | None
    alone: tuple[Margin, ...]
    #: Wall time of each stage.
    seconds: Mapping[str, float]

    @property
    def verdict(self) -> Literal["inconsistent", "infeasible", "feasible", "undecided"]:
        """The conclusion for these moments.

        ``"inconsistent"``: the linear equations contradict each other (exact arithmetic).
        ``"infeasible"``: no solution's moments make all blocks positive semidefinite, and
        ``"feasible"``: the moments found do (both numerical). ``"undecided"``: neither was
        shown.
        """
        if self.margin is None:
            return "inconsistent"
        if self.margin.proved < 0:
            return "infeasible"
        return "feasible" if self.margin.attained >= 0 else "undecided"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON; None stands for an infinite one."""
        moments, margin = self.moments, self.margin
        checked = ("attained", "proved", "residual", "smallest_eigenvalue")
        exact = ("order", "equations", "rank", "consistent")
        return {
            "kind": "exact" if margin is None else "numerical",
            "verdict": self.verdict,
            **vars(moments.frame),  # joints, task_dimension, diagonal
            "classes": len(moments.classes),
            **{name: getattr(moments, name) for name in exact},
            "free_moments": [{"w": graph.w, "wbar": graph.wbar} for graph in moments.free],
            "largest_block": max((block.size for block in self.blocks), default=0),
            "margin": margin and margin.value,
            "certificate": margin
            and {name: finite_or_none(getattr(margin, name)) for name in checked},
            "blocks": [
                {
                    "charge": block.charge,
                    "representation": block.shape,
                    "dimension": len(standard_tableaux(block.shape)),
                    "copies": block.copies,
                    "size": block.size,
                    "margin_alone": alone.value,
                    "infeasible_alone": alone.proved < 0,
                }
                for block, alone in zip(self.blocks, self.alone, strict=True)
            ],
            "rank_doubt": max((block.doubt for block in self.blocks), default=0.0),
            "solver": SOLVER,
            "status": margin and margin.status,
            "seconds": dict(self.seconds),
        }


def existence_relaxation(
    order: int,
    joints: int = 7,
    *,
    task_dimension: int | None = None,
    diagonal: bool = False,
) -> ExistenceRelaxation:
    """Test whether isotropic Jacobians with equal columns can exist, by moments.

    The columns are as in eq. (21): two halves of equal norm, at right angles. The Jacobian is
    square, or has one redundant joint and is then optimally failure tolerant. The equations are
    eqs. (23)–(43), with the columns scaled so that JJᵀ = I. A solver that fails is no error:
    see the status of the `margin`.

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

    Raises
    ------
    InputError
        If an argument is out of range, before any computation.
    """
    whole_number("order", order, 1, 3)
    even = whole_number("joints", joints, 2, 7) // 2 * 2
    if task_dimension not in (None, even):
        raise InputError("task_dimension", task_dimension, f"{even}, for {joints} joints")
    clock = [time.perf_counter()]
    moments = solve_moment_equations(Frame(joints, even, diagonal), order)
    clock.append(time.perf_counter())
    with one_blas_thread():
        blocks = tuple(moment_blocks(moments)) if moments.consistent else ()
    clock.append(time.perf_counter())
    limits, chosen = moments.limits(), [blocks, *((block,) for block in blocks)]
    margins = [solve_margin(own, limits) for own in chosen if own]
    clock.append(time.perf_counter())
    seconds = dict(zip(("equations", "blocks", "solver"), np.diff(clock).tolist(), strict=True))
    margin = margins[0] if margins else None
    return ExistenceRelaxation(moments, blocks, margin, tuple(margins[1:]), seconds)
