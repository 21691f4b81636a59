"""Values of plain rows: products of Wigner functions, coupled to a total spin.

A value has a component for each of the 2L + 1 components of the total spin L, and couplings are
numbered as in `wigner.coupled_tensors`. Labels (l, m), assignments and couplings are those of
`plain_rows`. D^l_{Mm}, the Wigner function of a joint, has the index M as a component and m
fixed. Configurations are the last axis of every array but of the D^l.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.moments.plain_rows import Assignment, PlainRows
from lockedjoint.formulations.bounds.moments.wigner import ComplexArray, coupling
from lockedjoint.nlp.arrays import FloatArray

#: Values by total spin l, each of shape (couplings, 2l + 1, configurations).
Coupled: TypeAlias = dict[int, ComplexArray]


def plain_values(
    rows: PlainRows, wigner: Sequence[ComplexArray], order: Sequence[int]
) -> FloatArray:
    """Return the values of plain rows, shape (rows, 2(2L + 1), configurations), doubles.

    There is one configuration where no joint carries a label: the values are constants. The
    real parts of the components of spin L come first, then the imaginary parts.

    Parameters
    ----------
    rows
        The plain rows of one label set.
    wigner
        D^0, D^1, …, each of shape (configurations, n, 2l + 1, 2l + 1), complex in double or
        extended precision.
    order
        The joint at each place, shape (n,).
    """
    values: list[FloatArray] = []
    one = np.ones((1, 1, 1), dtype=wigner[0].dtype)
    # Products of the first factors, coupled, by the joints that carry them. Assignments are
    # sorted: many have the same beginning, and only beginnings of the present one are kept.
    coupled: dict[Assignment, Coupled] = {(): {0: one}}
    for assignment in rows.assignments:
        coupled = {
            beginning: product
            for beginning, product in coupled.items()
            if assignment[: len(beginning)] == beginning
        }
        longest = max(map(len, coupled))
        for q in range(longest, len(rows.labels)):
            spin, m = rows.labels[q]
            joint = order[assignment[q]]
            # Shape (2·spin + 1, configurations): the index M first.
            factor = np.ascontiguousarray(wigner[spin][:, joint, :, spin + m].T)
            products = {
                before: product[:, :, None] * factor
                for before, product in coupled[assignment[:q]].items()
            }
            # Total spins from which the spins that follow still lead to L.
            remaining = sum(rows.spins[q + 1 :])
            useful = range(max(0, rows.spin - remaining), rows.spin + remaining + 1)
            coupled[assignment[: q + 1]] = recoupled(products, spin, useful)
        product = coupled[assignment][rows.spin]
        values.append(np.concatenate([product.real, product.imag], axis=1).astype(float))
    return np.concatenate(values)


def recoupled(products: Coupled, spin: int, useful: range) -> Coupled:
    """Couple one more factor, of a given spin, to the total spins that are useful.

    Parameters
    ----------
    products
        For each spin l before: products with the factor, shape (couplings, 2l + 1,
        2·spin + 1, configurations).
    spin
        Spin of the factor.
    useful
        The total spins that are wanted.

    Returns
    -------
    dict
        The values by total spin, couplings in the order of `coupled_tensors`.
    """
    parts: dict[int, list[ComplexArray]] = {}
    for before, values in products.items():
        for total in range(abs(before - spin), before + spin + 1):
            if total in useful:
                parts.setdefault(total, []).append(_coupled(values, total))
    return {total: np.concatenate(some) for total, some in parts.items()}


def _coupled(values: ComplexArray, total: int) -> ComplexArray:
    """Return the part of one total spin of products: (couplings, 2·total + 1, configurations).

    The products have the shape (couplings, 2·first + 1, 2·second + 1, configurations).
    """
    couplings, first_size, second_size, configurations = values.shape
    extended = values.dtype != complex
    table = coupling(first_size // 2, second_size // 2, total, extended=extended)
    if not extended:
        # The table is real: real and imaginary parts are columns of one real product.
        flat = np.ascontiguousarray(values.reshape(couplings, -1, configurations)).view(float)
        return np.asarray((table.reshape(-1, 2 * total + 1).T @ flat).view(complex))
    # Extended precision has no fast product of matrices; most entries of the table are 0.
    sums = np.zeros((couplings, 2 * total + 1, configurations), dtype=values.dtype)
    for a, b, component in zip(*np.nonzero(table), strict=True):
        sums[:, component] += table[a, b, component] * values[:, a, b]
    return sums
