"""A path, or its rest, after failures: to its first pose, and along it.

Every configuration found at the first pose follows the samples of the path as `paths.survival`
does. The one that comes farthest is taken; a path of which not all is done is an answer with
the share that is, or with a proof that its next sample is out of reach.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.pose import Pose
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.progress import Step
from lockedjoint.paths.connecting import SearchLimit
from lockedjoint.paths.following import follow
from lockedjoint.paths.timing import TimedTrajectory, joined, off_lines
from lockedjoint.paths.waypoints import Poses, ToolPath, at_waypoints
from lockedjoint.recovery.answers import Recovery
from lockedjoint.recovery.checking import faults, tip_pose
from lockedjoint.recovery.configurations import GoalSearch
from lockedjoint.recovery.damaged_state import DamagedState
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.unreachable import ReachProof, prove_unreachable

# A path has few samples at first, and then many.
_SAMPLE_COUNTS = (60, 240)
# The tip must be this near to the path everywhere.
_NEAR_M = 1e-3
# The tool must be turned by no more than this from the path's orientation.
_TURNED_RAD = 5e-3
# Samples stay this far within the limits.
_INSIDE_M_OR_RAD = 2e-3
# Samples are followed this nearly.
_FOLLOWED_M_OR_RAD = 2e-5
# A path has a corner where the sine of the angle by which it turns is larger.
_CORNER_SINE = 0.05
# Proofs that a sample is out of reach are tried for so many of those that were not reached.
_MOST_PROOFS = 5
# So many first configurations follow the path at once.
_MOST_BEGINNINGS = 200
# Ways to so many of the first configurations are tried.
_MOST_WAYS = 4
# Joints go this share of the way to the middle of their ranges, where the arm still can: they
# meet their limits later.
_CENTRE_SHARE = 0.1


def recover_path(state: DamagedState, path: ToolPath) -> Recovery:
    """Follow a path from where a damaged arm is; see `recover`."""
    rng, tried = np.random.default_rng(state.search.seed), list[str]()
    poses, _ = _sampled(path, _SAMPLE_COUNTS[0])
    goals = [_goal(poses, k, path.has_orientation) for k in range(len(poses))]
    places = [GoalSearch(state.arm, goal, state.start) for goal in goals]
    done = 0

    def answer(verdict: str, proof: ReachProof | None, sample: int | None) -> Recovery:
        advice = places[min(done, len(goals) - 1)].help(rng, done / len(goals))
        return Recovery(verdict, tuple(tried), None, proof, sample, advice)

    rounds, tell = state.search.rounds, state.search.progress
    for number, (starts, boxes) in enumerate(rounds):
        tell(Step("along the path", number / len(rounds)))
        begins = places[0].at_goal(starts, rng)[:_MOST_BEGINNINGS]
        tried.append(f"{starts} starts: {len(begins)} configurations at its beginning")
        if len(begins):
            done, run = _along(state, path, begins, goals, tried)
            if run is not None:
                return Recovery("trajectory", tuple(tried), run)
        later = []
        if starts == state.search.starts and done < len(goals):
            later = np.unique(
                np.linspace(done, len(goals) - 1, _MOST_PROOFS).astype(int)
            ).tolist()
        elif not done:
            later = [0]
        tell(Step("proofs", (number + 0.5) / len(rounds)) if later else Step("along the path"))
        for k in later:
            proof = prove_unreachable(state.arm.chain, goals[k], boxes // len(later))
            if proof is not None:
                tried.append(f"a proof that sample {k + 1} is out of reach, {proof.grade}")
                return answer(f"impossible, {proof.grade}", proof, k)
    return answer("not found", None, None)


def _along(
    state: DamagedState,
    path: ToolPath,
    begins: FloatArray,
    goals: list[ToolGoal],
    tried: list[str],
) -> tuple[int, TimedTrajectory | None]:
    """Return how many samples are done from configurations (B, n), and a checked trajectory."""
    poses, stops = _sampled(path, _SAMPLE_COUNTS[0])
    tracks, reached = _followed(state, begins, poses, goals[0])
    tried.append(f"of {len(poses)} samples {reached.max()} in one go")
    complete = tracks[:, :, reached == len(poses)]
    # The smoothest are kept, as splines keep to them. The nearest of these is first, so that
    # the arm goes on at once.
    rough = np.max(np.abs(np.diff(complete, 2, axis=0)), axis=(0, 1))
    begins = complete[0][:, np.argsort(rough, kind="stable")[:_MOST_WAYS]].T
    begins = begins[np.argsort(np.max(np.abs(begins - state.start), axis=1), kind="stable")]
    for count in _SAMPLE_COUNTS:
        poses, stops = _sampled(path, count)
        tracks, again = _followed(state, begins, poses, goals[0])
        for k in np.flatnonzero(again == len(poses)):
            runs = _runs(state, tracks[:, :, k], stops)
            if runs is None:
                tried.append("a track: links come too near")
                continue
            run, clearance = joined(runs), state.connector.clearance
            wrong = faults(state.arm, state.whole, goals[-1], run, clearance)
            wrong += _off_path(state, runs[1], poses, path.has_orientation)
            tried.append(f"by {len(poses)} samples: {', '.join(wrong) or 'it is right'}")
            if not wrong:
                return len(goals), run
    return int(reached.max()), None


def _sampled(path: ToolPath, count: int) -> tuple[Poses, list[int]]:
    """Return samples of a path, and those at which it has corners, where the arm stops."""
    _, poses, places = path.sampled(count, 1.0)
    waypoints = at_waypoints(places)
    stops = []
    for k in waypoints[1:-1].tolist():
        before, after = np.diff(poses.positions[k - 1 : k + 2], axis=0)
        turned = np.linalg.norm(np.cross(before, after))
        most = _CORNER_SINE * np.linalg.norm(before) * np.linalg.norm(after)
        if turned > most or before @ after < 0:
            stops.append(k)
    return poses, stops


def _goal(poses: Poses, sample: int, oriented: bool) -> ToolGoal:
    """Return the pose of a sample as a goal."""
    quaternion = Rotation.from_matrix(poses.rotations[sample]).as_quat()
    position = tuple(poses.positions[sample].tolist())
    turn = tuple(quaternion.tolist()) if oriented else None
    return ToolGoal(
        Pose(position, turn, _FOLLOWED_M_OR_RAD, _FOLLOWED_M_OR_RAD if oriented else 0.0)
    )


def _followed(
    state: DamagedState, begins: FloatArray, poses: Poses, goal: ToolGoal
) -> tuple[FloatArray, IntArray]:
    """Return tracks (N, n, B) from beginnings (B, n), and how many samples each has."""
    chain, poses = _inside(state.arm.chain), replace(poses, rows=goal.rows)
    if len(chain.joints) <= len(goal.rows):
        track, last = follow(chain, begins.T, poses, 0)
        return track, last + 1
    # Tracks go towards the middle of the ranges, or do not: either may come farther.
    both = [follow(chain, begins.T, poses, 0, centre=part) for part in (_CENTRE_SHARE, 0.0)]
    tracks = np.concatenate([track for track, _ in both], axis=2)
    return tracks, np.concatenate([last + 1 for _, last in both])


def _inside(chain: Chain) -> Chain:
    """Return the chain with limits a little narrower: splines through one would pass it."""
    joints = tuple(
        replace(
            joint,
            lower=min(joint.lower + _INSIDE_M_OR_RAD, middle),
            upper=max(joint.upper - _INSIDE_M_OR_RAD, middle),
        )
        for joint, middle in zip(chain.joints, chain.mid_range.tolist(), strict=True)
    )
    return replace(chain, joints=joints)


def _runs(
    state: DamagedState, track: FloatArray, stops: list[int]
) -> list[TimedTrajectory] | None:
    """Return trajectories to the beginning of a track (N, n) and along it, or None."""
    connector, search = state.connector, state.search
    if not all(connector.is_free(q) for q in track):
        return None
    if not all(connector.is_line_free(a, b) for a, b in pairwise(track)):
        return None
    limit = SearchLimit(seconds=search.time_limit)
    corners = connector.way(state.start, track[[0]], limit, search.seed)
    if corners is None:
        return None
    there = state.run_along(corners, range(len(corners)))
    try:
        return [there, state.run_along(track, stops)]
    except InputError:  # the spline leaves the limits: from sample to sample, in lines
        return [there, state.run_along(track, range(len(track)))]


def _off_path(
    state: DamagedState, run: TimedTrajectory, poses: Poses, oriented: bool
) -> list[str]:
    """Return in words where a trajectory leaves the path, by the tree alone."""
    names = state.arm.healthy.names
    tips = [tip_pose(state.arm, dict(zip(names, q, strict=True))) for q in run.positions]
    places = np.array([place for place, _ in tips])
    off, place = off_lines(places, poses.positions)
    wrong = []
    if np.max(off) > _NEAR_M:
        wrong.append("it leaves the path")
    if np.max(off_lines(poses.positions, places)[0]) > _NEAR_M:
        wrong.append("it leaves out a part of the path")
    if oriented:
        slerp = Slerp(np.arange(len(poses)), Rotation.from_matrix(poses.rotations))
        turned = Rotation.from_matrix(np.array([turn for _, turn in tips]))
        if np.max((turned * slerp(place).inv()).magnitude()) > _TURNED_RAD:
            wrong.append("the tool turns away")
    return wrong
