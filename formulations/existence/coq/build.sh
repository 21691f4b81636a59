#!/bin/sh
# Check the proof with Coq: its sources assume nothing, its theorems are those that are stated here,
# and what Coq prints of them, with definitions and axioms, is printed.txt word for word, `Arguments`
# apart. Needs coqc and coqchk (Debian: apt-get install --no-install-recommends coq); writes to a
# temporary folder only, but for `build.sh --record`: that writes to accepted.txt which sources
# were accepted. The tests compare the sources with it, and take no minute for Coq.
set -eu
cd "$(dirname "$0")"
record=${1:-}
set --
command -v coqc > /dev/null || { echo "build.sh: coqc is not installed" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Sources have no strings, and no characters but printable ASCII and line ends: what is a comment, and
# where a sentence ends, is then the same here as for Coq.
for file in ./*.v; do
  if LC_ALL=C tr -d '\n -~' < "$file" | grep -q . || grep -q '"' "$file"; then
    echo "build.sh: $file has a string, or a character that is not printable ASCII" >&2
    exit 1
  fi
done
# Without comments, the first word of every sentence: a tactic, or one of these commands. What a
# section assumes is allowed in sections alone; elsewhere it is an axiom.
awk -v allowed=" Add Check Context Definition Defined End Fixpoint From Hypothesis Implicit \
Import Inductive Lemma Let Open Print Proof Qed Record Section Theorem Variable \
Variables " -v assumed=" Context Hypothesis Variable Variables " '
  FNR == 1 { code = code (depth ? " . Unended . " : " . ") }
  {
    for (i = 1; i <= length($0); i++) {
      two = substr($0, i, 2)
      if (two == "(*") { depth++; i++ }
      else if (two == "*)" && depth) { depth--; i++ }
      else if (!depth) code = code substr($0, i, 1)
    }
    code = code " "
  }
  END {
    count = split(code, sentences, /[.][ ]+/)
    for (k = 1; k <= count; k++) {
      sub(/^[-+*{} ]+/, "", sentences[k])
      split(sentences[k], words, /[^A-Za-z_#]/)
      first = words[1]
      if (first == "Section") inside++
      if (first == "End") inside--
      if (first ~ /^[A-Z#]/ && (!index(allowed, " " first " ") || inside < 0)) wrong = first
      if (index(assumed, " " first " ") && inside < 1) wrong = first
      if (wrong) {
        print "build.sh: a source has the command " wrong > "/dev/stderr"
        exit 1
      }
    }
  }' ./*.v

cp ./*.v "$work"
files="Definitions Sums Checker Soundness Reduction Data Nonexistence Bound Existence Negative Theorems"
for file in $files; do
  (cd "$work" && coqc -q -R . Lockedjoint "$file.v") > "$work/$file.out"
done
# The statements in full, of the words of Definitions.v alone, whatever other files define and print.
cat > "$work/Query.v" << 'END'
From Coq Require Import Reals List.
From Lockedjoint Require Bound Nonexistence Existence Negative Theorems.
From Lockedjoint Require Import Definitions.
Open Scope R_scope.
Print Lockedjoint.Definitions.sum.
Print Lockedjoint.Definitions.delta.
Print Lockedjoint.Definitions.matrix.
Print Lockedjoint.Definitions.dot.
Print Lockedjoint.Definitions.column.
Print Lockedjoint.Definitions.revolute.
Print Lockedjoint.Definitions.optimally_failure_tolerant.
Print Lockedjoint.Definitions.exists_optimal.
Print Lockedjoint.Definitions.worst_case_at_least.
Print Lockedjoint.Definitions.squared_norm.
Print Lockedjoint.Definitions.bound.
Definition no_optimally_failure_tolerant_7R : forall (J : Lockedjoint.Definitions.matrix) (s : R),
  Lockedjoint.Definitions.revolute 7 J ->
  ~ Lockedjoint.Definitions.optimally_failure_tolerant 7 J s
  := Lockedjoint.Theorems.no_optimally_failure_tolerant_7R.
Check no_optimally_failure_tolerant_7R.
Print Assumptions no_optimally_failure_tolerant_7R.
Definition worst_case_at_most_bound :
  forall (n : nat) (J : Lockedjoint.Definitions.matrix) (t : R), (6 < n)%nat ->
  0 < Lockedjoint.Definitions.squared_norm n J ->
  Lockedjoint.Definitions.worst_case_at_least n J t -> t <= Lockedjoint.Definitions.bound n J
  := Lockedjoint.Theorems.worst_case_at_most_bound.
Check worst_case_at_most_bound.
Print Assumptions worst_case_at_most_bound.
Definition bound_attained_iff_optimal :
  forall (n : nat) (J : Lockedjoint.Definitions.matrix), (6 < n)%nat ->
  0 < Lockedjoint.Definitions.squared_norm n J ->
  Lockedjoint.Definitions.worst_case_at_least n J (Lockedjoint.Definitions.bound n J) <->
  (exists s : R, Lockedjoint.Definitions.optimally_failure_tolerant n J s)
  := Lockedjoint.Theorems.bound_attained_iff_optimal.
Check bound_attained_iff_optimal.
Print Assumptions bound_attained_iff_optimal.
Definition worst_case_below_bound_7R : forall (J : Lockedjoint.Definitions.matrix) (t : R),
  Lockedjoint.Definitions.revolute 7 J ->
  Lockedjoint.Definitions.worst_case_at_least 7 J t -> t < Lockedjoint.Definitions.bound 7 J
  := Lockedjoint.Theorems.worst_case_below_bound_7R.
Check worst_case_below_bound_7R.
Print Assumptions worst_case_below_bound_7R.
Definition six_joints_more : forall n : nat, (0 < n)%nat ->
  Lockedjoint.Definitions.exists_optimal n -> Lockedjoint.Definitions.exists_optimal (n + 6)
  := Lockedjoint.Theorems.six_joints_more.
Check six_joints_more.
Print Assumptions six_joints_more.
Definition exists_optimal_iff : forall n : nat, (6 < n)%nat ->
  Lockedjoint.Definitions.exists_optimal n <-> n <> 7%nat
  := Lockedjoint.Theorems.exists_optimal_iff.
Check exists_optimal_iff.
Print Assumptions exists_optimal_iff.
Definition other_constant : Lockedjoint.Checker.check (Lockedjoint.Checker.Certificate
  (Lockedjoint.Checker.constant Lockedjoint.Data.proof + 1)%Z
  (Lockedjoint.Checker.squares Lockedjoint.Data.proof)
  (Lockedjoint.Checker.multipliers Lockedjoint.Data.proof)) = false
  := Lockedjoint.Negative.other_constant.
Print Assumptions other_constant.
Definition missing_multiplier : Lockedjoint.Checker.check (Lockedjoint.Checker.Certificate
  (Lockedjoint.Checker.constant Lockedjoint.Data.proof)
  (Lockedjoint.Checker.squares Lockedjoint.Data.proof)
  (tl (Lockedjoint.Checker.multipliers Lockedjoint.Data.proof))) = false
  := Lockedjoint.Negative.missing_multiplier.
Print Assumptions missing_multiplier.
Definition no_constant :
  Lockedjoint.Checker.check (Lockedjoint.Checker.Certificate 0 nil nil) = false
  := Lockedjoint.Negative.no_constant.
Print Assumptions no_constant.
Definition negative_weight : Lockedjoint.Checker.check (Lockedjoint.Checker.Certificate 1
  (((-1)%Z, (1%Z, Lockedjoint.Checker.one) :: nil) :: nil) nil) = false
  := Lockedjoint.Negative.negative_weight.
Print Assumptions negative_weight.
Definition eighth_joint : forall e, In e (Lockedjoint.Checker.RowSum 7
  :: Lockedjoint.Checker.Square 0 7 :: Lockedjoint.Checker.TightFrame 7 0 :: nil)
  -> Lockedjoint.Checker.well_formed e = false
  := Lockedjoint.Negative.eighth_joint.
Print Assumptions eighth_joint.
END
(cd "$work" && coqc -q -R . Lockedjoint Query.v) > "$work/Query.out" || {
  echo "build.sh: the theorems are not those that it states" >&2
  exit 1
}
# Versions show otherwise how arguments are written, and break lines in other places.
for file in "$work/Query.out" printed.txt; do
  awk '/^[^ ]/ { shown = !/^Arguments / } shown { sub(/[{]A : Type[}]/, "A : Type"); print }' \
    "$file" > "$work/shown"
  tr -s ' \n' '\n' < "$work/shown" > "$work/${file##*/}.words"
done
cmp -s "$work/Query.out.words" "$work/printed.txt.words" || {
  diff printed.txt "$work/Query.out" >&2 || true
  echo "build.sh: the theorems and axioms are not those of printed.txt" >&2
  exit 1
}
# The independent checker, but for the two files with the long computation: it has no virtual
# machine. What they assume is printed above.
for file in $files Query; do
  case $file in Nonexistence | Negative) ;; *) set -- "$@" -norec "Lockedjoint.$file" ;; esac
done
(cd "$work" && coqchk -silent -o -R . Lockedjoint "$@") > "$work/checked" 2>&1 || {
  cat "$work/checked" >&2
  exit 1
}
if grep Lockedjoint "$work/checked" >&2; then
  echo "build.sh: coqchk finds these assumed" >&2
  exit 1
fi
cat "$work/Query.out"
if [ "$record" = --record ]; then
  sha256sum build.sh printed.txt *.v > accepted.txt
fi
