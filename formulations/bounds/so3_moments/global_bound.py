"""A bound that holds for every unit revolute Jacobian, and the evidence for it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, TypeAlias

from formulations import measures
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from formulations.joints.kinds import UnitRevolute
from nlp.errors import InputError

Quantity: TypeAlias = Literal["residual", "max-min"]
Kind: TypeAlias = Literal["numerical", "rigorous", "closed form"]


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What a bound rests on.

    Parameters
    ----------
    size
        Of the moment program, see `MomentProgram.size`, or None if there is none.
    solver, status, iterations
        Of the solver; all empty without a program.
    dual_residual
        Largest violation of the dual equations by the solver's multipliers.
    smallest_eigenvalue
        Of the solver's multipliers; negative ones were set to zero before the check.
    how_checked, check
        In words, and the details.
    seconds
        Wall time of each phase.
    """

    size: Mapping[str, int] | None = None
    solver: str = ""
    status: str = ""
    iterations: int | None = None
    dual_residual: float | None = None
    smallest_eigenvalue: float | None = None
    how_checked: str = ""
    check: Mapping[str, Any] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class GlobalBound(Evidence):
    """A bound on the residual from below or on the max-min measure from above.

    Parameters
    ----------
    quantity
        ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², bounded from below. ``"max-min"``: the worst
        case σ after one locked joint, eq. (5), bounded from above.
    joints
        Number n of unit revolute joints.
    preset
        Name of the choice of rows.
    kind
        ``"rigorous"`` only if rounding is accounted for everywhere.
    bound
        The bound, after the largest difference of the check was subtracted.
    best_known
        The best value of the quantity that a Jacobian is known to reach, or None.
    """

    quantity: Quantity
    joints: int
    preset: str
    kind: Kind
    bound: float
    best_known: float | None

    @property
    def gap(self) -> float | None:
        """Distance between the bound and the best known value, not negative if both hold."""
        if self.best_known is None:
            return None
        if self.quantity == "residual":
            return self.best_known - self.bound
        return self.bound - self.best_known

    @property
    def gap_percent(self) -> float | None:
        """`measures.gap_percent`; None where the bound is 0 or no value is known."""
        if self.best_known is None or not self.bound:
            return None
        return measures.gap_percent(self.best_known, self.bound)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON."""
        evidence = asdict(self)
        names = ("quantity", "joints", "preset", "kind", "bound", "best_known")
        head = {name: evidence.pop(name) for name in names}
        return {**head, "gap": self.gap, "gap_percent": self.gap_percent, **evidence}


def unit_revolute_joints(arm: ColumnModel, locked: int) -> int:
    """Return n of an arm of n unit revolute joints of which one locks; InputError if not so."""
    if not (isinstance(arm, Arm) and set(arm.joints) == {UnitRevolute()}):
        raise InputError("arm", arm.description, "unit revolute joints only for a relaxation")
    if locked != 1:
        raise InputError("locked joints", locked, "1 for a relaxation")
    return len(arm.joints)
