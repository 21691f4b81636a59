"""A matrix whose columns depend on variables, and derivatives written out in matrix operations.

Automatic differentiation of J(x) Jᵀ(x), of its inverse and of what follows from them gives
hundreds of thousands of scalar operations. Written in matrices they are a few products.

x are the N variables; J(x) is a matrix of shape (m, n). A parameter p moves one column of J,
that of index k(p). d_p is the derivative of this column by p, shape (m,), and D, shape (m, P),
has d_p as its columns, one for each of P parameters.

- Where every variable moves one column at most, the parameters are the variables, P = N.
- Where a variable moves several columns, as in a robot, the parameters are the entries of J,
  column by column, P = mn. D then consists of n identity matrices side by side, and the chain
  rule leads from the entries to x.

A matrix of shape (n, n) with the subscript ₓ is expanded by k to shape (P, P): its entry (p, q)
is that of (k(p), k(q)), in code ``[k, k]``. ∘ is the product entry by entry. SX are CasADi's
scalar expressions, MX its matrix expressions.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

# A matrix with a pivot below this counts as not positive definite. J has entries of the order
# of 1; a larger number would cut off optima near a singular matrix.
_LEAST_PIVOT = 1e-9
# The Gauss–Newton Hessian gets this multiple of ‖S‖_F on its diagonal: more of it makes shorter
# steps, less of it leaves directions without curvature.
_SHIFT_SHARE = 0.1
# The least that is added to the diagonal, where S is zero: the frame's directions have no
# curvature at all.
_LEAST_SHIFT = 1e-8


@dataclass(frozen=True, eq=False)
class Columns:
    """A matrix J(x), ready for derivatives of functions of it."""

    owner: tuple[int, ...]  # k(p), the column that each of the P parameters moves
    matrix: ca.Function  # of x: J, shape (m, n), and D, shape (m, P)
    # Function of x: ∂vec(J)/∂x, shape (mn, N), where a variable moves several columns; else
    # None.
    chain: ca.Function | None
    curvature: ca.Function  # of x and vec(Y): second derivatives of ⟨Y, J⟩ in x, shape (N, N)

    @classmethod
    def of(cls, variables: ca.SX, matrix: ca.SX) -> Columns:
        """Return the columns of a matrix of expressions, shape (m, n), in N variables."""
        m, n = matrix.shape
        slopes = ca.jacobian(ca.vec(matrix), variables)  # shape (mn, N), columns of J stacked
        rows, columns = (np.array(part, dtype=int) for part in slopes.sparsity().get_triplet())
        # The columns of J that each variable moves: row i of `slopes` belongs to column i // m.
        moved = [sorted(set(rows[columns == p] // m)) for p in range(variables.numel())]
        if all(len(places) <= 1 for places in moved):
            owner = tuple(int(places[0]) if places else 0 for places in moved)
            by_variable = [slopes[m * k : m * (k + 1), p] for p, k in enumerate(owner)]
            chain, directions = None, ca.horzcat(*by_variable)
        else:
            owner = tuple(k for k in range(n) for _ in range(m))
            chain = ca.Function("chain", [variables], [ca.densify(slopes)])
            directions = ca.SX(np.tile(np.eye(m), n))
        values = [ca.densify(matrix), ca.densify(directions)]
        entries = ca.Function("matrix", [variables], values)
        return cls(owner, entries, chain, second(variables, ca.vec(ca.densify(matrix))))

    def slopes(self, x: ca.MX, by_parameter: ca.MX) -> ca.MX:
        """Return first derivatives in x, shape (rows, N), from those in p, shape (rows, P)."""
        return by_parameter if self.chain is None else by_parameter @ self.chain(x)

    def second(self, x: ca.MX, by_parameter: ca.MX, gradient: ca.MX) -> ca.MX:
        """Return the second derivatives in x of a function of J, shape (N, N).

        They follow from those in p, J taken as linear in p, shape (P, P), and from the
        function's gradient in J, shape (m, n), times the curvature of J(x).
        """
        bent = self.curvature(x, ca.vec(gradient))
        if self.chain is None:
            return by_parameter + bent
        chain = self.chain(x)
        return chain.T @ by_parameter @ chain + bent


def gauss_newton(columns: Columns, x: ca.MX, scale: ca.MX | float = 1.0) -> ca.MX:
    """Return a positive definite approximation of the Hessian of ½‖S‖_F² in x, times a scale.

    S = JJᵀ − (‖J‖_F²/m) I. The approximation, shape (N, N), has the inner products of the
    derivatives of S, and (‖S‖_F/10 + 1e-8) I beside them: where S is not zero at the minimum,
    the products alone leave out what holds the frame's directions. ::

        ∂_p S = d_p jᵀ + j d_pᵀ − (τ_p/m) I,  τ_p = 2 d_p·j,  j the column k(p)
        ⟨∂_p S, ∂_q S⟩ = 2 (DᵀD ∘ (JᵀJ)ₓ + R ∘ Rᵀ) − τ_p τ_q/m,  R_pq = j_k(p)·d_q

    In the code `across` is R and `trace` is τ; the factor `scale` is put into them while they
    are small, since each pass over a matrix of shape (P, P) takes as long as its arithmetic.
    """
    k = list(columns.owner)
    jacobian, directions = columns.matrix(x)
    m = jacobian.shape[0]
    gram = jacobian @ jacobian.T
    defect = gram - ca.trace(gram) / m * ca.MX.eye(m)
    scaled = (2 * scale * directions).T
    across = (jacobian.T @ directions)[k, :]
    trace = 2 * ca.diag(across)
    products = (scaled @ directions) * (jacobian.T @ jacobian)[k, k]
    products += across * (scaled @ jacobian)[:, k]
    products = ca.mac(trace * (-scale / m), trace.T, products)
    if columns.chain is not None:
        chain = columns.chain(x)
        products = chain.T @ products @ chain
    shift = scale * (_SHIFT_SHARE * ca.sqrt(ca.sumsqr(defect)) + _LEAST_SHIFT)
    return products + ca.diag(ca.repmat(shift, products.shape[0], 1))


def second(variables: ca.SX, rows: ca.SX) -> ca.Function:
    """Return the function of x and λ that is the Hessian of λ·rows(x), shape (N, N).

    `rows` is a column of expressions in the variables, λ has one number for each of them.
    """
    weights = ca.SX.sym("lambda", rows.numel())
    hessian = ca.hessian(ca.dot(weights, rows), variables)[0]
    return ca.Function("second", [variables, weights], [hessian])


def inverse(matrix: ca.SX) -> ca.SX:
    """Return the inverse of a positive definite matrix by LDLᵀ; NaN where it is not one.

    A solver then shortens its step; a large finite value would mislead it. L is unit lower
    triangular, `lower`, and D has the `pivots`; the inverse is L⁻ᵀ D⁻¹ L⁻¹.
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
