"""What is certified about the optimum of each formulation on an arm, for tables.

What is certified holds for every Jacobian of the arm: in closed form, by a proof in exact
arithmetic, or with all rounding bounded. A numerical bound may be sharper; it is checked, but
in floating point. Bounds that take minutes come from the record that the package carries; the
commands that compute them again are in results/bounds.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from math import isnan
from typing import Any

from formulations import isotropy, measures, residual
from formulations.existence.theorem import excludes
from formulations.joints.arm import Arm
from formulations.joints.kinds import LeverRevolute, UnitRevolute

# A value this close to its bound has no gap worth a percentage.
CLOSED = 1e-6


@dataclass(frozen=True)
class CertifiedBound:
    """A bound on what a formulation optimises.

    Attributes
    ----------
    value
        The bound, from below if the formulation minimises and from above if it maximises;
        NaN if it is proved that nothing satisfies the formulation.
    kind
        ``closed form``, ``exact proof``, ``rigorous`` or ``numerical``, with the preset of
        the relaxation if there is one.
    """

    value: float
    kind: str

    def to_dict(self) -> dict[str, float | str | None]:
        """Return plain values for tables and JSON; no value where nothing exists to bound."""
        return {"value": None if isnan(self.value) else self.value, "kind": self.kind}

    def gap_percent(self, found: float) -> float:
        """Return how far a value found is from the bound, in percent of that value."""
        gap = abs(found - self.value)
        return 0.0 if gap <= CLOSED * max(1.0, abs(self.value)) else 100 * gap / abs(found)


def certified_bound(formulation: str, arm: Arm, locked: int = 1) -> CertifiedBound:
    """Return the best bound on the optimum that is proved.

    Parameters
    ----------
    formulation
        Name of the formulation.
    arm
        The joints.
    locked
        How many joints lock at once. What is on record for one holds for more.
    """
    if formulation == residual.NAME:
        trivial = CertifiedBound(0.0, "closed form")
        return _on_record("residual", arm, "rigorous") or trivial
    if formulation == isotropy.NAME and is_excluded(arm):
        return CertifiedBound(float("nan"), "exact proof")
    value = measures.sigma_bound(*arm.shape, arm.largest_trace, locked)
    bounds = [CertifiedBound(value, "closed form"), _on_record("max-min", arm, "rigorous")]
    return min((one for one in bounds if one), key=lambda one: one.value)


def numerical_bound(formulation: str, arm: Arm) -> CertifiedBound | None:
    """Return the best numerical bound on record, for any number of locked joints, or None."""
    if formulation == isotropy.NAME and is_excluded(arm):
        return None
    quantity = "residual" if formulation == residual.NAME else "max-min"
    return _on_record(quantity, arm, "numerical")


def is_excluded(arm: Arm) -> bool:
    """Whether it is proved that the arm has no isotropic Jacobian.

    Isotropic revolute joints with |v_i| ≤ 1 are optimally failure-tolerant (Section 2), and
    with seven of them there are none (docs/nonexistence.md).
    """
    unit = set(arm.joints) <= {UnitRevolute(), LeverRevolute(1.0, "each")}
    return unit and excludes(len(arm.joints))


def _on_record(quantity: str, arm: Arm, kind: str) -> CertifiedBound | None:
    if set(arm.joints) != {UnitRevolute()}:
        return None
    found = [
        one
        for one in _record()
        if (one["quantity"], one["kind"]) == (quantity, kind)
        and one["joints"] == len(arm.joints)
    ]
    if not found:
        return None
    sharpest = max if quantity == "residual" else min
    best = sharpest(found, key=lambda one: float(one["bound"]))
    return CertifiedBound(float(best["bound"]), f"{kind} ({best['preset']})")


@lru_cache(maxsize=1)
def _record() -> tuple[dict[str, Any], ...]:
    content = (files("formulations.bounds") / "record.json").read_text("utf-8")
    return tuple(json.loads(content))
