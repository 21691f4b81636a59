"""Localisers: blocks that are positive semidefinite only where a condition holds.

`ScaledBlocks` multiplies blocks by a scalar that must not be negative. `FormLocaliser` states
wᵀHw ≥ 0 for a form H and vectors w = Σ r_a w_a with polynomials r_a(x) that depend on which
joint f is locked; compared with vectors of arbitrary polynomials there are far fewer rows:
blocks of scalar rows are multiplied by the numbers w_aᵀHw_b.

`KrylovLocaliser` has H = J_f J_fᵀ − tI and w = r_0 j_f + r_1 M j_f + r_2 M² j_f with M = JJᵀ.
Where a worst case t is reached with joint f locked, the eigenvector is (M − tI)⁻¹j_f, and M is
close to a multiple of I; so few powers of M approximate it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from formulations.bounds.so3_moments.row_sectors import RowSector, UnsignedSector
from formulations.bounds.so3_moments.sampled_blocks import BlockFamily, RowBlocks, choices_first
from formulations.bounds.so3_moments.wigner import jacobians_of, wigner_matrices
from nlp.arrays import FloatArray

# Degree of r_0, r_1 and r_2 in J, less that of r_0.
_LOWERED = (0, 2, 4)
POWERS = len(_LOWERED)


@dataclass(frozen=True, eq=False)
class ScaledBlocks:
    """A scalar localiser: g(x)B(x) ⪰ 0 where g(x) ≥ 0."""

    family: BlockFamily
    #: Values of g at rotations (configurations, n, 3, 3).
    factor: Callable[[FloatArray], FloatArray]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return self.family.sizes

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        factor = self.factor(rotations)[:, None, None]
        return [factor * block for block in self.family.evaluate(rotations)]


@dataclass(frozen=True)
class Form:
    """A form H on vectors w_a that is positive semidefinite where the conditions hold."""

    #: Values w_aᵀHw_b, (configurations, vectors, vectors), at Jacobians (configurations, 6, n)
    #: with the given joint locked.
    values: Callable[[FloatArray, int], FloatArray]
    #: Degree of each w_a in the entries of J, less that of the first.
    lowered: tuple[int, ...]


class FormLocaliser(RowBlocks):
    """Blocks of a form on vectors, averaged over symmetries and locked joints.

    The sector of the polynomials r_a has a locked joint; the degree of r_a is lower by
    `form.lowered` than that of the sector.
    """

    def __init__(self, sector: RowSector | UnsignedSector, joints: int, form: Form) -> None:
        super().__init__(sector, joints)
        self.form, self.lowered = form, form.lowered

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        wigner = wigner_matrices(rotations, self.largest_spin)
        jacobians = jacobians_of(rotations)
        total = [np.zeros((len(rotations), size, size)) for size in self.sizes]
        for locked in range(self.joints):
            values = self.form.values(jacobians, locked)
            squares = self.mean_squares(wigner, self.orders(locked), share=self.joints)
            for block, square, (chosen, a) in zip(total, squares, self.selections, strict=True):
                block += square[:, chosen[:, None], chosen] * values[:, a[:, None], a]
        return total

    def orders(self, locked: int) -> list[tuple[int, ...]]:
        """Return orders of the joints that put the locked one and each choice of k first."""
        others = [joint for joint in range(self.joints) if joint != locked]
        return [(locked, *order) for order in choices_first(others, self.sector.odd)]


class KrylovLocaliser(FormLocaliser):
    """Blocks of J_f J_fᵀ − tI on Krylov vectors, averaged over symmetries and locked joints."""

    def __init__(self, sector: RowSector, joints: int, limit: float = 0.0) -> None:
        def values(jacobians: FloatArray, locked: int) -> FloatArray:
            vectors, left = krylov_vectors(jacobians, locked)
            products = left.swapaxes(1, 2) @ left, vectors.swapaxes(1, 2) @ vectors
            return np.asarray(products[0] - limit * products[1])

        super().__init__(sector, joints, Form(values, _LOWERED))
        self.limit = limit


def krylov_vectors(jacobians: FloatArray, locked: int) -> tuple[FloatArray, FloatArray]:
    """Return V = (j_f, M j_f, M² j_f) in units of the mean, and J_fᵀV.

    j_f is in units of √2, M in units of n/3. In the precision of the Jacobians, shapes
    (configurations, 6, powers) and (configurations, n − 1, powers).
    """
    real = jacobians.dtype.type
    mean = real(jacobians.shape[2]) / 3
    vector = jacobians[:, :, locked] / np.sqrt(real(2))
    powers = [vector]
    for _ in range(1, POWERS):
        products = (jacobians.swapaxes(1, 2) @ vector[..., None]) / mean
        vector = (jacobians @ products)[..., 0]
        powers.append(vector)
    vectors = np.stack(powers, axis=-1)
    return vectors, np.delete(jacobians, locked, axis=2).swapaxes(1, 2) @ vectors
