"""First and second order at a worst case that is claimed to be a maximum, in NumPy.

With A_F = J_F̄J_F̄ᵀ, t = min_F λ_min(A_F) is at most Σ_F ⟨Y_F, A_F(J)⟩ for every Y_F ⪰ 0, Σ tr
Y_F = 1. So t is stationary where 2 Σ Y_F J_F̄ + Σ μ_k ∇h_k = 0, h_k = 0 the equations of the
model. The second derivative along directions d that keep the least eigenvalues is in
docs/atlas_proofs.md. Where it is negative but for changes of frame and phase, the optimum is
isolated. Its null space beyond these is the family: an upper bound on the dimension of the
optima around J.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, combinations_with_replacement, product

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

Places = npt.NDArray[np.int_]
# Eigenvalues this near to the least one, relative to it, count as equal to it.
_TIE = 1e-5
# Singular values below this count as zero where a rank is counted, after scaling to one.
_RANK_TOLERANCE = 1e-4
# Multipliers below this share of the mean one count as zero.
_INACTIVE = 1e-3
# Second derivatives below this, where the largest is of the order of one, count as zero.
_FLAT = 1e-5


@dataclass(frozen=True)
class LocalOptimality:
    """What holds to second order at a Jacobian."""

    # ‖2 Σ Y_F J_F̄ + Σ μ_k ∇h_k‖ of the best multipliers: 0 at a stationary point.
    stationarity: float
    # Largest second derivative along unit directions that change more than frame and phase and
    # keep the active eigenvalues: at most 0 at a maximum; −∞ if there are none.
    curvature: float
    family: int  # number of such directions in which it is zero


@dataclass(frozen=True, eq=False)
class Condition:
    """One equation ½ jᵀHj + ℓ·j = c of the model, j the entries of J row after row."""

    form: FloatArray
    linear: FloatArray
    level: float
    limit: bool = False  # whether it is a limit from above instead

    def gradient(self, jacobian: FloatArray) -> FloatArray:
        """Return the left side's gradient, of the shape of J."""
        return np.reshape(self.form @ jacobian.ravel() + self.linear, jacobian.shape)


@dataclass(frozen=True, eq=False)
class TiedFailure:
    """A set of locked joints at the worst case: J without them, and the spectrum left."""

    rest: FloatArray
    kept: FloatArray  # 1 for joints that are left
    active: FloatArray  # eigenvectors at t, shape (m, p)
    others: FloatArray
    above: FloatArray  # their eigenvalues minus t


def local_optimality(entry: Entry, jacobian: FloatArray) -> LocalOptimality:
    """Judge a Jacobian, shape (m, n), as a maximum of an entry's worst case."""
    conditions = [*model_conditions(entry)]
    if entry.formulation == isotropy.NAME:
        conditions += isotropic_conditions(entry)
    failures = worst_failures(jacobian, entry.failures)
    fixed = [condition.gradient(jacobian) for condition in conditions]
    stationarity, multipliers, weights = _multipliers(failures, fixed)
    for failure, multiplier in zip(failures, multipliers, strict=True):
        fixed += _kept(failure, multiplier)
    # Away from changes of frame and phase.
    free = null_space([*fixed, *frame_changes(entry, jacobian)])
    if not free.size:
        return LocalOptimality(stationarity, -np.inf, 0)
    hessians = [condition.form for condition in conditions]
    second = free @ np.tensordot(weights, hessians, axes=1) @ free.T
    for failure, multiplier in zip(failures, multipliers, strict=True):
        second += _bending(failure, multiplier, free.reshape(-1, *jacobian.shape))
    values = np.linalg.eigvalsh(0.5 * (second + second.T))
    return LocalOptimality(
        stationarity, float(values[-1]), int(np.sum(np.abs(values) <= _FLAT))
    )


def worst_failures(jacobian: FloatArray, failures: int) -> list[TiedFailure]:
    """Return the sets of `failures` joints at whose loss J is at its worst case."""
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


def _multipliers(
    failures: list[TiedFailure], gradients: list[FloatArray]
) -> tuple[float, list[FloatArray], FloatArray]:
    """Return what is left of the gradient, the Y_F on the active eigenvectors, and the μ_k."""
    parts = [cp.Variable((f.active.shape[1],) * 2, PSD=True) for f in failures]
    weights = cp.Variable(len(gradients))
    left = np.array([gradient.ravel() for gradient in gradients]).T @ weights
    for failure, part in zip(failures, parts, strict=True):
        pulled = failure.active.T @ failure.rest  # (p, n)
        size = failure.active.shape[1]
        # vec of 2 U Y Uᵀ J_F̄, row after row.
        map_ = 2 * np.einsum("ia,bf->ifab", failure.active, pulled).reshape(-1, size * size)
        left = left + map_ @ cp.vec(part, order="C")
    total = sum(cp.trace(part) for part in parts)
    problem = cp.Problem(cp.Minimize(cp.norm(left)), [total == 1])
    run(problem)
    found = [np.atleast_2d(np.asarray(part.value, dtype=np.float64)) for part in parts]
    return float(problem.value), found, np.asarray(weights.value, dtype=np.float64)


def _kept(failure: TiedFailure, multiplier: FloatArray) -> list[FloatArray]:
    """Gradients of the eigenvalues that have a multiplier, and of what couples equal ones."""
    values, vectors = np.linalg.eigh(multiplier)
    strong = failure.active @ vectors[:, values > _INACTIVE * max(values[-1], 1e-9)]
    if values[-1] < 1e-7:
        return []
    rest, pairs = failure.rest, product(strong.T, failure.active.T)
    return [np.outer(a, b @ rest) + np.outer(b, a @ rest) for a, b in pairs]


def _bending(failure: TiedFailure, multiplier: FloatArray, free: FloatArray) -> FloatArray:
    """2⟨Y, d d'ᵀ − D (A − tI)⁺ D'⟩ for all pairs of directions, of shape (free, m, n)."""
    root = failure.active @ semidefinite_root(multiplier)  # Y = root rootᵀ
    kept = free * failure.kept
    pulled = np.einsum("kif,ia->kaf", kept, root)
    direct = pulled.reshape(len(free), -1)
    # Vᵀ D root, scaled by (λ − t)^(-1/2).
    change = np.einsum("kif,jf->kij", kept, failure.rest)
    change = change + change.transpose(0, 2, 1)
    crossed = np.einsum("iv,kij,ja->kva", failure.others, change, root)
    crossed = (crossed / np.sqrt(failure.above)[None, :, None]).reshape(len(free), -1)
    return np.asarray(2 * (direct @ direct.T - crossed @ crossed.T))


def model_conditions(entry: Entry) -> Iterator[Condition]:
    """Yield those on |v|²/2, |ω|²/2 and v·ω, or |j|²/2; in the mean where shared."""
    m, n = entry.task_dimension, entry.joints
    places = np.arange(m * n).reshape(m, n)  # of the entries of J, row after row
    none = np.zeros(m * n)
    shared: dict[Joint, list[Condition]] = defaultdict(list)
    for f, joint in enumerate(entry.arm.joints):
        free, prismatic = isinstance(joint, FreeColumn), isinstance(joint, Prismatic)
        form = _pairing(m * n, places[: m if free else 3, f])
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
    """Return H with ½ jᵀHj = Σ j_first·j_second, or ½ Σ j_first² for one row of places."""
    form = np.zeros((size, size))
    second = first if second is None else second
    form[first, second] = form[second, first] = 1.0
    return form


def isotropic_conditions(entry: Entry) -> Iterator[Condition]:
    """Yield those on the entries of mJJᵀ, which are T on the diagonal and 0 beside it."""
    m, n, total = entry.task_dimension, entry.joints, entry.arm.largest_trace
    for i, j in combinations_with_replacement(range(m), 2):
        pair = np.zeros((m, m))
        pair[i, j] = pair[j, i] = m * (1 + (i == j))
        form = np.asarray(np.kron(pair, np.eye(n)), dtype=np.float64)
        yield Condition(form, np.zeros(m * n), total * (i == j))


def frame_changes(entry: Entry, jacobian: FloatArray) -> list[FloatArray]:
    """Return the directions in which only the frame changes, or the common phase."""
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
    """Return orthonormal rows that are normal to all of these."""
    stacked = np.array([row.ravel() / max(float(np.linalg.norm(row)), 1e-300) for row in rows])
    _, values, vectors = np.linalg.svd(stacked)
    return np.asarray(vectors[int(np.sum(values > _RANK_TOLERANCE)) :])
