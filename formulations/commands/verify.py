"""``lockedjoint verify``: check a certificate in code that shares nothing with the search."""

from pathlib import Path
from typing import Annotated, Any

import typer

from formulations.commands.arguments import Json, progress, whole_option
from formulations.commands.output import show

MOST_SAMPLES = 1_000_000


def verify(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="A certificate in JSON; by default that of nonexistence in the package.",
            show_default=False,
        ),
    ] = None,
    samples: Annotated[
        int,
        whole_option(
            0,
            "K",
            "Also evaluate the identity, exactly and over all 5040 joint orders, at K "
            "random matrices that violate every equation.",
            MOST_SAMPLES,
        ),
    ] = 0,
    as_json: Json = False,
) -> None:
    """Verify that an optimally failure-tolerant Jacobian exists, that none does, or a bound.

    Existence and nonexistence: expands the polynomials, or multiplies out the columns, in
    exact arithmetic. A bound of `lockedjoint bound --rigorous --out`: evaluates its sums with
    all rounding errors bounded, in minutes. The code shares nothing with the derivation or
    the solver. Exit status 0 if the proof holds, 1 if it does not, 2 if the file is
    unreadable.
    """
    from formulations.bounds.so3_moments.certificate import read_any
    from formulations.existence.certificate import Certificate
    from formulations.existence.exact_jacobian import ExactJacobian
    from formulations.existence.theorem import package_certificate
    from nlp.errors import InputError

    certificate = package_certificate() if file is None else read_any(file)
    if isinstance(certificate, Certificate):
        show(_nonexistence(certificate, samples), as_json)
        return
    if samples:
        allowed = "0 for a certificate of existence or of a bound, without such an identity"
        raise InputError("--samples", samples, allowed)
    if isinstance(certificate, ExactJacobian):
        show(_existence(certificate), as_json)
    else:
        show(_bound(certificate), as_json)


def _nonexistence(certificate: Any, samples: int) -> dict[str, Any]:
    from formulations.existence.certificate import CertificateError
    from formulations.existence.evaluate import defects
    from formulations.existence.verify import verify as expand

    report = expand(certificate)
    if samples and any(defects(certificate, samples=samples)):
        raise CertificateError("the identity does not hold at a random matrix.")
    return {
        "verdict": "proved: no optimally failure-tolerant 7R Jacobian exists",
        "joints": report.joints,
        "constant": str(report.constant),
        "squares": report.squares,
        "multipliers": report.multipliers,
        "averages_that_cancelled": report.monomials,
        "random_matrices": samples,
    }


def _existence(certificate: Any) -> dict[str, Any]:
    from formulations.existence.exact_jacobian import verify_existence

    equations = verify_existence(certificate)
    n = certificate.joints
    return {
        "verdict": f"proved: an optimally failure-tolerant {n}R Jacobian exists",
        "joints": n,
        "columns": len(certificate.columns),
        "six_joint_arms": certificate.six_joint_arms,
        "square_roots": len(certificate.roots),
        "equations": equations,
    }


def _bound(certificate: Any) -> dict[str, Any]:
    from formulations.bounds.so3_moments.verification import verify_bound

    found = verify_bound(certificate, progress=progress)
    left = {
        "residual": f"½‖JJᵀ − (n/3)I‖_F² ≥ {found.claimed}",
        "max-min": f"worst case after one locked joint σ ≤ {found.claimed}",
    }[found.quantity]
    statement = f"{left} for every unit revolute {found.joints}R Jacobian"
    return {"verdict": f"proved: {statement}", **found.to_dict()}
