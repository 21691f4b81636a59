"""Values of enclosed blocks at configurations, and bounds on the norms of their rows."""

from collections.abc import Sequence
from math import sqrt

import numpy as np

from lockedjoint.formulations.bounds.moments.enclosed_matrix import (
    SAFETY,
    rounded_once,
    short_sums,
)
from lockedjoint.formulations.bounds.moments.enclosed_squares import (
    TERMS,
    EnclosedBlock,
    terms_of,
)
from lockedjoint.formulations.bounds.moments.row_rounding import row_error, unit_of
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.nlp.arrays import FloatArray

# Number of configurations that are evaluated together.
_CONFIGURATIONS_AT_ONCE = 64


def plain_norms(family: BlockFamily, plain: Sequence[FloatArray]) -> FloatArray:
    """Return bounds on |φ| of each label set, (label sets, configurations)."""
    configurations = max(values.shape[2] for values in plain)
    norms = [
        np.broadcast_to(np.sqrt(np.sum(values**2, axis=(0, 1))), configurations)
        + sqrt(len(rows.assignments)) * row_error(rows, unit_of(family))
        for values, rows in zip(plain, family.rows, strict=True)
    ]
    return SAFETY * np.array(norms)


def in_chunks(plain: Sequence[FloatArray], configurations: int) -> list[list[FloatArray]]:
    """Return the plain values of some configurations after the others.

    Each array has the shape (rows, components · some configurations).
    """
    chunks = []
    for first in range(0, configurations, _CONFIGURATIONS_AT_ONCE):
        some = min(_CONFIGURATIONS_AT_ONCE, configurations - first)
        chunk = []
        for values in plain:
            if values.shape[2] < configurations:  # constants: one value for all
                chunk.append(np.repeat(values[..., 0], some, axis=1))
            else:
                here = values[:, :, first : first + some]
                chunk.append(here.reshape(len(values), -1))
        chunks.append(chunk)
    return chunks


def block_values(
    block: EnclosedBlock, plain: Sequence[FloatArray], components: int
) -> FloatArray:
    """Return r of one chunk, (vectors, tableaux · columns, components, configurations)."""
    vectors, size, _ = block.factors.shape
    width = plain[0].shape[1]
    rows = np.zeros((block.tableaux, size, width))
    for part in block.parts:
        values = plain[part.label_set]
        if block.bits:
            product = rounded_once(part.basis, values, block.bits)
        else:
            product = short_sums(part.basis, values, TERMS)
        rows[:, part.columns] += product.reshape(block.tableaux, -1, width)
    values = short_sums(block.factors.transpose(0, 2, 1)[:, None], rows, terms_of(block.bits))
    return values.reshape(vectors, -1, components, width // components)
