"""The proof in Coq: its data are the certificate's, it builds, and its page prints it."""

import os
import re
import shutil
import subprocess
from fractions import Fraction
from hashlib import sha256
from pathlib import Path

import pytest

from lockedjoint.formulations.existence.coq_data import coq_data

ROOT = Path(__file__).parents[3]
COQ = ROOT / "formulations" / "existence" / "coq"
PRINTED = (COQ / "printed.txt").read_text()


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


def built(folder, path=os.environ["PATH"]):
    how = {"capture_output": True, "text": True, "timeout": 600}
    environment = os.environ | {"PATH": path}
    return subprocess.run(["/bin/sh", str(folder / "build.sh")], env=environment, **how)


def test_coq_has_accepted_these_sources():
    """Coq itself takes a minute and runs in `.ci/run`; `build.sh --record` writes the list."""
    files = [COQ / "build.sh", COQ / "printed.txt", *COQ.glob("*.v")]
    digests = {file.name: sha256(file.read_bytes()).hexdigest() for file in files}
    lines = (COQ / "accepted.txt").read_text().splitlines()
    assert {name: digest for digest, name in map(str.split, lines)} == digests
    assert PRINTED.count("Axioms:") == 6
    assert list(COQ.glob("*.vo")) == []


def stand_ins(folder, coqc, coqchk="exit 0"):
    """Return a search path with the tools of the script, and stand-ins for those of Coq."""
    for tool in ("awk", "cat", "cmp", "cp", "diff", "dirname", "grep", "mktemp", "rm", "tr"):
        (folder / tool).symlink_to(shutil.which(tool))
    for name, script in (("coqc", coqc), ("coqchk", coqchk)):
        if script is not None:
            (folder / name).write_text(f"#!/bin/sh\n{script}\n")
            (folder / name).chmod(0o755)
    return str(folder)


@pytest.fixture
def proof(tmp_path):
    """A copy of the sources with short data, which the script has read at once."""
    folder = shutil.copytree(COQ, tmp_path / "coq")
    (folder / "Data.v").write_text("Definition one := 1.\n")
    return folder


def printing(text):
    return f"cat <<'END'\n{text}END"


FALSE = PRINTED.replace("sig_not_dec : forall P : Prop, {~ ~ P} + {~ P}", "sig_not_dec : False")


@pytest.mark.parametrize(
    ("coqc", "coqchk", "status", "message"),
    [
        (printing(PRINTED), "exit 0", 0, ""),
        (printing(PRINTED.replace("\n     : ", " : ")), "exit 0", 0, ""),
        (printing(PRINTED.replace("%nat_scope", "%_nat_scope")), "exit 0", 0, ""),
        (printing(PRINTED.replace("forall A : Type", "forall {A : Type}")), "exit 0", 0, ""),
        (printing(PRINTED.replace("Arguments sum", "my_axiom")), "exit 0", 1, "not those of"),
        (printing(PRINTED + "my_axiom : False\n"), "exit 0", 1, "not those of printed.txt"),
        (printing(FALSE), "exit 0", 1, "not those of printed.txt"),
        (printing(PRINTED.replace("revolute 7", "revolute 6")), "exit 0", 1, "not those of"),
        (printing(PRINTED), "echo Lockedjoint.Sums.x", 1, "coqchk finds these assumed"),
        (printing(PRINTED), "exit 3", 1, ""),
        ("exit 1", "exit 0", 1, ""),
        (None, "exit 0", 1, "coqc is not installed"),
    ],
)
def test_the_build_script_with_stand_ins_for_coq(
    coqc, coqchk, status, message, proof, tmp_path
):
    """The sources as they are where all is well."""
    done = built(proof if status else COQ, stand_ins(tmp_path, coqc, coqchk))
    assert done.returncode == status, done.stderr
    assert message in done.stderr


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("Lemma wrong : False. Admitted.", "Admitted"),
        ("Module ClassicalDedekindReals.\nAxioms sig_not_dec : False.\nEnd M.", "Module"),
        ("(* a (* nested *) comment *) Axiom wrong : False.", "Axiom"),
        ("#[bypass_check(guard)] Fixpoint wrong (n : nat) : False := wrong n.", "#"),
        ("Lemma wrong : True. Proof. - Unset Guard Checking. exact I. Qed.", "Unset"),
        ("Hypothesis wrong : False.", "Hypothesis"),
        ("Section a. End a. Variable wrong : False.", "Variable"),
        ("Section a. Hypothesis fine : True. End a. Context (wrong : False).", "Context"),
        ("End a. Section a. Hypothesis wrong : False.", "End"),
        ("(* a comment without an end. Axiom wrong : False.", "Unended"),
    ],
)
def test_sources_that_assume_something_are_refused(line, command, proof, tmp_path):
    with (proof / "Negative.v").open("a") as file:
        file.write(line + "\n")
    (tmp_path / "tools").mkdir()
    done = built(proof, stand_ins(tmp_path / "tools", printing(PRINTED)))
    assert done.returncode == 1
    assert f"a source has the command {command}" in done.stderr


@pytest.mark.parametrize(
    "text",
    [
        'Definition a := "(*". Axiom wrong : False. Definition b := "*)".',
        '(* " *) Axiom wrong : False. (* " *)',
        "Lemma a : True. exact I. Qed.\rAxiom wrong : False.",
        "Lemma a : True. exact I. Qed.\fAxiom wrong : False.",
        "Lemma a : True. exact I. Qed.\tAxiom wrong : False.",
        "Lemma a : True. exact I. Qed.\u00a0Axiom wrong : False.",
    ],
)
def test_sources_that_could_be_read_otherwise_are_refused(text, proof, tmp_path):
    """Strings, and characters that are blanks for Coq, hide commands from a filter."""
    with (proof / "Negative.v").open("a", newline="") as file:
        file.write(text + "\n")
    (tmp_path / "tools").mkdir()
    done = built(proof, stand_ins(tmp_path / "tools", printing(PRINTED)))
    assert done.returncode == 1
    assert "a string, or a character that is not printable ASCII" in done.stderr


SPOOFS = {
    # Other bodies of the same names, in a file that is imported last.
    "other definitions": (
        "Definition revolute (n : nat) (J : matrix) := False.\n",
        "Theorem no_optimally_failure_tolerant_7R J s :\n"
        "  revolute 7 J -> ~ optimally_failure_tolerant 7 J s.\nProof. intros []. Qed.\n",
    ),
    # Nothing is proved, and what is expected is printed by a theorem of another statement.
    "other statement": (
        "",
        "Theorem no_optimally_failure_tolerant_7R (J : matrix) (s : R) : True.\n"
        "Proof. exact I. Qed.\n",
    ),
    "no theorem": ("", "Print sum.\n"),
}


@pytest.mark.skipif(shutil.which("coqc") is None, reason="install coqc (Debian: coq)")
@pytest.mark.parametrize("spoof", SPOOFS)
def test_theorems_about_something_else_are_refused(spoof, tmp_path):
    """What the build states is of Definitions.v, whatever other files define or print."""
    shutil.copy(COQ / "Definitions.v", tmp_path)
    redefined, theorem = SPOOFS[spoof]
    head = "From Coq Require Import Reals List.\nFrom Lockedjoint Require Import Definitions"
    (tmp_path / "Other.v").write_text(f"{head}.\nOpen Scope R_scope.\n{redefined}")
    (tmp_path / "Theorems.v").write_text(f"{head} Other.\nOpen Scope R_scope.\n{theorem}")
    script = (COQ / "build.sh").read_text()
    query = script.partition("Query.v\" << 'END'\n")[2].partition("\nEND\n")[0]
    stated = query[: query.index("Check no_optimally")]
    stated = stated.replace("Bound Nonexistence Existence Negative ", "")
    (tmp_path / "Query.v").write_text(stated)
    how = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": 300}
    for name in ("Definitions", "Other", "Theorems"):
        subprocess.run(["coqc", "-q", "-R", ".", "Lockedjoint", f"{name}.v"], check=True, **how)
    done = subprocess.run(["coqc", "-q", "-R", ".", "Lockedjoint", "Query.v"], **how)
    assert done.returncode != 0
    assert "has type" in done.stderr or "was not found" in done.stderr


def test_the_build_states_the_theorems_of_the_page():
    """In full: each theorem of Theorems.v, with the words of Definitions.v by their names."""
    script = (COQ / "build.sh").read_text()
    stated = dict(
        re.findall(r"^Definition (\w+) ?:(.*?):= Lock", script, re.DOTALL | re.MULTILINE)
    )
    source = (COQ / "Theorems.v").read_text()
    names = re.findall(r"^Theorem (\w+)", source, re.MULTILINE)
    assert len(names) == 6
    for name in names:
        assert f":= Lockedjoint.Theorems.{name}.\n" in script
        assert f"Print Assumptions {name}.\n" in script
        words = re.findall(rf"Theorem {name} .*?\.\nProof", source, re.DOTALL)[0]
        conclusion = words.removesuffix(".\nProof").rpartition(":")[2].partition("->")[2]
        plain = stated[name].replace("Lockedjoint.Definitions.", "")
        last = conclusion.rpartition("->")[2]
        squeezed = [re.sub(r"\s|[()]|: R", "", text) for text in (last, plain)]
        assert squeezed[1].endswith(squeezed[0])


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
    names = re.findall(r"^([a-z]\w+)\n +: ", PRINTED, re.MULTILINE)
    assert [statement.split()[1] for statement in printed] == names
