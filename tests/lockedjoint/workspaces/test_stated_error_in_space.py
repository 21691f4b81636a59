"""The size that is stated for an arm in space, and its error, contain the volume.

The arm has its shoulder's two axes, about z and y, at one point, and its elbow's two, alike, at
another. Its tool is at p = Rz(q0) Ry(q1) w with w = (l1, 0, 0) + l2 u, where u is the unit
vector (cos q2 cos q3, sin q2 cos q3, −sin q3). So |p| fixes the first entry of u, and with one
joint locked the others follow in closed form: nothing of this is shared with the library. The
volume is the share of random points that are kept.
"""

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.kinematics.serial_chain import serial_chain
from lockedjoint.workspaces.of_robot import limits_of
from lockedjoint.workspaces.workspace import workspace
from tests import made_robots as made

FIRST, SECOND = 0.55, 0.45
PHYSICAL = np.array([(-2.9, 2.9), (-1.9, 1.9), (-2.6, 2.6), (-1.45, 1.45)])
# Voxels in metres, and slices in degrees.
RESOLUTIONS = {"up": [(0.05, 10)], "stretched": [(0.05, 10)], "bent": [(0.06, 10), (0.04, 8)]}
# The middle of the artificial limits of each joint, and half of their width.
DRAWN = {
    "up": ((0.1, 0.2, -1.0, -0.8), (0.09, 0.29, 0.22, 0.29)),
    "stretched": ((-0.2, 0.3, -0.7, -0.6), (0.09, 0.12, 0.12, 0.2)),
    "bent": ((0.0, 0.5, -1.1, 0.7), (0.15, 0.17, 0.26, 0.17)),
}
POINTS = 30_000
# With three times as many of both the volumes differ by less than their standard errors / 4.
PLACES = 20
ELBOWS = 200


@pytest.fixture(scope="module")
def robot():
    ends = [f'lower="{low}" upper="{high}" effort="1" velocity="1"' for low, high in PHYSICAL]
    offsets = ["0 0 0", "0 0 0", f"{FIRST} 0 0", "0 0 0"]
    axes = ("0 0 1", "0 1 0", "0 0 1", "0 1 0")
    kinds = {f"j{k}": {"limit": limit} for k, limit in enumerate(ends)}
    tool = made.joint("end", "l4", "tool", "fixed", xyz=f"{SECOND} 0 0")
    return lj.Robot(made.tree(made.urdf([*made.serial(offsets, axes, **kinds), tool])))


def within(values, limits):
    return (values >= limits[0] - 1e-9) & (values <= limits[1] + 1e-9)


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def shoulder(points, w):
    """Both pairs (q0, q1) for which Rz(q0) Ry(q1) w is p, NaN where there is none."""
    far = np.hypot(w[0], w[2])
    with np.errstate(invalid="ignore"):
        off = np.arccos(points[2] / far)
        for sign in (1, -1):
            # −sin q1 w_x + cos q1 w_z = p_z, with w_x = far sin b and w_z = far cos b.
            q1 = wrapped(sign * off - np.arctan2(w[0], w[2]))
            x = np.cos(q1) * w[0] + np.sin(q1) * w[2]
            yield wrapped(np.arctan2(points[1], points[0]) - np.arctan2(w[1], x)), q1


def elbow(along, across, up):
    """q2 and q3 of a unit vector, with cos q3 above 0."""
    return np.arctan2(across, along), -np.arcsin(up)


def configurations(points, joint, at):
    """All configurations (4, N) with a joint at a place, NaN where there is none."""
    along = (np.sum(points**2, axis=0) - FIRST**2 - SECOND**2) / (2 * FIRST * SECOND)
    with np.errstate(invalid="ignore", divide="ignore"):
        if joint in (2, 3):
            other = np.arccos(along / np.cos(at))
            for sign in (1, -1):
                both = (at, sign * other) if joint == 2 else (sign * other, at)
                q2, q3 = (np.broadcast_to(q, along.shape) for q in both)
                u = np.stack([along, np.sin(q2) * np.cos(q3), -np.sin(q3)])
                for q0, q1 in shoulder(points, FIRST * np.eye(3)[0][:, None] + SECOND * u):
                    yield np.stack([q0, q1, q2, q3])
            return
        x = FIRST + SECOND * along
        if joint == 1:
            up = (points[2] + np.sin(at) * x) / np.cos(at) / SECOND
            left = np.sqrt(1 - along**2 - up**2)
            sides = [(left, up), (-left, up)]
        else:
            turned = np.cos(at) * points[1] - np.sin(at) * points[0]
            across = turned / SECOND
            left = np.sqrt(1 - along**2 - across**2)
            sides = [(across, left), (across, -left)]
        for across, up in sides:
            q2, q3 = elbow(along, across, up)
            w = np.stack([x, SECOND * across, SECOND * up])
            for q0, q1 in shoulder(points, w):
                yield np.stack([q0, q1, q2, q3])


def reached(points, joint, at, limits):
    found = np.zeros(points.shape[1], dtype=bool)
    for q in configurations(points, joint, at):
        there = position(q)
        good = np.all(np.abs(there - points) < 1e-7, axis=0)
        free = [k for k in range(4) if k != joint]
        good &= np.abs(wrapped(q[joint] - at)) < 1e-7
        found |= good & np.all([within(q[k], limits[k]) for k in free], axis=0)
    return found


def position(q):
    u = np.stack([np.cos(q[2]) * np.cos(q[3]), np.sin(q[2]) * np.cos(q[3]), -np.sin(q[3])])
    w = FIRST * np.eye(3)[0][:, None] + SECOND * u
    x, z = np.cos(q[1]) * w[0] + np.sin(q[1]) * w[2], np.cos(q[1]) * w[2] - np.sin(q[1]) * w[0]
    return np.stack(
        [np.cos(q[0]) * x - np.sin(q[0]) * w[1], np.sin(q[0]) * x + np.cos(q[0]) * w[1], z]
    )


def volume(limits, points=POINTS):
    """The volume that is kept, and its standard error."""
    rng = np.random.default_rng(5)
    q = rng.uniform(*np.transpose(limits), (4000, 4)).T
    tip = position(q)
    low, high = tip.min(axis=1) - 0.01, tip.max(axis=1) + 0.01
    drawn = rng.uniform(low, high, (points, 3)).T
    # The ends of the limits come first, because most points are lost there.
    places = [np.linspace(*limits[joint], PLACES) for joint in range(4)]
    for place in sorted(range(PLACES), key=lambda k: min(k, PLACES - 1 - k)):
        for joint in range(4):
            drawn = drawn[:, reached(drawn, joint, places[joint][place], PHYSICAL)]
    missed = drawn
    for at in np.linspace(*limits[2], ELBOWS):
        missed = missed[:, ~reached(missed, 2, at, limits)]
    share = (drawn.shape[1] - missed.shape[1]) / points
    whole = float(np.prod(high - low))
    return share * whole, whole * np.sqrt(share / points)


def test_the_closed_form_finds_configurations():
    rng = np.random.default_rng(0)
    q = rng.uniform(*PHYSICAL.T, (500, 4)).T
    for joint in range(4):
        for k in range(0, 500, 5):
            assert reached(position(q[:, [k]]), joint, q[joint, k], PHYSICAL).all()
            own = np.array([(value - 1e-6, value + 1e-6) for value in q[:, k]])
            assert reached(position(q[:, [k]]), joint, q[joint, k], own).all()


@pytest.mark.long
@pytest.mark.parametrize("name", DRAWN)
def test_the_error_contains_the_volume(name, robot):
    limits = np.array([(at - half, at + half) for at, half in zip(*DRAWN[name], strict=True)])
    truth, deviation = volume(limits)
    assert truth > 20 * deviation
    arm = serial_chain(robot.chain)
    stated = limits_of(dict(zip(robot.chain.names, map(tuple, limits), strict=True)), arm)
    for voxel, degrees in RESOLUTIONS[name]:
        found = workspace(arm, stated, voxel, np.radians(degrees))
        assert abs(found.size - truth) < found.error + 3 * deviation
        assert found.error < truth
