"""Blocks and localisers evaluated in a second way, without the averages of the library.

Wigner functions come from Euler angles and the exponential of J_y instead of Clebsch–Gordan
coefficients, and the order of the joints is averaged by summing over all n! orders with one
tableau, instead of over tableaux with one order. For conditions the multiplier's root gives
vectors w of polynomials; they are written out in full, and wᵀQw is evaluated with the matrix Q
itself.
"""

from itertools import permutations
from math import factorial

import numpy as np
from scipy.linalg import expm

from lockedjoint.formulations.bounds.moments.rotations import jacobians_of
from lockedjoint.nlp.arrays import semidefinite_root

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
        # Rows without any joint are the same for all orders.
        total += np.repeat(values, size // values.shape[1], axis=1)
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


def plain_condition_sum(family, rotations, multipliers, form=None):
    """Return Σ ⟨X, B(x)⟩ of a family by summing over all orders, (configurations,).

    `form` is the condition in a second way: vectors w_a, (entries, vectors), and their matrix,
    at a Jacobian and the locked joint.
    """
    if form is None:
        assert family.condition is None
        return averaged_sum_of_squares(family, rotations, multipliers)
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
                found[number] += _sum(family, here, some, block, weights, plain, form)
    return found / (factorial(family.joints) * (2 * family.sector.spin + 1))


def _sum(family, jacobian, orders, block, weights, plain, form):
    """Return Σ wᵀQw over orders, components and columns of the root."""
    polynomials = [first_tableau(block, root, plain) for root in weights]
    # Rows without any joint are the same for all orders: one value for each component.
    columns = len(orders) * (2 * (2 * family.sector.spin + 1))
    shaped = [
        np.repeat(values, columns // values.shape[1], axis=1).reshape(
            len(values), -1, len(orders)
        )
        for values in polynomials
    ]
    total = 0.0
    for locked in [None] if family.sector.locked is None else range(jacobian.shape[1]):
        here = np.full(len(orders), True) if locked is None else orders[:, 0] == locked
        vectors, matrix = form(jacobian, locked)
        together = np.stack([values[..., here].ravel() for values in shaped])
        w = vectors @ together
        total += float(np.sum(w * (matrix @ w)))
    return total


def defect(jacobian):
    """Return E = JJᵀ − (n/3)I."""
    return jacobian @ jacobian.T - jacobian.shape[1] / 3 * np.eye(6)


def number(value):
    """Return a condition on one number, a function of J."""
    return lambda jacobian, _: (np.eye(1), np.array([[value(jacobian)]]))


def scaled(limit, unit):
    """Return (limit − ρ)/unit."""
    return number(lambda j: (limit - 0.5 * np.sum(defect(j) ** 2)) / unit)


def spectral(limit):
    """Return α + tr E³/5 − ρ, by eigenvalues."""

    def value(jacobian):
        e = np.linalg.eigvalsh(defect(jacobian))
        return limit + np.sum(e**3) / 5 - np.sum(e**2) / 2

    return number(value)


def near(limit):
    """Return (limit − |s|²)/2."""
    return number(lambda j: (limit - np.sum(np.sum(j, axis=1) ** 2)) / 2)


def krylov(t):
    """Return J_f J_fᵀ − tI on (3M/n)ᵏj_f/√2."""

    def condition(jacobian, locked):
        powers = [jacobian[:, locked] / np.sqrt(2)]
        for _ in range(2):
            powers.append(3 / jacobian.shape[1] * jacobian @ jacobian.T @ powers[-1])
        kept = np.delete(jacobian, locked, axis=1)
        return np.stack(powers, axis=1), kept @ kept.T - t * np.eye(6)

    return condition


def gram(t):
    """Return J_fᵀJ_f − tI on (1, …, 1)/√6, J_fᵀj_f/√2 and J_fᵀs/0.6."""

    def condition(jacobian, locked):
        kept = np.delete(jacobian, locked, axis=1)
        ones = np.ones(kept.shape[1])
        parts = [ones / np.sqrt(6), kept.T @ jacobian[:, locked] / np.sqrt(2)]
        parts.append(kept.T @ jacobian.sum(axis=1) / 0.6)
        return np.stack(parts, axis=1), kept.T @ kept - t * np.eye(len(ones))

    return condition


def deviation(share):
    """Return (δ₀M − ssᵀ)/0.36 on j_f/√2, s/0.6 and 3M/n times them."""

    def condition(jacobian, locked):
        total, whole = jacobian.sum(axis=1), jacobian @ jacobian.T
        first = np.stack([jacobian[:, locked] / np.sqrt(2), total / 0.6], axis=1)
        vectors = np.hstack([first, 3 / jacobian.shape[1] * whole @ first])
        return vectors, (share * whole - np.outer(total, total)) / 0.36

    return condition
