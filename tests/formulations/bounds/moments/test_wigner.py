import numpy as np
import pytest

from lockedjoint.formulations.bounds.moments.rotations import jacobians_of, random_rotations
from lockedjoint.formulations.bounds.moments.wigner import (
    axis_exchange,
    coupled_tensors,
    coupling,
    wigner_matrices,
)
from tests.formulations.bounds.moments import made_rotations as so3


def test_matrices_multiply_as_rotations_do():
    first, second = so3.haar_rotations(1, 2, 4)
    together = wigner_matrices(first @ second, 6)
    pairs = zip(wigner_matrices(first, 6), wigner_matrices(second, 6), strict=True)
    for spin, (a, b) in enumerate(pairs):
        np.testing.assert_allclose(together[spin], a @ b, atol=1e-12)
        unit = np.broadcast_to(np.eye(2 * spin + 1), a.shape)
        np.testing.assert_allclose(a @ a.conj().swapaxes(-1, -2), unit, atol=1e-12)


def test_first_spin_holds_the_columns_of_the_jacobian():
    rotation = so3.haar_rotations(2, 1, 1)[0, 0]
    one = wigner_matrices(rotation, 1)[1]
    v, omega = rotation[:, 0], rotation[:, 1]
    # Component 0 of the frame and m = 1: ⟨z, R e₊₁⟩ = −(v + iω)_z/√2.
    assert one[1, 2] == pytest.approx(-(v[2] + 1j * omega[2]) / np.sqrt(2))


def test_phase_multiplies_by_its_charge():
    rotation = so3.haar_rotations(3, 1, 1)[0, 0]
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    pairs = zip(wigner_matrices(rotation @ turn, 4), wigner_matrices(rotation, 4), strict=True)
    for spin, (a, b) in enumerate(pairs):
        phases = np.exp(-0.3j * np.arange(-spin, spin + 1))
        np.testing.assert_allclose(a, b * phases, atol=1e-13)


@pytest.mark.parametrize(("first", "second"), [(1, 1), (2, 3), (4, 2)])
def test_couplings_are_complete_and_orthonormal(first, second):
    size = (2 * first + 1) * (2 * second + 1)
    totals = range(abs(first - second), first + second + 1)
    tables = [coupling(first, second, total).reshape(size, -1) for total in totals]
    together = np.hstack(tables)
    np.testing.assert_allclose(together.T @ together, np.eye(size), atol=1e-14)


def test_exchanging_factors_is_orthogonal_and_undone_by_its_inverse():
    spins, order = (1, 2, 1, 2), (2, 0, 3, 1)
    there = axis_exchange(spins, 1, order)
    back = axis_exchange(tuple(spins[q] for q in order), 1, tuple(np.argsort(order).tolist()))
    np.testing.assert_allclose(back @ there, np.eye(len(there)), atol=1e-13)
    assert len(coupled_tensors(spins, 1)) == len(there) > 1


def test_rotations_take_the_axes_to_the_columns_of_the_jacobian():
    rotations = random_rotations(np.random.default_rng(4), 1, 7)[0]
    jacobian = jacobians_of(rotations)
    np.testing.assert_array_equal(jacobian, so3.jacobian(rotations))
    third = np.cross(jacobian[:3].T, jacobian[3:].T)
    np.testing.assert_allclose(rotations[..., 2], third, atol=1e-14)
