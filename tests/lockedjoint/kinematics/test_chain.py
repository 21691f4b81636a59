"""Chains between links: fixed, mimic, prismatic and held joints, limits, base and tip."""

import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from lockedjoint.robot import Robot

PLANE = TaskSpace(("vx", "wz"))


@pytest.fixture(scope="module")
def mixed(made):
    """A tree with every kind of joint, a branch, and mimicry from another branch."""
    mimic = '<mimic joint="a" multiplier="-0.5" offset="0.2"/>'
    joints = [
        made.joint("a", "base", "one", xyz="0.1 0 0.2", rpy="0.3 0 0", axis="0 1 1"),
        made.joint("weld", "one", "two", "fixed", xyz="0 0.3 0", rpy="0 0.5 0"),
        made.joint("b", "two", "three", "prismatic", axis="1 0 1"),
        made.joint("c", "three", "four", xyz="0.2 0 0", axis="1 0 0", mimic=mimic),
        made.joint("d", "four", "five", "continuous", xyz="0 0.1 0.1", axis="0 0 1"),
        made.joint("e", "five", "tip", xyz="0 0.2 0.1", rpy="1 0 0.2", axis="0 1 0"),
        made.joint("other", "two", "branch", "floating"),
    ]
    return made.urdf(joints)


@pytest.mark.parametrize("locked_at", [{}, {"a": 0.4}, {"d": -2.5}, {"b": 0.7, "e": -1.0}])
def test_every_kind_of_joint_agrees_with_pinocchio(mixed, made, locked_at):
    """Of which the mimic joint's column is the driver's: pinocchio knows mimicry as well."""
    text = mixed.replace('type="floating"', 'type="fixed"')
    chain = made.chain(text, "tip", locked_at=locked_at)
    assert chain.names == tuple(name for name in "abde" if name not in locked_at)
    arm = RobotArm(chain, TaskSpace(("vx",)), 0.7)
    model, rng = pin.buildModelFromXML(text, mimic=True), np.random.default_rng(0)
    for _ in range(5):
        point = arm.sample(rng)
        theirs = made.of_pinocchio(model, chain, point)
        assert arm.metric_jacobian(point) == pytest.approx(theirs, abs=1e-12)


LEFT, RIGHT = "gripper_left_base_link", "gripper_right_base_link"
HANDS = [("Baxter", "right_gripper", "left_gripper"), ("TIAGo Pro", RIGHT, LEFT)]


@pytest.mark.parametrize(("name", "base", "tip"), [*HANDS, ("Talos", LEFT, "torso_1_link")])
def test_from_hand_to_hand_is_the_difference_of_both_by_pinocchio(name, base, tip, made):
    """Also from a hand to a link before it. Of poses, too."""
    declared = made.real(name)
    arm = Robot(declared.path, tip, base).arm
    model = made.pinocchio_model(declared)
    data, rng, axes = model.createData(), np.random.default_rng(5), pin.LOCAL_WORLD_ALIGNED
    frames = [model.getFrameId(link) for link in (tip, base)]
    for _ in range(4):
        point = arm.sample(rng)
        q, columns = made.in_pinocchio(model, arm.chain.names, point)
        own, other = (
            pin.computeFrameJacobian(model, data, q, frame, axes)[:, columns]
            for frame in frames
        )
        pin.framesForwardKinematics(model, data, q)
        here, there = (data.oMf[frame] for frame in frames)
        away = np.cross(other[3:].T, here.translation - there.translation).T
        linear = there.rotation.T @ (own[:3] - other[:3] - away)
        angular = there.rotation.T @ (own[3:] - other[3:])
        ours = arm.metric_jacobian(point)
        np.testing.assert_allclose(ours, np.vstack([linear, angular]), atol=1e-12)
        position, rotation = arm.chain.tip_at(point[:, None])
        relative = there.actInv(here)
        np.testing.assert_allclose(position[:, 0], relative.translation, atol=1e-12)
        np.testing.assert_allclose(rotation[..., 0], relative.rotation, atol=1e-12)


def test_a_driver_on_another_branch_moves_the_tip(made):
    """A finger that mimics: the driver is not on the way to the tip, its column is."""
    mimic = '<mimic joint="left" multiplier="2" offset="0.1"/>'
    joints = [
        made.joint("left", "palm", "l", "prismatic", limit='lower="0" upper="0.4"'),
        made.joint("right", "palm", "r", "prismatic", mimic=mimic),
        made.joint("nod", "r", "tip", axis="0 1 0"),
    ]
    chain = made.chain(joints, "tip")
    assert chain.names == ("left", "nod")
    assert chain.prismatic == (True, False)
    arm = RobotArm(chain, TaskSpace(("vz",)), 1.0)
    assert arm.metric_jacobian([0.2, 0.3])[:3, 0] == pytest.approx([0, 0, 2], abs=1e-12)


def test_limits_of_a_mimic_joint_narrow_its_drivers(mixed, made):
    """c = 0.2 − a/2 within ±2 leaves a ≥ −3.6, its own ±2 is narrower; but not at ±0.5."""
    lower, upper = made.chain(mixed, "tip").limits
    assert (lower[0], upper[0]) == (-2.0, 2.0)
    head, tail = mixed.split('<joint name="c"')
    tail = tail.replace('lower="-2" upper="2"', 'lower="-0.5" upper="0.5"', 1)
    lower, upper = made.chain(f'{head}<joint name="c"{tail}', "tip").limits
    assert (lower[0], upper[0]) == pytest.approx((-0.6, 1.4))


def test_the_point_is_in_the_tips_frame(mixed, made):
    """Moving the point by r changes v by ω × r and leaves ω."""
    shift, q = np.array([0.1, -0.2, 0.3]), np.array([0.3, 0.1, 0.9, -0.7])
    chains = [made.chain(mixed, "tip", point=r) for r in ((0, 0, 0), shift)]
    task = TaskSpace(("vx",), "tip")
    here, there = (RobotArm(chain, task, 1.0).metric_jacobian(q) for chain in chains)
    moved = here[:3] + np.cross(here[3:], shift, axisa=0, axisc=0)
    assert there[:3] == pytest.approx(moved, abs=1e-12)
    assert there[3:] == pytest.approx(here[3:], abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"tip": "nowhere"}, "tip is nowhere; allowed: one of the links base, one"),
        ({"tip": "tip", "base": "nowhere"}, "base is nowhere"),
        ({"tip": "four", "base": "four"}, "tip is four, which nothing moves"),
        ({"tip": "base"}, "nothing moves"),
        ({"tip": "two", "base": "one"}, "nothing moves"),
        ({"tip": "two", "locked_at": {"a": 0.0}}, "nothing moves"),
        ({"tip": "branch"}, "joint other is floating; allowed: only revolute"),
        ({"tip": "tip", "locked_at": {"x": 0.0}}, "at is x; allowed: one of a, b, d, e"),
        ({"tip": "tip", "locked_at": {"c": 0.0}}, "joint of locked_at is c"),
        (
            {"tip": "tip", "locked_at": {"a": 2.5}},
            r"joint a is 2.5 rad; allowed: within \[-2, 2\] rad",
        ),
        ({"tip": "tip", "locked_at": {"a": np.nan}}, "joint a is nan"),
        ({"tip": "tip", "point": (0, 0)}, "point is"),
    ],
)
def test_what_cannot_be_a_chain(mixed, made, arguments, sentence):
    with pytest.raises(InputError, match=sentence):
        made.chain(mixed, **arguments)


@pytest.mark.parametrize(
    ("mimic", "sentence"),
    [
        ('joint="none"', "<mimic> of joint b is none"),
        ('joint="b"', "circular"),
        ('joint="weld"', "joint weld, mimicked by b, is fixed"),
        ('joint="a" offset="9"', "limits of joint a is contradictory"),
    ],
)
def test_mimicry_that_is_refused(made, mimic, sentence):
    joints = [made.joint("a", "0", "1"), made.joint("weld", "1", "2", "fixed")]
    joints.append(made.joint("b", "2", "3", mimic=f"<mimic {mimic}/>"))
    with pytest.raises(InputError, match=sentence):
        made.chain(joints, "3")


@pytest.mark.parametrize(
    ("limit", "at"),
    [
        ("", 0.0),  # invalid URDF
        ('effort="1" velocity="1"', 0.0),  # what is left out is zero, says the specification
        ('lower="0.25" upper="0.25"', 0.25),
        ('lower="0" upper="2e-7"', 1e-7),
    ],
)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_joint_without_room_has_no_column(made, limit, at, kind):
    """It is a fixed one, as if held, and is named; the others keep their columns."""
    places = ["0.1 0.2 0.3", "0 0 0.3", "0.3 0.1 0", "0.3 0.1 0"]
    axes = ["1 0 0", "0 1 0", "0 0 1", "1 0 0"]
    found = made.chain(made.serial(places, axes, j1={"kind": kind, "limit": limit}), "l4")
    same = made.serial(places, axes, j1={"kind": kind})
    same = made.chain(same, "l4", locked_at={"j1": at})
    assert found.names == ("j0", "j2", "j3")
    assert found.immobile == (("j1", pytest.approx(at)),)
    ours, theirs = (
        RobotArm(chain, PLANE, 0.5).metric_jacobian([0.1, 0.2, 0.3]) for chain in (found, same)
    )
    assert ours == pytest.approx(theirs, abs=1e-15)


def followers(made, *mimics):
    """Joints of which each after the first follows one."""
    kinds = {f"j{k}": {"mimic": f"<mimic {mimic}/>"} for k, mimic in enumerate(mimics, start=1)}
    count = len(mimics) + 1
    return made.serial(["0 0 0.3"] * count, ["0 0 1"] * count, **kinds)


def test_a_row_of_mimicry_that_is_too_long_is_refused(made):
    joints = followers(made, *(f'joint="j{k}"' for k in range(119)))
    with pytest.raises(InputError, match="<mimic> of joint j100 is too long a row"):
        made.chain(joints, "l120")


def test_rows_of_mimicry_whose_multipliers_grow_are_refused(made):
    for one in ("1e15", "1e-15"):
        joints = followers(made, *(f'joint="j{k}" multiplier="{one}"' for k in range(2)))
        with pytest.raises(InputError, match="<mimic> of joint j2 is multiplier 1e"):
            made.chain(joints, "l3")


def test_mimicry_of_mimicry_and_of_multiplier_zero(made):
    joints = followers(
        made,
        'joint="j0" multiplier="2" offset="0.1"',
        'joint="j1" multiplier="-3" offset="0.4"',
        'joint="j0" multiplier="0" offset="0.3"',
    )
    chain = made.chain(joints, "l4")
    driven = [(motion.multiplier, motion.offset) for motion in chain.motions]
    assert driven == [(1.0, 0.0), (2.0, 0.1), (-6.0, pytest.approx(0.1))]


def test_speeds_are_read_and_narrowed_by_mimics(made):
    mimic = '<mimic joint="j1" multiplier="4"/>'
    joints = made.serial(["0 0 0.3"] * 7, j2={"mimic": mimic}, j3={"kind": "continuous"})
    chain = made.chain(joints, "l7")
    assert [one.velocity for one in chain.joints] == [1, 0.25, np.inf, 1, 1, 1]


def test_a_chain_of_more_joints_than_a_robot_has_is_refused(made):
    """It would take minutes."""
    joints = made.serial(["0.1 0 0"] * 101, ["0 0 1"] * 101)
    with pytest.raises(InputError, match="that move l101 is 101; allowed: at most 100"):
        made.chain(joints, "l101")
    assert len(made.chain(joints, "l100").joints) == 100


def test_a_joint_of_which_the_limits_are_too_near_each_other_is_said_to_be_immobile(made):
    near = {"j2": {"limit": 'lower="0.3" upper="0.300000001" effort="1" velocity="1"'}}
    text = made.urdf(made.serial(["0.1 0.05 0.3"] * 7, (made.AXES * 3)[:7], **near))
    with pytest.raises(
        InputError, match="j2 cannot move: limits missing, or at most 1e-06 rad"
    ):
        made.arm(text, "l7")
    notes = made.arm(text, "l7", "position").chain.notes
    assert "missing, or at most 1e-06 rad or m apart, cannot move" in notes[0]
