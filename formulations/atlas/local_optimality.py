"""First and second order at a worst case that is claimed to be a maximum, in NumPy.

J is the Jacobian, shape (m, n). F is a set of k joints that lock, and J_F̄ is J with zeros in
their columns, of the same shape; A_F = J_F̄J_F̄ᵀ. The worst case is σ = √t, where
t = min_F λ_min(A_F) is the least eigenvalue of all. h_k(J) = 0 are the equations of the model:
what the joints' columns satisfy, and isotropy where the entry asks for it.

t is at most Σ_F ⟨Y_F, A_F(J)⟩ for all multipliers Y_F ⪰ 0, shape (m, m), with Σ tr Y_F = 1. So
t is stationary where 2 Σ Y_F J_F̄ + Σ μ_k ∇h_k = 0 with numbers μ_k. Only sets F at the worst
case have a Y_F ≠ 0; it acts on the *active* eigenvectors of A_F, those at t. The second
derivative along directions d of J, shape (m, n), that keep the least eigenvalues is in
docs/atlas_proofs.md. Where it is negative but for changes of frame and phase, the optimum is
isolated. Its null space beyond these is the family: an upper bound on the dimension of the
optima around J. Nothing here is a proof: `local_maximum` has one.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, combinations_with_replacement, product
from typing import NamedTuple

import cvxpy as cp
import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import isotropy
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.conic import run
from lockedjoint.formulations.joints.joint import Joint
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.formulations.measures import locked_sets
from lockedjoint.nlp.arrays import FloatArray, semidefinite_root

#: Places of entries of J in the vector of its entries row after row, counted from 0.
Places = npt.NDArray[np.int_]
# Eigenvalues this near to the least one, relative to it, count as equal to it. Files have about
# 1e-9; distinct ones that are nearer would be treated as one.
_TIE = 1e-5
# Singular values below this count as zero where a rank is counted, after scaling rows to length
# one. A larger number can make a family larger than it is.
_RANK_TOLERANCE = 1e-4
# An eigenvalue of a multiplier Y_F below this share of its largest one counts as zero.
_INACTIVE = 1e-3
# A multiplier Y_F whose largest eigenvalue is below this counts as zero.
_NO_MULTIPLIER = 1e-7
# Second derivatives below this, where the largest is of the order of one, count as zero.
_FLAT = 1e-5
# A row is divided by its length, by at least this, so that a row of zeros stays one.
_LEAST_LENGTH = 1e-300


@dataclass(frozen=True)
class LocalOptimality:
    """What holds to second order at a Jacobian.

    Attributes
    ----------
    stationarity
        ‖2 Σ Y_F J_F̄ + Σ μ_k ∇h_k‖ of the best multipliers: 0 at a stationary point.
    curvature
        Largest second derivative of t along unit directions that change more than frame and
        phase and keep the active eigenvalues: at most 0 at a maximum; −∞ if there are none.
    family
        Number of such directions in which the second derivative is zero.
    """

    stationarity: float
    curvature: float
    family: int


@dataclass(frozen=True, eq=False)
class Condition:
    """One equation ½ jᵀHj + ℓ·j = c of the model, j the mn entries of J row after row."""

    form: FloatArray  # H, shape (mn, mn)
    linear: FloatArray  # ℓ, shape (mn,)
    level: float  # c
    limit: bool = False  # whether it is a limit from above instead, ½ jᵀHj + ℓ·j ≤ c

    def gradient(self, jacobian: FloatArray) -> FloatArray:
        """Return the gradient of the left side at J, shape (m, n)."""
        return np.reshape(self.form @ jacobian.ravel() + self.linear, jacobian.shape)


@dataclass(frozen=True, eq=False)
class TiedFailure:
    """A set F of locked joints at the worst case, and the spectrum of A_F.

    a of the m eigenvalues of A_F are at t.
    """

    rest: FloatArray  # J_F̄, shape (m, n), zeros in the columns of F
    kept: FloatArray  # 1 for joints that are left, 0 for those in F, shape (n,)
    active: FloatArray  # unit eigenvectors at t, shape (m, a)
    others: FloatArray  # the other unit eigenvectors, shape (m, m − a)
    above: FloatArray  # their eigenvalues minus t, shape (m − a,)


def local_optimality(entry: Entry, jacobian: FloatArray) -> LocalOptimality:
    """Judge a Jacobian, shape (m, n), as a maximum of an entry's worst case."""
    conditions = [*model_conditions(entry)]
    if entry.formulation == isotropy.NAME:
        conditions += isotropic_conditions(entry)
    failures = worst_failures(jacobian, entry.failures)
    normals = [condition.gradient(jacobian) for condition in conditions]
    found = _multipliers(failures, normals)
    for failure, multiplier in zip(failures, found.of_sets, strict=True):
        normals += _eigenvalue_gradients(failure, multiplier)
    # Directions that keep the model and the eigenvalues, and are none of frame or phase. A row
    # has the mn entries of one direction.
    free = null_space([*normals, *frame_changes(entry, jacobian)])
    if not free.size:
        return LocalOptimality(found.stationarity, -np.inf, 0)
    hessians = [condition.form for condition in conditions]
    second = free @ np.tensordot(found.of_conditions, hessians, axes=1) @ free.T
    for failure, multiplier in zip(failures, found.of_sets, strict=True):
        second += _bending(failure, multiplier, free.reshape(-1, *jacobian.shape))
    values = np.linalg.eigvalsh(0.5 * (second + second.T))
    return LocalOptimality(
        found.stationarity, float(values[-1]), int(np.sum(np.abs(values) <= _FLAT))
    )


def worst_failures(jacobian: FloatArray, failures: int) -> list[TiedFailure]:
    """Return the sets of `failures` joints whose loss leaves J, shape (m, n), the least."""
    spectra = []
    for joints in locked_sets(jacobian, failures):
        left = np.ones(jacobian.shape[1])
        left[list(joints)] = 0.0
        rest = jacobian * left
        spectra.append((rest, left, *np.linalg.eigh(rest @ rest.T)))
    least = min(values[0] for _, _, values, _ in spectra)
    ties = [values <= least * (1 + _TIE) for _, _, values, _ in spectra]
    return [
        TiedFailure(rest, left, vectors[:, near], vectors[:, ~near], values[~near] - least)
        for (rest, left, values, vectors), near in zip(spectra, ties, strict=True)
        if near.any()
    ]


class _Multipliers(NamedTuple):
    """The multipliers that leave the least of the gradient."""

    stationarity: float  # ‖2 Σ Y_F J_F̄ + Σ μ_k ∇h_k‖
    of_sets: list[FloatArray]  # UᵀY_F U for each F, shape (a, a), U its active eigenvectors
    of_conditions: FloatArray  # μ_k, one for each condition


def _multipliers(failures: list[TiedFailure], gradients: list[FloatArray]) -> _Multipliers:
    """Return the multipliers that minimise ‖2 Σ Y_F J_F̄ + Σ μ_k ∇h_k‖, Σ tr Y_F = 1, Y_F ⪰ 0.

    `gradients` are the ∇h_k, each of shape (m, n).
    """
    parts = [cp.Variable((f.active.shape[1],) * 2, PSD=True) for f in failures]
    weights = cp.Variable(len(gradients))
    left = np.array([gradient.ravel() for gradient in gradients]).T @ weights
    for failure, part in zip(failures, parts, strict=True):
        pulled = failure.active.T @ failure.rest  # UᵀJ_F̄, shape (a, n)
        size = failure.active.shape[1]
        # Entries of 2 U Y Uᵀ J_F̄, row after row, from those of the (a, a) matrix Y.
        map_ = 2 * np.einsum("ia,bf->ifab", failure.active, pulled).reshape(-1, size * size)
        left = left + map_ @ cp.vec(part, order="C")
    total = sum(cp.trace(part) for part in parts)
    problem = cp.Problem(cp.Minimize(cp.norm(left)), [total == 1])
    run(problem)
    of_sets = [np.atleast_2d(np.asarray(part.value, dtype=np.float64)) for part in parts]
    of_conditions = np.asarray(weights.value, dtype=np.float64)
    return _Multipliers(float(problem.value), of_sets, of_conditions)


def _eigenvalue_gradients(failure: TiedFailure, multiplier: FloatArray) -> list[FloatArray]:
    """Return gradients in J, shape (m, n), of what must not change of A_F to first order.

    These are aᵀA_F b for eigenvectors a that have a multiplier and all active ones b: the
    eigenvalue itself, and what couples equal ones. `multiplier` has shape (a, a), as in
    `_Multipliers`.
    """
    values, vectors = np.linalg.eigh(multiplier)
    if values[-1] < _NO_MULTIPLIER:
        return []
    strong = failure.active @ vectors[:, values > _INACTIVE * values[-1]]
    rest, pairs = failure.rest, product(strong.T, failure.active.T)
    return [np.outer(a, b @ rest) + np.outer(b, a @ rest) for a, b in pairs]


def _bending(failure: TiedFailure, multiplier: FloatArray, free: FloatArray) -> FloatArray:
    """Return 2⟨Y_F, d_F̄ d'_F̄ᵀ − D (A_F − tI)⁺ D'⟩ for all pairs of directions d, d'.

    `free` has the directions, shape (directions, m, n); D = d_F̄ J_F̄ᵀ + J_F̄ d_F̄ᵀ is the
    change of A_F. What is returned has shape (directions, directions).
    """
    root = failure.active @ semidefinite_root(multiplier)  # Y_F = root rootᵀ
    kept = free * failure.kept
    pulled = np.einsum("kif,ia->kaf", kept, root)
    direct = pulled.reshape(len(free), -1)
    # Vᵀ D root for each direction, V the other eigenvectors, scaled by (λ − t)^(-1/2).
    change = np.einsum("kif,jf->kij", kept, failure.rest)
    change = change + change.transpose(0, 2, 1)
    crossed = np.einsum("iv,kij,ja->kva", failure.others, change, root)
    crossed = (crossed / np.sqrt(failure.above)[None, :, None]).reshape(len(free), -1)
    return np.asarray(2 * (direct @ direct.T - crossed @ crossed.T))


def model_conditions(entry: Entry) -> Iterator[Condition]:
    """Yield the conditions on the columns of an entry's arm.

    They are on |j|²/2 of a free column j; else on |v|²/2, |ω|²/2 and v·ω of a column (v; ω), or
    ω = 0 of a prismatic joint. Where joints share a budget the condition on lengths is on their
    sum.
    """
    m, n = entry.task_dimension, entry.joints
    places = np.arange(m * n).reshape(m, n)  # places of the entries of J, row after row
    none = np.zeros(m * n)
    shared: dict[Joint, list[Condition]] = defaultdict(list)
    for f, joint in enumerate(entry.arm.joints):
        free, prismatic = isinstance(joint, FreeColumn), isinstance(joint, Prismatic)
        form = _pairing(m * n, places[: m if free else 3, f])
        # The squared norm of a revolute column is |v|² + |ω|² with |ω|² = 1.
        size = joint.largest_norm_squared - (0 if free or prismatic else 1)
        length = Condition(form, none, 0.5 * size)
        if getattr(joint, "budget", "each") == "mean":
            shared[joint].append(length)
        else:
            yield replace(length, limit=isinstance(joint, LeverRevolute))
        if prismatic:
            for unit in np.eye(m * n)[places[3:, f]]:
                yield Condition(0.0 * form, unit, 0.0)
        elif not free:
            yield Condition(_pairing(m * n, places[3:, f]), none, 0.5)
            pitch = getattr(joint, "pitch", 0.0)
            yield Condition(_pairing(m * n, places[:3, f], places[3:, f]), none, pitch)
    for parts in shared.values():
        form = np.sum([part.form for part in parts], axis=0)
        yield Condition(form, none, sum(part.level for part in parts), limit=True)


def _pairing(size: int, first: Places, second: Places | None = None) -> FloatArray:
    """Return H with ½ jᵀHj = Σ j_first·j_second, a sum over pairs of places.

    H has shape (size, size). With one row of places only, ½ jᵀHj = ½ Σ j_first².
    """
    form = np.zeros((size, size))
    second = first if second is None else second
    form[first, second] = form[second, first] = 1.0
    return form


def isotropic_conditions(entry: Entry) -> Iterator[Condition]:
    """Yield the conditions on the entries of mJJᵀ: T = tr JJᵀ on the diagonal and 0 beside it.

    The factor m keeps their coefficients whole numbers.
    """
    m, n, total = entry.task_dimension, entry.joints, entry.arm.largest_trace
    for i, j in combinations_with_replacement(range(m), 2):
        pair = np.zeros((m, m))
        pair[i, j] = pair[j, i] = m * (1 + (i == j))
        form = np.asarray(np.kron(pair, np.eye(n)), dtype=np.float64)
        yield Condition(form, np.zeros(m * n), total * (i == j))


def frame_changes(entry: Entry, jacobian: FloatArray) -> list[FloatArray]:
    """Return the directions of J, shape (m, n), in which only the frame changes, or the phase.

    A turn of free columns is any of m dimensions; of other columns (v; ω) it turns v and ω in
    the same way. The phase, of unit revolute joints only, takes (v; ω) to (−ω; v).
    """
    kinds = {type(joint) for joint in entry.arm.joints}
    size = entry.task_dimension if kinds == {FreeColumn} else 3
    turned = []
    for i, j in combinations(range(size), 2):
        turn = np.zeros((size, size))
        turn[i, j], turn[j, i] = 1.0, -1.0
        whole = turn if kinds == {FreeColumn} else np.kron(np.eye(2), turn)
        turned.append(whole @ jacobian)
    if kinds == {UnitRevolute}:
        turned.append(np.vstack([-jacobian[3:], jacobian[:3]]))
    return turned


def null_space(rows: list[FloatArray]) -> FloatArray:
    """Return orthonormal rows that are normal to all of these.

    The given ones have any one shape, and each is taken as the vector of its entries. What is
    returned has shape (dimension of the null space, entries).
    """
    lengths = [max(float(np.linalg.norm(row)), _LEAST_LENGTH) for row in rows]
    stacked = np.array([row.ravel() / size for row, size in zip(rows, lengths, strict=True)])
    _, values, vectors = np.linalg.svd(stacked)
    return np.asarray(vectors[int(np.sum(values > _RANK_TOLERANCE)) :])
