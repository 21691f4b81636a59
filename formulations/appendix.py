"""The Appendix: f_1 … f_21 of unit revolute joints as closed forms of their angles.

With α_i, β_i, γ_i as in eq. (21) the Appendix expands the distinct entries of JJᵀ − (n/3)I.
Three remarks on the print:

- f_17 repeats f_18, −Σ sinβ cosβ cosγ. By eq. (39) it is v_zᵀω_y = −Σ sinα cos²β cosγ.
- f_1 … f_6 are n/3 − v_xᵀv_x and so on, the negatives of eqs. (23)–(28).
- Their 7/3 is n/3 for the paper's n = 7; here it is n/3.
"""

import casadi as ca

from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.joints.kinds import UnitRevolute
from nlp.errors import InputError

#: Sign of f_k as printed relative to eqs. (23)–(43), k = 1 … 21.
SIGNS = (-1,) * 6 + (1,) * 15
#: The printed number of the misprinted equation.
MISPRINTED = 17


def closed_forms(variables: ca.SX, as_printed: bool = False) -> ca.SX:
    """f_1 … f_21 with the Appendix's signs.

    Parameters
    ----------
    variables
        α_1, β_1, γ_1, α_2, …, in radians, shape (3n, 1).
    as_printed
        Whether to keep the misprint in f_17.

    Returns
    -------
    casadi.SX
        Shape (21, 1).

    Raises
    ------
    InputError
        If there are not three angles for every joint.
    """
    if not variables.is_column() or variables.numel() % 3 or not variables.numel():
        allowed = "a column of three angles per joint"
        raise InputError("variables", f"of shape {variables.shape}", allowed)
    n = variables.numel() // 3
    joints = [_summands(*ca.vertsplit(variables[3 * i : 3 * i + 3])) for i in range(n)]
    norms = [n / 3 - sum(joint[0][k] for joint in joints) for k in range(6)]
    products = [sum(joint[1][k] for joint in joints) for k in range(15)]
    forms = ca.vertcat(*norms, *products)
    if as_printed:
        forms[MISPRINTED - 1] = forms[MISPRINTED]
    return forms


def residuals(arm: ColumnModel, variables: ca.SX) -> ca.SX:
    """f_1 … f_21 with the signs of eqs. (23)–(43), f_17 corrected, shape (21, 1).

    The same functions as `isotropy_equations.residuals`, written as in the Appendix.

    Raises
    ------
    InputError
        If a joint of the arm is not a unit revolute one.
    """
    if not (isinstance(arm, Arm) and set(arm.joints) == {UnitRevolute()}):
        raise InputError("arm", f"of {arm.description}", "unit revolute joints only")
    return closed_forms(variables) * ca.DM(SIGNS)


def _summands(alpha: ca.SX, beta: ca.SX, gamma: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
    """One joint's share in the sums of f_1 … f_6 and of f_7 … f_21."""
    s_a, c_a, s_b, c_b = ca.sin(alpha), ca.cos(alpha), ca.sin(beta), ca.cos(beta)
    s_g, c_g = ca.sin(gamma), ca.cos(gamma)
    mixed = 2 * s_a * c_a * s_b * s_g * c_g
    norms = [
        c_a**2 * s_b**2 * c_g**2 + mixed + s_a**2 * s_g**2,
        s_a**2 * s_b**2 * c_g**2 - mixed + c_a**2 * s_g**2,
        c_b**2 * c_g**2,
        c_a**2 * c_b**2,
        s_a**2 * c_b**2,
        s_b**2,
    ]
    products = [
        s_a * c_a * s_b**2 * c_g**2
        - c_a**2 * s_b * s_g * c_g
        + s_a**2 * s_b * s_g * c_g
        - s_a * c_a * s_g**2,
        -c_a * s_b * c_b * c_g**2 - s_a * c_b * s_g * c_g,
        c_a**2 * s_b * c_b * c_g + s_a * c_a * c_b * s_g,
        s_a * c_a * s_b * c_b * c_g + s_a**2 * c_b * s_g,
        c_a * s_b**2 * c_g + s_a * s_b * s_g,
        -s_a * s_b * c_b * c_g**2 + c_a * c_b * s_g * c_g,
        s_a * c_a * s_b * c_b * c_g - c_a**2 * c_b * s_g,
        s_a**2 * s_b * c_b * c_g - s_a * c_a * c_b * s_g,
        s_a * s_b**2 * c_g - c_a * s_b * s_g,
        -c_a * c_b**2 * c_g,
        -s_a * c_b**2 * c_g,
        -s_b * c_b * c_g,
        s_a * c_a * c_b**2,
        c_a * s_b * c_b,
        s_a * s_b * c_b,
    ]
    return norms, products
