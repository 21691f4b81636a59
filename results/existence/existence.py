"""The existence proofs: certificates, derived and verified, and their numbers.

A Jacobian of n revolute joints is optimally failure tolerant if it is isotropic (its singular
values are equal) and its columns have the same length. What goes out: ``certificate.json``, a
proof in rational numbers that there is none for n = 7, and ``existence.csv``, its numbers, a
`Fact` a line; ``optimal_N.json``, an exact Jacobian for each n of `_OPTIMAL`, and
``optimal.csv``, an `OptimalRow` for each. All are verified after they were read from their
files. formulations/existence has the mathematics.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lockedjoint.formulations.existence.certificate import Certificate
from lockedjoint.formulations.existence.derive import derive
from lockedjoint.formulations.existence.exact_jacobian import ExactJacobian, verify_existence
from lockedjoint.formulations.existence.reading import read_certificate
from lockedjoint.formulations.existence.rings import exact_jacobian
from lockedjoint.formulations.existence.verify import TheoremReport, verify_nonexistence
from lockedjoint.formulations.io.files import write_text
from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.solving.effort import Effort
from results.script import main, study_of

# The file of the proof that none exists.
_CERTIFICATE = "certificate.json"
# The numbers of joints from which all others follow by adding six.
_OPTIMAL = (8, 9, 10, 11, 12, 13)


@dataclass(frozen=True)
class Fact:
    """A line of ``existence.csv``: what is counted, and the count, as text."""

    quantity: str
    value: str


@dataclass(frozen=True)
class OptimalRow:
    """A line of ``optimal.csv``: a verified certificate that an optimal Jacobian exists."""

    joints: int = field(metadata=column("n"))
    square_roots: int
    equations: int
    file: str


def facts(certificate: Certificate, report: TheoremReport) -> list[Fact]:
    """Return the lines of the table."""
    squares = certificate.squares
    return [
        Fact("joints", str(report.joints)),
        Fact("squares", str(report.squares)),
        Fact("weights", " and ".join(str(square.weight) for square in squares)),
        Fact("terms", " and ".join(str(len(square.terms)) for square in squares)),
        Fact("constant", str(report.constant)),
        Fact("multipliers", str(report.multipliers)),
        Fact("averages of monomials that cancel", str(report.monomials)),
        Fact("verdict", "proved"),
    ]


def optimal_row(path: Path) -> OptimalRow:
    """Verify a certificate of existence and return its line of the table."""
    certificate = read_certificate(path)
    assert isinstance(certificate, ExactJacobian)
    roots, equations = len(certificate.roots), verify_existence(certificate)
    return OptimalRow(certificate.joints, roots, equations, path.name)


def compute(effort: Effort, folder: Path) -> Iterator[Fact | OptimalRow]:
    """Derive the certificates, then verify them from their files."""
    effort.progress("certificate: derivation")
    write_text(folder / _CERTIFICATE, derive().to_json())
    effort.progress("certificate: verification")
    certificate = read_certificate(folder / _CERTIFICATE)
    assert isinstance(certificate, Certificate)
    yield from facts(certificate, verify_nonexistence(certificate))
    for joints in _OPTIMAL:
        path = folder / f"optimal_{joints}.json"
        write_text(path, exact_jacobian(joints).to_json())
        yield optimal_row(path)


STUDY = study_of(
    __file__,
    compute,
    title="for which n optimally failure-tolerant nR Jacobians exist, in exact arithmetic",
    page="README.md",
    tables={"existence": Fact, "optimal": OptimalRow},
    takes="seconds",
)

if __name__ == "__main__":
    main(STUDY, __file__)
