"""``lockedjoint prove``: derive the certificate that no optimal 7R Jacobian exists."""

from pathlib import Path
from typing import Annotated, Any

import typer

from formulations.commands.arguments import Json
from formulations.commands.output import show


def prove(
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="Where to write the certificate (JSON).")
    ] = Path("certificate.json"),
    as_json: Json = False,
) -> None:
    """Prove that no optimally failure-tolerant 7R Jacobian exists.

    Derives, in exact rational arithmetic and from the definitions alone, polynomials whose
    weighted squares would sum to a negative constant if such a Jacobian existed, and writes
    them with every multiplier that is needed to check this. Every run writes the same bytes.
    Check the file with `lockedjoint verify`.
    """
    from formulations.existence.derive import derive
    from nlp.files import prepare_file

    prepare_file(out)
    certificate = derive()
    certificate.write(out)
    found: dict[str, Any] = {
        "file": str(out),
        "joints": certificate.joints,
        "constant": f"-{certificate.constant}",
        "weights": [str(square.weight) for square in certificate.squares],
        "terms": [len(square.terms) for square in certificate.squares],
        "multipliers": len(certificate.multipliers),
    }
    squares = " + ".join(f"{weight} |p{k}|²" for k, weight in enumerate(found["weights"], 1))
    text = (
        f"For every optimally failure-tolerant 7R Jacobian, averaged over joint orders,\n\n"
        f"    {squares} = {found['constant']} < 0,\n\n"
        f"so there is none. The identity has {found['multipliers']} multipliers of the "
        f"equations;\nall of it is in {out}."
    )
    show(found, as_json, lambda _: text)
