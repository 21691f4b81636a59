"""``lockedjoint prove``: for which n optimally failure-tolerant nR Jacobians exist."""

from pathlib import Path
from typing import Annotated, Any

import typer

from formulations.commands.arguments import Json, whole_option
from formulations.commands.output import show


def prove(
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Where to write it.",
            show_default="certificate.json; with --to coq Data.v",
        ),
    ] = None,
    joints: Annotated[
        int, whole_option(1, "N", "Number of revolute joints: 7, or 8 to 1000.")
    ] = 7,
    to: Annotated[
        str,
        typer.Option(
            metavar="FORM",
            help="json: the certificate; coq: the data file of the proof in Coq, for n = 7.",
        ),
    ] = "json",
    as_json: Json = False,
) -> None:
    """Prove that an optimally failure-tolerant nR Jacobian exists, or for n = 7 that none does.

    Seven joints: derives, in exact rational arithmetic and from the definitions alone,
    polynomials whose weighted squares would sum to a negative constant if such a Jacobian
    existed, and writes them with every multiplier that is needed to check this. Eight and
    more: writes the exact columns of such a Jacobian, for 8 to 13 joints, and beyond that
    how many isotropic six-joint arms stand beside them. Every run writes the same bytes.
    Check the file with `lockedjoint verify`, a data file with Coq (docs/nonexistence.md).
    """
    from formulations.existence.rings import exact_jacobian
    from nlp.errors import InputError
    from nlp.files import prepare_file, write_text

    if to not in ("json", "coq"):
        raise InputError("--to", to, "json or coq")
    if to == "coq" and joints != 7:
        raise InputError("--joints", joints, "7 with --to coq; others need no data file")
    existence = None if joints == 7 else exact_jacobian(joints)
    out = out or Path("Data.v" if to == "coq" else "certificate.json")
    prepare_file(out)
    if existence is None:
        _prove_nonexistence(out, to, as_json)
        return
    write_text(out, existence.to_json())
    columns, arms = len(existence.columns), existence.six_joint_arms
    sizes = {"joints": joints, "columns": columns, "six_joint_arms": arms}
    beside = f" beside {arms} isotropic six-joint arms" if arms else ""
    text = (
        f"Optimally failure-tolerant {joints}R Jacobians exist: {columns} exact columns"
        f"{beside}\nsatisfy J Jᵀ = ({joints}/3) I with |v| = |ω| = 1. They are in {out}."
    )
    show({"file": str(out), **sizes}, as_json, lambda _: text)


def _prove_nonexistence(out: Path, to: str, as_json: bool) -> None:
    """Derive and write the certificate for seven joints."""
    from formulations.existence.coq_data import coq_data
    from formulations.existence.derive import derive
    from nlp.files import write_text

    certificate = derive()
    if to == "coq":
        write_text(out, coq_data(certificate))
    else:
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
