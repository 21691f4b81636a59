"""JAX: the worst case of an arm as a pure function of q, for pyroki and whatever else traces.

J(q) is the library's own, CasADi's expressions carried out by jax.numpy one after the other, so
that it can be compiled, batched and differentiated to any order.

JAX computes in single precision unless it is told otherwise, in which σ has six digits and
small ones none: that must be asked for, by `single`. Configurations of another shape are
refused, also while JAX traces; NaN is where there are numbers, and not in compiled functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from lockedjoint.adapters import checked
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.errors import InputError, LockedJointError, MissingLibraryError, of_kind

try:
    import jax
    import jax.numpy as jnp
except ImportError:
    raise MissingLibraryError("jax") from None

#: A function of configurations, shape (…, n).
Function = Callable[[jax.Array], jax.Array]

# What jax.numpy does for each of CasADi's operations that Jacobians of arms have.
_OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_SQRT: jnp.sqrt,
    ca.OP_SIN: jnp.sin,
    ca.OP_COS: jnp.cos,
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_CONSTPOW: lambda a, b: a**b,
}


def jacobian(robot: object, single: bool = False) -> Function:
    """Return J(q), of shapes (…, n) → (…, m, n), with lengths in units of the arm's ℓ.

    `robot` is a `Robot`, or what makes one; `single` allows single precision. So below.
    """
    return _jacobian(checked(robot), single)


def _jacobian(arm: RobotArm, single: bool) -> Function:
    """Return J(q) of an arm: CasADi's program, carried out by jax.numpy."""
    of_kind("single", single, bool, "True or False")
    q = arm.symbols()
    program = ca.Function("jacobian", [q], [ca.densify(arm.matrix(q))])
    m, n = arm.shape

    def of(points: jax.Array) -> jax.Array:
        points = _checked(points, n, single)
        columns = [points[..., k] for k in range(n)]
        entries = _carried_out(program, columns, jnp.zeros_like(columns[0]))
        # CasADi's entries are column by column.
        return jnp.stack(entries, axis=-1).reshape(*points.shape[:-1], n, m).swapaxes(-1, -2)

    return of


def worst_case(robot: object, single: bool = False) -> Function:
    """Return σ(q) (eq. 5), of shapes (…, n) → (…).

    Where failures tie it has a kink, and JAX's slope there is the mean of theirs.
    """
    left = _singular_values_left(checked(robot), single)
    return lambda points: jnp.min(left(points), axis=(-2, -1))


def smooth_worst_case(robot: object, width: float = 0.01, single: bool = False) -> Function:
    """Return s(q) of `RobotArm.smooth_worst_case`: at most w log(mn) below σ, without kinks."""
    left = _singular_values_left(checked(robot, width), single)
    return lambda points: -width * jax.nn.logsumexp(-left(points) / width, axis=(-2, -1))


def _singular_values_left(arm: RobotArm, single: bool) -> Function:
    """Return the singular values after each failure, of shapes (…, n) → (…, n, m)."""
    matrix, joints = _jacobian(arm, single), arm.shape[1]

    def of(points: jax.Array) -> jax.Array:
        full = matrix(points)
        rest = jnp.stack([jnp.delete(full, k, axis=-1) for k in range(joints)], axis=-3)
        return jnp.linalg.svd(rest, compute_uv=False)

    return of


def _checked(points: Any, joints: int, single: bool) -> jax.Array:
    """Return configurations, shape (…, n), as an array of JAX; InputError if not allowed."""
    try:
        points = jnp.asarray(points)
    except (TypeError, ValueError):
        raise InputError("configurations", points, "an array of real numbers") from None
    if points.shape[-1:] != (joints,):
        allowed = f"shape (…, {joints})"
        raise InputError("configurations", f"an array of shape {points.shape}", allowed)
    if points.dtype != jnp.float64 and not (single and points.dtype == jnp.float32):
        enabled = "jax.config.update('jax_enable_x64', True)"
        allowed = f"float64, by {enabled}, or float32 with single=True"
        raise InputError("configurations", f"an array of {points.dtype}", allowed)
    if not isinstance(points, jax.core.Tracer) and not bool(jnp.all(jnp.isfinite(points))):
        allowed = "finite numbers only"
        raise InputError("configurations", "an array with NaN or infinity", allowed)
    return points


def _carried_out(program: ca.Function, inputs: list[jax.Array], zero: jax.Array) -> list[Any]:
    """Carry out a program of CasADi; return the entries of its one result, column by column.

    `inputs` are the entries of its one argument, and `zero` is a zero of their shape and type.
    The program is a list of instructions on a list of numbers, `work`.
    """
    work: list[Any] = [zero] * program.sz_w()
    result: list[Any] = [zero] * program.nnz_out(0)
    for k in range(program.n_instructions()):
        operation = program.instruction_id(k)
        sources, targets = program.instruction_input(k), program.instruction_output(k)
        if operation == ca.OP_CONST:
            work[targets[0]] = zero + program.instruction_constant(k)
        elif operation == ca.OP_INPUT:
            work[targets[0]] = inputs[sources[1]]
        elif operation == ca.OP_OUTPUT:
            result[targets[1]] = work[sources[0]]
        elif operation in _OPERATIONS:
            work[targets[0]] = _OPERATIONS[operation](*(work[i] for i in sources))
        else:
            raise LockedJointError(f"the arm's Jacobian uses CasADi's operation {operation}")
    return result
