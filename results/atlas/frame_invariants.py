"""What of a Jacobian neither a frame nor the signs of its columns change, to many digits.

What comes in: J, shape (m, n). What goes out: S, the x_f and the w_f of `exact_search`, from
which J follows but for a rotation of its rows and the signs of its columns. Arrays have the
dtype object and hold `mpmath.mpf`.
"""

from typing import Any, TypeAlias

import mpmath as mp
import numpy as np

from results.atlas.many_digits import small

#: Array of dtype object with numbers of many digits, `mpmath.mpf`.
DigitArray: TypeAlias = Any
#: One number of many digits, `mpmath.mpf`.
DigitNumber: TypeAlias = Any

# Columns span a direction more if the least singular value with one more column is above this.
_LEAST_SINGULAR_VALUE = 0.1
# Entries count as zero below 10 to minus (number of digits over this).
_ZERO_SHARE = 3


def invariants(jacobian: DigitArray) -> tuple[DigitArray, DigitArray, DigitArray]:
    """Return S, the x_f and the w_f, which neither a frame nor signs of columns change.

    Their shapes are (m, m), (m, n) and (n,), that of J is (m, n). The frame B consists of
    columns of J. Rows and columns of the x_f are scaled such that the entries along a spanning
    tree are 1: the tree ties each row to a column, or to another row where a column has one
    entry only.
    """
    m, n = jacobian.shape
    basis: list[int] = []
    for f in range(n):
        columns = jacobian[:, [*basis, f]].astype(float)
        least = np.linalg.svd(columns, compute_uv=False)[-1]
        if len(basis) < m and least > _LEAST_SINGULAR_VALUE:
            basis.append(f)
    frame = jacobian[:, basis]
    coordinates = inverted(frame) @ jacobian
    gram = frame.T @ frame
    row_scales, column_scales = _scales(coordinates, gram)
    return (
        gram / (row_scales[:, None] * row_scales),
        coordinates * row_scales[:, None] * column_scales,
        1 / column_scales**2,
    )


def _scales(coordinates: DigitArray, gram: DigitArray) -> tuple[DigitArray, DigitArray]:
    """Return the scales of rows and columns, shapes (m,) and (n,), along a spanning tree."""
    m, n = coordinates.shape
    nonzero = np.abs(coordinates) > small(_ZERO_SHARE)
    row_scales: dict[int, DigitNumber] = {0: mp.mpf(1)}
    column_scales: dict[int, DigitNumber] = {}
    while len(row_scales) < m or len(column_scales) < n:
        # Entries that tie a row that has a scale to a column that has none, or the reverse.
        edges = [
            (i, f) for i, f in np.argwhere(nonzero) if (i in row_scales) != (f in column_scales)
        ]
        if edges:
            i, f = edges[0]
            if i in row_scales:
                column_scales[f] = 1 / (row_scales[i] * coordinates[i, f])
            else:
                row_scales[i] = 1 / (column_scales[f] * coordinates[i, f])
        else:
            i = next(i for i in range(m) if i not in row_scales)
            tied = [k for k in row_scales if abs(gram[i, k]) > small(_ZERO_SHARE)]
            row_scales[i] = 1
            if tied:
                k = tied[0]
                row_scales[i] = gram[i, k] * row_scales[k] / gram[k, k]
    rows = np.array([row_scales[i] for i in range(m)])
    columns = np.array([column_scales[f] for f in range(n)])
    return rows, columns


def inverted(matrix: DigitArray) -> DigitArray:
    """Return the inverse of a square matrix, to all digits."""
    inverse = mp.matrix(matrix.tolist()) ** -1
    return np.array(inverse.tolist(), dtype=object).reshape(matrix.shape)
