"""``lockedjoint prove`` and ``verify``: exact proofs, and the check of any certificate.

What verifies shares nothing with what derives or solves, except, for a bound, the evaluation
of Wigner functions.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from lockedjoint.commands.bars import progress
from lockedjoint.commands.options import ARGUMENT
from lockedjoint.commands.output import Answer, as_text
from lockedjoint.nlp.errors import InputError

# Ending of the name of a file with the proof in Coq.
_COQ = ".v"
# The line below the verdict: it says in words what the certificate of nonexistence proves.
_MEANING = {
    "that is": "for seven revolute joints no Jacobian J with JJᵀ = σ²I and columns of equal "
    "length exists (docs/nonexistence.md)"
}


def prove(joints: Annotated[int, ARGUMENT] = 7, out: Path | None = None) -> Answer:
    """Prove that an optimally failure-tolerant nR Jacobian exists, or that none does.

    For seven joints it derives, in exact rational arithmetic and from the definitions alone,
    polynomials whose weighted squares would sum to a negative constant if such a Jacobian
    existed, and writes them with every multiplier that is needed to check this. For eight and
    more it writes the exact columns of such a Jacobian; beyond 13 joints those of 8 to 13, and
    how many isotropic arms of six joints complete them. Every run writes the same bytes.
    Check the file with `lockedjoint verify`, a data file with Coq (docs/nonexistence.md).

    Parameters
    ----------
    joints
        They are revolute: 7, or 8 to 1000; by default 7.
    out
        The file that is written: the certificate (by default certificate.json); with a name
        that ends in .v the data file of the proof in Coq, for seven joints.
    """
    from lockedjoint.formulations.existence.rings import exact_jacobian
    from lockedjoint.formulations.io.files import prepare_file, write_text

    out = out or Path("certificate.json")
    if out.suffix == _COQ and joints != 7:
        raise InputError("number of joints", joints, "7 for Coq; others need no data file")
    existence = None if joints == 7 else exact_jacobian(joints)
    prepare_file(out)
    if existence is None:
        return _nonexistence_proved(out)
    write_text(out, existence.to_json())
    columns, arms = len(existence.columns), existence.six_joint_arms
    sizes = {"joints": joints, "columns": columns, "six_joint_arms": arms}
    beside = f" beside {arms} isotropic six-joint arms" if arms else ""
    text = (
        f"Optimally failure-tolerant {joints}R Jacobians exist: {columns} exact columns"
        f"{beside}\nsatisfy J Jᵀ = ({joints}/3) I with |v| = |ω| = 1. They are in {out}."
    )
    return Answer({"file": str(out), **sizes}, text)


def _nonexistence_proved(out: Path) -> Answer:
    """Derive and write the certificate for seven joints."""
    from lockedjoint.formulations.existence.coq_data import coq_data
    from lockedjoint.formulations.existence.derive import derive
    from lockedjoint.formulations.io.files import write_text

    certificate = derive()
    write_text(out, coq_data(certificate) if out.suffix == _COQ else certificate.to_json())
    values: dict[str, Any] = {
        "file": str(out),
        "joints": certificate.joints,
        "constant": f"-{certificate.constant}",
        "weights": [str(square.weight) for square in certificate.squares],
        "terms": [len(square.terms) for square in certificate.squares],
        "multipliers": len(certificate.multipliers),
    }
    squares = " + ".join(f"{weight} |p{k}|²" for k, weight in enumerate(values["weights"], 1))
    text = (
        f"For every optimally failure-tolerant 7R Jacobian, averaged over joint orders,\n\n"
        f"    {squares} = {values['constant']} < 0,\n\n"
        f"so there is none. The identity has {values['multipliers']} multipliers of the "
        f"equations;\nall of it is in {out}."
    )
    return Answer(values, text)


def verify(data: Annotated[Path | None, ARGUMENT] = None) -> Answer:
    """Verify a certificate of existence, of nonexistence or of a bound, or a kept workspace.

    For nonexistence it expands the polynomials, and for existence it multiplies out the
    columns, in exact arithmetic. For a bound of `lockedjoint bound residual`, `max-min` or
    `isotropy` it evaluates the sums with all rounding errors bounded, in minutes. It shares no
    code with what derives or solves. Only for a bound it shares the definitions: Wigner
    functions, rows and conditions. The bound on isotropic lever arms is proved by branch and
    bound from the centres in its file, in hours of processor time. Cubes of `prove-workspace`
    are proved again from their file alone, by the same test. Exit status 0 if the proof holds,
    1 if it does not, 2 if the file is unreadable.

    Parameters
    ----------
    data
        A certificate in JSON, or cubes in NPZ; by default the certificate of nonexistence in
        the package.
    """
    from lockedjoint.formulations.bounds.lever_certificate import LeverCertificate
    from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
    from lockedjoint.formulations.existence.certificate import Certificate
    from lockedjoint.formulations.existence.exact_jacobian import ExactJacobian
    from lockedjoint.formulations.existence.verify import package_certificate

    if data is not None and data.suffix == ".npz":
        return _cubes(data)
    certificate = package_certificate() if data is None else read_any(data)
    if isinstance(certificate, Certificate):
        values = _nonexistence(certificate)
        return Answer(values, as_text({"verdict": values["verdict"], **_MEANING, **values}))
    if isinstance(certificate, LeverCertificate):
        return Answer(_levers(certificate))
    exact = isinstance(certificate, ExactJacobian)
    return Answer(_existence(certificate) if exact else _bound(certificate))


def _nonexistence(certificate: Any) -> dict[str, Any]:
    """Verify the certificate of nonexistence; return what was checked, by name."""
    from lockedjoint.formulations.existence.verify import verify_nonexistence as expand

    report = expand(certificate)
    return {
        "verdict": "proved: no optimally failure-tolerant 7R Jacobian exists",
        "joints": report.joints,
        "constant": str(report.constant),
        "squares": report.squares,
        "multipliers": report.multipliers,
        "averages_that_cancelled": report.monomials,
    }


def _cubes(file: Path) -> Answer:
    """Prove the cubes of a kept workspace again, from their file alone."""
    from lockedjoint.nlp.executors import LocalExecutor, default_workers
    from lockedjoint.workspaces.check_kept import check_cubes
    from lockedjoint.workspaces.kept_cubes import KeptCubes

    cubes = KeptCubes.read(file)
    with LocalExecutor(default_workers()) as executor:
        again = check_cubes(cubes, executor=executor, progress=progress)
    size, unit = cubes[again].size, "m²" if cubes.centre.shape[1] == 2 else "m³"
    values: dict[str, Any] = {
        "verdict": f"proved: {size:.6g} {unit} are kept wherever a joint locks",
        "claimed": cubes.size,
        "cubes": len(again),
        "proved_again": int(again.sum()),
    }
    failure = f"{len(again) - again.sum()} of {len(again)} cubes were not proved again."
    return Answer(values, failure=[] if again.all() else [failure], status=int(not again.all()))


def _existence(certificate: Any) -> dict[str, Any]:
    """Verify an exact Jacobian; return what was checked, by name."""
    from lockedjoint.formulations.existence.exact_jacobian import verify_existence

    equations, n = verify_existence(certificate), certificate.joints
    return {
        "verdict": f"proved: an optimally failure-tolerant {n}R Jacobian exists",
        "joints": n,
        "columns": len(certificate.columns),
        "six_joint_arms": certificate.six_joint_arms,
        "square_roots": len(certificate.roots),
        "equations": equations,
    }


def _levers(certificate: Any) -> dict[str, Any]:
    """Prove the bound on isotropic lever arms; return what was checked, by name."""
    from lockedjoint.formulations.bounds.lever_certificate import verify_levers
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    with LocalExecutor(default_workers()) as executor:
        report = verify_levers(certificate, executor=executor, progress=progress)
    statement = f"worst case after one locked joint σ ≤ {report.claimed}"
    return {
        "verdict": f"proved: {statement} for every isotropic revolute 7R Jacobian",
        **asdict(report),
    }


def _bound(certificate: Any) -> dict[str, Any]:
    """Verify the certificate of a bound; return what was checked, by name."""
    from lockedjoint.formulations.bounds.moments.verification import verify_bound
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    with LocalExecutor(default_workers()) as executor:
        report = verify_bound(certificate, executor=executor, progress=progress)
    worst_case = f"worst case after one locked joint σ ≤ {report.claimed}"
    claim, arms = {
        "residual": (f"½‖JJᵀ − (n/3)I‖_F² ≥ {report.claimed}", "unit revolute"),
        "max-min": (worst_case, "unit revolute"),
        "isotropy": (worst_case, "isotropic revolute"),
    }[report.quantity]
    statement = f"{claim} for every {arms} {report.joints}R Jacobian"
    return {"verdict": f"proved: {statement}", **report.to_dict()}
