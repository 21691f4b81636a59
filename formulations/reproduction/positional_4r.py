"""Section 3, positional 4R: eqs. (18) and (19)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations import measures
from formulations.reproduction import reference
from formulations.reproduction.row import Row, shown, shown_error
from formulations.reproduction.verdicts import equal, holds
from nlp.arrays import FloatArray

_ROUNDING = 1e-12


def rows(matrix: FloatArray = reference.POSITIONAL_4R) -> Iterator[Row]:
    """Rows of eqs. (18) and (19); `matrix` is Vᵀ, shape (4, 4)."""
    error = float(np.max(np.abs(matrix @ matrix.T - np.eye(4))))
    ours = shown_error(error, _ROUNDING)
    yield Row("(18)", "VᵀV = I", "orthogonal", ours, holds(error <= _ROUNDING))
    jacobian = matrix[:3]
    unit = jacobian / np.linalg.norm(jacobian, axis=0)
    cosines = (unit.T @ unit)[np.triu_indices(4, 1)]
    yield Row(
        "(18)",
        "cosines between the columns",
        "span space symmetrically",
        shown(cosines),
        equal(-1 / 3, cosines, _ROUNDING),
        "all −1/3: the corners of a regular tetrahedron",
    )
    sigmas = measures.locked_singular_values(jacobian)
    verdict = equal(reference.POSITIONAL_4R_SIGMA, sigmas, _ROUNDING)
    paper = f"1/2 = {shown(reference.POSITIONAL_4R_SIGMA)}"
    yield Row("(19)", "fσ_3 for f = 1, …, 4", paper, shown(sigmas), verdict)
