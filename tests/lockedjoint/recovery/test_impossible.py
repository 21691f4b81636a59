"""That a goal is out of reach: against more digits, and configurations that are drawn."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.geometry import rotation
from lockedjoint.kinematics.pose import Pose
from lockedjoint.recovery import unreachable
from lockedjoint.recovery.check_proof import SURPLUS, distances, require_bounded_rounding
from lockedjoint.recovery.failures import Damage, Locked
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.recover import recover
from lockedjoint.recovery.unreachable import upright_motions

pytest.importorskip("toppra", reason="install toppra")


@pytest.fixture(scope="module")
def six(made):
    """A robot of seven joints of general geometry, and its arm with j2 locked."""
    tree = made.tree(made.offset_arm())
    return tree, Damage.of(tree, [Locked("j2", 0.3)])


def pose_at(chain, q):
    """The tip's pose at a configuration, as a goal."""
    position, rotation = chain.tip_at(q[:, None])
    quaternion = Rotation.from_matrix(rotation[:, :, 0]).as_quat()
    return Pose(tuple(position[:, 0]), tuple(quaternion))


def test_rounding_is_within_what_the_check_allows_for(six):
    """Cosines and sines of NumPy, and all that follows, against more digits."""
    angles = np.concatenate([np.random.default_rng(1).uniform(-7, 7, 300), [0.0, np.pi, 63.0]])
    with mpmath.workdps(50):
        for mine, exact in ((np.cos(angles), mpmath.cos), (np.sin(angles), mpmath.sin)):
            for angle, value in zip(angles, mine, strict=True):
                assert abs(mpmath.mpf(value) - exact(mpmath.mpf(angle))) < 2.0**-52
    proof, low, high = boxes(six[1].chain, 2000)
    require_bounded_rounding(proof)
    more = (side.astype(np.longdouble) for side in (low, high))
    away, exactly = distances(proof, 0, low, high), distances(proof, 0, *more)
    if np.finfo(np.longdouble).eps < 1e-18:
        assert 0 < np.abs(away - exactly).max() < SURPLUS / 1e6


def boxes(chain, count):
    """A proof's motions and a point far away, and boxes of all widths within the limits."""
    rng = np.random.default_rng(2)
    lower, upper = (side[:, None] for side in chain.limits)
    middle = rng.uniform(lower, upper, (len(lower), count))
    half = (upper - lower) * 10.0 ** rng.uniform(-4, 0, count)
    proof = upright_motions(chain, ToolGoal(Pose((0.5, 9.0, 0.1))))
    proof |= {"lower": chain.limits[0], "upper": chain.limits[1]}
    return proof, np.maximum(middle - half, lower), np.minimum(middle + half, upper)


def second_bound(proof, low, high):
    """The bounds of `check_proof` for one box and point, with vectors and rotation matrices."""
    z, share = np.array([0.0, 0.0, 1.0]), np.array(proof["multipliers"])
    middle, half = share @ (low + high) / 2, abs(share) @ (high - low) / 2
    point, columns, rest = np.array(proof["starts"][0]), [], 0.0
    for k in reversed(range(len(share))):
        if proof["slides"][k]:
            point, columns = point + middle[k] * z, [*columns, half[k] * z]
        else:
            turn = rotation(z, middle[k])
            point, columns = turn @ point, [turn @ g for g in columns]
            lever, *levers = (np.linalg.norm(np.cross(z, v)) for v in (point, *columns))
            if half[k] > 1:
                rest += lever + sum(levers)
                point, *columns = (z * v[2] for v in (point, *columns))
            else:
                rest += half[k] ** 2 * lever / 2 + half[k] * sum(levers)
                columns.append(half[k] * np.cross(z, point))
        frame = np.array(proof["placements"][k])
        point = frame[:, :3] @ point + frame[:, 3]
        columns = [frame[:, :3] @ g for g in columns]
    off = point - proof["targets"][0]
    far = np.linalg.norm(off)
    return far - sum(abs(off @ g) for g in columns) / far - rest - proof["tolerances"][0]


@pytest.mark.parametrize("first", ["revolute", "prismatic"])
def test_no_box_is_left_out_that_reaches_its_target(six, first):
    """By the check, and by a second implementation, which shares nothing with it."""
    chain = six[1].chain
    if first == "prismatic":
        motions = (replace(chain.motions[0], prismatic=True), *chain.motions[1:])
        chain = replace(chain, motions=motions)
    _, low, high = boxes(chain, 250)
    rng, left_out = np.random.default_rng(3), 0
    for k, inside in enumerate(rng.uniform(low, high).T):
        place = chain.tip_at(inside[:, None])[0][:, 0]
        box = low[:, k], high[:, k]
        for target, reached in ((place, True), (place + np.ptp(box, 0).max() + 0.01, False)):
            proof = upright_motions(chain, ToolGoal(Pose(tuple(target))))
            away = distances(proof, 0, *(side[:, None] for side in box))[0]
            assert away == pytest.approx(second_bound(proof, *box), abs=1e-12)
            assert not reached or away < 0
            left_out += away > 0
    assert left_out > 94


def test_a_proof_that_is_not_checked_again_is_numerical(six, monkeypatch):
    """As one of too many boxes."""
    monkeypatch.setattr(unreachable, "_MOST_CHECKED_LEAVES", 0)
    tree, arm = six
    far = Pose((9.0, 0.0, 0.0))
    start = arm.whole(arm.chain.mid_range[None])[0]
    answer = recover(tree, start, [Locked("j2", 0.3)], far)
    assert answer.verdict == "impossible, numerical"
    assert answer.proof.grade == "numerical"
