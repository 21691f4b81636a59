"""That a goal is out of reach: against exact numbers, and configurations that are drawn."""

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formulations.kinematics.forward import Kinematics
from formulations.recovery.check_proof import Interval, _cos_sin, _root, stays_away
from formulations.recovery.damaged_state import RecoverySearch
from formulations.recovery.failures import DamagedArm, Locked, ReducedRange
from formulations.recovery.goal import ToolGoal
from formulations.recovery.recover import recover
from formulations.recovery.six_joints import all_at_pose
from formulations.recovery.unreachable import plain_motions
from formulations.robots.pose_constrained_arm import Pose

pytest.importorskip("toppra", reason="install toppra")


@pytest.fixture(scope="module")
def six(request):
    """A robot of seven joints of general geometry, and its arm with j2 locked."""
    made = request.getfixturevalue("made")
    tree = made.tree(made.offset_arm())
    return tree, DamagedArm.of(tree, [Locked("j2", 0.3)])


def pose_at(chain, q):
    """The tip's pose at a configuration, as a goal."""
    position, rotation, _ = Kinematics(chain).forward(q[:, None])
    quaternion = Rotation.from_matrix(rotation[:, :, 0]).as_quat()
    return Pose(tuple(position[:, 0]), tuple(quaternion))


def test_intervals_hold_what_exact_arithmetic_gives():
    rng = np.random.default_rng(0)
    for _ in range(200):
        (a, b), (c, d) = np.sort(rng.normal(size=(2, 2)) * 10.0 ** rng.integers(-9, 9, (2, 1)))
        first, second = Interval(a, b), Interval(c, d)
        x, y, u, v = (Fraction(float(end)) for end in (a, b, c, d))
        products = [x * u, x * v, y * u, y * v]
        for interval, least, most in (
            (first + second, x + u, y + v),
            (first - second, x - v, y - u),
            (first * second, min(products), max(products)),
            (first * d, min(x * v, y * v), max(x * v, y * v)),
            (-first, -y, -x),
        ):
            assert Fraction(float(interval.low)) <= least
            assert Fraction(float(interval.high)) >= most
        root = _root(Interval(abs(a), abs(a)))
        assert Fraction(float(root.low)) ** 2 <= abs(x) <= Fraction(float(root.high)) ** 2
        assert abs(first).low == (0 if a <= 0 <= b else min(abs(a), abs(b)))


def test_intervals_hold_cosines_and_sines():
    angles = np.concatenate([np.random.default_rng(1).uniform(-7, 7, 300), [0.0, np.pi, 63.0]])
    with mpmath.workdps(50):
        for interval, exact in zip(
            _cos_sin(angles, True), (mpmath.cos, mpmath.sin), strict=True
        ):
            for angle, low, high in zip(angles, interval.low, interval.high, strict=True):
                assert mpmath.mpf(low) <= exact(mpmath.mpf(angle)) <= mpmath.mpf(high)
            assert np.max(interval.high - interval.low) < 1e-10
    with pytest.raises(ValueError, match="rad"):
        _cos_sin(np.array([65.0]), True)


@pytest.mark.parametrize("first", ["revolute", "prismatic"])
def test_no_box_is_left_out_that_reaches_its_target(six, first):
    """Of boxes of all widths, in plain numbers and in intervals."""
    chain = six[1].chain
    if first == "prismatic":
        motions = (replace(chain.motions[0], prismatic=True), *chain.motions[1:])
        chain = replace(chain, motions=motions)
    rng, left_out = np.random.default_rng(2), 0
    lower, upper = (side[:, None] for side in chain.limits)
    middle = rng.uniform(lower, upper, (6, 400))
    half = (upper - lower) * 10.0 ** rng.uniform(-4, 0, 400)
    low, high = np.maximum(middle - half, lower), np.minimum(middle + half, upper)
    for k, inside in enumerate(rng.uniform(low, high).T):
        place = Kinematics(chain).forward(inside[:, None])[0][:, 0]
        point = {"start": [row[3] for row in chain.end[:3]], "tolerance": 1e-6}
        for rigorous in (True, False):
            box = low[:, [k]], high[:, [k]], 1e-10, rigorous
            there = {**point, "target": place.tolist()}
            assert not stays_away(plain_motions(chain), there, *box)[0][0]
            far = {**point, "target": (place + half[:, k].max() * 2 + 0.01).tolist()}
            left_out += stays_away(plain_motions(chain), far, *box)[0][0]
    assert left_out > 300


def test_all_configurations_of_six_joints_are_found(six):
    chain, rng = six[1].chain, np.random.default_rng(3)
    for q in rng.uniform(*chain.limits, (5, 6)):
        goal = ToolGoal(pose_at(chain, q))
        every = all_at_pose(chain, goal, rng)
        off = np.exp(1j * every) - np.exp(1j * q)
        assert np.abs(off).max(axis=1).min() < 1e-5
        position, rotation, _ = Kinematics(chain).forward(every.T)
        assert max(far.max() for far in goal.distances(goal.missing(position, rotation))) < 2e-6


def test_what_is_not_one_pose_of_six_revolute_joints_has_no_such_list(six):
    tree, arm = six
    rng, pose = np.random.default_rng(4), pose_at(arm.chain, arm.chain.mid_range)
    assert all_at_pose(arm.chain, ToolGoal(Pose(pose.position)), rng) is None
    near = ToolGoal(replace(pose, tolerance=0.01))
    assert all_at_pose(arm.chain, near, rng) is None
    five = DamagedArm.of(tree, [Locked("j2", 0.3), Locked("j5", 0.0)]).chain
    assert all_at_pose(five, ToolGoal(pose), rng) is None


def test_without_a_proof_all_configurations_out_of_limits_are_numerical(six):
    """One joint may turn just so far that no configuration at the pose is within its range."""
    tree, arm = six
    rng = np.random.default_rng(5)
    q = rng.uniform(*arm.chain.limits)
    goal = pose_at(arm.chain, q)
    values = np.sort(all_at_pose(arm.chain, ToolGoal(goal), rng)[:, 0])
    values = np.concatenate([values, values + 2 * np.pi, values - 2 * np.pi])
    joint = arm.chain.joints[0]
    ends = np.sort([joint.lower, *values[np.abs(values) < joint.upper], joint.upper])
    gap = int(np.argmax(np.diff(ends)))
    low, high = ends[gap] + 0.01, ends[gap + 1] - 0.01
    failures = [Locked("j2", 0.3), ReducedRange("j0", low, high)]
    start = arm.whole(arm.chain.mid_range[None])[0]
    start[0] = (low + high) / 2
    search = RecoverySearch(starts=70, boxes=10)
    answer = recover(tree, start, failures, goal, search=search)
    assert answer.verdict == "impossible, numerical"
    assert answer.proof is None
    assert any("eigenvalues" in sentence for sentence in answer.tried)
