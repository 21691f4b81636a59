"""The best planar Jacobians, by branch and bound over the directions of their columns.

J has two rows and n columns, of which k lock. With m = 2 let z_i be the complex square of
column i. What the columns S leave has the eigenvalues (W ± |Z|)/2, W = Σ_S |z_i|, Z = Σ_S z_i,
so that with k locked

    max-min          2t ≤ W − Re(Z v̄)              for every S of n − k columns, |v| = 1,
    manipulability   r √(1 − |v|²) ≤ W − Re(Z v̄)   for every S, |v| < 1; Σ|z_i| = 1, Σ z_i = 0,
    condition        0 ≤ c W − Re(Z v̄)             for every S, |v| = 1; c = (1 − κ²)/(1 + κ²),

t the square of the worst case, r the least relative manipulability, κ the least ratio of the
smallest to the largest singular value; v is a complex number and v̄ its conjugate. A node of
the search says how many z_i each cell of the circle holds; multipliers p and ν of a linear
program for the means of the cells prove a number for it, whatever they are
(docs/several_failures.md). Rounding is paid for. So the bound is rigorous. The search is in
this file, the nodes are in `planar_node`, their cells in `planar_cells` and the multipliers in
`planar_conditions`.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, get_args

from lockedjoint.formulations.bounds.planar_cells import first_cells
from lockedjoint.formulations.bounds.planar_conditions import Claim, Measure
from lockedjoint.formulations.bounds.planar_node import Node
from lockedjoint.nlp.arrays import real_number, whole_number
from lockedjoint.nlp.errors import one_of
from lockedjoint.nlp.progress import Progress, Step

# Number of nodes between two reports of how far the search is.
_REPORTED_NODES = 20


@dataclass(frozen=True)
class PlanarBound:
    """What a search proved."""

    #: What is bounded: ``max-min``, ``manipulability`` or ``condition``.
    measure: Measure
    #: n.
    joints: int
    #: k.
    failures: int
    #: No planar J with ‖J‖_F² = n has a worst case, or other measure, above it.
    level: float
    #: Whether the search ended; else nothing is known.
    proved: bool
    #: How many nodes were looked at.
    nodes: int

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as in the record; of kind `undecided` if nothing is proved."""
        return {
            **asdict(self),
            "kind": "rigorous" if self.proved else "undecided",
            "command": f"lockedjoint bound planar --joints {self.joints} "
            f"--failures {self.failures} --level {self.level!r}"
            + (f" --measure {self.measure}" if self.measure != "max-min" else ""),
        }


def planar_bound(
    joints: int,
    failures: int,
    level: float,
    measure: Measure = "max-min",
    *,
    most_nodes: int = 100_000,
    progress: Progress = lambda _: None,
) -> PlanarBound:
    """Prove that no planar J of n free columns, k of which lock, is better than a level.

    Parameters
    ----------
    joints
        n, from 3 to 20.
    failures
        k, from 1 to n − 2.
    level
        Of the worst case where ‖J‖_F² = n, of the least relative manipulability, or of the
        least reciprocal condition number.
    measure
        Which of these.
    most_nodes
        Number of nodes after which the search gives up. It has to where the level is below the
        best that exists.
    progress
        Is told how far the search is.

    Raises
    ------
    InputError
        If a number is out of range.
    """
    n = whole_number("joints", joints, 3, 20)
    k = whole_number("failures", failures, 1, n - 2)
    one_of("measure", measure, get_args(Measure))
    real_number("level", level, "a number above 0, at most 1e100", math.ulp(0.0), 1e100)
    most = whole_number("most_nodes", most_nodes, 1)
    claim = Claim.of(measure, n, k, level)
    first = [Node(cells, claim) for cells in first_cells(n)]
    # Each node with its share of the search: what it divides into has equal parts of it.
    waiting, count, done = [(node, 1 / len(first)) for node in first], 0, 0.0
    while waiting and count < most:
        node, share_of_search = waiting.pop()
        count += 1
        parts = node.parts()
        waiting += [(part, share_of_search / len(parts)) for part in parts]
        done += 0.0 if parts else share_of_search
        if count % _REPORTED_NODES == 0:
            words = f"{count} nodes, {len(waiting)} wait"
            progress(Step(words, min(1.0, max(done, count / most))))
    return PlanarBound(measure, n, k, float(level), not waiting, count)
