"""A basis of the space of invariants that bounds one by few of its values.

V has the functions on SO(3)ⁿ which are polynomials of degree at most d in the entries of J and
invariant under frame, phase, conjugation, signs and order of the columns; and those of degree
at most d' that the common sign of all columns keeps, if there are any. Its dimension is counted
exactly (`characters`). It is spanned by the real parts of F_λ(x), for multisets λ of labels:
the sum over all ways to give the labels to different joints of ΠD^l_{·m} coupled to spin 0.
They give nearly orthonormal functions, whose values at points bound any f in V everywhere:
|f(x)| ≤ Λ ‖Q̃‖ |c|, |c| ≤ |R f|/(1 − ‖RG − I‖) (docs/bounds.md, section 3).
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import combinations
from math import comb, factorial, perm, prod, sqrt
from typing import TypeAlias

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.moments.enclosed_matrix import SAFETY, gamma
from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.plain_values import Coupled, recoupled
from lockedjoint.formulations.bounds.moments.row_rounding import row_error
from lockedjoint.formulations.bounds.moments.row_sectors import Label, RowSector, label_degree
from lockedjoint.formulations.bounds.moments.wigner import (
    ComplexArray,
    axis_exchange,
    coupled_tensors,
    coupling,
    wigner_matrices,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LockedJointError
from lockedjoint.nlp.executors import in_groups

Labels: TypeAlias = tuple[Label, ...]
# Configurations at which everything is evaluated together.
_CHUNK = 10
# Points that are left out together.
_AT_ONCE = 25


class NoBasisError(LockedJointError):
    """The values at the points do not prove that the functions are a basis."""


@dataclass(frozen=True, eq=False)
class InvariantBasis:
    """What is needed to bound an invariant by its values at the points."""

    #: R, shape (dimension, points).
    left_inverse: FloatArray
    #: Bound on ‖RG − I‖ for the exact matrix of values G; below 1.
    defect: float
    #: Λ‖Q̃‖, so that |f| ≤ amplification · |c|.
    amplification: float

    def largest_value(self, values: FloatArray, errors: FloatArray) -> float:
        """Bound |f| over all configurations by its values at the points and their errors."""
        norm = float(np.linalg.norm(self.left_inverse, 2))
        # Rounding of R · values is relative to |R|, whose 2-norm is at most the Frobenius norm.
        rounding = gamma(len(values) + 2) * float(np.linalg.norm(self.left_inverse))
        coefficients = float(np.linalg.norm(self.left_inverse @ values))
        coefficients += norm * float(np.linalg.norm(errors))
        coefficients += rounding * float(np.linalg.norm(values))
        return SAFETY**2 * self.amplification * coefficients / (1.0 - self.defect)


@dataclass(frozen=True, eq=False)
class InvariantFunctions:
    """The functions of one multiset of labels: coefficientsᵀ · Re F_λ."""

    #: λ, ascending.
    labels: Labels
    joints: int
    #: Q̃ of this λ, shape (ways, functions), scaled to mean square 1.
    coefficients: FloatArray

    @property
    def largest_square(self) -> Fraction:
        """Bound on the sum of squares of the functions; of those of λ and −λ together."""
        spins = [spin for spin, _ in self.labels]
        share = Fraction(prod(2 * spin + 1 for spin in spins), 2 * max(spins, default=0) + 1)
        twice = 1 if self.labels == _reversed(self.labels) else 2
        return twice * share * _assignments(self.labels, self.joints)

    @property
    def value_error(self) -> float:
        """Bound on the error of all the functions at a configuration, Euclidean norm.

        A sum of vectors of norm at most 1, each off by 2 `row_error`: over the joints for the
        last label, then over subsets for the others and over components.
        """
        rows = PlainRows(((), self.labels), (range(0), range(self.joints)), 0)
        subsets = comb(self.joints, max(len(self.labels) - 1, 0))
        components = 2 * max((spin for spin, _ in self.labels), default=0) + 1
        step = 2 * row_error(rows) + gamma(subsets * components + 2 * self.joints + 10)
        step += gamma(len(self.coefficients) + 4) * sqrt(self.coefficients.shape[1])
        terms = perm(self.joints, len(self.labels))
        return SAFETY * terms * step * float(np.linalg.norm(self.coefficients))


def invariant_functions(
    joints: int, degree: int, unsigned: int = 0
) -> list[InvariantFunctions]:
    """Return nearly orthonormal functions that span V."""
    found = []
    chosen = {labels for _, labels in RowSector(0, 0, 0, degree).label_sets(joints)}
    if unsigned:
        chosen |= {labels for (labels,) in RowSector(None, 0, 0, unsigned).label_sets(joints)}
    for labels in sorted(chosen):
        ways = len(coupled_tensors(tuple(spin for spin, _ in labels), 0))
        if ways and labels <= _reversed(labels):
            basis = _invariant_ways(labels, ways)
            if basis.size:
                found.append(InvariantFunctions(labels, joints, _scale(labels, joints) * basis))
    return found


def _reversed(labels: Labels) -> Labels:
    return tuple(sorted((spin, -m) for spin, m in labels))


def _ties(labels: Labels) -> int:
    return prod(factorial(count) for count in Counter(labels).values())


def _assignments(labels: Labels, joints: int) -> int:
    return perm(joints, len(labels)) // _ties(labels)


def _scale(labels: Labels, joints: int) -> float:
    """Return 1 over the root mean square of uᵀ Re F_λ for an invariant unit vector u."""
    twice = 1 if labels == _reversed(labels) else 2
    norm = prod(2 * spin + 1 for spin, _ in labels) / _assignments(labels, joints)
    return sqrt(twice * norm) / _ties(labels)


def _invariant_ways(labels: Labels, ways: int) -> FloatArray:
    """Return an orthonormal basis of what exchanges of equal labels and conjugation leave."""
    spins = tuple(spin for spin, _ in labels)
    projector, start, places = np.eye(ways), 0, list(range(len(labels)))
    for count in Counter(labels).values():
        for last in range(start + 1, start + count):  # from S_k to S_{k+1}: cosets
            total = coset = np.eye(ways)
            for q in range(last, start, -1):
                order = (*places[: q - 1], q, q - 1, *places[q + 1 :])
                coset = coset @ axis_exchange(spins, 0, order)
                total = total + coset
            projector = projector @ total / (last - start + 1)
        start += count
    if labels == _reversed(labels):
        image = [(spin, -m) for spin, m in labels]
        order = tuple(sorted(places, key=image.__getitem__))
        conjugation = (-1) ** sum(spins) * axis_exchange(spins, 0, order)
        projector = projector @ (np.eye(ways) + conjugation) @ projector / 2
    values, vectors = np.linalg.eigh((projector + projector.T) / 2)
    return np.asarray(vectors[:, values > 0.5])


def invariant_values(
    functions: Sequence[InvariantFunctions],
    rotations: FloatArray,
    degree: int,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FloatArray:
    """Return the values of all functions, (configurations, functions)."""
    starts = range(0, len(rotations), _CHUNK)
    calls = [(start, rotations[start : start + _CHUNK]) for start in starts]
    work, name = partial(_values_of_some, functions, degree), "groups of configurations"
    parts = dict(in_groups(work, calls, executor, progress, name))
    return np.concatenate([parts[start] for start in starts])


def _values_of_some(
    functions: Sequence[InvariantFunctions], degree: int, start: int, rotations: FloatArray
) -> tuple[int, FloatArray]:
    """Return where some configurations begin, and the values of all functions there."""
    wanted = {entry.labels for entry in functions}
    largest = max((spin for labels in wanted for spin, _ in labels), default=0)
    sums = dict(_symmetric_sums(wanted, wigner_matrices(rotations, largest), degree))
    parts = [sums[entry.labels].real.T @ entry.coefficients for entry in functions]
    return start, np.concatenate(parts, axis=1)


def _symmetric_sums(
    wanted: set[Labels], wigner: Sequence[ComplexArray], degree: int
) -> Iterator[tuple[Labels, ComplexArray]]:
    """Give F_λ, (ways, configurations), of all λ; those with the same beginning together.

    The sum over the orders of a set of joints follows from those with one label and joint less.
    """
    count, joints = wigner[0].shape[:2]
    followers: dict[Labels, set[Labels]] = {}
    for labels in wanted:
        for q in range(len(labels)):
            followers.setdefault(labels[:q], set()).add(labels[: q + 1])

    def grow(begun: Labels, sums: Coupled) -> Iterator[tuple[Labels, ComplexArray]]:
        if begun in wanted:
            yield begun, sums[0].reshape(len(sums[0]), -1, count).sum(axis=1)
        left = degree - sum(map(label_degree, begun))
        subsets = {one: i for i, one in enumerate(combinations(range(joints), len(begun)))}
        larger = list(combinations(range(joints), len(begun) + 1))
        # Each position has the larger sets without the joint there, and that joint.
        removals = [
            ([subsets[one[:q] + one[q + 1 :]] for one in larger], [one[q] for one in larger])
            for q in range(len(begun) + 1)
        ]

        def products(values: ComplexArray, factor: ComplexArray) -> ComplexArray:
            apart = values.reshape(*values.shape[:2], 1, len(subsets), count)
            terms = (apart[..., rest, :] * factor[:, joint] for rest, joint in removals)
            total = next(terms)
            for term in terms:
                total += term
            return total.reshape(*total.shape[:3], len(larger) * count)

        def ended(values: ComplexArray, factor: ComplexArray, spin: int) -> ComplexArray:
            """Return the sum over all sets, coupled to spin 0: joints may be added up first."""
            others = [[joint not in one for joint in range(joints)] for one in subsets]
            added = np.array(others, dtype=float) @ factor
            both = coupling(spin, spin, 0)[..., 0] @ added.reshape(len(factor), -1)
            terms = values * both
            return np.asarray(terms.reshape(len(values), -1, count).sum(axis=1))

        for labels in sorted(followers.get(begun, ())):
            spin, m = labels[-1]
            factor = np.ascontiguousarray(wigner[spin][..., spin + m].T)
            if labels not in followers:
                yield labels, ended(sums[spin], factor, spin)
                continue
            reachable = range(left - label_degree(labels[-1]) + 1)
            together = {
                total: products(x, factor)
                for total, x in sums.items()
                if abs(total - spin) in reachable
            }
            yield from grow(labels, recoupled(together, spin, reachable))

    yield from grow((), {0: np.ones((1, 1, count), dtype=complex)})


def invariant_basis(
    rotations: FloatArray,
    degrees: tuple[int, int],
    dimension: int,
    points: int,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[InvariantBasis, FloatArray]:
    """Return a basis of V, and the `points` of the rotations that it uses, see `_well_spread`.

    NoBasisError if the values there do not prove that there is a basis.
    """
    functions = invariant_functions(rotations.shape[1], *degrees)
    values = invariant_values(functions, rotations, max(degrees), executor, progress)
    if values.shape[1] != dimension:
        raise NoBasisError(f"{values.shape[1]} functions for {dimension} invariants")
    kept = _well_spread(values, points)
    matrix = values[kept]
    left_inverse = np.asarray(scipy.linalg.pinv(matrix))
    norm, size = float(np.linalg.norm(left_inverse, 2)), float(np.linalg.norm(left_inverse))
    error = sqrt(len(kept) * sum(entry.value_error**2 for entry in functions))
    rounding = gamma(len(kept) + 2) * size * float(np.linalg.norm(matrix))
    defect = float(np.linalg.norm(left_inverse @ matrix - np.eye(dimension)))
    defect = SAFETY**2 * (defect + rounding + norm * error)
    if not defect < 0.5:
        raise NoBasisError(f"the values are too inexact: ‖RG − I‖ could be {defect:.2g}")
    return InvariantBasis(left_inverse, defect, _largest_ratio(functions)), rotations[kept]


def _largest_ratio(functions: Sequence[InvariantFunctions]) -> float:
    """Return a bound on Λ‖Q̃‖."""
    norm = 1.0
    for entry in functions:
        basis = entry.coefficients / _scale(entry.labels, entry.joints)
        excess = float(np.linalg.norm(basis.T @ basis - np.eye(basis.shape[1])))
        norm = max(norm, sqrt(1 + excess + gamma(2 * len(basis) + 8) * basis.shape[1]))
    return SAFETY * norm * sqrt(sum(entry.largest_square for entry in functions))


def _well_spread(values: FloatArray, count: int) -> NDArray[np.intp]:
    """Return `count` rows G that determine all columns well: ‖G⁺‖ is small.

    Those that it needs least go first, some at a time. Without a row v, |G⁺|² in the Frobenius
    norm grows by |M⁻¹v|²/(1 − vᵀM⁻¹v), M = GᵀG.
    """
    kept = np.arange(len(values))
    while len(kept) > count:
        rows = values[kept]
        images = rows @ np.linalg.pinv(rows.T @ rows, hermitian=True)
        left = 1.0 - np.sum(images * rows, axis=1)
        growth = np.sum(images**2, axis=1) / np.maximum(left, np.finfo(float).tiny)
        some = min(_AT_ONCE, len(kept) - count)
        kept = np.delete(kept, np.argsort(growth, kind="stable")[:some])
    return kept
