"""The functions that CasADi's solvers call, with derivatives that a formulation wrote out.

A program has N variables x, an objective f, to be minimised, and R constraints g. Names of
functions and of their inputs and outputs are CasADi's: ``lam_f`` is the factor σ of the
objective in the Lagrangian σf + λᵀg, ``lam_g`` are the multipliers λ, ``grad_gamma_x`` and
``hess_gamma_x_x`` are its gradient and Hessian in x, and ``p`` are parameters: there are none.
"""

from collections.abc import Mapping, Sequence

import casadi as ca

from lockedjoint.nlp.problem import Derivatives


def callbacks(
    written: Derivatives, program: Mapping[str, ca.SX], sign: float, solver: str
) -> tuple[ca.Function, ...]:
    """Return all functions that a solver calls, by CasADi's names and with its signatures.

    The written derivatives replace those by automatic differentiation. `program` has the
    expressions of ``x``, ``f`` and ``g``; f is the objective times `sign`, −1 where it is
    maximised. `solver` is ``"ipopt"`` or ``"fatrop"``; Ipopt calls only the last two functions.
    """
    x, f, g = (program[name] for name in "xfg")
    p, point, none = ca.SX(0, 1), ca.MX.sym("x", x.numel()), ca.MX.sym("p", 0, 1)
    sigma, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    slope = ca.Function("slope", [x], [f, g, ca.densify(ca.gradient(f, x))])
    jacobian = written.jacobian or ca.Function("jacobian", [x], [ca.jacobian(g, x)])
    values = slope(point)
    # Gradient and Hessian of the Lagrangian.
    steep = values[2] * sigma + jacobian(point).T @ multipliers
    own = ca.densify(written.hessian(point, sign * sigma, multipliers))
    at, full = ["x", "p"], ["x", "p", "lam_f", "lam_g"]
    if solver == "fatrop":
        own += (written.shift or 0.0) * ca.MX.eye(x.numel())
        hessian = {"grad_gamma_x": steep, "hess_gamma_x_x": own}
    else:
        hessian = {"triu_hess_gamma_x_x": ca.triu(own)}
    both = {"f": values[0], "g": values[1], "grad_gamma_x": steep, "grad_gamma_p": none}
    given = {"x": point, "p": none, "lam_f": sigma, "lam_g": multipliers}

    def function(name: str, inputs: Sequence[str], results: Mapping[str, ca.MX]) -> ca.Function:
        """Return a function of inputs and results by CasADi's names."""
        entries = [given[symbol] for symbol in inputs]
        return ca.Function(name, entries, list(results.values()), inputs, list(results))

    return (
        ca.Function("nlp", [x, p], [f, g], at, ["f", "g"]),
        ca.Function("nlp_f", [x, p], [f], at, ["f"]),
        ca.Function("nlp_g", [x, p], [g], at, ["g"]),
        function("nlp_grad", full, both),
        function("nlp_grad_f", at, {"grad_f_x": values[2]}),
        function("nlp_jac_g", at, {"g": values[1], "jac_g_x": jacobian(point)}),
        function("nlp_hess_l", full, hessian),
    )
