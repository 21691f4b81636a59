"""The smooth worst case of one configuration is that of many, by other formulas."""

import copy
import pickle

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.kinematics.smooth_of_one import smooth_of_one
from lockedjoint.kinematics.worst_cases import smooth_from_jacobian

MIMIC = '<mimic joint="j0" multiplier="-0.5" offset="0.2"/>'
OFFSETS = ["0.1 0.05 0.3", "0 0.2 0.1", "0.1 0 0.3", "0 0.1 0.2", "0.3 0 0", "0 0.1 0", "0 0 1"]


def arms(made):
    plain = made.urdf(made.serial(OFFSETS))
    rail = made.urdf(made.serial(OFFSETS, j1={"kind": "prismatic"}))
    mimic = made.urdf(made.serial(OFFSETS, j2={"mimic": MIMIC}))
    return {
        "all": made.arm(plain),
        "position": made.arm(plain, task="position"),
        "of the tip": made.arm(plain, task="vx,vy,wz", frame="tip"),
        "length": made.arm(plain, length=0.4),
        "rail": made.arm(rail),
        "mimic": made.arm(mimic, task="position"),
    }


@pytest.mark.parametrize("kind", ["all", "position", "of the tip", "length", "rail", "mimic"])
@pytest.mark.parametrize("width", [0.001, 0.01, 0.3])
def test_one_is_one_of_many(made, kind, width):
    arm = arms(made)[kind]
    points = arm.samples(np.random.default_rng(1), 40)
    values, slopes = arm.smooth_worst_case(points, width)
    quick = 0
    for point, value, slope in zip(points, values, slopes, strict=True):
        alone, own = arm.smooth_worst_case(point, width)
        assert (alone.shape, own.shape) == ((), (arm.size,))
        assert alone == pytest.approx(value, abs=1e-11)
        assert own == pytest.approx(slope, abs=1e-8)
        quick += smooth_of_one(arm)(point, width) is not None
    assert quick > 30


def test_near_singularity_it_is_computed_from_the_jacobian(made):
    """A straight planar arm: JJᵀ does not tell what is left."""
    arm = made.planar([1.0, 1.0, 1.0, 1.0])
    straight = np.array([0.3, 1e-6, -1e-6, 1e-6])
    assert smooth_of_one(arm)(straight, 1e-6) is None
    value, slope = arm.smooth_worst_case(straight, 1e-6)
    many, slopes = arm.smooth_worst_case(straight[None], 1e-6)
    assert value == pytest.approx(many[0], abs=1e-15)
    assert slope == pytest.approx(slopes[0], abs=1e-9)


def test_near_the_switch_it_has_all_digits(made):
    """Here the eigenvalues of JJᵀ alone would be off by 1e-13, and nearer to it by 1e-12."""
    arm = made.planar([1.0, 1.0, 1.0, 1.0])
    errors = []
    for bend in np.geomspace(2e-3, 1e-2, 30):
        point = np.array([0.3, bend, -bend, bend])
        value, _ = smooth_of_one(arm)(point, 1e-6)
        errors.append(abs(value - smooth_from_jacobian(arm, point, 1e-6)[0]))
    assert max(errors) < 1e-15


def test_what_is_no_configuration_is_refused(made):
    arm = made.arm(made.urdf(made.serial(OFFSETS)))
    for wrong in (np.full(7, np.nan), np.zeros(6)):
        with pytest.raises(lj.InputError):
            arm.smooth_worst_case(wrong)
    for width in (0, -1.0, np.nan, "wide"):
        with pytest.raises(lj.InputError, match="width is"):
            arm.smooth_worst_case(np.zeros(7), width)


def test_an_arm_travels_without_what_was_made(made):
    arm = made.arm(made.urdf(made.serial(OFFSETS)))
    value = arm.smooth_worst_case(np.full(7, 0.4))[0]
    for other in (pickle.loads(pickle.dumps(arm)), copy.deepcopy(arm)):
        assert other == arm
        assert other.smooth_worst_case(np.full(7, 0.4))[0] == value
