"""The bounds of the atlas, proved anew: of what an entry states, not of how it was computed.

A closed form is decided in rational arithmetic, by arguments of docs/several_failures.md or
docs/bounds.md; but for `proves_ratio` and `excludes_eigenvalue`, no function here shares code
with `lockedjoint.formulations.bounds`, which finds these numbers. The relaxation is solved
again, and its multipliers are checked in rational arithmetic. Branch and bound is searched
again at the number that is stated, or at one that implies it. A two-point bound is proved from
multipliers. What follows from the least residual needs its certificate, and so do the worst
cases of unit revolute 7R and of isotropic 7R.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from fractions import Fraction
from functools import cache
from inspect import signature
from math import comb, factorial
from pathlib import Path

from lockedjoint.formulations import condition, isotropy, manipulability
from lockedjoint.formulations.atlas.entry import RESOLUTION, Entry, EntryPage
from lockedjoint.formulations.bounds.certified import (
    FIVE_LEVERS,
    Bound,
    planar_on_record,
    two_point_on_record,
)
from lockedjoint.formulations.bounds.five_levers import has_five_levers, proves_five_levers
from lockedjoint.formulations.bounds.moments.certificate import BoundCertificate
from lockedjoint.formulations.bounds.moments.certificate_reader import read_any
from lockedjoint.formulations.bounds.moments.verification import verify_bound
from lockedjoint.formulations.bounds.planar import planar_bound
from lockedjoint.formulations.bounds.planar_conditions import Measure
from lockedjoint.formulations.bounds.rational_roots import root_below
from lockedjoint.formulations.bounds.relaxed import KIND, relaxed
from lockedjoint.formulations.bounds.revolute_exclusions import (
    excludes_isotropic,
    excludes_max_min,
)
from lockedjoint.formulations.bounds.several_failures import proves_ratio
from lockedjoint.formulations.bounds.two_point_proof import prove_two_point
from lockedjoint.formulations.bounds.two_sliders import excludes_eigenvalue, has_two_sliders
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic
from lockedjoint.formulations.joints.parts import Statement
from lockedjoint.nlp.errors import FileError

# A bound is stated to the last digits of a double.
_ROUNDING = 1 + Fraction(1, 10**14)
# The measure that branch and bound bounds, of formulations other than max-min.
_PLANAR_MEASURES: dict[str, Measure] = {
    manipulability.NAME: "manipulability",
    condition.NAME: "condition",
}
# The longest search on record looks at 7 877.
_MOST_NODES = 10_000
# Name of the certificate of the residual.
_RESIDUAL = "residual_tight.json"
# Name of the certificate of the worst case.
_MAX_MIN = "max_min_null_vector.json"
# Name of the certificate of isotropic lever arms.
_ISOTROPY = "isotropy_turned.json"
# What each certificate bounds.
_QUANTITIES = {_RESIDUAL: "residual", _MAX_MIN: "max-min", _ISOTROPY: "isotropy"}


class BoundProver:
    """Proves bounds of entries; a certificate is verified once, its sums on the executor."""

    def __init__(
        self,
        certificates: Path,
        executor: Executor | None = None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        if not all((certificates / name).is_file() for name in _QUANTITIES):
            names = ", ".join(_QUANTITIES)
            allowed = f"a folder with {names}, as results/bounds/certificates in a clone"
            raise FileError("--certificates", str(certificates), allowed)
        self._certificates, self._executor, self._progress = certificates, executor, progress
        self._verified: dict[str, BoundCertificate] = {}

    def prove(self, page: EntryPage, bound: Bound) -> None:
        """Prove a bound, of a numerical one that the value is below; or CertificateError."""
        asked, square = page.entry, Fraction(bound.value) ** 2 * _ROUNDING
        if float(page.value) > bound.value + RESOLUTION:
            raise CertificateError(
                f"the value {page.value} is above the bound {bound.value!r}."
            )
        if not bound.certified:
            return
        if bound.kind == "closed form":
            proved = closed_form_proves(asked, square)
        elif bound.kind == KIND:
            proved = _relaxation_proves(asked, square)
        elif "two-point" in bound.kind:
            proved = self._two_point_proves(asked, square)
        elif bound.kind == FIVE_LEVERS:
            isotropic = asked.formulation == isotropy.NAME and has_five_levers(asked.arm)
            proved = isotropic and proves_five_levers(square)
        elif "branch and bound" in bound.kind:
            proved = _projection_proves(asked, bound.value)
        elif "null-vector" in bound.kind:
            proved = bound.value >= self._stated(_MAX_MIN, asked.joints)
        elif "turned" in bound.kind:
            proved = asked.formulation == isotropy.NAME and bound.value >= self._stated(
                _ISOTROPY, asked.joints
            )
        else:
            excludes = excludes_max_min
            if asked.formulation == isotropy.NAME:
                excludes = excludes_isotropic
            residual = self._stated(_RESIDUAL, asked.joints)
            proved = excludes(residual, bound.value, asked.joints)
        if not proved:
            raise CertificateError(f"the bound {bound.value!r} is not proved.")

    def _two_point_proves(self, asked: Entry, square: Fraction) -> bool:
        """Whether it follows from what any two of as many or fewer joints leave."""
        m, n = asked.task_dimension, asked.joints
        for failures in range(2, asked.failures + 1):
            limit = _two_point_limit(m, n - failures + 2)
            if limit is None:
                continue
            for joints in range(n - failures + 3, n + 1):
                # tr G = m + s with (a − s)(b − s) ≥ s + s²/m, s ≤ a and s ≤ b.
                a, b = joints - m, limit - m
                root = root_below((a + b + 1) ** 2 - 4 * (1 - Fraction(1, m)) * a * b)
                limit = m + 2 * a * b / (a + b + 1 + root)
            if square >= Fraction(asked.arm.largest_trace) / m * (1 - m / limit):
                return True
        return False

    def _stated(self, name: str, joints: int) -> float:
        """Return the bound of a certificate on file, verified."""
        if name not in self._verified:
            read = read_any(self._certificates / name)
            if not isinstance(read, BoundCertificate) or read.quantity != _QUANTITIES[name]:
                raise CertificateError(f"{name} is not one of the {_QUANTITIES[name]}.")
            verify_bound(read, executor=self._executor, progress=self._progress)
            self._verified[name] = read
        found = self._verified[name]
        if found.joints != joints:
            raise CertificateError(f"{name} is for {found.joints} joints.")
        return found.bound


@cache
def _two_point_limit(task_dimension: int, joints: int) -> Fraction | None:
    """Return the limit on tr G that is proved from multipliers on record, if there are any."""
    known = two_point_on_record(task_dimension, joints)
    if known is None:
        return None
    prove_two_point(**{name: known[name] for name in signature(prove_two_point).parameters})
    return Fraction(known["trace_limit"])


def _projection_proves(asked: Entry, level: float) -> bool:
    """Whether a search proves a level, of J itself or of J seen along m − 2 of its columns.

    These leave n − m + 2 columns in the plane: their worst case is no smaller, their condition
    numbers are no larger, and of the trace at most 2/m is left (docs/several_failures.md).
    """
    m, n, k = asked.task_dimension, asked.joints - asked.task_dimension + 2, asked.failures
    measure = _PLANAR_MEASURES.get(asked.formulation, "max-min")
    if m > 2:
        if measure == "manipulability":
            return False
        known = planar_on_record((2, n), k, measure)
        if known is None:
            return False
        needed = Fraction(known.value) ** 2
        if measure == "max-min":
            needed *= Fraction(asked.arm.largest_trace) * 2 / (m * n)
        if Fraction(level) ** 2 < needed:
            return False
        level = known.value
    return _planar_proves(n, k, level, measure, _MOST_NODES)


@cache
def _planar_proves(
    joints: int, failures: int, level: float, measure: Measure, most_nodes: int
) -> bool:
    """Whether a new search proves a level, which is one for all models of free columns."""
    return planar_bound(joints, failures, level, measure, most_nodes=most_nodes).proved


def _relaxation_proves(asked: Entry, square: Fraction) -> bool:
    """Whether multipliers, found anew and checked in rational arithmetic, prove a number.

    What holds of all Jacobians holds of isotropic ones, and after fewer failures after k.
    """
    statements: tuple[Statement, ...] = ("max-min",)
    if asked.formulation == isotropy.NAME:
        statements = ("isotropy", "max-min")
    for failures in range(asked.failures, 0, -1):
        for statement in statements:
            with suppress(CertificateError):
                proof = relaxed(asked.arm, failures, statement).proof
                proof.check()
                if square >= proof.level:
                    return True
    return False


def closed_form_proves(asked: Entry, square: Fraction) -> bool:
    """Whether the square of an entry's measure is proved not to be above a number."""
    m, n, k = asked.task_dimension, asked.joints, asked.failures
    if asked.relative:
        return _minors_prove(m, n, k, square)
    if asked.formulation == condition.NAME:
        return _determinants_prove(m, n, k, square)
    if has_two_sliders(asked.arm) and excludes_eigenvalue(square):
        return True
    joints = asked.arm.joints
    norms = [Fraction(joint.largest_norm_squared) for joint in joints]
    if several_failures_prove(m, n, k, square / sum(norms)):
        return True
    if asked.model == "free" and asked.formulation == isotropy.NAME:
        return _unit_columns_prove(m, n, k, square)
    if asked.model.startswith("free"):
        return False
    # Revolute and prismatic joints: rotational and linear rows, each with its own joints.
    r = Fraction(sum(not isinstance(joint, Prismatic) for joint in joints))
    linear = sum(norms) - r
    by_rows = several_failures_prove(3, int(r), k, square / r) or several_failures_prove(
        3, n, k, square / linear
    )
    if by_rows or asked.formulation != isotropy.NAME:
        return by_rows
    # Isotropic: T = 2r, and some column has at least the mean of what fixed ones leave.
    fixed = [
        norm
        for norm, joint in zip(norms, joints, strict=True)
        if not isinstance(joint, LeverRevolute)
    ]
    largest = max([*fixed, (2 * r - sum(fixed)) / max(n - len(fixed), 1)])
    return square >= 2 * r / m - largest


def several_failures_prove(m: int, n: int, k: int, share: Fraction) -> bool:
    """Whether t ≤ T · `share` is proved, t the squared worst case of n columns, T = ‖J‖_F².

    What holds after fewer failures holds after k; without its longest column J keeps (n − 1)/n
    of T.
    """
    if k > n - m:
        return share >= 0
    if k > 1 and several_failures_prove(m, n, k - 1, share):
        return True
    if k > 1 and several_failures_prove(m, n - 1, k - 1, share * n / (n - 1)):
        return True
    sine = _sine_above(2 * n) ** 2
    if k == 2 and n == m + 2 and share * (n - 2 + (1 / sine - 2) ** 2 / 2) >= 1:
        return True
    if k == 2 and n == m + 3 > 6 and share > 0 and proves_ratio(m, 1 / share):
        return True
    if m == 2 and k == n - 2 and share >= 2 * sine / n:
        return True
    return _mean_proves(m, n, k, m * share)


def _mean_proves(m: int, n: int, k: int, y: Fraction) -> bool:
    """Whether the mean of det(xI − A_F) over F changes its sign in [0, y], for JJᵀ = I.

    Of N columns it is p + (xp′ − mp)/N after one of them, p the polynomial before.
    """
    p = [Fraction((-1) ** (m - i) * comb(m, i)) for i in range(m + 1)]
    for columns in range(n, n - k, -1):
        p = [c * (1 + Fraction(i - m, columns)) for i, c in enumerate(p)]
    value = sum(c * y**i for i, c in enumerate(p))
    return value == 0 or (value > 0) != (p[0] > 0)


def _minors_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether no least squared relative manipulability is above a number."""
    if square >= Fraction(comb(n - k, m), comb(n, m)):
        return True
    if k == n - m > 1 and 2 in (m, k) and square >= (2 * _sine_above(n) / n) ** 2:
        return True
    r = n - m
    if k == 2 and 2 * n > r * (r + 1) and square * (r + 2) * n * m >= r**2 * (r - 1):
        return True
    return k > 1 and _minors_prove(m, n - 1, k - 1, square * n / (n - m))


def _unit_columns_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether t ≤ `square` is proved of isotropic columns of length 1: by cosines of lines."""
    largest = root_below(Fraction(n - m, m * (n - 1)))
    if 2 * n > m * (m + 1):
        largest = max(largest, root_below(Fraction(1, m)))
    if m == 3:
        largest = max(largest, 1 / (2 * _sine_above(Fraction(6 * (n - 1), n)) ** 2) - 1)
    longest = [1 + largest if k > 1 else Fraction(1)]
    for few in range(2, min(k, n // 2 + 1) + 1) if m == 2 else ():
        # |a + b exp(iφ)|² = (a + b)² − 4ab sin²(φ/2)
        turned = 4 * (few // 2) * (few - few // 2) * _sine_above(Fraction(n, few - 1)) ** 2
        longest.append((few + root_below(few**2 - turned)) / 2)
    return square >= Fraction(n, m) - max(longest)


def _determinants_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether no least ratio of eigenvalues after k failures is above a number."""
    share = Fraction(comb(n - m, k), comb(n, k)) * Fraction(n, (n - k) * m) ** m
    t = square
    if k > n - m or all(t**p >= share * (p * t + m - p) ** m for p in range(1, m)):
        return True
    sine = _sine_above(2 * n) ** 2
    if m == 2 and k == n - 2 and square >= sine / (1 - sine):
        return True
    if (m, n, k) == (3, 5, 2) and _pentagon_proves(square):
        return True
    if m > 2 and _determinants_prove(m - 1, n - 1, k, square):
        return True
    return k > 1 and _determinants_prove(m, n - 1, k - 1, square)


def _pentagon_proves(square: Fraction) -> bool:
    """Whether κ ≥ tan(θ/2), sin θ = (√5 − 1)/2, for κ² = `square` below 1.

    sin²θ = (3 − √5)/2 is to be at most the squared sine of 2 arctan κ, 4κ²/(1 + κ²)².
    """
    rest = 3 - 8 * square / (1 + square) ** 2
    return square >= 1 or rest <= 0 or rest**2 <= 5


def _sine_above(parts: int | Fraction) -> Fraction:
    """Return a number above sin(π/parts), by less than 1e-13, for at least two parts."""
    x = Fraction(3141592653589793238463, 10**21) / parts
    terms = ((-1) ** i * x ** (2 * i + 1) / factorial(2 * i + 1) for i in range(9))
    return sum(terms, Fraction(0))
