"""The Appendix's closed forms, proved equal to the entries of JJᵀ − (n/3)I."""

import casadi as ca
import numpy as np
import pytest
import sympy

from lockedjoint.formulations import isotropy_equations as equations
from lockedjoint.formulations import residual
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.nlp.solver import solve

ARITHMETIC = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_SQ: lambda a, _: a * a,
    ca.OP_NEG: lambda a, _: -a,
    ca.OP_TWICE: lambda a, _: a + a,
}


def normal_forms(variables, expressions):
    """Exact normal forms over the rationals: polynomials in cos x and sin x, sin²x = 1 − cos²x.

    Walks CasADi's own instructions, so the proof is about the expressions that are solved.
    Every constant is taken as the exact rational that its double is.
    """
    size = variables.numel()
    names = [f"c{k}" for k in range(size)] + [f"s{k}" for k in range(size)]
    ring, *generators = sympy.ring(names, sympy.QQ)
    cosines, sines = generators[:size], generators[size:]
    function = ca.Function("f", [variables], [expressions])
    work: dict[int, object] = {}
    outputs = [ring.zero] * expressions.numel()
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            work[target[0]] = source[1]  # an angle: only ever inside sin or cos
        elif op == ca.OP_CONST:
            numerator, denominator = function.instruction_constant(k).as_integer_ratio()
            work[target[0]] = ring(sympy.QQ(numerator, denominator))
        elif op == ca.OP_OUTPUT:
            outputs[function.sparsity_out(0).row()[target[1]]] = work[source[0]]
        elif op in (ca.OP_SIN, ca.OP_COS):
            work[target[0]] = (sines if op == ca.OP_SIN else cosines)[work[source[0]]]
        else:
            work[target[0]] = ARITHMETIC[op](work[source[0]], work[source[-1]])
    rules = [s**2 + c**2 - 1 for c, s in zip(cosines, sines, strict=True)]
    return [expression.rem(rules) for expression in outputs]


@pytest.fixture(scope="module", params=[7, 8])
def proof(request):
    """Derived, Appendix (corrected) and Appendix (printed), in normal form."""
    arm = Arm.of(UnitRevolute(), request.param)
    x = arm.symbols()
    forms = [
        equations.residuals(arm, x),
        equations.closed_forms(x),
        equations.closed_forms(x, as_printed=True),
    ]
    return [normal_forms(x, form) for form in forms]


@pytest.mark.parametrize("k", range(1, 22))
def test_closed_form_equals_the_derived_residual_and_only_the_printed_f17_differs(proof, k):
    derived, closed, printed = (form[k - 1] for form in proof)
    assert derived != 0
    assert closed == equations.SIGNS[k - 1] * derived
    assert (printed == closed) == (k != equations.MISPRINTED)


def test_the_misprint_repeats_f18(proof):
    _, _, printed = proof
    assert printed[16] == printed[17]


@pytest.mark.parametrize("weighting", ["invariant", "paper"])
def test_either_rows_build_the_same_problem(weighting):
    arm = Arm.of(UnitRevolute(), 7)
    start = arm.sample(np.random.default_rng(3))
    values = [
        solve(residual.build(arm, weighting, rows), start).objective
        for rows in ("derived", "appendix")
    ]
    assert values == pytest.approx([0.0568265457487] * 2, abs=1e-9)
