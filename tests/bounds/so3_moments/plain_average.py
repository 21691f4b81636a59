"""Blocks and localisers evaluated in a second way, without the averages of the library.

Wigner functions come from Euler angles and the exponential of J_y instead of Clebsch–Gordan
coefficients, and the order of the joints is averaged by summing over all n! orders with one
tableau, instead of over tableaux with one order. For Krylov localisers the multiplier's root
gives vectors w of six polynomials; they are written out in full, and wᵀ(J_f J_fᵀ − tI)w is
evaluated with the matrix itself.
"""

from itertools import permutations
from math import factorial

import numpy as np
from scipy.linalg import expm

from formulations.bounds.so3_moments.wigner import jacobians_of
from nlp.arrays import semidefinite_root

_ORDERS_AT_ONCE = 720


def plain_values(family, configuration):
    """Give orders of the joints, and the values of all plain rows at each, all n! in turn."""
    orders = np.array(list(permutations(range(family.joints))))
    single = [wigner_by_angles(configuration, spin) for spin in range(family.largest_spin + 1)]
    for start in range(0, len(orders), _ORDERS_AT_ONCE):
        some = orders[start : start + _ORDERS_AT_ONCE]
        wigner = [matrix[some] for matrix in single]
        yield some, family.plain_values(wigner, range(family.joints))


def averaged_sum_of_squares(family, rotations, multipliers):
    """Return Σ ⟨X, B(x)⟩ over the blocks of a sector at configurations, (configurations,)."""
    roots = [semidefinite_root(x) for x in multipliers]
    found = np.zeros(len(rotations))
    for number, configuration in enumerate(rotations):
        for _, plain in plain_values(family, configuration):
            for block, root in zip(family.blocks, roots, strict=True):
                found[number] += np.sum(first_tableau(block, root, plain) ** 2)
    return found / (factorial(family.joints) * (2 * family.sector.spin + 1))


def first_tableau(block, root, plain):
    """Return rootᵀ times the values of the block's rows for one tableau."""
    size = max(values[0].size for values in plain)
    total = np.zeros((root.shape[1], size))
    for number, columns, coefficients in block.parts:
        weights = coefficients[0] @ root[columns.start : columns.stop]
        values = weights.T @ plain[number].reshape(len(plain[number]), -1)
        total += np.tile(values, size // values.shape[1])
    return total


def wigner_by_angles(rotations, spin):
    """Return D^spin, (n, 2·spin+1, 2·spin+1), of R = R_z(α) R_y(β) R_z(γ)."""
    m = np.arange(-spin, spin + 1)
    raising = np.diag(np.sqrt(spin * (spin + 1) - m[:-1] * (m[:-1] + 1)), -1)
    generator = 0.5 * (raising - raising.T)  # i J_y
    beta = np.arccos(np.clip(rotations[:, 2, 2], -1, 1))
    alpha = np.arctan2(rotations[:, 1, 2], rotations[:, 0, 2])
    gamma = np.arctan2(rotations[:, 2, 1], -rotations[:, 2, 0])
    middle = np.stack([expm(-b * generator) for b in beta])
    left, right = np.exp(-1j * np.outer(alpha, m)), np.exp(-1j * np.outer(gamma, m))
    return np.asarray(left[:, :, None] * middle * right[:, None, :])


def plain_condition_sum(family, rotations, multipliers):
    """Return Σ ⟨X, B(x)⟩ of a family by summing over all orders, (configurations,).

    Raises
    ------
    TypeError
        If there is no second way to evaluate the family.
    """
    if family.form is None:
        found = averaged_sum_of_squares(family, rotations, multipliers)
        return found if family.factor is None else family.factor(rotations) * found
    if family.form.limit is not None:
        return averaged_krylov_sum(family, rotations, multipliers)
    raise TypeError(f"no second way to evaluate {family.form}")


def averaged_krylov_sum(family, rotations, multipliers):
    """Return Σ ⟨X, B(x)⟩ over the blocks of a Krylov localiser, (configurations,)."""
    roots = [semidefinite_root(x) for x in multipliers]
    found = np.zeros(len(rotations))
    for number, configuration in enumerate(rotations):
        for some, plain in plain_values(family, configuration):
            together = zip(family.blocks, roots, family.selections, strict=True)
            for block, root, (chosen, powers) in together:
                weights = []
                for power in range(len(family.lowered)):
                    weights.append(np.zeros((block.size, root.shape[1])))
                    weights[-1][chosen[powers == power]] = root[powers == power]
                here = jacobians_of(configuration)
                found[number] += _sum(family, here, some, block, weights, plain)
    return found / (factorial(family.joints) * (2 * family.sector.spin + 1))


def _sum(family, jacobian, orders, block, weights, plain):
    """Return Σ wᵀ(J_f J_fᵀ − tI)w over orders, components and columns of the root."""
    joints = jacobian.shape[1]
    whole = jacobian @ jacobian.T / (joints / 3)
    polynomials = [first_tableau(block, root, plain) for root in weights]
    # Rows without any joint are the same for all orders: one value for each component.
    columns = len(orders) * (2 * (2 * family.sector.spin + 1))
    shaped = [
        np.tile(values, columns // values.shape[1]).reshape(len(values), len(orders), -1)
        for values in polynomials
    ]
    total = 0.0
    for locked in range(joints):
        here = orders[:, 0] == locked
        vector = jacobian[:, locked] / np.sqrt(2)
        w = np.zeros((6, *shaped[0][:, here].shape))
        for values in shaped:
            w += vector[:, None, None, None] * values[:, here]
            vector = whole @ vector
        flat = w.reshape(6, -1)
        kept = np.delete(jacobian, locked, axis=1)
        total += float(np.sum(flat * ((kept @ kept.T - family.form.limit * np.eye(6)) @ flat)))
    return total
