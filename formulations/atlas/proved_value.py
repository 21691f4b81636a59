"""A worst case proved from below, in rational arithmetic, of the numbers in a file.

A file has a matrix C, shape (m, n), of rounded columns. It stands for the Jacobian J* of the
arm that these columns lead to: axes scaled to length 1, lever arms made normal to them and
scaled to what the model asks for. δ ≥ ‖J* − C‖_F, and C_F̄ is C without the columns of a set F
of k joints that lock, so that

    σ(J*) ≥ √t − δ    if    C_F̄ C_F̄ᵀ − tI is positive definite for every set F of k joints

(docs/atlas_proofs.md). σ is the worst case, the smallest singular value over all F.
Definiteness is decided by elimination in whole numbers; nothing is rounded.

`columns` are those of C as whole numbers in units of 2⁻⁶⁰ (`Units`), n lists of m numbers. A
`Vector` is a list of fractions.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import combinations

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import condition, measures
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.bounds.rational_roots import rational_root_above, root_below
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import Joint
from lockedjoint.formulations.joints.kinds import FreeColumn, LeverRevolute, Prismatic
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

Vector = list[Fraction]
Units = list[list[int]]
# Entries are rounded to whole multiples of 2 to the power of minus this, and δ grows by what
# that moves. More bits make δ smaller and the elimination slower.
_BITS = 60
# Number of these units in 1.
_SCALE = 1 << _BITS
# Number of decimals of a value, which is rounded down to them. Files on record have as many.
_DIGITS = 15
# The largest δ with which a matrix still counts as one of the model.
_LARGEST_DISTANCE = Fraction(1, 10**6)
# A value that is computed in floating point is lowered by these shares, and amounts, in turn
# until the lower one is proved.
_LOWERED_BY = (1e-14, 1e-12, 1e-10, 1e-8)
# The largest eigenvalue, computed in floating point, is raised by this factor: at 1 the matrix
# largest · I − A would often be singular up to rounding, and nothing would be proved.
_RAISED_BY = 1 + 1e-13


def proved_value(asked: Entry, jacobian: FloatArray) -> str:
    """Return a decimal number, as text, that the measure of J* is proved not to be below.

    `jacobian` is the matrix C of the entry's file.
    """
    columns, distance = _rounded(asked.arm, jacobian)
    if asked.relative:
        square = _proved_square(jacobian, columns, distance, asked.failures)
        return _decimal(root_below(max(square, Fraction(0)), _SCALE))
    if asked.formulation == condition.NAME:
        # The condition number is that of C: the entry's columns are free, and J* is C scaled.
        ratio = condition.score(jacobian, asked.failures)
        return _decimal(_proved_sigma(columns, ratio, asked.failures, ratio_exceeds))
    found = measures.worst_case_sigma(jacobian, asked.failures)
    return _decimal(_proved_sigma(columns, found, asked.failures) - distance)


def proves(asked: Entry, jacobian: FloatArray, value: str) -> bool:
    """Whether the same measure of J* is proved not to be below a decimal number above 0.

    Unlike the last digit of `proved_value` the answer is the same on every machine.
    """
    columns, distance = _rounded(asked.arm, jacobian)
    if asked.relative:
        square = _proved_square(jacobian, columns, distance, asked.failures)
        return Fraction(value) ** 2 <= square
    if asked.formulation == condition.NAME:
        return ratio_exceeds(columns, Fraction(value), asked.failures)
    return exceeds(columns, Fraction(value) + distance, asked.failures)


def _proved_square(
    jacobian: FloatArray, columns: Units, distance: Fraction, failures: int
) -> Fraction:
    """Return what the squared relative manipulability r² of J* is not below.

    r² = det(C_F̄C_F̄ᵀ)/det(CCᵀ) is a minor of order k of the projection onto the null space.
    The projection of J* differs by at most δ/σ_min(C), `distance` over `sigma`, and a minor by
    k times that.
    """
    least = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
    sigma = _proved_sigma(columns, least, 0)
    whole = next(_determinants(columns, 0))
    return Fraction(min(_determinants(columns, failures)), whole) - failures * distance / sigma


def _rounded(arm: Arm, jacobian: FloatArray) -> tuple[Units, Fraction]:
    """Return the columns in units of 2⁻⁶⁰, and δ with what the rounding moves."""
    columns = [[round(Fraction(x) * _SCALE) for x in column] for column in jacobian.T.tolist()]
    exact = [[Fraction(value, _SCALE) for value in column] for column in columns]
    distance = distance_from_model(arm, exact)
    if distance > _LARGEST_DISTANCE:
        raise InputError("jacobian", "not of the model", "columns as the entry's joints have")
    return columns, distance + Fraction(jacobian.size, _SCALE)


def _proved_sigma(
    columns: Units,
    found: float,
    failures: int,
    proved: Callable[[Units, Fraction, int], bool] | None = None,
) -> Fraction:
    """Return a number just below a computed one, `found`, that is proved; or refuse the matrix.

    `proved` says of the columns, a number and k whether it is; by default it is `exceeds`.
    """
    for lost in _LOWERED_BY:
        root = Fraction(max(found * (1 - lost) - lost, 0.0))
        if root > 0 and (proved or exceeds)(columns, root, failures):
            return root
    raise InputError("jacobian", f"with worst case {found:.3g}", "one that can be proved")


def _decimal(value: Fraction) -> str:
    """Return a number above 0, rounded down; InputError if it is none."""
    if value <= 0:
        raise InputError("jacobian", "singular after a failure", "one that can be proved")
    whole, rest = divmod((value * 10**_DIGITS).__floor__(), 10**_DIGITS)
    return f"{whole}.{rest:0{_DIGITS}d}"


def exceeds(columns: Units, sigma: Fraction, failures: int) -> bool:
    """Whether all singular values without any `failures` columns are proved to exceed σ > 0."""
    level = ((sigma * _SCALE) ** 2).__ceil__()
    return all(least > 0 for least in _determinants(columns, failures, level))


def ratio_exceeds(columns: Units, ratio: Fraction, failures: int) -> bool:
    """Whether without any `failures` columns σ_min/σ_max is proved to be above a ratio.

    All eigenvalues of C_F̄C_F̄ᵀ are proved to be between ratio²·u and a u near the largest one.
    """
    for gram in _grams(columns, failures):
        unit = np.eye(len(gram), dtype=object)
        largest = Fraction(np.linalg.eigvalsh(gram.astype(float))[-1] * _RAISED_BY).__ceil__()
        least = (ratio**2 * largest).__ceil__()
        between = (determinant(largest * unit - gram), determinant(gram - least * unit))
        if min(between) <= 0:
            return False
    return True


def _determinants(columns: Units, failures: int, level: int = 0) -> Iterator[int]:
    """Yield det(C_F̄C_F̄ᵀ − level·I) for every F; 0 where a leading minor is not positive.

    `level` is in the squared units of the columns, 2⁻¹²⁰.
    """
    unit = level * np.eye(len(columns[0]), dtype=object)
    for gram in _grams(columns, failures):
        yield determinant(gram - unit)


def _grams(columns: Units, failures: int) -> Iterator[npt.NDArray[np.object_]]:
    """Yield C_F̄C_F̄ᵀ for every F: m×m matrices of whole numbers of Python, in units of 2⁻¹²⁰."""
    whole = np.array(columns, dtype=object)
    products = whole[:, :, None] * whole[:, None, :]
    total = products.sum(axis=0)
    for locked_set in combinations(range(len(whole)), failures):
        yield total - products[list(locked_set)].sum(axis=0)


def determinant(rest: npt.NDArray[np.object_]) -> int:
    """Return the determinant of a symmetric matrix of whole numbers; 0 if not definite.

    Elimination without fractions (Bareiss) has the leading minors as pivots. The matrix is
    positive definite if and only if all are positive.
    """
    pivot = 1
    while len(rest):
        before, pivot = pivot, rest[0, 0]
        if pivot <= 0:
            return 0
        rest = (rest[1:, 1:] * pivot - np.outer(rest[1:, 0], rest[0, 1:])) // before
    return pivot


def distance_from_model(arm: Arm, columns: list[Vector]) -> Fraction:
    """Return an upper bound on ‖J* − C‖_F, from the columns of C as fractions."""
    # The squared distance, and a factor on the distance, where columns are screws.
    moved, screwed = Fraction(0), Fraction(1)
    # The squared length of each vector that a limit is on, and the squared limit. The key is a
    # joint's own place, or −1 for joints that keep their limit in the mean.
    budgets: dict[tuple[Joint, int], list[tuple[Fraction, Fraction]]] = defaultdict(list)
    for place, (joint, column) in enumerate(zip(arm.joints, columns, strict=True)):
        if isinstance(joint, FreeColumn):
            turned, length, limit = Fraction(0), _dot(column, column), joint.norm
        elif isinstance(joint, Prismatic):
            turned, length = _dot(column[3:], column[3:]), _dot(column[:3], column[:3])
            limit = joint.speed
        else:  # revolute: the atlas has no others
            # A screw of pitch c has v − cω normal to ω. What moves this difference and ω by d
            # moves v by (1 + |c|)d at most.
            pitch = Fraction(getattr(joint, "pitch", 0.0))
            screwed = max(screwed, 1 + abs(pitch))
            lever = [v - pitch * w for v, w in zip(column[:3], column[3:], strict=True)]
            turned, length = _onto_axis(lever, column[3:])
            limit = getattr(joint, "length", 1.0)
        moved += turned
        shared = getattr(joint, "budget", "each") == "mean"
        budgets[joint, -1 if shared else place].append((length, Fraction(limit) ** 2))
    for (joint, _), lengths in budgets.items():
        total, most = (sum(part, Fraction(0)) for part in zip(*lengths, strict=True))
        excess = total / most - 1
        # The squared length is 1 + e times what it should be, e = `excess`. A vector is scaled
        # by 1/√(1 + e), and |1 − 1/√(1 + e)| ≤ |e| for e ≥ −1/2. Lever arms may be shorter.
        if excess > 0 or not isinstance(joint, LeverRevolute):
            moved += excess**2 * total
    return screwed * rational_root_above(moved, _SCALE)


def _onto_axis(velocity: Vector, axis: Vector) -> tuple[Fraction, Fraction]:
    """Return how far (v; ω) is, squared, from ω of length 1 and v normal to it; and |v|² then.

    | |ω| − 1 | ≤ | |ω|² − 1 |, and v loses v·ω/|ω|. The squares of both changes add up.
    """
    size, along = _dot(axis, axis), _dot(velocity, axis)
    tilt = along**2 / size
    return (size - 1) ** 2 + tilt, _dot(velocity, velocity) - tilt


def _dot(first: Vector, second: Vector) -> Fraction:
    """Return the inner product of two vectors."""
    return sum((a * b for a, b in zip(first, second, strict=True)), Fraction(0))
