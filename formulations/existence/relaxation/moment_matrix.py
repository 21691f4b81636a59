"""The moment matrix as small blocks that depend affinely on the free moments.

An entry is the moment of a class of monomials, found by array look-up. There are few multisets
of edges (1771 of three edges on seven joints) but millions of pairs of them, so the whole
matrix is never stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.numbered_monomials import (
    EdgeMultisets,
    Integers,
    RowSector,
)
from formulations.existence.relaxation.row_bases import RowBasis
from formulations.existence.relaxation.tableaux import Shape
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Pieces large enough to keep the number of matrix products small, and memory below 50 MB.
_ENTRIES_AT_ONCE = 2_000_000


@dataclass(frozen=True, eq=False)
class MomentBlock:
    """One block of the moment matrix, B_0 + Σ_k y_k B_k for free moments y_k.

    Parameters
    ----------
    charge, shape
        The charge of its rows and the partition of their representation.
    copies
        Number of rows before the equations were taken out.
    matrices
        B_0, B_1, …: shape (1 + free moments, size, size).
    """

    charge: int
    shape: Shape
    copies: int
    matrices: FloatArray

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.matrices.shape[1])

    def at(self, free: FloatArray) -> FloatArray:
        """Return the block at given free moments."""
        return np.tensordot(np.concatenate([[1.0], free]), self.matrices, axes=1)


def moment_blocks(
    bases: Sequence[RowBasis],
    sector: RowSector,
    tables: Sequence[Integers],
    moments: FloatArray,
) -> list[MomentBlock]:
    """Return the blocks of one charge.

    Parameters
    ----------
    bases
        The rows, per representation.
    sector
        The monomials that the rows are made of.
    tables
        The class of every monomial, from `class_tables`.
    moments
        Class moments, a column for the constant part and for each free moment.
    """
    kept = [basis for basis in bases if basis.rows.shape[1]]
    together = np.hstack([basis.rows for basis in kept])
    projected = _projected(sector, tables, moments, together)
    symmetric = 0.5 * (projected + projected.transpose(0, 2, 1))
    blocks, end = [], 0
    for basis in kept:
        start, end = end, end + basis.rows.shape[1]
        matrices = symmetric[:, start:end, start:end]
        blocks.append(MomentBlock(sector.charge, basis.shape, basis.copies, matrices))
    return blocks


def _projected(
    sector: RowSector, tables: Sequence[Integers], moments: FloatArray, basis: FloatArray
) -> FloatArray:
    """Return basisᵀ·M_k·basis, shape (K, r, r), for the K moment matrices M_k.

    M_k is given by its class moments, column k of `moments`; `basis` has shape (length, r).
    """
    result = np.zeros((moments.shape[1], basis.shape[1], basis.shape[1]))
    for p, q in sector.types:
        left = basis[sector.offset(p, q) :][: sector.size(p, q)]
        for r, s in sector.types:
            right = basis[sector.offset(r, s) :][: sector.size(r, s)]
            # Row conj(u), column v: the factors W of v meet the factors conj(W) of u.
            w = sector.multisets.unions(q, r)
            wbar = sector.multisets.unions(p, s)
            step = max(1, _ENTRIES_AT_ONCE // len(right))
            for start in range(0, len(left), step):
                part = left[start : start + step]
                u_w, u_wbar = np.divmod(np.arange(start, start + len(part)), len(w))
                found = tables[q + r][w[u_wbar][:, :, None], wbar[u_w][:, None, :]]
                found = found.reshape(len(part), -1)
                for k, values in enumerate(moments.T):
                    result[k] += part.T @ (values[found] @ right)
    return result


def class_tables(graphs: Sequence[Monomial], multisets: EdgeMultisets) -> tuple[Integers, ...]:
    """Tabulate the classes by relabelling one monomial of each in every way.

    Parameters
    ----------
    graphs
        One monomial per class, of at most the order of the multisets.
    multisets
        The numbering of multisets of edges.

    Returns
    -------
    tuple of ndarray
        For each size p, the class of (multiset of W, multiset of conj(W)): shape (N_p, N_p).

    Raises
    ------
    InputError
        If some monomial belongs to no class or to two.
    """
    sizes = [len(members) for members in multisets.members]
    tables = tuple(np.full((size, size), -1, dtype=np.int32) for size in sizes)
    orders = np.array(list(permutations(range(multisets.joints))))
    for place, graph in enumerate(graphs):
        table = tables[len(graph.w)]
        w, wbar = (
            multisets.images(multisets.members[len(pairs)][multisets.of_pairs(pairs)], orders)
            for pairs in (graph.w, graph.wbar)
        )
        if not np.isin(table[w, wbar], (-1, place)).all():
            raise InputError(
                "graphs", graph, "one monomial of each class, this one is a second"
            )
        table[w, wbar] = place
        table[wbar, w] = place
    if any((table < 0).any() for table in tables):
        raise InputError("graphs", len(graphs), "one monomial of each class, some are missing")
    return tables
