"""The proof in Coq: its data are the certificate's, it builds, and its page prints it."""

import os
import re
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from formulations.existence.coq_data import coq_data

ROOT = Path(__file__).parents[2]
COQ = ROOT / "formulations" / "existence" / "coq"
AXIOMS = (COQ / "axioms.txt").read_text()


def test_the_committed_data_file_is_that_of_the_derived_certificate(derived):
    assert coq_data(derived).encode() == (COQ / "Data.v").read_bytes()


def test_numbers_of_the_data_file_are_those_of_the_certificate(derived):
    """Read back; a tight-frame equation stands for seven times itself."""
    text = coq_data(derived)
    common = int(re.search(r"certificate times (\d+)", text)[1])
    lines = re.findall(r"^M \(?(-?\d+)\)? \((\w+) ([\d ]+)\) ", text, re.MULTILINE)
    assert len(lines) == len(derived.multipliers)
    for (number, kind, place), multiplier in zip(lines, derived.multipliers, strict=True):
        factor = 7 if kind == "TightFrame" else 1
        assert Fraction(int(number) * factor, common) == multiplier.coefficient
        assert tuple(map(int, place.split())) == multiplier.place
    proof = re.search(r"Certificate (\d+) \[\((\d+)%Z, square0\); \((\d+)%Z", text)
    values = [derived.constant, *(square.weight for square in derived.squares)]
    assert [Fraction(int(number), common) for number in proof.groups()] == values


def test_a_square_without_whole_coefficients_is_refused(derived):
    square = derived.squares[0]
    half = replace(square.terms[0], coefficient=Fraction(1, 2))
    squares = (replace(square, terms=(half,)),)
    with pytest.raises(ValueError, match="1/2 is not a whole number"):
        coq_data(replace(derived, squares=squares))


def test_nothing_is_assumed_in_the_sources():
    forbidden = {"Admitted", "admit", "Axiom", "Parameter", "Conjecture", "Unset"}
    for file in COQ.glob("*.v"):
        code = re.sub(r"\(\*.*?\*\)", "", file.read_text(), flags=re.DOTALL)
        assert not forbidden & set(re.findall(r"\w+", code)), file.name


def built(folder, path=None):
    environment = os.environ | ({"PATH": path} if path else {})
    return subprocess.run(
        ["/bin/sh", str(folder / "build.sh")], capture_output=True, text=True, env=environment
    )


@pytest.mark.long
@pytest.mark.skipif(shutil.which("coqc") is None, reason="install coqc (Debian: coq)")
def test_coq_accepts_the_proof_with_the_axioms_on_record():
    done = built(COQ)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Axioms:") == AXIOMS.count("Axioms:") == 6
    assert list(COQ.glob("*.vo")) == []


@pytest.mark.parametrize(
    ("coqc", "status", "message"),
    [
        (f"cat <<'END'\n{AXIOMS}END", 0, ""),
        (f"cat <<'END'\n{AXIOMS}my_axiom : False\nEND", 1, "are not those of axioms.txt"),
        ("exit 1", 1, ""),
        (None, 1, "coqc is not installed"),
    ],
)
def test_the_build_script_with_a_stand_in_for_coq(coqc, status, message, tmp_path):
    for tool in ("awk", "cat", "cp", "diff", "dirname", "mktemp", "rm"):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    if coqc is not None:
        (tmp_path / "coqc").write_text(f"#!/bin/sh\n{coqc}\n")
        (tmp_path / "coqc").chmod(0o755)
    done = built(COQ, str(tmp_path))
    assert done.returncode == status, done.stderr
    assert message in done.stderr


def test_the_page_prints_definitions_and_theorems_as_they_are():
    page = (ROOT / "docs" / "nonexistence.md").read_text()
    definitions, *theorems = re.findall(r"```coq\n(.*?)```", page, re.DOTALL)
    code = (COQ / "Definitions.v").read_text()
    assert code.endswith(definitions)
    assert code[: -len(definitions)].endswith("Open Scope R_scope.\n\n")
    source = (COQ / "Theorems.v").read_text()
    printed = re.findall(r"Theorem .*?\.\n", "".join(theorems), re.DOTALL)
    assert printed
    assert all(f"{statement}Proof." in source for statement in printed)
    names = re.findall(r"^[a-z]\w+$", AXIOMS, re.MULTILINE)
    assert [statement.split()[1] for statement in printed] == names
