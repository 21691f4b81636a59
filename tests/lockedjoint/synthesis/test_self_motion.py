"""Self-motion curves hold the pose, and say which failures a pose survives."""

import csv
import itertools

import numpy as np
import pytest
from scipy.optimize import least_squares

from lockedjoint.kinematics.inverse import SelfMotionPoses, arcs, kept, solve_pose
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.synthesis.choice import choose_arrangement
from lockedjoint.synthesis.criteria import CRITERIA, Sampling
from lockedjoint.synthesis.family import Arrangements, family
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.ranking import rank

HALF = np.deg2rad(20.0)


def ahead(lengths):
    """A planar arm stretched along x at q = 0, one in front."""
    n = len(lengths)
    points = np.zeros((1, n, 3))
    points[0, 1:, 0] = np.cumsum(lengths)[:-1]
    axes = np.tile([0.0, 0.0, 1.0], (1, n, 1))
    return JointAxes(axes, points, np.zeros((1, n), bool), np.array([sum(lengths), 0.0, 0.0]))


def test_curves_hold_the_pose_and_close(optimum):
    arm = realise(optimum)
    members = family(arm)
    tip = arm.end_effector + np.array([[0.2, -0.1, 0.3], [0.0, 0.0, 0.0]])
    poses = SelfMotionPoses(members, list(range(6)), tip, np.broadcast_to(np.eye(3), (2, 3, 3)))
    none = np.full(7, np.inf)
    q, found = solve_pose(poses, np.zeros((2, 7)), -none, none)
    assert found.all()
    curves, _, _ = arcs(poses, q, -none, none, steps=150)
    for own, points in zip(tip, curves, strict=True):
        points = points[~np.isnan(points[:, 0])]
        held = arm.pose(points)
        assert np.abs(held[:, :3, 3] - own).max() < 6e-3
        assert np.abs(held[:, :3, :3] - np.eye(3)).max() < 2e-3
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.16
        assert len(points) > 20


def test_curves_end_at_limits():
    poses = SelfMotionPoses(
        ahead((1.0, 1.0, 1.0)), [0, 1], np.array([[1.5, 0.5, 0]]), np.eye(3)[None]
    )
    low, high = np.array([-0.4, -3.0, -3.0]), np.array([1.3, 3.0, 3.0])
    q, found = solve_pose(poses, np.array([[0.8, -1.0, 0.5]]), low, high)
    assert found.all()
    (points,), _, _ = arcs(poses, q, low, high)
    ends = points[~np.isnan(points[:, 0])]
    assert np.all((ends >= low - 1e-12) & (ends <= high + 1e-12))
    for end in (ends[0], ends[-1]):
        assert min(np.abs(end - low).min(), np.abs(end - high).min()) < 1e-9


@pytest.mark.parametrize("lengths", [(1.0, 1.0, 1.0), (1.0, 0.7, 0.4)])
def test_planar_curves_sweep_what_two_links_reach(lengths):
    """The angles of joint 1 on the curves of p are those at which links 2 and 3 reach p."""
    one, two, three = lengths
    rng = np.random.default_rng(0)
    points = np.zeros((12, 3))
    points[:, :2] = rng.uniform(-1.0, 1.0, (12, 2))
    poses = SelfMotionPoses(
        ahead(lengths), [0, 1], points, np.broadcast_to(np.eye(3), (12, 3, 3))
    )
    none, angles = np.full(3, np.inf), np.linspace(-np.pi, np.pi, 181)
    swept = np.zeros((12, len(angles)), dtype=bool)
    for _ in range(7):  # both curves of a point, if it has two
        q, found = solve_pose(poses, rng.uniform(-3, 3, (12, 3)), -none, none)
        _, least, most = arcs(poses, q, -none, none, steps=120)
        low, high = least[:, :1], most[:, :1]
        shift = 2 * np.pi * np.ceil((low - angles) / (2 * np.pi))
        swept |= (angles + shift <= high) & found[:, None]
    elbow = points[:, None, :2] - one * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    away = np.linalg.norm(elbow, axis=2)
    margin = np.minimum(away - abs(two - three), two + three - away)
    clear = np.abs(margin) > 0.02
    assert np.array_equal(swept[clear], (margin > 0)[clear])


def test_the_reverse_order_keeps_the_mirror_image(optimum):
    arm = realise(optimum)
    orders = np.random.default_rng(0).permuted(np.tile(np.arange(7), (2, 1)), axis=1)
    offsets = 1.2 * np.random.default_rng(1).uniform(-0.6, 0.6, (10, 3))
    flips = np.zeros(orders.shape, dtype=bool)
    rows = list(range(6))
    one = kept(family(arm, Arrangements(orders, flips)), rows, offsets, HALF)
    back = kept(family(arm, Arrangements(orders[:, ::-1], flips)), rows, -offsets, HALF)
    assert 0 < one.sum() < 20
    assert np.sum(one != back) <= 1


def test_what_is_kept_is_kept_by_inverse_kinematics(optimum):
    """SciPy finds a configuration with a joint locked at the ends of its artificial limits."""
    arm = realise(optimum)
    members = family(arm)
    offsets = np.random.default_rng(2).uniform(-0.5, 0.5, (12, 3))
    found = kept(members, list(range(6)), offsets, HALF)[0]
    assert found.any()

    def off(free, joint, angle, tip):
        q = np.insert(free, joint, angle)
        pose = arm.pose(q)
        turned = pose[:3, :3] - pose[:3, :3].T
        wrong = [turned[2, 1], turned[0, 2], turned[1, 0], 3 - np.trace(pose[:3, :3])]
        return np.concatenate([pose[:3, 3] - tip, wrong])

    rng = np.random.default_rng(0)
    tip = arm.end_effector + offsets[np.flatnonzero(found)[0]]
    for joint, angle in itertools.product((0, 3, 6), (-HALF, HALF)):
        starts = [np.zeros(6), *rng.uniform(-2.0, 2.0, (30, 6))]
        assert any(
            least_squares(off, start, args=(joint, angle, tip), max_nfev=60).cost < 1e-16
            for start in starts
        )


def test_ranking_by_what_is_kept(lockedjoint, tmp_path):
    """Of a planar 4R that holds its orientation: every order, and its reverse alike."""
    pose = np.array([[0.2, -1.0, 0.6, 1.4], [1.0, 0.3, 0.8, 0.0], [1.0, 1.0, 1.0, 1.0]])
    arm, how = realise(pose, space="planar-pose"), Sampling(0, 60, 0.3)
    found = rank(arm, "kept", how, shortlist=30)
    assert len(found.values) == 24
    assert np.all(np.diff(found.values) <= 0)
    assert found.values[0] > found.values[-1]
    orders = found.arrangements.orders
    by_order = dict(zip(map(tuple, orders.tolist()), found.values, strict=True))
    alone = family(arm, Arrangements(orders[:, ::-1], np.zeros(orders.shape, dtype=bool)))
    again = CRITERIA["kept"].evaluate(alone, how)
    for order, value in zip(orders.tolist(), again, strict=True):
        assert by_order[tuple(order)] == by_order[tuple(order[::-1])]
        assert value == pytest.approx(by_order[tuple(order)], rel=0.2)
    chosen = choose_arrangement(arm, "kept", how, ranking=found)
    assert chosen.values["kept"] == pytest.approx(found.values[0], rel=0.2)
    np.savetxt(tmp_path / "j.csv", pose, delimiter=",")
    words = ["realise", "j.csv", "--space", "planar-pose", "--criterion", "kept"]
    more = ["--effort=samples=60", "--effort=radius=0.3", "--to", "ranking", "--out", "r.csv"]
    assert lockedjoint.here(*words, *more, cwd=tmp_path).returncode == 0
    with (tmp_path / "r.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [line["rank"] for line in lines] == [str(k + 1) for k in range(24)]
    assert [float(line["value"]) for line in lines] == pytest.approx(found.values)
