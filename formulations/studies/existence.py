"""The existence proofs as a study: certificates, derived and verified, and their figures."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from formulations.existence.certificate import Certificate
from formulations.existence.derive import derive
from formulations.existence.evaluate import defects
from formulations.existence.exact_jacobian import ExactJacobian, verify_existence
from formulations.existence.reading import read, read_either
from formulations.existence.rings import exact_jacobian
from formulations.existence.verify import TheoremReport, verify
from formulations.io.table import column
from formulations.studies.study import INCOMPLETE, Effort, Part, Study

CERTIFICATE = "certificate.json"
# Of matrices that violate every equation, at which the identity is evaluated as well.
_SAMPLES = 1
# The numbers of joints from which all others follow by adding six.
_OPTIMAL = (8, 9, 10, 11, 12, 13)


@dataclass(frozen=True)
class Fact:
    """A line of ``existence.csv``: what is counted, and the count, as text."""

    quantity: str
    value: str


@dataclass(frozen=True)
class OptimalRow:
    """A line of ``optimal.csv``: a verified certificate that an optimal Jacobian exists.

    Attributes
    ----------
    joints, file
        Number of joints n, and the certificate.
    square_roots
        How many square roots its columns are made of.
    equations
        How many exact equations were checked.
    """

    joints: int = field(metadata=column("n"))
    square_roots: int
    equations: int
    file: str


def study() -> Study:
    """Return the existence proofs."""
    return Study(
        name="existence",
        title="for which n optimally failure-tolerant nR Jacobians exist, in exact arithmetic",
        page="README.md",
        template="existence.md.j2",
        tables={"existence": Fact, "optimal": OptimalRow},
        command="lockedjoint report --only existence --out results",
        takes="seconds",
        compute=_compute,
        complain=lambda rows: (
            "the identity does not hold at a random matrix"
            if Fact("verdict", "not proved") in rows
            else ""
        ),
    )


def facts(certificate: Certificate, report: TheoremReport, verdict: str) -> list[Fact]:
    """Return the lines of the table."""
    lines = {
        "joints": report.joints,
        "squares": report.squares,
        "weights": " and ".join(str(square.weight) for square in certificate.squares),
        "terms": " and ".join(str(len(square.terms)) for square in certificate.squares),
        "constant": report.constant,
        "multipliers": report.multipliers,
        "averages of monomials that cancel": report.monomials,
        "random matrices at which the identity holds": _SAMPLES,
        "verdict": verdict,
    }
    return [Fact(name, str(value)) for name, value in lines.items()]


def optimal_row(certificate: ExactJacobian, file: str) -> OptimalRow:
    """Verify a certificate of existence and return its line of the table."""
    equations = verify_existence(certificate)
    return OptimalRow(certificate.joints, len(certificate.roots), equations, file)


def _compute(effort: Effort, folder: Path) -> Iterator[Part]:
    effort.progress("certificate: derivation")
    yield Part(files={CERTIFICATE: derive().to_json().encode()})
    effort.progress("certificate: verification")
    certificate = read(folder / INCOMPLETE / CERTIFICATE)
    report = verify(certificate)
    wrong = any(defects(certificate, samples=_SAMPLES))
    yield Part(rows=facts(certificate, report, "not proved" if wrong else "proved"))
    for joints in _OPTIMAL:
        file = f"optimal_{joints}.json"
        yield Part(files={file: exact_jacobian(joints).to_json().encode()})
        existence = read_either(folder / INCOMPLETE / file)
        if isinstance(existence, ExactJacobian):
            yield Part(rows=[optimal_row(existence, file)])
