"""The joint trajectory from which a path can most often be finished after a joint locks.

1. Configurations along the path. An arm with one joint more than the task needs: all of them,
   see `SelfMotionMap`. Other arms: tracks of configurations at several samples, found by
   inverse kinematics from random starts, which follow the path both ways. Some stay near
   minimum norm, some drift towards the middle of the joints' ranges.
2. Every configuration is a node, see `nodes`. Dynamic programming over the nodes finds the
   sequence of the largest total score, with joint speeds within their limits, and little
   motion. Then again with nodes beside it, and between nodes that survive different failures.
3. Means over neighbouring samples make it smooth. They are tested, and kept only if the share
   that survives rises, or if it stays and the trajectory is smoother.

The arm has n joints and the path N samples; B is a number of configurations, (n, B), in radians
or metres. A sequence or track is one configuration at each sample, (N, n); several have the
shape (N, n, B).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.kinematics.chain import narrowed
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.pose import asks_for_millimetres
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step
from lockedjoint.paths.following import follow
from lockedjoint.paths.nearest_pose import nearest_pose
from lockedjoint.paths.nodes import Nodes
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.plan import PathPlan, Trajectory
from lockedjoint.paths.self_motion_map import SelfMotionMap
from lockedjoint.paths.survival import on_path, survivors
from lockedjoint.paths.waypoints import ToolPath, at_waypoints, place_name

# Inverse kinematics has so many random starts at each waypoint.
_WAYPOINT_STARTS = 30
# Inverse kinematics has so many random starts at the first sample of the track of minimum norm.
_FIRST_STARTS = 200
# Inverse kinematics has so many random starts where the path may be out of reach.
_REACH_STARTS = 2000
# This share of the search is done when all tracks are followed.
_FOLLOWED_SHARE = 0.4
# This share of the search is done when the last round ends.
_COMBINED_SHARE = 0.8
# Inverse kinematics has so many random starts at every other sample in the end.
_SCATTERED_STARTS = 60
# A track turns aside to a better node and back over so many samples each way.
_ASIDE_SAMPLES = np.array([4.0, 12.0])
# Tracks begin at so many samples.
_ANCHOR_SAMPLES = 5
# The deviation is measured at the ends of so many parts between two samples.
_PARTS_BETWEEN = 8
# Means of these widths, in samples, make a sequence smooth.
_MEAN_SAMPLES = (0.5, 1.0, 2.0, 4.0)
# A round tries tracks beside the best sequence: their number is that of tracks over this.
_TRACKS_PER_PUSH = 24
# Inverse kinematics has so many iterations for configurations near a sequence.
_BESIDE_ITERATIONS = 12
# A track beside a sequence starts at least so far away, as a Euclidean length over all joints.
_LEAST_PUSH_M_OR_RAD = 0.02
# A track beside a sequence starts at most so far away.
_LARGEST_PUSH_M_OR_RAD = 0.3
# Random starts at an anchor for each track: where not all reach the path, enough are left.
_STARTS_PER_TRACK = 6
# At each sample half of the tracks go this share of the way to the middle of joints' ranges.
_CENTRE_SHARE = 0.05
# A node is at a configuration if no joint differs by more: rounding.
_SAME_M_OR_RAD = 1e-9
# Squared lengths are at least this, so that samples at one place are not divided by 0.
_LEAST_SQUARED_LENGTH_M2 = 1e-300
# Shares in percent are the same if they agree to so many decimals: then the smoother way wins.
_SHARE_DECIMALS = 9


class Planner:
    """One search: the arm, the samples, and all nodes so far."""

    def __init__(
        self,
        arm: RobotArm,
        path: ToolPath,
        search: PathSearch,
        clearance: LinkClearance | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.search = search
        # Artificial limits are released after a failure.
        self.after_failure = arm.chain
        self.arm = arm = replace(arm, chain=narrowed(arm.chain, limits or {}, "limits"))
        self.times, poses, self.places = path.sampled(search.samples, search.duration)
        self.poses = replace(poses, rows=arm.task.rows)
        velocity = np.array([joint.velocity for joint in arm.chain.joints])
        #: Joints may move by at most this between two samples, shape (N - 1, n).
        self.most = velocity * np.diff(self.times)[:, None]
        self.motion = None if clearance is None else ClearMotion(clearance, arm.chain)
        self.nodes = Nodes(
            arm,
            self.poses,
            self.places,
            self.most,
            search.seed,
            self.motion,
            self.after_failure,
        )
        self.rng = np.random.default_rng(search.seed)

    def plan(self) -> PathPlan:
        """Search; see `plan_path` in `search` for what is raised."""
        search, nodes, complete = self.search, self.nodes, True
        self.check_reach()
        search.progress(Step("configurations along the path", 0.0))
        minimum_norm = self._add_map() if nodes.mapped else self._add_candidates()
        search.progress(Step("dynamic programming", _FOLLOWED_SHARE))
        sequence = nodes.best_sequence()
        base = [] if minimum_norm is None else [minimum_norm]
        try:
            for number in range(search.rounds):
                self._add_beside(sequence)
                if not nodes.mapped:
                    with suppress(InputError):  # there may be no other
                        other = nodes.best_sequence(nodes.tests_at_once, apart_from=sequence)
                        self._add_beside(other)
                sequence = nodes.best_sequence(tested=nodes.tests_at_once)
                search.progress(Step("dynamic programming", self._share(number + 1)))
            if not nodes.mapped:
                # Random starts find configurations that no track led to.
                every_other = np.repeat(np.arange(0, len(self.times), 2), _SCATTERED_STARTS)
                nodes.add(*self._on_path(every_other))
            search.progress(Step("polish", _COMBINED_SHARE))
            measured = self._measured(*base, sequence, *self._smoothed(sequence))
        except KeyboardInterrupt:  # the best sequence so far is an answer, too
            complete = False
            measured = self._measured(*base, sequence)
        least = measured.pop(0) if base else None
        candidates = measured
        if least is not None and self._may_be_gone(least.configurations):
            candidates = [*measured, least]
        planned = max(
            candidates, key=lambda way: (round(way.share, _SHARE_DECIMALS), -way.roughness)
        )
        q, limited = planned.configurations, np.isfinite(self.most).any()
        return PathPlan(
            joints=self.arm.chain.names,
            times=self.times,
            places=self.places,
            poses=self.poses,
            planned=planned,
            minimum_norm=least,
            **self._best_of_samples(planned.survives),
            nodes=nodes.count,
            polished=planned is not measured[0],
            deviation=self._deviation(q),
            speed=float(np.max(np.abs(np.diff(q, axis=0)) / self.most)) if limited else None,
            closest=None if self.motion is None else self.motion.closest(q),
            complete=complete,
            units=tuple(joint.unit for joint in self.arm.chain.joints),
        )

    def _deviation(self, q: FloatArray) -> float:
        """Return the largest distance of the tool from the path, at samples and between.

        By the directions of the task, where joints move evenly from sample to sample.
        """
        shares = np.linspace(0.0, 1.0, _PARTS_BETWEEN + 1)[:, None, None]
        between = (q[:-1] + shares * (q[1:] - q[:-1])).reshape(-1, q.shape[1])
        places, _ = self.arm.chain.tip_at(between.T)
        rows = [row for row in self.arm.task.rows if row < 3]
        if not rows:
            return 0.0
        corners = self.poses.positions[:, rows]
        tool = places[rows].T.reshape(_PARTS_BETWEEN + 1, len(q) - 1, len(rows))
        ways = np.diff(corners, axis=0)
        along = np.sum((tool - corners[:-1]) * ways, axis=2)
        share = np.clip(
            along / np.maximum(np.sum(ways**2, axis=1), _LEAST_SQUARED_LENGTH_M2), 0.0, 1.0
        )
        off = tool - corners[:-1] - share[..., None] * ways
        # Samples have to be where the path has them.
        ends = tool[[0, -1]] - np.stack([corners[:-1], corners[1:]])
        return float(max(np.max(np.linalg.norm(part, axis=2)) for part in (off, ends)))

    def _share(self, rounds: int) -> float:
        """Return which share of all is done after so many rounds of dynamic programming."""
        return (
            _FOLLOWED_SHARE + (_COMBINED_SHARE - _FOLLOWED_SHARE) * rounds / self.search.rounds
        )

    def check_reach(self) -> None:
        """Raise InputError if a waypoint is out of reach."""
        waypoints = at_waypoints(self.places)
        reached, _ = self._on_path(np.repeat(waypoints, _WAYPOINT_STARTS))
        for sample in np.setdiff1d(waypoints, reached).tolist():
            self._reachable(sample)

    def _on_path(self, samples: IntArray) -> tuple[IntArray, FloatArray]:
        """Move a random start to each sample; those reached, (B,), and where, (n, B)."""
        return on_path(self.arm.chain, self.poses, samples, self.rng)

    def _starts(self, sample: int, count: int) -> FloatArray:
        """Return configurations at a sample from so many random starts, (n, B)."""
        return self._on_path(np.full(count, sample))[1]

    def _reachable(self, sample: int) -> FloatArray:
        """Return configurations at a sample from many starts; InputError if there is none."""
        q = self._starts(sample, _REACH_STARTS)
        if q.shape[1]:
            return q[:, : self.search.tracks]
        where = place_name(float(self.places[sample]))
        position = ", ".join(f"{x:.4g}" for x in self.poses.positions[sample])
        pose = "a pose" if max(self.poses.rows) > 2 else "a position"
        limits = "that the arm reaches within its joints' limits"
        wrong_unit = asks_for_millimetres(self.poses.positions[sample], "name the column x_mm")
        if wrong_unit:
            limits += wrong_unit
        else:
            near = nearest_pose(self.arm.chain, self.poses.at(sample), self.rng)
            limits += f"; the nearest found, which is no proof, is {near}"
        raise InputError(where, f"out of reach at ({position}) m", f"{pose} {limits}")

    def _add_map(self) -> FloatArray | None:
        """Add points of all self-motion curves; return the track of minimum norm, (N, n)."""
        whole = SelfMotionMap(self.arm.chain, self.poses, self.rng)
        for sample, ends in enumerate(whole.ends()):
            points = whole.points(sample) if ends.size else self._reachable(sample)
            self._add_at(sample, points, ends if ends.size else None)
            self._tell_followed(sample + 1, len(self.times))
        self.nodes.test_best()
        return self._minimum_norm(self._starts(0, _FIRST_STARTS))

    def _add_candidates(self) -> FloatArray | None:
        """Add the first tracks; return the track of minimum norm, shape (N, n)."""
        anchors = np.unique(np.linspace(0, len(self.times) - 1, _ANCHOR_SAMPLES).astype(int))
        per_anchor = -(-self.search.tracks // len(anchors))
        half = (per_anchor + 1) // 2
        minimum_norm = None
        for number, anchor in enumerate(anchors.tolist()):
            self._tell_followed(number, len(anchors))
            starts = self._starts(anchor, _STARTS_PER_TRACK * per_anchor)
            for part, centre in (
                (starts[:, :half], 0.0),
                (starts[:, half:per_anchor], _CENTRE_SHARE),
            ):
                given = self.arm.chain, part, self.poses, anchor
                track, _ = follow(*given, centre=centre)
                track[:anchor] = follow(*given, step=-1, centre=centre)[0][:anchor]
                self.nodes.add_tracks(track)
            if anchor == 0:
                minimum_norm = self._minimum_norm(starts)
        for sample in range(len(self.times)):
            if not self.nodes.at(sample).size:
                self._add_at(sample, self._reachable(sample))
        return minimum_norm

    def _tell_followed(self, count: int, whole: int) -> None:
        """Tell the user that so many of the whole number of parts are followed."""
        share = _FOLLOWED_SHARE * count / whole
        self.search.progress(Step("configurations along the path", share))

    def _add_at(self, sample: int, q: FloatArray, ends: IntArray | None = None) -> None:
        """Add configurations (n, B) at one sample, with estimates (n, B), see `Nodes.add`."""
        self.nodes.add(np.full(q.shape[1], sample), q, ends)

    def _minimum_norm(self, starts: FloatArray) -> FloatArray | None:
        """Return the track that completes the path from the start nearest mid-range, (N, n)."""
        lower, upper = self.arm.bounds
        widths = np.where(np.isfinite(upper - lower), upper - lower, 2 * np.pi)
        off = (starts - self.arm.chain.mid_range[:, None]) / widths[:, None]
        order = np.argsort(np.sum(off**2, axis=0))
        track, last = follow(self.arm.chain, starts[:, order], self.poses, 0)
        whole = np.flatnonzero(last == len(self.times) - 1)
        return track[:, :, whole[0]] if whole.size else None

    def _add_beside(self, sequence: FloatArray) -> None:
        """Add configurations beside a sequence, (N, n), in part towards better nodes."""
        count = -(-self.search.tracks // _TRACKS_PER_PUSH)  # rounded up
        push = self.rng.normal(size=(sequence.shape[1], count))
        lengths = self.rng.uniform(_LEAST_PUSH_M_OR_RAD, _LARGEST_PUSH_M_OR_RAD, count)
        push *= lengths / np.linalg.norm(push, axis=0)
        tracks = np.concatenate(
            [sequence[:, :, None] + push, *_means(sequence), *self._aside(sequence)], axis=2
        )
        samples, which = np.nonzero(np.isfinite(tracks[:, 0]))
        others, between = self.nodes.between()
        starts = np.concatenate([tracks[samples, :, which].T, between], axis=1)
        samples = np.concatenate([samples, others])
        starts = np.clip(starts, self.arm.chain.lower, self.arm.chain.upper)
        q, reached = solve_ik(
            self.arm.chain, starts, self.poses.at(samples), iterations=_BESIDE_ITERATIONS
        )
        self.nodes.add(samples[reached], q[:, reached])

    def _aside(self, sequence: FloatArray) -> Iterator[FloatArray]:
        """Yield ways to the nearest of the best nodes of samples and back, (N, n, widths)."""
        samples = np.arange(len(sequence))
        for sample, point in enumerate(sequence):
            total = np.sum(self.nodes.survives(sample), axis=0)
            off = self.nodes.apart(self.nodes.at(sample), point[:, None])
            off = off[:, total == np.max(total, initial=0)]
            distance = np.max(np.abs(off), axis=0)
            if np.min(distance, initial=np.inf) > _SAME_M_OR_RAD:  # not there already
                share = 1 - np.abs(samples - sample)[:, None, None] / _ASIDE_SAMPLES
                share[share <= 0] = np.nan
                nearest = off[:, np.argmin(distance)]
                yield sequence[:, :, None] + share * nearest[:, None]

    def _smoothed(self, sequence: FloatArray) -> Iterator[FloatArray]:
        """Yield means of a sequence, (N, n), moved to the path, where they may be gone."""
        poses = self.poses.at(np.arange(len(sequence)))
        for mean in _means(sequence):
            q, reached = solve_ik(self.arm.chain, mean[:, :, 0].T, poses)
            if reached.all() and self._may_be_gone(q.T):
                yield q.T

    def _may_be_gone(self, q: FloatArray) -> bool:
        """Whether joints keep their speeds, and links are apart, along a track, (N, n)."""
        if not np.all(np.abs(np.diff(q, axis=0)) <= self.most):
            return False
        if self.motion is None:
            return True
        kept = self.motion.clearance.is_kept(q.T).all()
        return bool(kept and self.motion.clear(q[:-1].T, q[1:].T).all())

    def _measured(self, *tracks: FloatArray) -> list[Trajectory]:
        """Test the configurations of tracks, shape (N, n) each, all at once."""
        q, samples = np.concatenate(tracks), np.tile(np.arange(len(self.times)), len(tracks))
        # Links must not touch after a failure either.
        allowed = None if self.motion is None else self.motion.clear
        given = self.after_failure, q.T, samples, self.poses, self.search.seed
        parts = (q, survivors(*given, allowed).T, self.arm.worst_case(q)[0])
        split = (np.split(part, len(tracks)) for part in parts)
        return [Trajectory(*part) for part in zip(*split, strict=True)]

    def _best_of_samples(self, own: BoolArray) -> dict[str, Any]:
        """Return the last three results of `PathPlan` that look at samples one by one.

        `own` says which failures a trajectory survives, (N, n). Keys are names of fields of
        `PathPlan`: no trajectory through the nodes exceeds the two shares, in percent.
        """
        samples = range(len(self.times))
        nodes = [self.nodes.at(k) for k in samples]
        survives = [self.nodes.survives(k) for k in samples]
        best = [np.max(np.sum(here, axis=0)) for here in survives]
        single = np.array([np.any(here, axis=1) for here in survives]) | own
        # Ranges are reduced to what those of all later samples have in common.
        least = np.maximum.accumulate([np.min(q, axis=1) for q in reversed(nodes)])[::-1]
        largest = np.minimum.accumulate([np.max(q, axis=1) for q in reversed(nodes)])[::-1]
        turns = self.arm.chain.whole_turns.T & self.nodes.mapped
        apart = (least > largest) & ~single & ~turns
        share = np.mean(np.maximum(best, np.sum(own, axis=1)))
        return {
            "best_of_samples": 100 * float(share) / self.arm.size,
            "joint_best_of_samples": 100 * np.mean(single, axis=0),
            "unrecoverable_until": np.max(np.where(apart.T, samples, -1), axis=1),
        }


def _means(sequence: FloatArray) -> list[FloatArray]:
    """Return means over neighbours of a sequence, (N, n, 1) each."""
    means = [
        gaussian_filter1d(sequence, width, axis=0, mode="nearest") for width in _MEAN_SAMPLES
    ]
    return [mean[:, :, None] for mean in means]
