"""A second search for the atlas: another statement, another method and other starts.

The first search states an entry in CasADi and solves it with Ipopt; entries on the condition
number are polished by SLSQP. This one has variables x without equations (`columns`). It climbs
the smoothed least level (`levels`) with L-BFGS, with smaller and smaller widths, and polishes
with SLSQP::

    maximise s   subject to   s ≤ ℓ_F(x)   for the sets F with the least levels

A Jacobian that has to be isotropic, E = 0 (`evenness`), is brought there by an augmented
Lagrangian, ⟨Y + pE, E⟩ with multipliers Y and a penalty p, and polished under E = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize

from lockedjoint.formulations import isotropy
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.nlp.arrays import FloatArray
from results.second_search.columns import Columns
from results.second_search.evenness import entries, entry_slopes, unevenness, weighted_slopes
from results.second_search.levels import Levels

# Widths of smoothing, in logarithms of what is asked for. A start draws its first width between
# the narrowest and the widest, and climbs again with widths a step smaller until one is below
# the least width. From wide ones all starts go to a few symmetric Jacobians, from narrow ones
# to many different optima.
_WIDEST = 0.1
_NARROWEST = 1e-4
_LEAST_WIDTH = 4e-3
_STEP = 5.0
# Iterations of L-BFGS for each width, at most. SLSQP goes on from there: it is faster near the
# top.
_ITERATIONS = 100
# Relative change of the loss below which L-BFGS ends.
_LEAST_CHANGE = 1e-5
# Largest slope of the loss below which L-BFGS ends.
_LEAST_SLOPE = 1e-4
# Draws for each start, of which the one with the best smoothed level begins.
_DRAWS = 4
# First penalty p, and its factor from width to width.
_PENALTY = 10.0
_PENALTY_GROWTH = 10.0
# Climbs with new multipliers Y for each width.
_ROUNDS = 4
# Sets F that are constraints of SLSQP, in numbers of variables. Others may have lower levels
# afterwards: then the next polish has them.
_SETS_PER_VARIABLE = 3
_POLISHES = 4
_POLISH_ITERATIONS = 150
# Gain of a level below which there is no other polish.
_GAIN = 1e-10
# Share of the largest singular value below which an equation depends on the others.
_DEPENDENT = 1e-8
# Steps of Newton's method to E = 0 after a polish: SLSQP leaves 1e-9.
_NEWTON_STEPS = 3


@dataclass(frozen=True, eq=False)
class SmoothedSearch:
    """The search of one entry: its levels, J of x, and whether J has to be isotropic."""

    levels: Levels
    columns: Columns
    isotropic: bool

    @classmethod
    def of(cls, entry: Entry) -> "SmoothedSearch":
        """Return the search of an entry; InputError for a kind of joint without a formula."""
        isotropic = entry.formulation == isotropy.NAME
        return cls(Levels.of(entry), Columns.of(entry.arm, isotropic), isotropic)

    def answer(self, rng: np.random.Generator) -> FloatArray:
        """Return the Jacobian that one start leads to, (m, n).

        It may be none of the entry's: from some starts no isotropic one is reached.
        """
        widest = float(np.exp(rng.uniform(np.log(_NARROWEST), np.log(_WIDEST))))
        m, _ = self.columns.shape
        multipliers, penalty = np.zeros((m, m)), _PENALTY
        draws = [self.columns.sample(rng) for _ in range(_DRAWS)]
        point = min(draws, key=lambda drawn: self.loss(drawn, widest, multipliers, penalty)[0])
        for width in _widths(widest):
            for _ in range(_ROUNDS if self.isotropic else 1):
                point = self._climbed(point, width, multipliers, penalty)
                uneven = unevenness(self.columns.jacobian(point))
                multipliers = multipliers + 2 * penalty * uneven
            penalty *= _PENALTY_GROWTH
        return self.columns.jacobian(self.polished(point))

    def loss(
        self, point: FloatArray, width: float, multipliers: FloatArray, penalty: float
    ) -> tuple[float, FloatArray]:
        """Return minus the smoothed least level, and its gradient by x, shape (size,).

        Where J has to be isotropic with ⟨Y + pE, E⟩; Y has the shape (m, m).
        """
        jacobian = self.columns.jacobian(point)
        least, change = self.levels.smoothed(jacobian, width)
        loss, change = -least, -change
        if self.isotropic:
            uneven = unevenness(jacobian)
            loss += float(np.sum((multipliers + penalty * uneven) * uneven))
            change += weighted_slopes(jacobian, multipliers + 2 * penalty * uneven)
        return loss, self.columns.pulled(point, change)

    def _climbed(
        self, point: FloatArray, width: float, multipliers: FloatArray, penalty: float
    ) -> FloatArray:
        """Return the variables at which L-BFGS ends, shape (size,)."""
        settled = (width, multipliers, penalty)
        options = {
            "maxiter": _ITERATIONS,
            "maxcor": 20,
            "ftol": _LEAST_CHANGE,
            "gtol": _LEAST_SLOPE,
        }
        answer = minimize(
            self.loss, point, settled, jac=True, method="L-BFGS-B", options=options
        )
        return np.asarray(answer.x)

    def polished(self, point: FloatArray, enough: float = -np.inf) -> FloatArray:
        """Return the variables at which SLSQP ends, again and again as long as they are better.

        They have the shape (size,). Where J has to be isotropic a level may fall: a start from
        E ≠ 0 may be too good. It ends early if the levels that a polish was for are not
        `enough` after it.
        """
        best = point
        for _ in range(_POLISHES):
            jacobian = self.columns.jacobian(best)
            chosen = self.levels.lowest(jacobian, _SETS_PER_VARIABLE * best.size)
            better = self._polished_once(best, chosen)
            reached = self.columns.jacobian(better)
            gain = self.levels.least(reached) - self.levels.least(jacobian)
            if gain > 0 or self.isotropic:
                best = better
            if chosen.least(reached) < enough:
                break
            if gain < _GAIN and not (self.isotropic and gain < -_GAIN):
                break
        return self._evened(best) if self.isotropic else best

    def _evened(self, point: FloatArray) -> FloatArray:
        """Return the variables after steps of least length to E = 0, shape (size,)."""
        for _ in range(_NEWTON_STEPS):
            jacobian, by_point = self.columns.with_slopes(point)
            slopes = entry_slopes(jacobian) @ by_point
            step = np.linalg.lstsq(slopes, entries(jacobian), rcond=_DEPENDENT)[0]
            point = point - step
        return point

    def _polished_once(self, point: FloatArray, chosen: Levels) -> FloatArray:
        """Return the variables at which SLSQP ends with some of the levels."""
        columns = self.columns

        @lru_cache(maxsize=1)  # SLSQP asks for slopes where it has just asked for values
        def levels_at(variables: bytes) -> tuple[FloatArray, FloatArray]:
            return chosen.with_weights(columns.jacobian(np.frombuffer(variables)))

        def above(unknowns: FloatArray) -> FloatArray:
            return np.asarray(levels_at(unknowns[:-1].tobytes())[0] - unknowns[-1])

        def above_slopes(unknowns: FloatArray) -> FloatArray:
            jacobian, by_point = columns.with_slopes(unknowns[:-1])
            by_gram = levels_at(unknowns[:-1].tobytes())[1]
            change = chosen.slopes_of(jacobian, by_gram) @ by_point
            return np.hstack([change, -np.ones((len(change), 1))])

        constraints: Sequence[dict[str, object]]
        constraints = [{"type": "ineq", "fun": above, "jac": above_slopes}]
        if self.isotropic:
            constraints = [*constraints, self._equations(point)]
        slope = np.append(np.zeros(point.size), -1.0)
        answer = minimize(
            lambda unknowns: -unknowns[-1],
            np.append(point, chosen.least(columns.jacobian(point))),
            jac=lambda _: slope,
            method="SLSQP",
            constraints=constraints,
            options={"ftol": 1e-13, "maxiter": _POLISH_ITERATIONS},
        )
        return np.asarray(answer.x[:-1]) if np.isfinite(answer.x).all() else point

    def _equations(self, point: FloatArray) -> dict[str, object]:
        """Return E = 0 as SLSQP takes it: combinations of its rows, independent here."""
        jacobian, by_point = self.columns.with_slopes(point)
        left, sizes, _ = np.linalg.svd(entry_slopes(jacobian) @ by_point)
        basis = left[:, : int(np.sum(sizes > _DEPENDENT * sizes[0]))].T

        def slopes(unknowns: FloatArray) -> FloatArray:
            jacobian, by_point = self.columns.with_slopes(unknowns[:-1])
            change = basis @ entry_slopes(jacobian) @ by_point
            return np.hstack([change, np.zeros((len(basis), 1))])

        return {
            "type": "eq",
            "fun": lambda unknowns: basis @ entries(self.columns.jacobian(unknowns[:-1])),
            "jac": slopes,
        }


def _widths(widest: float) -> FloatArray:
    """Return the widths of a start's climbs, the widest first, at least one."""
    steps = np.log(max(widest / _LEAST_WIDTH, 1.0)) / np.log(_STEP)
    return np.asarray(widest / _STEP ** np.arange(int(np.ceil(steps)) + 1))
