"""A basis of the space of invariants that bounds one by few of its values.

V has the functions on SO(3)ⁿ which are polynomials of degree at most d in the entries of J and
invariant under frame, phase, conjugation, signs and order of the columns; and those of degree
at most d' that the common sign of all columns keeps, if there are any. Its dimension is counted
exactly (`characters`). It is spanned by the real parts of F_λ(x), for multisets λ of labels:
the sum over all ways to give the labels to different joints of ΠD^l_{·m} coupled to spin 0.
They give nearly orthonormal functions, whose values at points bound any f in V everywhere:
|f(x)| ≤ Λ ‖Q̃‖ |c|, |c| ≤ |R f|/(1 − ‖RG − I‖) (docs/bounds.md, section 3).

- x: a configuration, n rotations, shape (n, 3, 3); J: its Jacobian. Nothing has a unit;
- label (l, m) and its degree: see `row_sectors`. λ: a tuple of p labels, ascending, p ≤ n; −λ
  has the opposite m. Labels that occur more than once are called equal;
- D^l_{·m}: column m of the Wigner matrix of a joint, see `wigner`;
- way: one of the ways to couple the spins of λ to spin 0, see `coupled_tensors`; F_λ(x) has one
  complex entry for each way;
- Q̃: `InvariantFunctions.coefficients`. e(x) = Q̃ᵀ Re F_λ(x) are the functions of λ, whose mean
  squares over all x are 1 but for rounding;
- f: a function in V, and c its coefficients in all e, shape (dimension,). In the line above f
  also stands for its values at the points;
- G: values of all e at the points, shape (points, dimension); R: its computed left inverse;
- Λ²: a bound on Σ e(x)² over all functions e and everywhere, if Q̃ were not rounded.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import combinations
from math import comb, factorial, perm, prod, sqrt
from typing import NamedTuple, TypeAlias

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
# Number of configurations at which everything is evaluated together. More take more memory, and
# fewer take more time. Results do not depend on it.
_CONFIGURATIONS_AT_ONCE = 10
# Number of points that are left out together. Fewer choose slightly better points, and take
# more time.
_POINTS_AT_ONCE = 25
# Largest bound on ‖RG − I‖ with which values count as a proof. Any number below 1 is correct;
# near 1 bounds on functions would be useless.
_LARGEST_DEFECT = 0.5
# Eigenvalue of a projector above which it is 1, and below which it is 0, whatever the rounding.
_BETWEEN_0_AND_1 = 0.5


class _Removal(NamedTuple):
    """What is left of each set of joints without the joint at one position: two equal lists."""

    #: The number of the set that is left.
    rest: list[int]
    #: The joint that is taken away.
    joints: list[int]


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
        """Bound |f| over all configurations by its values at the points and their errors.

        Both have the shape (points,). `values` are computed ones of some f in V, and `errors`
        bound their distances from the exact values.
        """
        norm = float(np.linalg.norm(self.left_inverse, 2))
        # Rounding of R · values is relative to |R|, whose 2-norm is at most the Frobenius norm.
        rounding = gamma(len(values) + 2) * float(np.linalg.norm(self.left_inverse))
        coefficients = float(np.linalg.norm(self.left_inverse @ values))
        coefficients += norm * float(np.linalg.norm(errors))
        coefficients += rounding * float(np.linalg.norm(values))
        return SAFETY**2 * self.amplification * coefficients / (1.0 - self.defect)


@dataclass(frozen=True, eq=False)
class InvariantFunctions:
    """The functions e of one multiset of labels: coefficientsᵀ · Re F_λ."""

    #: λ, ascending.
    labels: Labels
    joints: int
    #: Q̃ of this λ, shape (ways, functions), scaled so that each function has mean square 1.
    coefficients: FloatArray

    @property
    def largest_square(self) -> Fraction:
        """Bound on Σ e(x)² of these functions; of those of λ and −λ together if they differ.

        It is N Π(2l + 1)/(2l_max + 1), with the number N of `_assignments`.
        """
        spins = [spin for spin, _ in self.labels]
        of_one = Fraction(prod(2 * spin + 1 for spin in spins), 2 * max(spins, default=0) + 1)
        return _multisets(self.labels) * of_one * _assignments(self.labels, self.joints)

    @property
    def value_error(self) -> float:
        """Bound on the error of all the functions at a configuration, Euclidean norm.

        The values are a sum of perm(n, p) vectors of norm at most 1, each off by 2 `row_error`.
        It is added up over the joints for the last label, then over the subsets of joints for
        the others and over the components of the last coupling, and multiplied by Q̃ᵀ.
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
    """Return nearly orthonormal functions that span V, d = `degree` and d' = `unsigned`.

    One entry stands for both λ and −λ, which have the same real parts.
    """
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
    """Return −λ, ascending."""
    return tuple(sorted((spin, -m) for spin, m in labels))


def _multisets(labels: Labels) -> int:
    """Return how many multisets the functions of λ stand for: λ, and −λ if it differs."""
    return 1 if labels == _reversed(labels) else 2


def _ties(labels: Labels) -> int:
    """Return the number of permutations of the labels that exchange equal ones only."""
    return prod(factorial(count) for count in Counter(labels).values())


def _assignments(labels: Labels, joints: int) -> int:
    """Return N, the number of different ways to give the labels to different joints."""
    return perm(joints, len(labels)) // _ties(labels)


def _scale(labels: Labels, joints: int) -> float:
    """Return 1 over the root mean square of uᵀ Re F_λ for an invariant unit vector u.

    The mean square is ties² N/Π(2l + 1), and half of that if λ and −λ differ.
    """
    norm = prod(2 * spin + 1 for spin, _ in labels) / _assignments(labels, joints)
    return sqrt(_multisets(labels) * norm) / _ties(labels)


def _invariant_ways(labels: Labels, ways: int) -> FloatArray:
    """Return an orthonormal basis of the vectors u that symmetries keep, (ways, functions).

    The symmetries are the exchanges of equal labels and, if λ = −λ, conjugation (v, ω) →
    (v, −ω). It takes D^l_{·m} to D^l_{·−m} with the sign (−1)^l. `ways` is the number of ways.
    """
    spins = tuple(spin for spin, _ in labels)
    projector, start, places = np.eye(ways), 0, list(range(len(labels)))
    for count in Counter(labels).values():
        # The mean over all orders of some labels, times a mean over the moves of the next label
        # to any place among them, is the mean over all orders of one label more.
        for last in range(start + 1, start + count):
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
    return np.asarray(vectors[:, values > _BETWEEN_0_AND_1])


def invariant_values(
    functions: Sequence[InvariantFunctions],
    rotations: FloatArray,
    degree: int,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FloatArray:
    """Return the values of all functions, shape (configurations, functions).

    Parameters
    ----------
    functions
        The functions; those of each entry are columns side by side.
    rotations
        The configurations, shape (configurations, n, 3, 3).
    degree
        Largest degree of a function: the sum of the degrees of its labels.
    executor
        Where groups of configurations are evaluated, by default in this process.
    progress
        Is told how many groups are done.
    """
    starts = range(0, len(rotations), _CONFIGURATIONS_AT_ONCE)
    calls = [(start, rotations[start : start + _CONFIGURATIONS_AT_ONCE]) for start in starts]
    work, name = partial(_values_of_some, functions, degree), "groups of configurations"
    parts = dict(in_groups(work, calls, executor, progress, name))
    return np.concatenate([parts[start] for start in starts])


def _values_of_some(
    functions: Sequence[InvariantFunctions], degree: int, start: int, rotations: FloatArray
) -> tuple[int, FloatArray]:
    """Return `start` and the values of all functions, shape (some configurations, functions).

    `start` is the number of the first of these configurations, `rotations` has their rotations.
    """
    wanted = {entry.labels for entry in functions}
    largest = max((spin for labels in wanted for spin, _ in labels), default=0)
    sums = dict(_symmetric_sums(wanted, wigner_matrices(rotations, largest), degree))
    parts = [sums[entry.labels].real.T @ entry.coefficients for entry in functions]
    return start, np.concatenate(parts, axis=1)


def _symmetric_sums(
    wanted: set[Labels], wigner: Sequence[ComplexArray], degree: int
) -> Iterator[tuple[Labels, ComplexArray]]:
    """Give each λ of `wanted` with its F_λ, shape (ways, configurations).

    `wigner` has D^0, D^1, …, each of shape (configurations, n, 2l + 1, 2l + 1). Multisets with
    the same beginning share its sums: for each set of joints the sum over all ways to give the
    labels of the beginning to them. That over sets with one joint more follows from it, by
    giving the next label to each of the joints in turn.
    """
    count, joints = wigner[0].shape[:2]
    followers: dict[Labels, set[Labels]] = {}
    for labels in wanted:
        for q in range(len(labels)):
            followers.setdefault(labels[:q], set()).add(labels[: q + 1])

    def grow(begun: Labels, sums: Coupled) -> Iterator[tuple[Labels, ComplexArray]]:
        """Give each λ that begins so.

        `sums` has the sums of the beginning by total spin l, shape (ways, 2l + 1, sets ·
        count).
        """
        if begun in wanted:
            yield begun, sums[0].reshape(len(sums[0]), -1, count).sum(axis=1)
        degree_left = degree - sum(map(label_degree, begun))
        sets = list(combinations(range(joints), len(begun)))
        removals = _removals(sets, joints)
        for labels in sorted(followers.get(begun, ())):
            spin, m = labels[-1]
            # Column m of D^spin of each joint, shape (2·spin + 1, n, configurations).
            factor = np.ascontiguousarray(wigner[spin][..., spin + m].T)
            if labels not in followers:
                yield labels, _ended(sums[spin], factor, sets)
                continue
            # Labels that follow have degrees, and so spins, that add up to no more than this.
            reachable = range(degree_left - label_degree(labels[-1]) + 1)
            together = {
                total: _products(x, factor, removals)
                for total, x in sums.items()
                if abs(total - spin) in reachable
            }
            yield from grow(labels, recoupled(together, spin, reachable))

    yield from grow((), {0: np.ones((1, 1, count), dtype=complex)})


def _removals(sets: list[tuple[int, ...]], joints: int) -> list[_Removal]:
    """Return for each position in the sets with one joint more what is left without it there.

    `sets` are all ascending sets of joints of one size, in lexicographic order.
    """
    numbers = {one: number for number, one in enumerate(sets)}
    size = len(sets[0]) + 1
    larger = list(combinations(range(joints), size))
    return [
        _Removal(
            [numbers[one[:q] + one[q + 1 :]] for one in larger], [one[q] for one in larger]
        )
        for q in range(size)
    ]


def _products(
    values: ComplexArray, factor: ComplexArray, removals: Sequence[_Removal]
) -> ComplexArray:
    """Return sums over sets times a factor, (ways, 2l + 1, 2·spin + 1, larger sets · count).

    `values` has the shape (ways, 2l + 1, sets · count), l the total spin, `factor` the shape
    (2·spin + 1, n, count), and `count` is the number of configurations.
    """
    ways, components, _ = values.shape
    count = factor.shape[2]
    apart = values.reshape(ways, components, 1, -1, count)
    terms = (apart[..., one.rest, :] * factor[:, one.joints] for one in removals)
    total = next(terms)
    for term in terms:
        total += term
    return total.reshape(*total.shape[:3], -1)


def _ended(
    values: ComplexArray, factor: ComplexArray, sets: list[tuple[int, ...]]
) -> ComplexArray:
    """Return F_λ, (ways, configurations): sums coupled with the last factor to spin 0.

    `values` has the shape (ways, 2·spin + 1, sets · count) and `factor` (2·spin + 1, n, count).
    The factors of all joints beside a set may be added up before they are coupled.
    """
    joints, count = factor.shape[1:]
    spin = len(factor) // 2
    others = [[joint not in one for joint in range(joints)] for one in sets]
    added = np.array(others, dtype=float) @ factor
    both = coupling(spin, spin, 0)[..., 0] @ added.reshape(len(factor), -1)
    terms = values * both
    return np.asarray(terms.reshape(len(values), -1, count).sum(axis=1))


def invariant_basis(
    rotations: FloatArray,
    degrees: tuple[int, int],
    dimension: int,
    points: int,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[InvariantBasis, FloatArray]:
    """Return a basis of V, and the configurations that are its points.

    Parameters
    ----------
    rotations
        Candidates for the points, shape (candidates, n, 3, 3), in extended precision.
    degrees
        d and d', the latter 0 if signs of columns are symmetries.
    dimension
        dim V, as counted by `characters`.
    points
        Number of points, at least `dimension`; they are chosen by `_well_spread`.
    executor, progress
        As in `invariant_values`.

    Returns
    -------
    tuple
        The basis, and the points, shape (points, n, 3, 3).

    Raises
    ------
    NoBasisError
        If the values at the points do not prove that there is a basis.
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
    if not defect < _LARGEST_DEFECT:
        raise NoBasisError(f"the values are too inexact: ‖RG − I‖ could be {defect:.2g}")
    return InvariantBasis(left_inverse, defect, _largest_ratio(functions)), rotations[kept]


def _largest_ratio(functions: Sequence[InvariantFunctions]) -> float:
    """Return a bound on Λ‖Q̃‖, where ‖Q̃‖ ≥ 1 stands for what rounding of Q̃ can add.

    If Q̃ᵀQ̃, scaled, is I + X, then ‖Q̃‖² ≤ 1 + ‖X‖.
    """
    norm = 1.0
    for entry in functions:
        basis = entry.coefficients / _scale(entry.labels, entry.joints)
        excess = float(np.linalg.norm(basis.T @ basis - np.eye(basis.shape[1])))
        norm = max(norm, sqrt(1 + excess + gamma(2 * len(basis) + 8) * basis.shape[1]))
    return SAFETY * norm * sqrt(sum(entry.largest_square for entry in functions))


def _well_spread(values: FloatArray, count: int) -> NDArray[np.intp]:
    """Return the numbers of `count` rows of `values` that make a G with a small ‖G⁺‖.

    `values` has the shape (candidates, functions). The rows that it needs least are left out
    first, some at a time. Without a row v, the square of the Frobenius norm of G⁺ grows by
    |M⁻¹v|²/(1 − vᵀM⁻¹v), M = GᵀG.
    """
    kept = np.arange(len(values))
    while len(kept) > count:
        rows = values[kept]
        images = rows @ np.linalg.pinv(rows.T @ rows, hermitian=True)
        divisors = 1.0 - np.sum(images * rows, axis=1)
        growth = np.sum(images**2, axis=1) / np.maximum(divisors, np.finfo(float).tiny)
        some = min(_POINTS_AT_ONCE, len(kept) - count)
        kept = np.delete(kept, np.argsort(growth, kind="stable")[:some])
    return kept
