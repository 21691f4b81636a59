"""The Appendix: f_1 … f_21 as printed, against eqs. (23)–(43) computed from J."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np

from formulations import appendix
from formulations.isotropy_equations import pairs
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.reproduction.row import Row, Verdict, shown_error
from formulations.reproduction.verdicts import misprint
from nlp.arrays import FloatArray

Forms = Callable[[ca.SX], ca.SX]
ROW_NAMES = ("v_x", "v_y", "v_z", "ω_x", "ω_y", "ω_z")
_ROUNDING = 1e-12
_CONFIGURATIONS = 50


def _as_printed(variables: ca.SX) -> ca.SX:
    return appendix.closed_forms(variables, as_printed=True)


def rows(
    seed: int = 0, printed: Forms = _as_printed, corrected: Forms = appendix.closed_forms
) -> Iterator[Row]:
    """One row per closed form, compared at random configurations of a 7R."""
    arm = Arm.of(UnitRevolute(), 7)
    rng = np.random.default_rng(seed)
    points = [arm.sample(rng) for _ in range(_CONFIGURATIONS)]
    derived = np.array(appendix.SIGNS) * [_equations(arm.jacobian(point)) for point in points]
    print_errors, corrected_errors = (
        np.max(np.abs(_values(arm, forms, points) - derived), axis=0)
        for forms in (printed, corrected)
    )
    for k, (print_error, corrected_error) in enumerate(
        zip(print_errors, corrected_errors, strict=True)
    ):
        yield _row(k, float(print_error), float(corrected_error))


def _row(k: int, print_error: float, corrected_error: float) -> Row:
    i, j = pairs(6)[k]
    product = f"{ROW_NAMES[i]}ᵀ{ROW_NAMES[j]}"
    entry = product if i != j else f"{product} − n/3"
    verdict = misprint(print_error, corrected_error, _ROUNDING)
    note = "printed with the opposite sign; 7/3 stands for n/3" if i == j else ""
    equation, quantity = f"({23 + k})", f"f_{k + 1} = {entry}, closed form"
    if k + 1 == appendix.MISPRINTED and verdict is not Verdict.AGREES:
        return Row(
            equation,
            quantity,
            "Σ −sinβ cosβ cosγ",
            "Σ −sinα cos²β cosγ",
            verdict,
            f"the print repeats f_18 and is off by up to {print_error:.2g}; ours equals J's "
            f"entry {shown_error(corrected_error, _ROUNDING)}",
        )
    ours = f"equal {shown_error(print_error, _ROUNDING)}"
    return Row(equation, quantity, "as printed in the Appendix", ours, verdict, note)


def _equations(jacobian: FloatArray) -> FloatArray:
    """Left-hand sides of eqs. (23)–(43) from J alone, shape (21,)."""
    n = jacobian.shape[1]
    deviation = jacobian @ jacobian.T - n / 3 * np.eye(6)
    return np.array([deviation[i, j] for i, j in pairs(6)])


def _values(arm: Arm, forms: Forms, points: list[FloatArray]) -> FloatArray:
    variables = arm.symbols()
    function = ca.Function("forms", [variables], [forms(variables)])
    return np.array([np.array(function(point)).ravel() for point in points])
