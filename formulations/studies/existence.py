"""The existence proof as a study: the certificate, derived and verified, and its figures."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from formulations.existence.certificate import Certificate
from formulations.existence.derive import derive
from formulations.existence.evaluate import defects
from formulations.existence.reading import read
from formulations.existence.verify import Report, verify
from formulations.files.provenance import header
from formulations.files.rows import read_rows
from formulations.studies.study import Effort, Study
from nlp.files import write_text

TABLE, CERTIFICATE, PAGE = "existence.csv", "certificate.json", "README.md"
# Of matrices that violate every equation, at which the identity is evaluated besides.
_SAMPLES = 1
_ABOUT = """\
    lockedjoint verify results/existence/certificate.json

Derivation and verification use nothing but Python's integers and fractions, so the file is
the same, byte for byte, whatever the versions, the machine and the hash seed; a test derives
it again and compares. What it means, why it is a proof, and twenty-odd lines of Python that
check it without this library are in [docs/nonexistence.md](../../docs/nonexistence.md),
sections 4 to 6. Changing anything in the file that matters makes `lockedjoint verify` refuse
it with one sentence and exit status 1; a file that is not JSON at all gives exit status 2.
The same file travels inside the package: `formulations/existence/theorem.py` verifies it
whenever a table says "proved".
"""


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
        page=PAGE,
        table=TABLE,
        command="lockedjoint prove --out results/existence/certificate.json",
        takes="seconds",
        long=False,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / TABLE, Fact)),
    )


def finding(facts: list[Fact]) -> str:
    """Return what the certificate shows, as a paragraph."""
    found = {fact.quantity: fact.value for fact in facts}
    return (
        f"For every optimally failure-tolerant Jacobian of {found['joints']} revolute joints "
        f"{found['squares']} averaged squares, with weights {found['weights']} and "
        f"{found['terms']} terms, would add up to −{found['constant']}, by "
        f"{found['multipliers']} multiples of the equations that it obeys. A sum of squares is "
        f"not negative, so there is none: {found['verdict']}."
    )


def facts(certificate: Certificate, report: Report, verdict: str) -> list[Fact]:
    """Return the lines of the table."""
    weights = " and ".join(str(square.weight) for square in certificate.squares)
    terms = " and ".join(str(len(square.terms)) for square in certificate.squares)
    lines = {
        "joints": report.joints,
        "squares": report.squares,
        "weights": weights,
        "terms": terms,
        "constant": report.constant,
        "multipliers": report.multipliers,
        "averages of monomials that cancel": report.monomials,
        "random matrices at which the identity holds": _SAMPLES,
        "verdict": verdict,
    }
    return [Fact(name, str(value)) for name, value in lines.items()]


def markdown_table(lines: list[Fact]) -> str:
    """Return the facts as a Markdown table."""
    frame = pd.DataFrame([asdict(line) for line in lines])
    return str(frame.to_markdown(index=False, disable_numparse=True))


def _run(folder: Path, effort: Effort) -> str:
    effort.progress("certificate: derivation")
    derive().write(folder / CERTIFICATE)
    effort.progress("certificate: verification")
    certificate = read(folder / CERTIFICATE)
    report = verify(certificate)
    wrong = any(defects(certificate, samples=_SAMPLES))
    lines = facts(certificate, report, "not proved" if wrong else "proved")
    write_text(folder / TABLE, pd.DataFrame([asdict(x) for x in lines]).to_csv(index=False))
    page = (
        "# The certificate that no optimally failure-tolerant 7R Jacobian exists\n\n"
        f"{header({'seed': 'none; nothing is random'})}\n{finding(lines)}\n\n"
        f"{markdown_table(lines)}\n\n{_ABOUT}"
    )
    write_text(folder / PAGE, page)
    return "the identity does not hold at a random matrix" if wrong else ""
