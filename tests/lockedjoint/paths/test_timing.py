"""Trajectories in time: against a double integrator, differences, pinocchio and ROS."""

import csv
import json
import re

import numpy as np
import pinocchio as pin
import pytest
import yaml
from scipy.interpolate import BPoly
from scipy.spatial.distance import cdist

from lockedjoint.nlp.errors import InputError
from lockedjoint.paths import timing
from lockedjoint.paths.motion_limits import MotionLimits
from lockedjoint.paths.quintic import Quintic
from lockedjoint.paths.timing import timed

pytest.importorskip("toppra", reason="install toppra")

ACCELERATION = (3.0, 4.0, 5.0)


@pytest.fixture(scope="module")
def text(made):
    limits = [f'lower="-3" upper="3" effort="1" velocity="{1 + k}"' for k in range(3)]
    kinds = {f"j{k}": {"limit": limit} for k, limit in enumerate(limits)}
    axes = ("0 0 1", "0 1 0", "1 0 0")
    return made.urdf(made.serial(["0.1 0 0.3"] * 3, axes, **kinds))


@pytest.fixture(scope="module")
def chain(made, text):
    return made.chain(text)


@pytest.fixture(scope="module")
def curve():
    s = np.linspace(0, 1, 30)[:, None]
    return np.sin(s * [2.0, 3.0, 4.0] + [0.0, 1.0, 2.0])


@pytest.mark.parametrize("distance", [0.05, 2.0])
def test_a_straight_way_takes_the_time_of_a_double_integrator(chain, distance):
    way = np.linspace(0, 1, 20)[:, None] * [distance, 0.0, 0.0]
    run = timed(chain, way, MotionLimits.of(chain, ACCELERATION))
    v, a = 1.0, ACCELERATION[0]
    best = distance / v + v / a if distance > v**2 / a else 2 * np.sqrt(distance / a)
    assert best - 1e-9 <= run.duration <= 1.02 * best


def test_limits_hold_and_derivatives_are_derivatives(chain, curve):
    run = timed(chain, curve, MotionLimits.of(chain, ACCELERATION), step=1e-3)
    assert np.all(np.abs(run.velocities) <= np.array([1, 2, 3]) * (1 + 1e-12))
    assert np.all(np.abs(run.accelerations) <= np.array(ACCELERATION) * (1 + 1e-12))
    assert max(run.speed, run.acceleration) == pytest.approx(1, abs=1e-3)
    assert run.velocities[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-9)
    steps = np.diff(run.times)
    middle = (run.velocities[1:] + run.velocities[:-1]) / 2
    assert np.diff(run.positions, axis=0) == pytest.approx(middle * steps[:, None], abs=2e-5)
    assert np.diff(run.velocities, axis=0) == pytest.approx(
        run.accelerations[:-1] * steps[:, None], abs=5e-3
    )


def test_it_passes_the_samples_and_rests_at_stops(chain, curve):
    run = timed(chain, curve, MotionLimits.of(chain, ACCELERATION), stops=[10], step=1e-3)
    for sample in curve:
        assert np.min(np.linalg.norm(run.positions - sample, axis=1)) < 3e-3
    at = np.argmin(np.linalg.norm(run.positions - curve[10], axis=1))
    assert run.velocities[at] == pytest.approx(np.zeros(3), abs=1e-9)
    assert run.duration > timed(chain, curve, MotionLimits.of(chain, ACCELERATION)).duration


def test_the_tool_is_where_pinocchio_has_it(text, chain, curve):
    model = pin.buildModelFromXML(text)
    data, run = model.createData(), timed(chain, curve, MotionLimits.of(chain, ACCELERATION))
    for k in range(0, len(run.times), 7):
        pin.framesForwardKinematics(model, data, run.positions[k])
        pose = pin.SE3ToXYZQUAT(data.oMf[model.getFrameId("l3")])
        sign = np.sign(pose[3:] @ run.tool[k, 3:])
        assert run.tool[k] == pytest.approx(np.r_[pose[:3], sign * pose[3:]], abs=1e-12)


def test_ros_takes_it(chain, curve):
    stores = pytest.importorskip("rosbags.typesys", reason="install rosbags")
    types = stores.get_typestore(stores.Stores.ROS2_HUMBLE).types
    run = timed(chain, curve, MotionLimits.of(chain, ACCELERATION))
    # Among the numbers are some with a point and an exponent, which YAML could take for texts.
    written = run.files()["trajectory.yaml"]
    assert re.search(r"\d\.\d+e-\d", written)
    read = yaml.safe_load(written)
    assert read == run.to_ros()
    point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = types["builtin_interfaces/msg/Duration"]
    for one in read["points"]:
        one["time_from_start"] = duration(**one["time_from_start"])
    points = [point(**one) for one in read["points"]]
    stamp = types["builtin_interfaces/msg/Time"](**read["header"]["stamp"])
    head = types["std_msgs/msg/Header"](stamp, read["header"]["frame_id"])
    message = types["trajectory_msgs/msg/JointTrajectory"](head, read["joint_names"], points)
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
    assert np.all(np.diff(times) > 0)
    assert times == pytest.approx(run.times, abs=1e-9)
    assert json.loads(json.dumps(run.to_dict()))["positions"] == run.positions.tolist()


def test_limits_that_are_none_are_refused(chain):
    for velocity in ((1, 1), (1, 1, np.nan)):
        with pytest.raises(InputError, match="velocity limits"):
            MotionLimits.of(chain, ACCELERATION, velocity)
    with pytest.raises(InputError, match="acceleration limits"):
        MotionLimits.of(chain, (1, 0, 1), None)


@pytest.mark.parametrize("stops", [(), (5, 6, 20)])
@pytest.mark.parametrize(("speed", "strength"), [(1e-7, 1.0), (1.0, 1e-6), (1e-6, 1e-8)])
def test_a_slow_arm_has_points_farther_apart(chain, curve, speed, strength, stops):
    """An arm of which a file says that it needs years asks for no more memory than others."""
    limits = MotionLimits.of(chain, [strength] * 3, [speed] * 3)
    run = timed(chain, curve, limits, stops)
    assert run.duration > 1e3
    assert len(run.times) <= timing._MOST_POINTS + len(stops) + 2
    assert np.max(np.abs(run.velocities)) <= speed * (1 + 1e-12)
    assert np.max(np.abs(run.accelerations)) <= strength * (1 + 1e-12)


@pytest.mark.parametrize(
    ("speed", "strength", "said"),
    [
        (1e-10, 1.0, "duration of the trajectory"),
        (1e-300, 1.0, "velocity limits"),
        (1e300, 1.0, "velocity limits"),
        (1.0, 5e-324, "acceleration limits"),
    ],
)
def test_limits_that_no_arm_has_are_refused(chain, curve, speed, strength, said):
    with pytest.raises(InputError, match=said):
        timed(chain, curve, MotionLimits.of(chain, [strength] * 3, [speed] * 3))


def hermite(run):
    """Polynomials between points, by scipy: as a controller goes from point to point."""
    states = np.stack([run.positions, run.velocities, run.accelerations], axis=1)
    return BPoly.from_derivatives(run.times, states)


@pytest.mark.parametrize("jerk", [None, 40.0])
@pytest.mark.parametrize("stops", [(), (10,)])
def test_limits_hold_between_points_too(chain, curve, stops, jerk):
    """With TOPP-RA's own accelerations, which jump, they were passed by a fifth and more."""
    roughest = None if jerk is None else [jerk] * 3
    limits = MotionLimits.of(chain, ACCELERATION, None, roughest)
    run = timed(chain, curve, limits, stops)
    between, times = hermite(run), np.linspace(0.0, run.duration, 50_000)
    shares = [
        np.max(np.abs(between(times, order)) / limit)
        for order, limit in ((1, limits.velocity), (2, limits.acceleration))
    ]
    assert max(shares) <= 1 + 1e-9
    assert shares[0] == pytest.approx(run.speed, abs=2e-3)
    assert shares[1] == pytest.approx(run.acceleration, abs=2e-3)
    assert run.speed <= 1 + 1e-9
    if jerk is None:
        assert run.jerk is None
    else:
        largest = np.max(np.abs(between(times, 3))) / jerk
        assert largest <= 1 + 1e-9
        assert largest == pytest.approx(run.jerk, abs=2e-2)
    # The way is that of TOPP-RA, as fine as one likes.
    fine = timed(chain, curve, limits, stops, step=1e-3)
    assert np.max(cdist(between(times[::50]), fine.positions).min(axis=1)) < 3e-3


def test_a_limit_of_jerk_makes_a_way_longer(chain, curve):
    runs = [
        timed(chain, curve, MotionLimits.of(chain, ACCELERATION, None, [jerk] * 3))
        for jerk in (1e4, 100.0, 10.0)
    ]
    durations = [run.duration for run in runs]
    free = timed(chain, curve, MotionLimits.of(chain, ACCELERATION)).duration
    assert durations[0] == pytest.approx(free)
    assert durations[0] < durations[1] < durations[2]


@pytest.mark.parametrize(("distance", "jerk"), [(0.5, 30.0), (2.0, 30.0), (2.0, 300.0)])
def test_a_line_with_limited_jerk_takes_little_more_than_the_least_time(chain, distance, jerk):
    """Of one joint, in seven phases: (v/a + a/j + d/v) where both limits are reached."""
    way = np.array([[0.0, 0.0, 0.0], [distance, 0.0, 0.0]])
    run = timed(chain, way, MotionLimits.of(chain, ACCELERATION, None, [jerk] * 3))
    v, a = 1.0, ACCELERATION[0]
    if distance >= v * (v / a + a / jerk):
        best = v / a + a / jerk + distance / v
    else:
        rise = a / jerk
        best = rise + np.sqrt(rise**2 + 4 * distance / a)
    assert best - 1e-9 <= run.duration <= 1.08 * best


def test_a_table_for_ros2_control(chain, curve):
    run = timed(chain, curve, MotionLimits.of(chain, ACCELERATION))
    text = run.files()["trajectory.ros2_control.csv"]
    heads, *lines = csv.reader(text.splitlines())
    assert heads[:4] == ["time_from_start", "j0/position", "j0/velocity", "j0/acceleration"]
    table = dict(zip(heads, np.array(lines, dtype=float).T, strict=True))
    np.testing.assert_array_equal(table["time_from_start"], run.times)
    for k, name in enumerate(run.joints):
        for kind, values in (
            ("position", run.positions),
            ("velocity", run.velocities),
            ("acceleration", run.accelerations),
        ):
            np.testing.assert_array_equal(table[f"{name}/{kind}"], values[:, k])


def test_every_column_and_list_says_its_unit(chain, curve):
    run = timed(chain, curve, MotionLimits.of(chain, ACCELERATION))
    heads = run.csv_lines()[0]
    assert heads[:2] == ["t (s)", "j0 (rad)"]
    assert "j2 velocity (rad/s)" in heads
    assert "j2 acceleration (rad/s²)" in heads
    assert run.to_dict()["units"] == ["rad"] * 3
    assert "quintic" in run.to_dict()["interpolation"]


@pytest.mark.parametrize("distance", [1e-1, 1e-3, 1e-4, 0.0])
def test_limits_hold_for_the_whole_nanoseconds_of_ros(chain, distance):
    """Where a piece is short too, and where nothing moves."""
    limits = MotionLimits.of(chain, (10.0,) * 3, jerk=(1000.0,) * 3)
    way = np.array([[0.1, 0.2, 0.3], [0.1 + distance, 0.2, 0.3]])
    run = timed(chain, way, limits)
    stamps = [point["time_from_start"] for point in run.to_ros()["points"]]
    nanoseconds = np.array([stamp["sec"] * 10**9 + stamp["nanosec"] for stamp in stamps])
    assert np.all(np.diff(nanoseconds) > 0)
    states = np.stack([run.positions, run.velocities, run.accelerations])
    shares = limits.shares(Quintic.through(nanoseconds / 1e9, states).largest())
    assert max(shares) <= 1 + 1e-6
