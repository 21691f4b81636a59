"""A matrix whose columns depend on variables, and derivatives written out in matrix operations.

Automatic differentiation of J(x) Jᵀ(x), of its inverse and of what follows from them gives
hundreds of thousands of scalar operations. Written in matrices they are a few products. Let
d_p be the derivative of the one column k(p) that the variable p moves, and D = (d_p). Where a
variable moves several columns, as in a robot, p is an entry of J itself, D is made of identity
matrices, and the chain rule leads on to x. A subscript x means: expanded by [k, k].
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

# A matrix with a pivot below this counts as not positive definite.
_LEAST_PIVOT = 1e-9


@dataclass(frozen=True, eq=False)
class Columns:
    """A matrix J(x), ready for derivatives of functions of it."""

    owner: tuple[int, ...]  # k(p), the column that each variable moves
    matrix: ca.Function  # of x: J, shape (m, n), and D, shape (m, len(owner))
    # Of x: ∂vec(J)/∂x where a variable moves several columns; None elsewhere.
    chain: ca.Function | None
    curvature: ca.Function  # of x and vec(Y): second derivatives of ⟨Y, J⟩

    @classmethod
    def of(cls, variables: ca.SX, matrix: ca.SX) -> Columns:
        """Return the columns of a matrix of expressions."""
        m, n = matrix.shape
        slopes = ca.jacobian(ca.vec(matrix), variables)
        rows, columns = (np.array(part, dtype=int) for part in slopes.sparsity().get_triplet())
        moved = [sorted(set(rows[columns == p] // m)) for p in range(variables.numel())]
        if all(len(places) <= 1 for places in moved):
            owner = tuple(int(places[0]) if places else 0 for places in moved)
            own = [slopes[m * k : m * (k + 1), p] for p, k in enumerate(owner)]
            chain, directions = None, ca.horzcat(*own)
        else:
            owner = tuple(k for k in range(n) for _ in range(m))
            chain = ca.Function("chain", [variables], [ca.densify(slopes)])
            directions = ca.SX(np.tile(np.eye(m), n))
        values = [ca.densify(matrix), ca.densify(directions)]
        entries = ca.Function("matrix", [variables], values)
        return cls(owner, entries, chain, second(variables, ca.vec(ca.densify(matrix))))

    def slopes(self, x: ca.MX, own: ca.MX) -> ca.MX:
        """Return first derivatives in x from those in p."""
        return own if self.chain is None else own @ self.chain(x)

    def second(self, x: ca.MX, own: ca.MX, gradient: ca.MX) -> ca.MX:
        """Return second derivatives in x from those in p and the gradient in J, (m, n)."""
        bent = self.curvature(x, ca.vec(gradient))
        if self.chain is None:
            return own + bent
        chain = self.chain(x)
        return chain.T @ own @ chain + bent


def gauss_newton(columns: Columns, x: ca.MX, scale: ca.MX | float = 1.0) -> ca.MX:
    """Return a positive definite approximation of the Hessian of ½‖S‖_F², times a scale.

    S = JJᵀ − (‖J‖_F²/m) I. Derivatives of S among themselves, and (‖S‖_F/10 + 1e-8) I: where
    S is not zero at the minimum, they alone leave out what holds the frame's directions. ::

        ∂_p S = d_p jᵀ + j d_pᵀ − (τ_p/m) I,  τ_p = 2 d_p·j,  j the column k(p)
        ⟨∂_p S, ∂_q S⟩ = 2 (DᵀD ∘ (JᵀJ)ₓ + R ∘ Rᵀ) − ττᵀ/m,  R_pq = j_k(p)·d_q
    """
    k = list(columns.owner)
    jacobian, directions = columns.matrix(x)
    m = jacobian.shape[0]
    gram = jacobian @ jacobian.T
    defect = gram - ca.trace(gram) / m * ca.MX.eye(m)
    # Scaled while it is small: each pass over the result takes as long as its arithmetic.
    scaled = (2 * scale * directions).T
    across = (jacobian.T @ directions)[k, :]
    trace = 2 * ca.diag(across)
    own = (scaled @ directions) * (jacobian.T @ jacobian)[k, k]
    own += across * (scaled @ jacobian)[:, k]
    own = ca.mac(trace * (-scale / m), trace.T, own)
    if columns.chain is not None:
        chain = columns.chain(x)
        own = chain.T @ own @ chain
    shift = scale * (0.1 * ca.sqrt(ca.sumsqr(defect)) + 1e-8)
    return own + ca.diag(ca.repmat(shift, own.shape[0], 1))


def second(variables: ca.SX, rows: ca.SX) -> ca.Function:
    """Return the function of x and λ that is the Hessian of λ·rows(x)."""
    weights = ca.SX.sym("lambda", rows.numel())
    hessian = ca.hessian(ca.dot(weights, rows), variables)[0]
    return ca.Function("second", [variables, weights], [hessian])


def inverse(matrix: ca.SX) -> ca.SX:
    """Return the inverse of a positive definite matrix by LDLᵀ; NaN where it is not one.

    A solver then shortens its step; a large finite value would mislead it.
    """
    size = matrix.shape[0]
    lower = ca.SX.eye(size)
    pivots: list[ca.SX] = []
    for j in range(size):
        known = sum((lower[j, i] ** 2 * pivots[i] for i in range(j)), ca.SX(0))
        pivot = matrix[j, j] - known
        pivots.append(ca.if_else(pivot > _LEAST_PIVOT, pivot, np.nan))
        for row in range(j + 1, size):
            known = sum((lower[row, i] * lower[j, i] * pivots[i] for i in range(j)), ca.SX(0))
            lower[row, j] = (matrix[row, j] - known) / pivots[j]
    root = ca.SX.eye(size)  # L⁻¹, by forward substitution
    for i in range(size):
        for j in range(i):
            root[i, j] = -sum((lower[i, r] * root[r, j] for r in range(j, i)), ca.SX(0))
    scaled = ca.vertcat(*(root[i, :] / pivots[i] for i in range(size)))
    return ca.densify(root.T @ scaled)
