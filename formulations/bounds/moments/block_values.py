"""Values of enclosed blocks at configurations, and bounds on the norms of their rows.

What comes in: the plain values φ of each label set, shape (rows, components, configurations),
as `plain_values` gives them. There are 2(2L + 1) components: the real parts come first, then
the imaginary parts. A label set without labels is a constant and has one configuration.

What goes out: r = Lᵀ(U_Tᵀφ) of an `EnclosedBlock`, and bounds on |φ|. L is the factor of a
multiplier for each vector of a condition, U_T the coefficients of the block's rows for tableau
T; both, and label sets, are defined in the header of `enclosed_squares`.
"""

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

# Number of configurations that are evaluated together. It limits the memory of U_Tᵀφ, which a
# chunk needs for all tableaux at once: at most 1.5 MB for a block of the residual of 7 joints.
_CONFIGURATIONS_AT_ONCE = 64


def plain_norms(family: BlockFamily, plain: Sequence[FloatArray]) -> FloatArray:
    """Return bounds on |φ| of each label set, shape (label sets, configurations).

    Parameters
    ----------
    family
        The blocks of which these are the plain rows.
    plain
        The plain values of each label set, shape (rows, components, configurations); constants
        have one configuration.
    """
    configurations = max(values.shape[2] for values in plain)
    norms = [
        np.broadcast_to(np.sqrt(np.sum(values**2, axis=(0, 1))), configurations)
        + sqrt(len(rows.assignments)) * row_error(rows, unit_of(family))
        for values, rows in zip(plain, family.rows, strict=True)
    ]
    return SAFETY * np.array(norms)


def in_chunks(plain: Sequence[FloatArray], configurations: int) -> list[list[FloatArray]]:
    """Return the plain values in chunks: those of some configurations, then those of the next.

    Parameters
    ----------
    plain
        The plain values of each label set, shape (rows, components, configurations); constants
        have one configuration.
    configurations
        Number of configurations.

    Returns
    -------
    list
        The chunks. A chunk has one array for each label set, shape (rows, components · some
        configurations): for each component the configurations are side by side.
    """
    chunks = []
    for first in range(0, configurations, _CONFIGURATIONS_AT_ONCE):
        some = min(_CONFIGURATIONS_AT_ONCE, configurations - first)
        chunk = []
        for values in plain:
            # Constants have one value for all configurations.
            if values.shape[2] < configurations:
                chunk.append(np.repeat(values[..., 0], some, axis=1))
            else:
                here = values[:, :, first : first + some]
                chunk.append(here.reshape(len(values), -1))
        chunks.append(chunk)
    return chunks


def block_values(
    block: EnclosedBlock, chunk: Sequence[FloatArray], components: int
) -> FloatArray:
    """Return r of one chunk, shape (vectors, tableaux · columns, components, configurations).

    Parameters
    ----------
    block
        The block.
    chunk
        The plain values of each label set, shape (rows, components · configurations), see
        `in_chunks`.
    components
        Number of components, 2(2L + 1).
    """
    vectors, size, _ = block.factors.shape
    width = chunk[0].shape[1]
    # U_Tᵀφ, to which each label set contributes.
    rows = np.zeros((block.tableaux, size, width))
    for part in block.parts:
        values = chunk[part.label_set]
        # Without bits there is no grid: sums of few products bound the rounding instead.
        if block.bits:
            product = rounded_once(part.basis, values, block.bits)
        else:
            product = short_sums(part.basis, values, TERMS)
        rows[:, part.columns] += product.reshape(block.tableaux, -1, width)
    values = short_sums(block.factors.transpose(0, 2, 1)[:, None], rows, terms_of(block.bits))
    return values.reshape(vectors, -1, components, width // components)
