"""An optimum of free columns in exact numbers, as it is on file.

The columns of the exact Jacobian are j_f = ±√w_f B x_f. The matrix B is a frame of the task
space, of which only the Gram matrix S = BᵀB is known. A change of frame or of a column's sign
changes none of S, x_f and w_f, so that these are numbers of a small field.

Let F be a set of locked joints and A_F = J_F̄J_F̄ᵀ what J is without them. The matrix

    M_F = Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹ = B⁻¹(A_F − tI)B⁻ᵀ

has the inertia of A_F − tI (Sylvester). Its null vector v_F makes u_F = B⁻ᵀv_F, the eigenvector
of A_F at t. J_F̄ is J without the columns in F, and t the squared worst case: the least
eigenvalue of any A_F. The multipliers c_F ≥ 0 of the sets F that attain it have Σ c_F |u_F|²
= 1. J has the shape (m, n); `ExactOptimum` lists all other shapes.

What is on file of an entry, its `Record`, comes from two files of JSON:

- formulations/atlas/exact.json, which the library shows: ``polynomial`` of t, constant first;
  ``near``, t as a decimal number; ``proof``, see `ExactValue`; ``active_sets``, the F with
  c_F > 0;
- exact_proofs.json beside this file, of free columns only: ``field``, the monic polynomial of
  θ, constant first; ``root``, a rational number near θ and the radius around it; ``numbers``,
  the lists c_0, c_1, …, d of (c_0 + c_1 θ + …)/d, t first; ``worst_sets``; and the arrays of
  `ExactOptimum`, as places in ``numbers``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations.atlas.entry import Entry, entries
from lockedjoint.formulations.atlas.exact_value import exact_values
from lockedjoint.formulations.existence.certificate import CertificateError
from results.atlas.enclosed_matrices import Exact
from results.atlas.number_field import Number, NumberField

#: What is on file of one entry: the exact value as in the library, and what proves it.
Record: TypeAlias = Mapping[str, Any]
#: Set of joints that are locked, ascending.
LockedSet: TypeAlias = tuple[int, ...]
# The file of what the library shows.
_VALUES = Path(__file__).parents[2] / "formulations" / "atlas" / "exact.json"
# The file of what proves it.
_PROOFS = Path(__file__).parent / "exact_proofs.json"
# Keys of a record that go into the file that the library shows; all others go into the other.
_SHOWN_FIELDS = ("polynomial", "near", "proof", "active_sets")


@lru_cache
def records() -> Mapping[str, Record]:
    """Return what is on file, by the names of entries; nothing proves a numerical value."""
    proofs = json.loads(_PROOFS.read_text(encoding="utf-8"))
    return {
        name: {**exact.to_dict(), **proofs.get(name, {})}
        for name, exact in exact_values().items()
    }


def write_records(found: Mapping[str, Record]) -> None:
    """Write what the library shows into its file, and what proves it into that beside."""
    shown: dict[str, Any] = {}
    proofs: dict[str, Any] = {}
    for name in (name for name in entries() if name in found):
        record = dict(found[name])
        if "worst_sets" in record:
            record["active_sets"] = active_sets(record)
        shown[name] = {key: record.pop(key) for key in _SHOWN_FIELDS if key in record}
        if record:
            proofs[name] = record
    for path, content in ((_VALUES, shown), (_PROOFS, proofs)):
        lines = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in content.items())
        path.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def active_sets(record: Record) -> list[list[int]]:
    """Return the worst sets of a record whose multipliers are not zero."""
    # The last of the integers of a number is its denominator.
    numerators = [record["numbers"][place][:-1] for place in record["multipliers"]]
    pairs = zip(record["worst_sets"], numerators, strict=True)
    return [locked for locked, multiplier in pairs if any(multiplier)]


@dataclass(frozen=True, eq=False)
class ExactOptimum:
    """The exact Jacobian of an entry, with an eigenvector and a multiplier for each worst set.

    Attributes
    ----------
    entry
        The entry: of max-min, with free columns.
    field
        The field of all numbers.
    t
        The squared worst case.
    gram
        S = BᵀB, shape (m, m).
    gram_inverse
        S⁻¹, shape (m, m).
    coordinates
        The x_f as columns, shape (m, n).
    squared_scales
        The w_f, shape (n,).
    worst_sets
        The sets F after whose loss the worst case is √t.
    eigenvectors
        The v_F as rows, shape (sets, m).
    multipliers
        The c_F, shape (sets,).
    """

    entry: Entry
    field: NumberField
    t: Number
    gram: Exact
    gram_inverse: Exact
    coordinates: Exact
    squared_scales: Exact
    worst_sets: tuple[LockedSet, ...]
    eigenvectors: Exact
    multipliers: Exact

    @staticmethod
    def of(entry: Entry, record: Record) -> ExactOptimum:
        """Read the record of an entry, or raise CertificateError or ValueError.

        ``numbers`` lists all numbers, t first. The matrices have the numbers' places in it.
        """
        require(entry.model in ("free", "free-mean"), "the columns are not free")
        m, n = entry.task_dimension, entry.joints
        worst_sets = tuple(tuple(one) for one in record["worst_sets"])
        shapes = {
            "gram": (m, m),
            "gram_inverse": (m, m),
            "coordinates": (m, n),
            "squared_scales": (n,),
            "eigenvectors": (len(worst_sets), m),
            "multipliers": (len(worst_sets),),
        }
        places = {name: np.array(record[name], dtype=int) for name in shapes}
        fits = all(places[name].shape == shape for name, shape in shapes.items())
        require(fits, "matrices have other shapes")
        all_sets = set(combinations(range(n), entry.failures))
        distinct = len(set(worst_sets)) == len(worst_sets)
        require(distinct and all_sets.issuperset(worst_sets), "sets are unknown")
        near, radius = map(Fraction, record["root"])
        field = NumberField.of(record["field"], near, radius)
        numbers = np.array([field.number(one) for one in record["numbers"]], dtype=object)
        matrices = {name: numbers[place] for name, place in places.items()}
        return ExactOptimum(entry, field, numbers[0], worst_sets=worst_sets, **matrices)

    @cached_property
    def outer_products(self) -> Exact:
        """The w_f x_f x_fᵀ, shape (m, m, n)."""
        return np.asarray(self.squared_scales * self.coordinates[:, None] * self.coordinates)

    @cached_property
    def pairings(self) -> Exact:
        """The v_F·x_f, shape (sets, n)."""
        return np.asarray(self.eigenvectors @ self.coordinates)

    @cached_property
    def dual_coordinates(self) -> Exact:
        """The S x_f as columns, shape (m, n)."""
        return np.asarray(self.gram @ self.coordinates)

    @cached_property
    def active(self) -> list[int]:
        """Numbers of the worst sets with c_F > 0; CertificateError if a c_F is negative."""
        signs = [multiplier.sign for multiplier in self.multipliers]
        require(min(signs) >= 0, "a multiplier is negative")
        return [number for number, sign in enumerate(signs) if sign > 0]

    def shifted_gram(self, locked: LockedSet) -> Exact:
        """Return M_F = Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹, shape (m, m), for F the `locked` joints."""
        kept = np.delete(self.outer_products, list(locked), axis=2)
        return np.asarray(kept.sum(axis=2) - self.gram_inverse * self.t)


def require(condition: bool | np.bool_, why: str) -> None:
    """Raise CertificateError unless the condition holds."""
    if not condition:
        raise CertificateError(f"the exact value is not proved: {why}.")
