"""Ipopt, called by CasADi."""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.calls import Call, CasadiCall

# CasADi's names of derivatives, and of Ipopt's options that replace them.
_OPTIONS = {"nlp_hess_l": "hess_lag", "nlp_jac_g": "jac_g"}


def ipopt_call(
    program: Mapping[str, ca.SX],
    functions: Sequence[ca.Function],
    settings: Mapping[str, Any],
    bounds: FloatArray,
) -> Call:
    """Return the call of Ipopt.

    Parameters
    ----------
    program
        The program as CasADi has it: ``x``, ``f``, to be minimised, and ``g``.
    functions
        Those of `callbacks`, none where no derivatives are written out.
    settings
        Options of `casadi.nlpsol`.
    bounds
        Lower and upper bounds of the variables and then of ``g``, shape (2, numbers).
    """
    named = {function.name(): function for function in functions}
    written = {option: named[key] for key, option in _OPTIONS.items() if named}
    solver = ca.nlpsol("solver", "ipopt", program, {**settings, **written})
    return CasadiCall(solver, bounds, program["x"].numel())
