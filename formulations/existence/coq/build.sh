#!/bin/sh
# Check the proof with Coq and compare the axioms of every theorem with axioms.txt. Needs coqc
# (Debian: apt-get install --no-install-recommends coq); writes to a temporary folder only.
set -eu
cd "$(dirname "$0")"
command -v coqc > /dev/null || { echo "build.sh: coqc is not installed" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp ./*.v "$work"
for file in Definitions Sums Checker Soundness Reduction Data Nonexistence Bound Existence \
            Negative Theorems; do
  (cd "$work" && coqc -q -R . Lockedjoint "$file.v") > "$work/$file.out"
done
# Statements and types of axioms are indented: what is left are names.
awk '/^[^ ]/ {print $1}' "$work/Theorems.out" | diff axioms.txt - || {
  echo "build.sh: the axioms are not those of axioms.txt" >&2
  exit 1
}
cat "$work/Theorems.out"
