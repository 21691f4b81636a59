"""``lockedjoint verify``: check a certificate in exact arithmetic, by expansion alone."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, whole_option
from formulations.commands.output import show

MOST_SAMPLES = 1_000_000


def verify(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="A certificate in JSON; by default the one that the package includes.",
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
    """Verify that no optimally failure-tolerant 7R Jacobian exists, or that an nR does, n ≥ 8.

    Expands the polynomials, or multiplies out the columns, in exact arithmetic, in code that
    shares nothing with the derivation. Exit status 0 if the proof holds, 1 if it does not, 2
    if the file is unreadable.
    """
    from formulations.existence.certificate import CertificateError
    from formulations.existence.evaluate import defects
    from formulations.existence.exact_jacobian import ExactJacobian, verify_existence
    from formulations.existence.reading import read_either
    from formulations.existence.theorem import package_certificate
    from formulations.existence.verify import verify as expand
    from nlp.errors import InputError

    certificate = package_certificate() if file is None else read_either(file)
    if isinstance(certificate, ExactJacobian):
        if samples:
            allowed = "0 for a certificate of existence, which has no identity to evaluate"
            raise InputError("--samples", samples, allowed)
        equations = verify_existence(certificate)
        n = certificate.joints
        verdict = f"proved: an optimally failure-tolerant {n}R Jacobian exists"
        sizes = {
            "joints": n,
            "columns": len(certificate.columns),
            "six_joint_arms": certificate.six_joint_arms,
            "square_roots": len(certificate.roots),
            "equations": equations,
        }
        show({"verdict": verdict, **sizes}, as_json)
        return
    report = expand(certificate)
    if samples and any(defects(certificate, samples=samples)):
        raise CertificateError("the identity does not hold at a random matrix.")
    found = {
        "verdict": "proved: no optimally failure-tolerant 7R Jacobian exists",
        "joints": report.joints,
        "constant": str(report.constant),
        "squares": report.squares,
        "multipliers": report.multipliers,
        "averages_that_cancelled": report.monomials,
        "random_matrices": samples,
    }
    show(found, as_json)
