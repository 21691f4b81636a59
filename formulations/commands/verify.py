"""``lockedjoint verify``: check a certificate by polynomial expansion alone."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, whole_option
from formulations.commands.output import show


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
        ),
    ] = 0,
    as_json: Json = False,
) -> None:
    """Verify a certificate that no optimally failure-tolerant 7R Jacobian exists.

    Expands the polynomials in exact arithmetic, in code that shares nothing with the
    derivation. Exit status 0 if the proof holds, 1 if it does not, 2 if the file is
    unreadable.
    """
    from formulations.existence.certificate import CertificateError
    from formulations.existence.evaluate import defects
    from formulations.existence.reading import read
    from formulations.existence.theorem import package_certificate
    from formulations.existence.verify import verify as expand

    certificate = package_certificate() if file is None else read(file)
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
