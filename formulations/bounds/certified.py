"""What is known about the optimum of a statement on an arm: bounds and how they are known.

A bound holds for every Jacobian of the arm. It is known in closed form, by a proof in exact
arithmetic, or with all rounding bounded. Bounds that take minutes come from the record that the
package carries; the commands that compute them again are in results/bounds. Each formulation's
``bound`` picks what applies to its score.

- J: the Jacobian of an arm, shape (m, n): `Arm.shape` is (m, n). Spatial arms have m = 6;
- worst case σ: the smallest singular value that J keeps without any k = `failures` columns, eq.
  (5) for k = 1; t = σ². `measures` computes it;
- T = ‖J‖_F²; `Arm.largest_trace` is the largest that the joints allow;
- max-min, isotropy: the largest σ of all J, and of isotropic ones; residual: the least
  ½‖JJᵀ − (T/m)I‖_F².

How to read it: `least_residual`, `largest_worst_case`, `largest_weighted_worst_case` and
`largest_isotropic_worst_case` take the best of all bounds that apply. Each private function
returns one `Bound`, or None where it does not apply. Files of JSON beside this one hold what
was proved by long computations: record.json and best_known.json (moments), planar.json and
isotropic_levers.json (branch and bound), two_point.json.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from html import escape
from importlib.resources import files
from math import inf, isnan, nextafter, sqrt
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds import (
    isotropic,
    rational_roots,
    revolute_exclusions,
    several_failures,
)
from lockedjoint.formulations.bounds.five_levers import five_levers_bound, has_five_levers
from lockedjoint.formulations.bounds.two_sliders import has_two_sliders, two_sliders_bound
from lockedjoint.formulations.bounds.unequal_failures import weighted_worst_bound
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.existence.verify import excludes
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.gram_conditions import checked_conditions
from lockedjoint.formulations.joints.joint import Joint
from lockedjoint.formulations.joints.kinds import (
    FreeColumn,
    LeverRevolute,
    Prismatic,
    UnitRevolute,
)
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.errors import InputError, of_kind

if TYPE_CHECKING:
    from lockedjoint.formulations.joints.parts import Statement


@dataclass(frozen=True, repr=False)
class Bound:
    """A bound on what a formulation optimises.

    Attributes
    ----------
    value
        The bound, from below if the formulation minimises and from above if it maximises;
        NaN if it is proved that nothing satisfies the formulation.
    kind
        How it is known: ``closed form``, ``exact proof``, ``proved`` (rounding errors
        included) or ``numerical``, with the relaxation or the search in parentheses.

    Raises
    ------
    InputError
        If the value is no number or the kind is no text.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> limit = lj.bound("max-min", lj.arm("unit-revolute", joints=7))
    >>> limit.certified
    True
    >>> print(f"{limit.gap_percent(0.571482968):.2f} %")
    0.14 %
    """

    value: float
    kind: str

    def __post_init__(self) -> None:
        of_kind("value", self.value, (float, int), "a number")
        of_kind("kind", self.kind, str, "how the bound is known, as text")

    @property
    def certified(self) -> bool:
        """Whether it is proved; False where it is checked in floating point only."""
        return not self.kind.startswith("numerical")

    def to_dict(self) -> dict[str, float | str | None]:
        """Return plain values for tables and JSON; no value where nothing exists to bound."""
        return {"value": None if isnan(self.value) else self.value, "kind": self.kind}

    def __repr__(self) -> str:
        """Say the bound, with all its digits as a rounded one may not hold, and its kind."""
        value = "nothing exists to bound" if isnan(self.value) else repr(float(self.value))
        return f"<Bound: {value}, {self.kind}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>"

    def gap_percent(self, found: float) -> float:
        """Return `measures.gap_percent` of a value found."""
        return measures.gap_percent(found, self.value)


# A lower bound on the residual below this is not above the rounding in its proof.
_NOTHING = 1e-9
#: The kind of the bound on isotropic arms of seven revolute joints by branch and bound.
LEVER_CELLS = "proved (branch and bound, axes)"
#: The kind of the bound on isotropic arms of five revolute and two prismatic joints.
FIVE_LEVERS = "proved (branch and bound, lever arms)"
#: The answer where it is proved that nothing satisfies the formulation.
NONE_EXISTS = Bound(float("nan"), "exact proof")
# Classes of revolute joints: |ω| = 1.
_REVOLUTE = (UnitRevolute, LeverRevolute)
# Number of bounds from the relaxation that are kept.
_KEPT_BOUNDS = 512
# Number of rows, v and then ω, of the column of a joint in space.
_SPATIAL_ROWS = 6
# Number of linear rows, and of rotational rows, in space.
_HALF_ROWS = 3


def least_residual(arm: Arm) -> Bound:
    """Return the best lower bound on ½‖JJᵀ − (T/m)I‖_F²."""
    found = _on_record("residual", arm) or _relaxed(arm, 1, "residual")
    return found if found and found.value > _NOTHING else Bound(0.0, "closed form")


def largest_worst_case(arm: Arm, failures: int = 1) -> Bound:
    """Return the best upper bound on the worst case σ after k = `failures` locked joints."""
    if _loses_rank(arm, failures):
        return Bound(0.0, "closed form")
    # What holds after k − 1 failures holds after k.
    fewer = largest_worst_case(arm, failures - 1) if failures > 1 else None
    found = _relaxed(arm, failures, "max-min")
    if found is None or failures > 1:
        found = least(found, Bound(_closed_form(arm, failures), "closed form"))
    short = all(
        isinstance(joint, UnitRevolute)
        or (isinstance(joint, LeverRevolute) and joint.length <= 1 and not joint.pitch)
        for joint in arm.joints
    )
    levers = _on_levers(revolute_exclusions.excludes_max_min, arm) if short else None
    sliders = Bound(two_sliders_bound(), "closed form") if has_two_sliders(arm) else None
    return least(
        found,
        _on_record("max-min", arm),
        levers,
        sliders,
        _seen_along_columns(arm, failures),
        _two_point(arm, failures),
        _several_by_rows(arm, failures),
        fewer,
    )


def _closed_form(arm: Arm, failures: int) -> float:
    """Return what the worst case σ is not above, of norms alone.

    For one failure it is eq. (6), rounded up.
    """
    m, n = arm.shape
    if failures == 1 and n > m:
        return rational_roots.root_above(Fraction(arm.largest_trace) * (n - m) / (m * n))
    return sqrt(several_failures.several_locked_bound(m, n, arm.largest_trace, failures))


def largest_weighted_worst_case(arm: Arm, failures: FailureModel) -> Bound:
    """Return the best upper bound on the weighted worst case of unequal failures.

    The closed form (docs/several_failures.md) takes norms of columns: it is used where these
    are fixed. No J has a larger σ than √(T/m), even without a failure.
    """
    found = _relaxed(arm, failures, "max-min")
    if all(map(_has_fixed_norm, arm.joints)):
        norms = [joint.largest_norm_squared for joint in arm.joints]
        value = weighted_worst_bound(arm.shape[0], norms, failures)
        found = least(found, Bound(nextafter(value, inf) if value else 0.0, "closed form"))
    whole = nextafter(sqrt(arm.largest_trace / arm.shape[0]), inf)
    return least(found, Bound(whole, "closed form"))


def largest_isotropic_worst_case(arm: Arm, failures: int = 1) -> Bound:
    """Return the best upper bound on σ of isotropic Jacobians of the arm.

    Isotropic Jacobians of n revolute joints have Σ |v_i|² = n, and any single |v_i|.
    """
    worst_case = largest_worst_case(arm, failures)
    levers = _on_levers(revolute_exclusions.excludes_isotropic, arm)
    apart = _isotropic_levers_on_record(arm)
    equal = _isotropic_of_equal_norms(arm, failures)
    relaxed = _relaxed(arm, failures, "isotropy")
    fixed = _isotropic_of_fixed_columns(arm)
    five = Bound(five_levers_bound(), FIVE_LEVERS) if has_five_levers(arm) else None
    return least(worst_case, relaxed, levers, apart, fixed, equal, five)


@lru_cache(maxsize=_KEPT_BOUNDS)
def _relaxed(arm: Arm, failures: int | FailureModel, statement: Statement) -> Bound | None:
    """Return what the relaxation proves; None where it says no more than a closed form.

    Programs that are too large have no bound either, nor have those whose solver fails.
    """
    m, n = arm.shape
    count = failures.failures if isinstance(failures, FailureModel) else failures
    equal = not isinstance(failures, FailureModel)
    if (equal and _contains_a_multiple_of_identity(arm)) or not 1 <= count <= n - m:
        return None
    # This import loads cvxpy, which takes a second: only where it is needed.
    from lockedjoint.formulations.bounds.relaxed import KIND, relaxed

    try:
        value = relaxed(arm, failures, statement).value
    except (InputError, CertificateError):
        return None
    return Bound(value, KIND)


def _contains_a_multiple_of_identity(arm: Arm) -> bool:
    """Whether all columns have the same conditions, and X = (c/m) I satisfies these.

    c is the largest squared norm of a column, m the number of rows. The relaxation then has
    this X for all joints, and its bound is that of norms alone, eq. (6). So it is if only norms
    are known, and for revolute joints with lever arms of length 1, or of mean square 1.
    """
    first, *others = set(arm.joints)
    m = arm.shape[0]
    conditions = checked_conditions(first.gram_conditions, m)
    if any(checked_conditions(one.gram_conditions, m) != conditions for one in others):
        return False
    entry = Fraction(first.largest_norm_squared) / m
    for one in conditions:
        value = entry * sum(Fraction(row[k]) for k, row in enumerate(one.matrix))
        if value != one.limit if one.equal else value > one.limit:
            return False
    return True


def _loses_rank(arm: Arm, failures: int) -> bool:
    """Whether k joints that lock leave fewer revolute joints than rotational rows."""
    revolute = _revolute(arm)
    return revolute is not None and revolute < _HALF_ROWS + failures


def _has_fixed_norm(joint: Joint) -> bool:
    """Whether all columns of a joint have one norm."""
    free = isinstance(joint, FreeColumn) and joint.budget == "each"
    return free or type(joint) in (UnitRevolute, Prismatic)


def _isotropic_of_fixed_columns(arm: Arm) -> Bound | None:
    """Return the bound on isotropic arms whose prismatic joints have a fixed norm.

    The trace of the rotational rows is the number r of revolute joints, and so T = 2r. The
    relaxation has no solution, and says nothing, where no isotropic Jacobian has full rank.
    """
    revolute = _revolute(arm)
    if not revolute:
        return None
    kinds = (UnitRevolute, Prismatic)
    fixed = [joint.largest_norm_squared for joint in arm.joints if isinstance(joint, kinds)]
    t = isotropic.isotropic_eigenvalue_bound(
        _SPATIAL_ROWS, 2.0 * revolute, fixed, len(arm.joints)
    )
    return Bound(nextafter(sqrt(t), inf) if t else 0.0, "closed form")


def _isotropic_of_equal_norms(arm: Arm, failures: int) -> Bound | None:
    """Return the closed form for isotropic J with free columns of one norm, or None."""
    joint = arm.joints[0]
    if set(arm.joints) != {joint} or not isinstance(joint, FreeColumn):
        return None
    if joint.budget != "each":
        return None
    value = joint.norm * sqrt(isotropic.isotropic_unit_bound(*arm.shape, failures))
    return Bound(nextafter(value, inf) if value else 0.0, "closed form")


def least(*bounds: Bound | None) -> Bound:
    """Return the least of the bounds that there are; of equal ones, the first."""
    return min((one for one in bounds if one), key=lambda one: one.value)


def sharpest_worst_case_of(jacobian: ArrayLike, failures: int = 1) -> Bound:
    """Return what no matrix with the shape and ‖J‖_F of `jacobian` has a worst case above.

    `jacobian` has the shape (m, n), n ≥ m + `failures`; the bound has its unit.
    """
    matrix = measures.as_jacobian(jacobian)
    m, n = matrix.shape
    size = sqrt(measures.trace(matrix) / n)
    free = Arm.of(FreeColumn(m, 1.0, "mean"), n)
    known = largest_worst_case(free, failures)
    value = size * known.value
    # A value of 0 is exact, any other one is rounded.
    return Bound(nextafter(value, inf) if value else 0.0, known.kind)


def _seen_along_columns(arm: Arm, failures: int) -> Bound | None:
    """Return what branch and bound proved of n − m + 2 columns in the plane, or None.

    Seen along m − 2 of its columns, J has so many there, and of its trace at most 2/m; of a
    planar J nothing is lost (docs/several_failures.md).
    """
    m, n = arm.shape
    joints = n - m + 2
    known = planar_on_record((2, joints), failures, "max-min") if m > 1 else None
    if known is None:
        return None
    # The planar bound is one for ‖J‖_F² = `joints`, and there it is at most 2T/m.
    scale = Fraction(2 * arm.largest_trace) / (m * joints)
    return Bound(rational_roots.root_above(scale * Fraction(known.value) ** 2), known.kind)


def planar_on_record(shape: tuple[int, int], failures: int, measure: str) -> Bound | None:
    """Return what branch and bound proved of planar J with ‖J‖_F² = n, or None.

    `shape` is (m, n); it is None unless m = 2. `measure` is a `planar_conditions.Measure`.
    """
    m, n = shape
    known = _stored("planar.json", joints=n, failures=failures, measure=measure, proved=True)
    if m != 2 or not known:
        return None
    return Bound(float(known[0]["level"]), "proved (branch and bound)")


def two_point_on_record(task_dimension: int, joints: int) -> dict[str, Any] | None:
    """Return the fields of a proved `TwoPointBound` for m rows and n columns, or None."""
    known = _stored("two_point.json", task_dimension=task_dimension, joints=joints)
    return known[0] if known else None


def _two_point(arm: Arm, failures: int) -> Bound | None:
    """Return the bound from pairs of columns, which holds whatever the columns are, or None.

    On record is what holds for two of n joints; of n + 1 joints three may lock, and so on.
    """
    m, n = arm.shape
    known = two_point_on_record(m, n - failures + 2) if failures > 1 else None
    if known is None:
        return None
    # The limit of tr G, see `two_point_proof`, of which t is a function.
    limit = known["trace_limit"]
    for joints in range(n - failures + 3, n + 1):
        limit = several_failures.with_one_more_locked(m, joints, limit)
    t = arm.largest_trace / m * (1 - m / limit)
    return Bound(nextafter(sqrt(t), inf), "proved (two-point)")


def _several_by_rows(arm: Arm, failures: int) -> Bound | None:
    """Return what the means over several failures say of the linear or the rotational rows.

    The relaxation has these conditions for one locked joint only. The traces are r for the
    rotational rows of r revolute joints, and what is left of T for the linear ones.
    """
    n, revolute = len(arm.joints), _revolute(arm)
    if revolute is None or failures == 1:
        return None
    linear = sum(one.largest_norm_squared - isinstance(one, _REVOLUTE) for one in arm.joints)
    level = min(
        several_failures.several_locked_bound(_HALF_ROWS, revolute, float(revolute), failures),
        several_failures.several_locked_bound(_HALF_ROWS, n, linear, failures),
    )
    return Bound(nextafter(sqrt(level), inf), "closed form")


def _revolute(arm: Arm) -> int | None:
    """Return how many joints are revolute; None if some are neither revolute nor prismatic."""
    if not all(isinstance(joint, (*_REVOLUTE, Prismatic)) for joint in arm.joints):
        return None
    return sum(isinstance(joint, _REVOLUTE) for joint in arm.joints)


def _on_levers(excluding: revolute_exclusions.Excludes, arm: Arm) -> Bound | None:
    """Return what the residual of as many unit revolute joints says of σ, or None.

    `excluding` tells whether a proved residual excludes a σ, see `revolute_exclusions`.
    """
    joints = len(arm.joints)
    if _revolute(arm) != joints:
        return None
    residual = _on_record("residual", Arm.of(UnitRevolute(), joints))
    return residual and Bound(
        revolute_exclusions.least_excluded(excluding, residual.value, joints), residual.kind
    )


def _isotropic_levers_on_record(arm: Arm) -> Bound | None:
    """Return what is on record for isotropic revolute joints with any lever arms, or None."""
    joints = len(arm.joints)
    known = _stored("isotropic_levers.json", joints=joints)
    if not known or _revolute(arm) != joints:
        return None
    return Bound(known[0]["bound"], LEVER_CELLS)


def has_no_isotropic(arm: Arm) -> bool:
    """Whether it is proved that the arm has no isotropic Jacobian.

    Isotropic revolute joints with |v_i| ≤ 1 are optimally failure-tolerant (Section 2), and
    with seven of them there are none (docs/nonexistence.md). Of other arms the residual has a
    bound above 0 where rows have traces that cannot be equal.
    """
    unit = set(arm.joints) <= {UnitRevolute(), LeverRevolute(1.0, "each")}
    return (unit and excludes(len(arm.joints))) or least_residual(arm).value > 0


def _on_record(quantity: str, arm: Arm) -> Bound | None:
    """Return what is on record for unit revolute joints, or None.

    `quantity` is ``residual`` or ``max-min``.
    """
    if set(arm.joints) != {UnitRevolute()}:
        return None
    known = _stored("record.json", quantity=quantity, joints=len(arm.joints))
    return Bound(known[0]["bound"], f"proved ({known[0]['preset']})") if known else None


def best_known(quantity: str, model: str, joints: int) -> float | None:
    """Return the best known value of a quantity in six task dimensions, or None.

    `quantity` is ``residual``, ``max-min`` for one locked joint, or ``isotropy``, which is
    max-min of isotropic arms. `model` is the name of a joint kind, such as ``unit-revolute``.
    """
    known = _stored("best_known.json", quantity=quantity, model=model, joints=joints)
    return float(known[0]["value"]) if known else None


def _stored(name: str, **sought: object) -> list[dict[str, Any]]:
    """Return the rows of a data file that have these values under these keys."""
    return [one for one in _rows(name) if sought.items() <= one.items()]


@lru_cache
def _rows(name: str) -> tuple[dict[str, Any], ...]:
    """Return all rows of a data file in this folder."""
    return tuple(
        json.loads((files("lockedjoint.formulations.bounds") / name).read_text("utf-8"))
    )
