"""The best planar Jacobians, by branch and bound over the directions of their columns.

With m = 2 let z_i be the complex square of column i. What the columns S leave has the
eigenvalues (W ± |Z|)/2, W = Σ_S |z_i|, Z = Σ_S z_i, so that with k locked

    max-min          2t ≤ W − Re(Z v̄)              for every S of n − k columns, |v| = 1,
    manipulability   r √(1 − |v|²) ≤ W − Re(Z v̄)   for every S, |v| < 1; Σ|z_i| = 1, Σ z_i = 0,
    condition        0 ≤ c W − Re(Z v̄)             for every S, |v| = 1; c = (1 − κ²)/(1 + κ²),

t the square of the worst case, r the least relative manipulability, κ the least ratio of the
smallest to the largest singular value. A node of the search
says how many z_i each cell of the circle holds; multipliers p and ν of a linear program for the
means of the cells prove a number for it, whatever they are (docs/several_failures.md). Rounding
in its closed form, some 1e-14, is paid for. So the bound is rigorous.

The linear program goes to Clarabel directly. Through cvxpy, with parameters, each takes four
times as long; the tests state it there.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, TypeAlias, get_args

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from lockedjoint.nlp.arrays import FloatArray, real_number, whole_number
from lockedjoint.nlp.errors import one_of
from lockedjoint.nlp.progress import Progress, Step

ComplexArray: TypeAlias = NDArray[np.complex128]
Measure: TypeAlias = Literal["max-min", "manipulability", "condition"]
Cell: TypeAlias = tuple[int, int, int]  # from, to, in units of 2π/TURN, and how many z_i

TURN = 2**48
ARCS = 8  # cells of the root
_ARC = TURN // ARCS

# Covers what rounding loses in `_proved`: some hundred operations on numbers of the size of 1.
_ROUNDING = 1e-13
_PROGRAMS = 12  # linear programs a node
# Number of nodes between two reports of how far the search is.
_REPORTED_NODES = 20
_DIRECTIONS = np.exp(2j * np.pi * np.arange(48) / 48)


@dataclass(frozen=True)
class PlanarBound:
    """What a search proved."""

    measure: Measure
    #: n and k.
    joints: int
    failures: int
    #: No planar J with ‖J‖_F² = n has a worst case, or other measure, above it.
    level: float
    #: Whether the search ended; else nothing is known.
    proved: bool
    #: How many counts of columns in cells were looked at.
    nodes: int

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as in the record; of kind `undecided` if nothing is proved."""
        return {
            **asdict(self),
            "kind": "rigorous" if self.proved else "undecided",
            "command": f"lockedjoint bound planar --joints {self.joints} "
            f"--failures {self.failures} --level {self.level!r}"
            + (f" --measure {self.measure}" if self.measure != "max-min" else ""),
        }


def planar_bound(
    joints: int,
    failures: int,
    level: float,
    measure: Measure = "max-min",
    *,
    most_nodes: int = 100_000,
    progress: Progress = lambda _: None,
) -> PlanarBound:
    """Prove that no planar J of n free columns, k of which lock, is better than a level.

    The level is one of the worst case where ‖J‖_F² = n, of the least relative manipulability,
    or of the least reciprocal condition number. The search gives up after `most_nodes`: it has
    to where the level is below the best.
    """
    n = whole_number("joints", joints, 3, 20)
    k = whole_number("failures", failures, 1, n - 2)
    one_of("measure", measure, get_args(Measure))
    real_number("level", level, "a number above 0, at most 1e100", math.ulp(0.0), 1e100)
    most = whole_number("most_nodes", most_nodes, 1)
    claim = Claim.of(measure, n, k, level)
    first = [_Node(cells, claim) for cells in first_cells(n)]
    # Each node with its share of the search: what it divides into has equal parts of it.
    waiting, count, done = [(node, 1 / len(first)) for node in first], 0, 0.0
    while waiting and count < most:
        node, share = waiting.pop()
        count += 1
        parts = node.parts()
        waiting += [(part, share / len(parts)) for part in parts]
        done += 0.0 if parts else share
        if count % _REPORTED_NODES == 0:
            words = f"{count} nodes, {len(waiting)} wait"
            progress(Step(words, min(1.0, max(done, count / most))))
    return PlanarBound(measure, n, k, float(level), not waiting, count)


@dataclass(frozen=True)
class Claim:
    """What is to be proved.

    Attributes
    ----------
    measure, failures
        The measure, and k.
    mass
        The factor of W in the conditions: c of the condition number, otherwise 1.
    limit
        The level, in the units of the conditions, less what rounding loses.
    """

    measure: Measure
    failures: int
    mass: float
    limit: float

    @classmethod
    def of(cls, measure: Measure, joints: int, failures: int, level: float) -> "Claim":
        """Return the claim that no J of n columns is better than a level."""
        if measure == "condition":
            mass, limit = (1 - level**2) / (1 + level**2), 0.0
        else:
            mass, limit = 1.0, 2 * level**2 / joints if measure == "max-min" else level
        return cls(measure, failures, mass, limit - _ROUNDING)


@dataclass(frozen=True)
class NodeConditions:
    """Conditions of a node, one an entry.

    Attributes
    ----------
    points, masses
        v, and the factor of W.
    weights
        √(1 − |v|²) of the manipulability, otherwise 1.
    shares
        The share x_s left of each cell.
    """

    points: ComplexArray
    masses: FloatArray
    weights: FloatArray
    shares: FloatArray

    def left_at(self, corners: ComplexArray) -> FloatArray:
        """Return x_s (c − Re(e^{iθ} v̄)) for each condition and the corners of each cell."""
        parts = (corners[None] * np.conj(self.points)[:, None, None]).real
        return np.asarray(self.shares[:, :, None] * (self.masses[:, None, None] - parts))

    def some(self, which: Any) -> "NodeConditions":
        """Return those that an index of NumPy chooses."""
        return NodeConditions(*(values[which] for values in vars(self).values()))

    def joined(self, other: "NodeConditions") -> "NodeConditions":
        """Return these and others on the same cells."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return NodeConditions(*map(np.concatenate, pairs))


@dataclass(frozen=True)
class Multipliers:
    """What proves a number: p, one for each condition, and ν."""

    conditions: NodeConditions
    p: FloatArray
    nu: complex

    def proved(self, low: FloatArray, high: FloatArray) -> float:
        """Return what the level is not above where all z_i are within the cells' angles."""
        p = self.p / (self.p @ self.conditions.weights)
        constant = (p * self.conditions.masses) @ self.conditions.shares
        wave = (p * self.conditions.points) @ self.conditions.shares - self.nu
        size, phase = np.abs(wave), np.angle(wave)
        ends = np.minimum(np.cos(low - phase), np.cos(high - phase))
        opposite = (phase + np.pi - low) % (2 * np.pi) <= high - low + 1e-9
        return float((constant - size * np.where(opposite, -1.0, ends)).max())

    def inherited(self, cell: int, parts: int) -> "Multipliers":
        """Return those not next to zero, where a cell is replaced by parts of it."""
        which = self.p > 1e-5 * self.p.max()
        some = self.conditions.some(which)
        times = np.ones(some.shares.shape[1], dtype=int)
        times[cell] = parts
        shares = np.repeat(some.shares, times, axis=1)
        return Multipliers(replace(some, shares=shares), self.p[which], self.nu)


_SETTINGS = clarabel.DefaultSettings()
_SETTINGS.verbose = _SETTINGS.equilibrate_enable = False
_SETTINGS.tol_gap_abs = _SETTINGS.tol_gap_rel = _SETTINGS.tol_feas = 1e-10


class _Node:
    """How many z_i each cell of the circle holds."""

    def __init__(
        self,
        cells: tuple[Cell, ...],
        claim: Claim,
        known: Multipliers | None = None,
    ) -> None:
        self._cells, self._claim, self._known = cells, claim, known
        self._counts = np.array([count for _, _, count in cells], dtype=np.float64)
        self._low = np.array([low for low, _, _ in cells]) * (2 * np.pi / TURN)
        self._high = np.array([high for _, high, _ in cells]) * (2 * np.pi / TURN)

    def parts(self) -> list["_Node"]:
        """Return the nodes that this one divides into; none if it is proved to be below."""
        known, limit = self._known, self._claim.limit
        if self._claim.measure == "manipulability" and _is_one_sided(self._cells):
            return []
        if known and known.proved(self._low, self._high) <= limit:
            return []
        middle = 0.5 * (self._low + self._high)
        corners = np.exp(1j * np.stack([self._low, middle, self._high], axis=1))
        even = np.full_like(self._counts, 1 / self._counts.sum())
        conditions = known.conditions if known else self._tightest(even, even * corners[:, 1])
        best, least, masses = known, math.inf, np.zeros(corners.shape)
        for _ in range(_PROGRAMS):
            masses, value, multipliers = self._program(corners, conditions)
            if multipliers is None:
                break
            proved = multipliers.proved(self._low, self._high)
            if proved <= limit:
                return []
            if proved < least:
                best, least = multipliers, proved
            means = masses / self._counts[:, None]
            new = self._tightest(means.sum(axis=1), (means * corners).sum(axis=1))
            values = np.sum(new.left_at(corners) * masses, axis=(1, 2)) / new.weights
            if values.min() > limit or values.min() > value - 1e-10:
                break
            first = np.argsort(values)[:8]
            conditions = conditions.joined(new.some(first[values[first] < value]))
        loss = masses.sum(axis=1) - np.abs((masses * corners).sum(axis=1))
        width = self._high - self._low
        # The cell whose mean is least like the square of a column.
        widest = int(np.argmax(np.where(width > 0, loss + 1e-6 * width, -1.0)))
        return self._halved(best, widest)

    def _program(
        self, corners: ComplexArray, conditions: NodeConditions
    ) -> tuple[FloatArray, float, Multipliers | None]:
        """Return Σ w_i at the corners of the cells, the value, and the multipliers."""
        left = conditions.left_at(corners)
        size, count = corners.size, len(left)
        equal = [np.ones(size)]
        if self._claim.measure == "manipulability":
            equal += [corners.real.ravel(), corners.imag.ravel()]
        parts = [np.array(equal), -left.reshape(count, size), -np.eye(size)]
        last = [np.zeros(len(equal)), conditions.weights, np.zeros(size)]
        rows = np.column_stack([np.concatenate(parts), np.concatenate(last)])
        found = clarabel.DefaultSolver(
            csc_matrix((size + 1, size + 1)),
            np.append(np.zeros(size), -1.0),
            csc_matrix(rows),
            np.eye(len(rows))[0],
            [clarabel.ZeroConeT(len(equal)), clarabel.NonnegativeConeT(count + size)],
            _SETTINGS,
        ).solve()
        p = np.maximum(np.array(found.z)[len(equal) : len(equal) + count], 0.0)
        if not np.isfinite(p).all() or not 0.5 < p @ conditions.weights < 2.0:
            return np.ones(corners.shape), math.inf, None  # nothing can be there, or it failed
        nu = -complex(*found.z[1:3]) if len(equal) > 1 else 0j
        masses = np.maximum(np.array(found.x)[:-1], 0.0).reshape(corners.shape)
        return masses, float(found.x[-1]), Multipliers(conditions, p, nu)

    def _tightest(self, mass: FloatArray, mean: ComplexArray) -> NodeConditions:
        """Return the conditions that means of |z_i| and z_i of the cells violate most."""
        inside = self._claim.measure == "manipulability"
        radii = [0.3, 0.8] if inside else [1.0]
        points = np.outer(radii, _DIRECTIONS).ravel()
        for _ in range(3):
            shares = self._left(mass, mean, points)
            left = (shares * self._counts) @ np.stack([mass, mean], axis=1)
            radius = np.abs(left[:, 0] if inside else left[:, 1])
            sure = radius > 1e-9
            points = np.where(sure, left[:, 1] / np.where(sure, radius, 1.0), points)
        _, apart = np.unique(np.round(points, 3), return_index=True)  # many become the same
        points, shares = points[apart], shares[apart]
        masses = np.full(len(points), self._claim.mass)
        if not inside:
            return NodeConditions(points, masses, np.ones(len(points)), shares)
        points = points * np.minimum(1.0, 0.999999 / np.maximum(np.abs(points), 1e-9))
        return NodeConditions(points, masses, np.sqrt(1 - np.abs(points) ** 2), shares)

    def _left(self, mass: FloatArray, mean: ComplexArray, points: ComplexArray) -> FloatArray:
        """Return the shares that are left where the k locked ones leave least at each v."""
        terms = self._claim.mass * mass - (np.conj(points)[:, None] * mean).real
        order = np.argsort(-terms, axis=1)
        counts = self._counts[order]
        taken = np.clip(self._claim.failures - (np.cumsum(counts, axis=1) - counts), 0, counts)
        shares = np.empty_like(terms)
        np.put_along_axis(shares, order, 1 - taken / counts, axis=1)
        return shares

    def _halved(self, known: Multipliers | None, index: int) -> list["_Node"]:
        low, high, count = self._cells[index]
        middle = (low + high) // 2
        nodes = []
        for below in range(count + 1):
            halves = [(low, middle, below), (middle, high, count - below)]
            held = [half for half in halves if half[2]]
            cells = (*self._cells[:index], *held, *self._cells[index + 1 :])
            if is_crowded(cells):
                continue
            inherited = known and known.inherited(index, len(held))
            nodes.append(_Node(cells, self._claim, inherited))
        return nodes


def first_cells(n: int) -> Iterator[tuple[Cell, ...]]:
    """Return all counts of z_i in the first cells, but for rotations.

    One z_i is at the angle 0: one with the most in the arc that begins there.
    """
    for most in range(-(-n // ARCS), n + 1):
        for counts in _counts(n - most, ARCS - 1, most):
            held = [(0, 0, 1), (0, _ARC, most - 1)]
            held += [((i + 1) * _ARC, (i + 2) * _ARC, one) for i, one in enumerate(counts)]
            yield tuple(cell for cell in held if cell[2])


def _counts(total: int, cells: int, most: int) -> Iterator[tuple[int, ...]]:
    if cells == 0:
        yield from [()] if total == 0 else []
        return
    for first in range(min(total, most) + 1):
        for rest in _counts(total - first, cells - 1, most):
            yield (first, *rest)


def is_crowded(cells: tuple[Cell, ...]) -> bool:
    """Whether an arc of the length of the first holds more z_i than the first."""

    def held(start: int) -> int:
        return sum(
            count
            for low, high, count in cells
            if (low - start) % TURN + high - low <= _ARC
            and (low - start) % TURN < _ARC  # an arc is without its end
        )

    most = sum(count for low, _, count in cells if low < _ARC)
    return any(held(start) > most for start, _, _ in cells)


def _is_one_sided(cells: tuple[Cell, ...]) -> bool:
    """Whether all z_i are strictly on one side of a line, so that their sum is not 0."""
    for index, (_, end, _) in enumerate(cells):
        others = cells[:index] + cells[index + 1 :]
        if all((low - end) % TURN > TURN // 2 for low, _, _ in others):
            return True
    return False
