"""Configurations at the samples of a path, and the best sequence of one at each.

Each configuration is a node. Its score is the number of joints that may lock there, by the test
in `survival`; or by an estimate until it is tested. Where links have to stay apart, a test in
which they must not touch takes ten times as long: only nodes of a best sequence have it, which
is then chosen again, until it has no other nodes.

The arm has n joints and the path N samples; B is a number of nodes. Positions are in radians,
those of sliders in metres.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.following import JUMP
from lockedjoint.paths.near_pairs import near_pairs
from lockedjoint.paths.survival import survivors
from lockedjoint.paths.waypoints import Poses, place_name

# Motion between two samples costs so many surviving joints per squared radian, and per squared
# metre of a slider.
_JOINTS_PER_SQUARED_RAD_OR_M = 2.0
# Speeds stay below this share of their limits.
_SPEED_SHARE = 0.98
# Nodes with an estimate are tested if they are this near to the best sequence.
_BESIDE_M_OR_RAD = 0.3
# So many of the best nodes of each sample are tested.
_TESTED_BEST = 12
# So many nodes of each sample that survive a joint's failure are tested, for each joint.
_TESTED_OF_EACH = 8
# A node is far from a sequence if one of its joints is at least this far away.
_ELSEWHERE_M_OR_RAD = 1.0
# Points are added between at most so many pairs of nodes at a sample.
_MOST_PAIRS = 4
# Points lie at these shares of the way between the two nodes of a pair.
_PLACES_BETWEEN = (0.25, 0.5, 0.75)
# An error of a path that no trajectory follows allows this.
_ONE_TRAJECTORY = "a path that one trajectory follows within the joints' limits"


class Nodes:
    """The nodes at each sample, with what is left of the path after each joint's failure.

    Parameters
    ----------
    arm, poses, places
        The arm, the samples, and where they are on the path, see `ToolPath.sampled`.
    most
        Largest motion of each joint between two samples, shape (N - 1, n).
    seed
        Of the test in `survival`.
    motion
        Where links have to stay apart: what tells whether they do.
    after_failure
        The chain after a failure, without artificial limits; by default as before.
    """

    def __init__(
        self,
        arm: RobotArm,
        poses: Poses,
        places: FloatArray,
        most: FloatArray,
        seed: int,
        motion: ClearMotion | None = None,
        after_failure: Chain | None = None,
    ) -> None:
        self._chain = chain = arm.chain
        self._after_failure = after_failure or chain
        self._names, self._motion = arm.chain.names, motion
        # Links touch between the two nodes of these pairs, which follow one another.
        self._barred: set[tuple[int, int]] = set()
        self._poses, self._places, self._most, self._seed = poses, places, most, seed
        #: True if the self-motion of a sample is made of curves, see `SelfMotionMap`.
        self.mapped = arm.size == len(poses.rows) + 1
        self._turns = chain.whole_turns & self.mapped
        self._q = np.zeros((arm.size, 0))
        # Each node has a sample, and the last sample that the arm reaches after each failure.
        self._samples = np.zeros(0, dtype=int)
        self._ends = np.zeros((arm.size, 0), dtype=int)
        # The entries of `_ends` are estimates where a node was not tested.
        self._tested = np.zeros(0, dtype=bool)
        # Whether links stay apart in the test, too. Only nodes that were tested can be cleared.
        self._cleared = np.zeros(0, dtype=bool)

    @property
    def tests_at_once(self) -> bool:
        """Whether nodes that are added are tested at once.

        If not, only those of sequences and near them are tested, and others by `test_best`.
        """
        return self.mapped or self._motion is None

    @property
    def count(self) -> int:
        """How many nodes were tested, at all samples together."""
        return int(np.sum(self._tested))

    def at(self, sample: int) -> FloatArray:
        """Return the nodes at a sample, shape (n, B)."""
        return self._q[:, self._samples == sample]

    def survives(self, sample: int) -> BoolArray:
        """Whether a test finished the path after joint f locked at each node, shape (n, B)."""
        return (self._finished & self._tested)[:, self._samples == sample]

    def apart(self, q: FloatArray, other: FloatArray) -> FloatArray:
        """Return q - other, both (n, B), without whole turns where those do not count."""
        return self._chain.turned(q - other) if self.mapped else q - other

    def add(
        self, samples: IntArray, nodes: FloatArray, estimated: IntArray | None = None
    ) -> None:
        """Add configurations as nodes, each at its sample.

        Without an estimate nodes are tested at once, or, where that would take long (links,
        not mapped), get as an estimate what the test gives when links may touch. Nodes at which
        links or obstacles are too near are left out.

        Parameters
        ----------
        samples
            The sample of each node, shape (B,).
        nodes
            The configurations, shape (n, B), in radians or metres.
        estimated
            An estimate of the last sample that is reached after each failure, shape (n, B).
        """
        if self._motion is not None:
            kept = self._motion.clearance.is_kept(nodes)
            samples, nodes = samples[kept], nodes[:, kept]
            estimated = None if estimated is None else estimated[:, kept]
        if estimated is None and not self.tests_at_once:
            estimated = survivors(self._after_failure, nodes, samples, self._poses, self._seed)
        tested = np.zeros(len(samples), dtype=bool)
        ends = np.zeros(nodes.shape, dtype=int) if estimated is None else estimated
        self._q = np.concatenate([self._q, nodes], axis=1)
        self._samples = np.concatenate([self._samples, samples])
        self._ends = np.concatenate([self._ends, ends], axis=1)
        self._tested = np.concatenate([self._tested, tested])
        self._cleared = np.concatenate([self._cleared, tested])
        if estimated is None:
            self._test(np.arange(len(self._samples) - len(samples), len(self._samples)))

    def add_tracks(self, tracks: FloatArray) -> None:
        """Add tracks, shape (N, n, B), NaN where they have no configuration."""
        samples, which = np.nonzero(np.isfinite(tracks[:, 0]))
        self.add(samples, tracks[samples, :, which].T)

    def test_best(self) -> None:
        """Test nodes that have, by the estimate, most survivors, and some for each joint."""
        finished, chosen = self._finished, []
        for sample in range(len(self._poses)):
            here = np.flatnonzero(self._samples == sample)
            own = finished[:, here]
            total = own.sum(axis=0)
            best = total == total.max(initial=0)
            for row, most in ((best, _TESTED_BEST), *((each, _TESTED_OF_EACH) for each in own)):
                where = here[row]
                # Neighbours on a curve are alike, and its ends are less sure.
                spread = (np.arange(most) + 0.5) / most * len(where)
                chosen.append(where[spread.astype(int)] if len(where) else where)
        self._test(np.unique(np.concatenate(chosen)))

    def between(self) -> tuple[IntArray, FloatArray]:
        """Return points between near nodes that together survive more than any node there.

        By tests and estimates; a few at each sample: the samples, (B,), and points, (n, B).
        """
        samples, points = [], [self._q[:, :0]]
        near, finished = np.full(len(self._q), _BESIDE_M_OR_RAD), self._finished
        for sample in range(len(self._poses)):
            own = np.flatnonzero(self._samples == sample)
            most = np.max(np.sum(self.survives(sample), axis=0), initial=0)
            first, second = near_pairs(self._q[:, own], None, near, self._turns)
            both = np.sum(finished[:, own[first]] | finished[:, own[second]], axis=0)
            more = np.flatnonzero(both > most)
            best = own[
                np.stack([first, second])[:, more[np.argsort(-both[more])[:_MOST_PAIRS]]]
            ]
            start = self._q[:, best[0]]
            way = self.apart(self._q[:, best[1]], start)
            points += [start + share * way for share in _PLACES_BETWEEN]
            samples += [np.full(best.shape[1] * len(_PLACES_BETWEEN), sample)]
        return np.concatenate(samples), np.concatenate(points, axis=1)

    def best_sequence(
        self, tested: bool = False, apart_from: FloatArray | None = None
    ) -> FloatArray:
        """Return the sequence of largest total score and little motion, shape (N, n).

        Of all nodes, or of those that were tested, or that are far from another sequence. If
        some of its nodes were not tested, they are, with those beside it, and it is chosen
        again; likewise without the steps on which links touch. InputError if no sequence keeps
        to the largest motions.
        """
        chosen = self._tested if tested else np.ones(len(self._samples), dtype=bool)
        if apart_from is not None:
            off = np.abs(self.apart(self._q, apart_from[self._samples].T))
            chosen = chosen & (np.max(off, axis=0) > _ELSEWHERE_M_OR_RAD)
        at = [np.flatnonzero(chosen & (self._samples == k)) for k in range(len(self._poses))]
        for k in (k for k, own in enumerate(at) if not own.size):
            allowed = "a path that can be followed with links apart"
            where = place_name(float(self._places[k]))
            raise InputError(where, "reached with links or obstacles too near only", allowed)
        steps = [self._steps(k, *pair) for k, pair in enumerate(pairwise(at))]
        while True:
            best = self._best_nodes(at, steps)
            if not self._tested[best].all():
                off = np.abs(self.apart(self._q, self._q[:, best][:, self._samples]))
                unsure = ~self._tested[best][self._samples]
                self._test(np.flatnonzero(unsure & (np.max(off, axis=0) < _BESIDE_M_OR_RAD)))
                continue
            if self._motion is not None and not self._cleared[best].all():
                self._test(best, with_links=True)
                continue
            sequence = self._turned_on(self._q[:, best])
            if self._motion is None:
                return sequence
            clear = self._motion.clear(sequence[:-1].T, sequence[1:].T)
            if clear.all():
                return sequence
            first, second = best[:-1][~clear].tolist(), best[1:][~clear].tolist()
            self._barred.update(zip(first, second, strict=True))

    @property
    def _finished(self) -> BoolArray:
        """Whether each failure is survived, as tested or estimated, shape (n, B)."""
        return np.asarray(self._ends == len(self._poses) - 1)

    def _test(self, nodes: IntArray, with_links: bool = False) -> None:
        """Test those of some nodes that were not, perhaps with links that stay apart."""
        with_links = self._motion is not None and (with_links or not self.mapped)
        nodes = nodes[~(self._cleared if with_links else self._tested)[nodes]]
        if not len(nodes):
            return
        allowed = None if self._motion is None or not with_links else self._motion.clear
        given = self._q[:, nodes], self._samples[nodes], self._poses
        ends = survivors(self._after_failure, *given, seed=self._seed, allowed=allowed)
        # What is not reached when links may touch is not reached either when they must not.
        known = np.where(self._tested[nodes], self._ends[:, nodes], len(self._poses))
        self._ends[:, nodes] = np.minimum(ends, known)
        self._tested[nodes] = True
        self._cleared[nodes] |= with_links

    def _steps(
        self, sample: int, now: IntArray, later: IntArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the steps from nodes at a sample to nodes at the next, and what they cost.

        Which of these nodes they lead from, and to which of those, shape (B,) each.
        """
        before, after = self._q[:, now], self._q[:, later]
        limits = np.minimum(_SPEED_SHARE * self._most[sample], JUMP)
        source, target = near_pairs(before, after, limits, self._turns)
        if not len(source):
            raise self._gap(before, after, sample)
        motion = self.apart(after[:, target], before[:, source])
        return source, target, _JOINTS_PER_SQUARED_RAD_OR_M * np.sum(motion**2, axis=0)

    def _best_nodes(
        self, at: list[IntArray], steps: list[tuple[IntArray, IntArray, FloatArray]]
    ) -> IntArray:
        """Return the nodes of the best sequence as it is known now, shape (N,).

        Dynamic programming over samples: value[k] is the best total score of a sequence that
        ends at node k of the present sample. `origin` is the node before each node.

        Parameters
        ----------
        at
            The nodes that may be chosen at each sample, by their numbers.
        steps
            The `_steps` from each sample to the next.
        """
        scores, origin = np.sum(self._finished, axis=0), np.zeros(len(self._samples), dtype=int)
        value = scores[at[0]].astype(float)
        for k, ((now, later), (source, target, cost)) in enumerate(
            zip(pairwise(at), steps, strict=True)
        ):
            total = value[source] - cost
            if self._barred:
                pairs = zip(now[source].tolist(), later[target].tolist(), strict=True)
                total[[pair in self._barred for pair in pairs]] = -np.inf
            order = np.lexsort((-source, total, target))  # the best of each target comes last
            order = order[np.append(np.diff(target[order]) > 0, True)]
            best = target[order]
            origin[later[best]] = now[source[order]]
            value = np.full(len(later), -np.inf)
            value[best] = total[order] + scores[later[best]]
            if not np.any(np.isfinite(value)):
                raise self._gap(self._q[:, now], self._q[:, later], k)
        sequence = [at[-1][np.argmax(value)]]
        while len(sequence) < len(at):
            sequence.append(origin[sequence[-1]])
        return np.array(sequence[::-1])

    def _turned_on(self, q: FloatArray) -> FloatArray:
        """Add the turns that make a sequence (n, N) continuous; return it as (N, n).

        InputError if a joint then turns beyond its limits.
        """
        chain = self._chain
        steps = self.apart(q[:, 1:], q[:, :-1])
        whole = np.cumsum(np.concatenate([q[:, :1], steps], axis=1), axis=1)
        # `centre` is the middle of each joint's motion, less the middle of its range. A joint
        # for which whole turns do not count is moved by the turns that make it smallest.
        centre = (whole.min(axis=1) + whole.max(axis=1))[:, None] / 2 - chain.mid_range[:, None]
        whole -= centre - np.where(self._turns, chain.turned(centre), centre)
        inside = (whole >= chain.lower - 1e-9) & (whole <= chain.upper + 1e-9)
        for name in np.array(self._names)[~inside.all(axis=1)]:
            raise InputError("path", f"turns {name} beyond its limits", _ONE_TRAJECTORY)
        return np.asarray(np.clip(whole, chain.lower, chain.upper).T)

    def _gap(self, before: FloatArray, after: FloatArray, sample: int) -> InputError:
        """Say why no sequence passes from a sample on: the limits of speed, or of position."""
        where, most = place_name(float(self._places[sample + 1])), self._most[sample]
        off = [np.abs(self.apart(after, point[:, None])) / most[:, None] for point in before.T]
        nearest = min((ratio[:, np.argmin(np.max(ratio, axis=0))] for ratio in off), key=np.max)
        least = float(np.max(nearest))
        if least > _SPEED_SHARE:
            name = self._names[int(np.argmax(nearest))]
            more = f"at least {1.1 * least:.3g} times as much time there"
            share = f"{least:.3g} times its limit"
            return InputError(f"speed of {name} at {where}", share, more)
        return InputError(where, "reached from no configuration before it", _ONE_TRAJECTORY)
