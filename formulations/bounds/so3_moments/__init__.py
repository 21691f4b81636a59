"""Bounds that hold for every unit revolute Jacobian: moment relaxations on SO(3)ⁿ.

A unit revolute joint, eq. (21), is a rotation, so a Jacobian is a point of SO(3)ⁿ and a bound
is a sum-of-squares identity among invariant polynomials there. The numbers that need it, all
for seven joints, in results/bounds and docs/bounds.md:

=====================================  ================================================
½‖JJᵀ − (7/3)I‖_F² ≥ 0.05682, proved   `residual_bound`, preset tight, rigorous; so do
                                       both bounds of `formulations.bounds.closed_form`
0.056826543, numerical                 preset tight
0.05665, both ways                     preset compact, the quickest
σ ≤ 0.572626, proved                   `max_min_bound`, preset localised, rigorous
σ ≤ 0.572277, proved                   preset null-vector, rigorous
=====================================  ================================================

In reading order: `wigner`, `symmetric_rows`, `sampled_blocks`, `moment_program`, which
`predictor_corrector` solves, `relaxation`, `null_vector_bound` and `unit_revolute_bounds`. What
a worst case implies, with error bounds: `conditions`, of `enclosed_matrix`. The proofs:
`certificate`, the file of a rigorous bound, and `verification`, without solver and relaxation:
sums with bounds on all rounding (`enclosed_squares`, `enclosed_sums`) at points that determine
all `invariants`.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, TypeAlias

from formulations import measures
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.joints.kinds import UnitRevolute
from nlp.errors import InputError

Kind: TypeAlias = Literal["numerical", "rigorous", "closed form"]


@dataclass(frozen=True)
class GlobalBound:
    """A bound from a relaxation for all unit revolute Jacobians, and what it rests on.

    The kind is ``"rigorous"`` only if rounding is accounted for everywhere.
    """

    #: ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², bounded from below. ``"max-min"``: the worst case
    #: σ after one locked joint, eq. (5), bounded from above.
    quantity: Literal["residual", "max-min"]
    joints: int
    #: Name of the choice of rows.
    preset: str
    kind: Kind
    #: After the largest difference of the check was subtracted.
    bound: float
    #: The best value of the quantity that a Jacobian is known to reach, or None.
    best_known: float | None
    #: Of the moment program, see `MomentProgram.size`, or None if there is none.
    size: Mapping[str, int] | None = None
    solver: str = ""
    status: str = ""
    iterations: int | None = None
    #: Largest violation of the dual equations by the solver's multipliers, and their smallest
    #: eigenvalue; negative ones were set to zero before the check.
    dual_residual: float | None = None
    smallest_eigenvalue: float | None = None
    #: In words, and the details.
    how_checked: str = ""
    check: Mapping[str, Any] = field(default_factory=dict)
    #: Wall time of each phase.
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def gap(self) -> float | None:
        """Distance between the bound and the best known value, not negative if both hold."""
        if self.best_known is None:
            return None
        distance = self.bound - self.best_known
        return -distance if self.quantity == "residual" else distance

    @property
    def gap_percent(self) -> float | None:
        """`measures.gap_percent`; None where the bound is 0 or no value is known."""
        if self.best_known is None or not self.bound:
            return None
        return measures.gap_percent(self.best_known, self.bound)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON."""
        gaps = {"gap": self.gap, "gap_percent": self.gap_percent}
        plain = list(asdict(self).items())
        after = 1 + list(vars(self)).index("best_known")
        return {**dict(plain[:after]), **gaps, **dict(plain[after:])}


def unit_revolute_joints(arm: ColumnModel, locked: int) -> int:
    """Return n of an arm of n unit revolute joints of which one locks; InputError if not so."""
    if not (isinstance(arm, Arm) and set(arm.joints) == {UnitRevolute()}):
        raise InputError("arm", arm.description, "unit revolute joints only for a relaxation")
    if locked != 1:
        raise InputError("locked joints", locked, "1 for a relaxation")
    return len(arm.joints)
