"""What planned paths survive, by a continuation of its own: pinocchio, adaptive steps."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.survival import survivors
from results.paths.paths import PATHS
from tests.made_robots import in_pinocchio

STORED = Path(__file__).parents[3] / "results/paths/trajectories.json"
TOLERANCE, LEAST_STEP, LONGEST = 1e-7, 1e-4, 0.08


class Continuation:
    """An arm that follows a path with one joint locked, between samples too."""

    def __init__(self, made, declared):
        self.arm, path = declared.stated()
        self.model = made.pinocchio_model(declared.robot)
        self.data = self.model.createData()
        self.tip = self.model.getFrameId(self.arm.chain.tip)
        self.lower, self.upper = self.arm.bounds
        _, poses, _ = path.sampled(PathSearch.samples, PathSearch.duration)
        self.poses = replace(poses, rows=self.arm.task.rows)
        self.positions, self.last = self.poses.positions, len(self.poses) - 1
        #: The turns of the tool between samples, as rotation vectors.
        self.steps = [
            pin.log3(one.T @ two) for one, two in pairwise(np.array(self.poses.rotations))
        ]
        self.root = self.model.getFrameId(self.arm.chain.base)

    def off(self, q, s):
        """What is missing to the pose at s, and its Jacobian, for the task's rows."""
        full, columns = in_pinocchio(self.model, self.arm.chain.names, q)
        world = pin.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(self.model, self.data, full, self.tip, world)
        pin.updateFramePlacements(self.model, self.data)
        base, tip = self.data.oMf[self.root], self.data.oMf[self.tip]
        here, back = base.actInv(tip), base.rotation.T
        k = min(int(s), self.last - 1)
        place = self.positions[k] + (s - k) * (self.positions[k + 1] - self.positions[k])
        turn = self.poses.rotations[k] @ pin.exp3((s - k) * self.steps[k])
        turned = pin.log3(turn @ here.rotation.T)
        missing = np.concatenate([place - here.translation, turned])
        both = back @ jacobian[:3, columns], back @ jacobian[3:, columns]
        rows = self.arm.task.rows
        return missing[rows], np.concatenate(both)[rows]

    def solved(self, q, s, free):
        """Newton from q, least motion, joints at limits held there; None if it is lost."""
        start = q
        for _ in range(12):
            missing, jacobian = self.off(q, s)
            if np.max(np.abs(missing)) < TOLERANCE:
                return q if np.max(np.abs(q - start)) < LONGEST else None
            movable = free.copy()
            while True:
                move = np.zeros(len(q))
                move[movable] = np.linalg.lstsq(jacobian[:, movable], missing, rcond=1e-9)[0]
                out = movable & ((q + move < self.lower) | (q + move > self.upper))
                held = out & ((q <= self.lower) | (q >= self.upper))
                if not held.any():
                    break
                movable &= ~held
            if np.max(np.abs(move)) > 1:
                return None
            q = np.clip(q + move, self.lower, self.upper)
        return None

    def aside(self, q, s, free, rng):
        """Move along the self-motion that is left, at random."""
        push = rng.normal(size=len(q)) * free
        for _ in range(int(rng.integers(5, 40))):
            moved = np.clip(q + 0.05 * push / np.linalg.norm(push), self.lower, self.upper)
            moved = self.solved(moved, s, free)
            if moved is None:
                break
            q = moved
        return q

    def finishes(self, q, sample, joint, rng, restarts=12):
        """Whether the path can be finished, from any of many points of the self-motion."""
        if sample == self.last:
            return True
        free = np.arange(len(q)) != joint
        spare = len(q) - 1 > len(self.arm.task.rows)
        polished = self.solved(q, sample, free)
        if polished is None:
            return False
        for attempt in range(1 + restarts * spare):
            here = self.aside(polished, sample, free, rng) if attempt else polished
            if self.followed(here, float(sample), free):
                return True
        return False

    def followed(self, q, s, free):
        step, before = 0.25, np.zeros(len(q))
        while s < self.last:
            step = min(step, self.last - s)
            guess = np.clip(q + step * before, self.lower, self.upper)
            ahead = self.solved(np.where(free, guess, q), s + step, free)
            if ahead is None:
                ahead = self.solved(q, s + step, free)
            if ahead is None:
                step /= 2
                if step < LEAST_STEP:
                    return False
                continue
            before, q, s = (ahead - q) / step, ahead, s + step
            step *= 1.6
        return True


def compared(made, number, count, seed):
    """Of some failures of a planned path those that do not end as our test says."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))[number]
    q = np.array(stored["configurations"])
    check = Continuation(made, PATHS[number])
    ends = survivors(check.arm.chain, q.T, np.arange(len(q)), check.poses).T
    rng = np.random.default_rng(seed)
    differ = []
    for _ in range(count):
        sample, joint = int(rng.integers(len(q))), int(rng.integers(q.shape[1]))
        if check.finishes(q[sample], sample, joint, rng) != (ends[sample, joint] == check.last):
            differ.append((sample, joint, int(ends[sample, joint])))
    return differ


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(PATHS)))
def test_failures_of_planned_paths_end_as_the_plan_says(made, number):
    assert compared(made, number, 8, number) == []
