"""Positions that are kept for certain, wherever a joint locks within its artificial limits.

A position p is kept if some configuration within the artificial limits reaches it, and for
every joint j and every angle θ within its artificial limits one within the physical limits
reaches it with q_j = θ. Here that is proved for a cube of positions and an interval of θ at a
time, so that nothing is sampled, neither positions nor angles.

Let q⁰ reach p⁰, the middle of a cube of half width w, with q⁰_j = θ⁰, the middle of an interval
of half width h, and let Y be a right inverse of J(q⁰) without column j. For a position p⁰ + δ
and an angle θ⁰ + ε try q = q⁰ + u with u = Y(δ − εJ_j + s), u_j = ε. It reaches the position if
s is a fixed point of s − (f(q) − p⁰ − δ), which is −½H(u, u) − ⅙T(u, u, u) and terms of fourth
order, with H and T the second and third derivatives of the tip's position f at q⁰. If its
entries stay below r for all |δ| ≤ w, |ε| ≤ h and |s| ≤ r, the map takes the cube of s into
itself, and has a fixed point by Brouwer's theorem. With x = (w + r, …, w + r, h) and U the
columns of Y and −YJ_j + e_j, so that u is U times something below x,

    |H(u, u)| ≤ Σ |H(U_k, U_l)| x_k x_l,    |T(u, u, u)| ≤ Σ |T(U_k, U_l, U_o)| x_k x_l x_o,
    fourth order ≤ Σ_c D_c (S_c⁴ − S_{c−1}⁴) / 24 + Σ_d |u_d| S_d³ / 6,

S_c the sum of |U|x over joints up to c that turn, D_c the most that the tip is from the axis of
joint c meanwhile, d the joints that slide. All of q⁰ ± |U|x has to be within the limits. What Y
misses of an inverse, and q⁰ of the position, is added. Rounding is paid for by `_ROUNDING`,
some thousand times what it is.

In shapes k is the number of pairs (a cube and an interval), n that of joints, and m = 2 in the
plane or 3 in space that of coordinates of a position. Lengths are in metres, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Any, Self

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray, crosses
from lockedjoint.kinematics.inverse import damped_least_squares
from lockedjoint.kinematics.serial_chain import (
    Ranges,
    from_first_joint,
    idle_joints,
    is_planar,
    link_lengths,
    opened,
    physical_ranges,
)
from lockedjoint.nlp.arrays import FloatArray

# The amount that is added for rounding, in metres and radians. If it is larger, less is proved;
# below what rounding is, proofs would be wrong.
_ROUNDING = 1e-10
# The least singular value of a matrix that is inverted. It saves trials that would fail: Y is
# large near singularities. No value makes a proof wrong.
_LEAST_SIGMA = 1e-2
# The number of times that r is widened, each time to so many times the image of the map, and
# its largest value in metres. No values make a proof wrong; more times take longer.
_WIDENINGS = 6
_WIDENED = 1.05
_LARGEST_R_M = 1.0
# A joint moves freely from this distance to its limit on, in radians or metres; nearer, Y gives
# the others more to do.
_FREE_DISTANCE = 0.3
#: The distance by which a configuration of the inverse kinematics may miss, in metres.
REACHED = 2e-9
# The damping of the inverse kinematics.
_DAMPING = 1e-12
# The number of steps of the inverse kinematics.
_STEPS = 25
# The largest half width of the first intervals, in radians or metres. Those that are too
# wide are halved later: it mainly changes how long that takes.
_WIDEST_HALF_WIDTH = 0.25


class Rows:
    """A dataclass of arrays of one length: some of their rows, or those of several together."""

    def __getitem__(self, which: BoolArray | IntArray | slice) -> Self:
        """Return some of the rows."""
        return type(self)(*(column[which] for column in vars(self).values()))

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Return the rows of all parts, of which there is one at least."""
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(np.concatenate(column) for column in columns))


@dataclass(frozen=True, eq=False)
class Pairs(Rows):
    """Cubes of positions, each with an interval of positions of the joint that is locked.

    Attributes
    ----------
    cube
        The number of the cube.
    centre, width
        Its middle, shape (k, m), and half width, (k,), in metres.
    joint, middle, half
        The joint that is locked, or n before a failure; and the middle and half width of the
        interval of its positions, in radians or metres; each of shape (k,).
    q
        Configurations that reach the middles, shape (k, n); NaN where none is known.
    """

    cube: IntArray
    centre: FloatArray
    width: FloatArray
    joint: IntArray
    middle: FloatArray
    half: FloatArray
    q: FloatArray

    def __len__(self) -> int:
        return len(self.joint)


class KeptProofs:
    """Tries to prove of pairs that every position is reached with the joint locked anywhere."""

    def __init__(self, arm: Chain, limits: Ranges) -> None:
        #: Between which positions a joint locks, (n + 1, 2); the last row is no failure.
        self.arm, self.ends = arm, np.array([*limits, (0.0, 0.0)])
        self.rows = [0, 1] if is_planar(arm) else [0, 1, 2]
        self.n = len(arm.joints)
        self.slides = np.array([joint.prismatic for joint in arm.joints])
        physical = opened(arm, *np.array(physical_ranges(arm)).T)
        artificial = opened(arm, *np.array(limits).T)
        #: Limits of the joints, shape (n + 1, n): after the failure of each, and before.
        self.lower, self.upper = (
            np.array([*[after] * self.n, before])
            for after, before in zip(physical, artificial, strict=True)
        )
        travels = self.slides * np.max(np.abs(physical_ranges(arm)), axis=1)
        #: The most that the tip is from the axis of each joint, in metres, shape (n,).
        self.far = np.cumsum((link_lengths(arm) + travels)[::-1])[::-1]

    def whole(self, centre: FloatArray, width: float) -> Pairs:
        """Return all pairs of cubes with intervals that cover the joints' artificial limits.

        `centre` has the middles of the cubes, (cubes, m), and `width` is their half width.
        """
        pieces = [
            1
            if k == self.n or idle_joints(self.arm)[k]
            else ceil((high - low) / (2 * _WIDEST_HALF_WIDTH)) or 1
            for k, (low, high) in enumerate(self.ends)
        ]
        joint = np.repeat(np.arange(self.n + 1), pieces)
        half = (np.diff(self.ends)[:, 0] / pieces / 2)[joint]
        place = np.concatenate([np.arange(count) for count in pieces])
        middle = self.ends[joint, 0] + (2 * place + 1) * half
        cube, own = np.indices((len(centre), len(joint))).reshape(2, -1)
        unknown = np.full((len(cube), self.n), np.nan)
        widths = np.full(len(cube), width)
        return Pairs(cube, centre[cube], widths, joint[own], middle[own], half[own], unknown)

    def reached(self, pairs: Pairs, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return configurations near a start, (n, k), and how far each misses its middle."""
        lower, upper = self._limits(pairs)
        target = pairs.centre.T

        def residual(which: Any, q: FloatArray) -> tuple[FloatArray, FloatArray]:
            tip, _, matrix = from_first_joint(self.arm).forward(q, range(3))
            missing, matrix = target[:, which] - tip[self.rows], matrix[self.rows]
            # A joint at a limit that is pushed outwards stays there, and the others do more.
            push = np.einsum("mnb,mb->nb", matrix, missing)
            low, high = q <= lower[:, which], q >= upper[:, which]
            return missing, np.where((low & (push < 0)) | (high & (push > 0)), 0.0, matrix)

        q, _ = damped_least_squares(
            residual,
            start,
            lower,
            upper,
            reached=REACHED / 2,
            damping=_DAMPING,
            steps=_STEPS,
            largest=1.0,
        )
        return q, np.linalg.norm(residual(slice(None), q)[0], axis=0)

    def _limits(self, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
        """Return the limits of the configurations, (n, k) each: equal if a joint is locked."""
        lower, upper = self.lower[pairs.joint].T, self.upper[pairs.joint].T
        at = np.flatnonzero(pairs.joint < self.n)
        lower[pairs.joint[at], at] = upper[pairs.joint[at], at] = pairs.middle[at]
        return lower, upper

    def drawn_from(self, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
        """Return between which positions of the joints, (n, k) each, to look for solutions."""
        lower, upper = self._limits(pairs)
        least, most = np.maximum(lower, -2 * np.pi), np.minimum(upper, 2 * np.pi)
        return np.where(np.isinf(lower), -np.pi, least), np.where(np.isinf(upper), np.pi, most)

    def hold(self, pairs: Pairs) -> tuple[BoolArray, FloatArray, BoolArray]:
        """Return of which pairs the test holds, how hard it was, and whether θ made it so.

        Each has the shape (k,). Hardness, no unit, only compares configurations of a pair: the
        bend of f beside the cube's half width or, if larger, the share of a joint's room to its
        limits that is spent.
        """
        at, joint = np.flatnonzero(pairs.joint < self.n), pairs.joint
        joint = joint[at]
        axes, origins, tip, _ = from_first_joint(self.arm).frames(pairs.q.T)
        arms = crosses(axes, tip - origins)
        columns = np.where(self.slides[:, None, None], axes, arms)
        room = np.minimum(pairs.q - self.lower[pairs.joint], self.upper[pairs.joint] - pairs.q)
        room[at, joint] = np.inf
        moves, defect, regular = self._moves(columns, room, at, joint)
        second, third = self._curvatures(axes, columns, moves)
        missing = np.linalg.norm(tip[self.rows] - pairs.centre.T, axis=0) + _ROUNDING
        size = np.abs(moves)
        x = np.column_stack([*[pairs.width] * len(self.rows), pairs.half])
        r, distance = np.zeros_like(x), np.linalg.norm(arms, axis=1).T
        for _ in range(_WIDENINGS):
            wide = x + r
            move = np.einsum("bnk,bk->bn", size, wide)
            curved = second + np.einsum("bijkl,bl->bijk", third, wide)
            image = np.einsum("bikl,bk,bl->bi", curved, wide, wide)
            image += np.einsum("bik,bk->bi", defect, wide)
            image += (missing + self._fourth_order(move, distance))[:, None]
            holds = np.all(image <= r[:, :-1], axis=1)
            r[:, :-1] = np.where(
                holds[:, None], r[:, :-1], np.minimum(_WIDENED * image, _LARGEST_R_M)
            )
        # A joint that does not move may be at its limit.
        holds &= regular & np.all(
            (move <= room - _ROUNDING) | ((move == 0) & (room >= 0)), axis=1
        )
        by_cube = np.einsum("bnk,bk->bn", size[:, :, :-1], x[:, :-1])
        by_angle = size[:, :, -1] * x[:, -1:]
        bent = np.einsum("bikl,bk,bl->bi", second, x, x).max(axis=1) / pairs.width
        spent = (by_cube + by_angle) / np.maximum(room, _ROUNDING)
        hard = np.where(regular, np.maximum(bent, spent.max(axis=1)), np.inf)
        return holds, hard, by_angle.sum(axis=1) > by_cube.sum(axis=1)

    def _moves(
        self, columns: FloatArray, room: FloatArray, at: IntArray, joint: IntArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return U, (k, n, m + 1), what J U misses, (k, m, m + 1), and where Y is good, (k,).

        `columns` is J, (n, 3, k); `room` is what is left to the limits, (k, n); `at` has the
        numbers of the pairs in which a joint is locked, and `joint` those joints. With J
        without the locked column and W the weights of joints, Y = W Jᵀ (J W Jᵀ)⁻¹: joints near
        their limits move less.
        """
        full = np.moveaxis(columns[:, self.rows], 2, 0).swapaxes(1, 2)
        jacobian, own = full.copy(), np.zeros(full.shape[:2])
        jacobian[at, :, joint] = 0.0
        own[at] = full[at, :, joint]
        weighted = jacobian * np.clip(room, 0.0, _FREE_DISTANCE)[:, None] / _FREE_DISTANCE
        gram = weighted @ jacobian.swapaxes(1, 2)
        regular = np.linalg.eigvalsh(gram)[:, 0] > _LEAST_SIGMA**2
        gram[~regular] = np.eye(len(self.rows))
        inverse = np.linalg.solve(gram, weighted).swapaxes(1, 2)
        moves = np.concatenate([inverse, -inverse @ own[:, :, None]], axis=2)
        moves[at, joint, -1] += 1.0
        defect = full @ moves
        defect[:, :, :-1] -= np.eye(len(self.rows))
        return moves, np.abs(defect), np.asarray(regular)

    def _curvatures(
        self, axes: FloatArray, columns: FloatArray, moves: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return |H(U_k, U_l)|/2 and |T(U_k, U_l, U_o)|/6, shape (k, m, m + 1, …).

        `axes` and `columns` of J have the shape (n, 3, k), `moves` is U, (k, n, m + 1).
        """
        count, n, wide = moves.shape
        m, turning = wide - 1, np.flatnonzero(~self.slides)
        second, third = np.zeros((count, m, n, n)), np.zeros((count, m, n, n, n))
        for b in turning:
            # ∂²f/∂q_b∂q_c = z_b × v_c and ∂³f/∂q_a∂q_b∂q_c = z_a × (z_b × v_c) for a ≤ b ≤ c.
            once = crosses(axes[b], columns[b:])
            second[:, :, b, b:] = second[:, :, b:, b] = self._relevant_rows(once)
            for a in turning[turning <= b]:
                twice = self._relevant_rows(crosses(axes[a], once))
                for i, j in {(a, b), (b, a)}:
                    third[:, :, i, j, b:] = third[:, :, i, b:, j] = twice
                    third[:, :, b:, i, j] = twice
        across = moves.swapaxes(1, 2)[:, None]
        bent = (across[:, None] @ third @ moves[:, None, None]).reshape(count, m, n, wide**2)
        cubic = (across @ bent).reshape(count, m, wide, wide, wide)
        return np.abs(across @ second @ moves[:, None]) / 2, np.abs(cubic) / 6

    def _relevant_rows(self, vectors: FloatArray) -> FloatArray:
        """Return the rows that count of vectors (c, 3, k), shape (k, m, c)."""
        return np.moveaxis(vectors[:, self.rows], 2, 0).swapaxes(1, 2)

    def _fourth_order(self, move: FloatArray, distance: FloatArray) -> FloatArray:
        """Bound the terms of fourth order, (k,), by moves and distances from axes, (k, n)."""
        shift = np.where(self.slides, move, move * self.far)
        beyond = np.cumsum(shift[:, :0:-1], axis=1)[:, ::-1]
        far = np.minimum(distance + np.pad(beyond, ((0, 0), (0, 1))), self.far)
        sums = np.cumsum(np.where(self.slides, 0.0, move), axis=1)
        turned = far * np.diff(sums**4, axis=1, prepend=0.0)
        # The direction of a slider turns with three joints before it.
        slid = np.where(self.slides, 4 * move * sums**3, 0.0)
        return np.asarray(np.sum(turned + slid, axis=1) / 24)
