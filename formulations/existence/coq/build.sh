#!/bin/sh
# Check the proof with Coq: its sources assume nothing, and what it prints of the theorems, their
# statements and axioms with their types, is printed.txt word for word, `Arguments` apart. Needs coqc and coqchk
# (Debian: apt-get install --no-install-recommends coq); writes to a temporary folder only.
set -eu
cd "$(dirname "$0")"
command -v coqc > /dev/null || { echo "build.sh: coqc is not installed" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Without comments, the first word of every sentence: a tactic, or one of these commands.
awk -v allowed=" Add Check Context Definition Defined End Fixpoint From Hypothesis Implicit \
Import Inductive Lemma Let Open Print Proof Qed Record Section Theorem Variable \
Variables " '
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
    count = split(code, sentences, /[.][ \t]+/)
    for (k = 1; k <= count; k++) {
      sub(/^[-+*{} \t]+/, "", sentences[k])
      split(sentences[k], words, /[^A-Za-z_#]/)
      if (words[1] ~ /^[A-Z#]/ && !index(allowed, " " words[1] " ")) {
        print "build.sh: a source has the command " words[1] > "/dev/stderr"
        wrong = 1
      }
    }
    exit wrong
  }' ./*.v

cp ./*.v "$work"
files="Definitions Sums Checker Soundness Reduction Data Nonexistence Bound Existence Negative Theorems"
for file in $files; do
  (cd "$work" && coqc -q -R . Lockedjoint "$file.v") > "$work/$file.out"
done
# Versions show otherwise how arguments are written, and break lines in other places.
for file in "$work/Theorems.out" printed.txt; do
  awk '/^[^ ]/ { shown = !/^Arguments / } shown { sub(/[{]A : Type[}]/, "A : Type"); print }' \
    "$file" > "$work/shown"
  tr -s ' \n' '\n' < "$work/shown" > "$work/${file##*/}.words"
done
cmp -s "$work/Theorems.out.words" "$work/printed.txt.words" || {
  diff printed.txt "$work/Theorems.out" >&2 || true
  echo "build.sh: the theorems and axioms are not those of printed.txt" >&2
  exit 1
}
# The independent checker, but for the two files with the long computation: it has no virtual
# machine. What they assume is printed above.
for file in $files; do
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
cat "$work/Theorems.out"
