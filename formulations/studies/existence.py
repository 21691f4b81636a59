"""The existence proof as a study: the certificate, derived and verified, and its figures."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from formulations.existence.certificate import Certificate
from formulations.existence.derive import derive
from formulations.existence.evaluate import defects
from formulations.existence.reading import read
from formulations.existence.verify import Report, verify
from formulations.studies.study import INCOMPLETE, Effort, Part, Study

CERTIFICATE = "certificate.json"
# Of matrices that violate every equation, at which the identity is evaluated as well.
_SAMPLES = 1


@dataclass(frozen=True)
class Fact:
    """A line of ``existence.csv``: what is counted, and the count, as text."""

    quantity: str
    value: str


def study() -> Study:
    """Return the existence proof."""
    return Study(
        name="existence",
        title="the exact proof that no optimally failure-tolerant 7R Jacobian exists",
        page="README.md",
        template="existence.md.j2",
        tables={"existence": Fact},
        command="lockedjoint prove --out results/existence/certificate.json",
        takes="seconds",
        compute=_compute,
        complain=lambda rows: (
            "the identity does not hold at a random matrix"
            if Fact("verdict", "not proved") in rows
            else ""
        ),
    )


def facts(certificate: Certificate, report: Report, verdict: str) -> list[Fact]:
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


def _compute(effort: Effort, folder: Path) -> Iterator[Part]:
    effort.progress("certificate: derivation")
    yield Part(files={CERTIFICATE: derive().to_json().encode()})
    effort.progress("certificate: verification")
    certificate = read(folder / INCOMPLETE / CERTIFICATE)
    report = verify(certificate)
    wrong = any(defects(certificate, samples=_SAMPLES))
    yield Part(rows=facts(certificate, report, "not proved" if wrong else "proved"))
