"""What a moment relaxation found, with everything needed to check it again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from formulations.existence.relaxation.linear_moments import LinearMoments
from formulations.existence.relaxation.margin_sdp import Margin
from formulations.existence.relaxation.moment_blocks import MomentBlock
from formulations.existence.relaxation.tableaux import dimension

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
        """What follows for these moments.

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

    @property
    def infeasible_alone(self) -> tuple[MomentBlock, ...]:
        """The blocks that no moments of a solution make positive semidefinite."""
        return tuple(
            block
            for block, margin in zip(self.blocks, self.alone, strict=True)
            if margin.certificate.infeasible
        )

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
