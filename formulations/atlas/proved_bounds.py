"""The bounds of the atlas, proved anew: of what an entry states, not of how it was computed.

A closed form is decided in rational arithmetic, by arguments of docs/several_failures.md or
docs/bounds.md; but for `proves_ratio` and `excludes_eigenvalue`, no function here shares code
with `lockedjoint.formulations.bounds`, which finds these numbers. The relaxation is solved
again, and its multipliers are checked in rational arithmetic. Branch and bound is searched
again at the number that is stated, or at one that implies it. A two-point bound is proved from
multipliers. What follows from the least residual needs its certificate, and so do the worst
cases of unit revolute 7R and of isotropic 7R.

J is a Jacobian of shape (m, n), one column per joint; F is any set of k joints that lock, and
A_F = J_F̄J_F̄ᵀ without their columns. T = ‖J‖_F². What is bounded is the entry's measure: the
worst case σ = √t, t the least eigenvalue of all A_F; or the least relative manipulability,
√(det A_F/det JJᵀ); or the least reciprocal condition number of J_F̄. In the functions below
`m`, `n` and `k` are these numbers. `square` is the square of a stated bound, and a function
``…_proves`` says whether it is proved that no squared measure is above it; False says that
*this* argument does not prove it. All numbers are fractions and nothing is rounded, but for the
searches and certificates, which bound their own rounding.
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

# Factor on the square of a stated bound, which is right to the last digits of a double. At 1
# some bounds would be refused for their last digit.
_ROUNDING = 1 + Fraction(1, 10**14)
# The measure that branch and bound bounds, of formulations other than max-min.
_PLANAR_MEASURES: dict[str, Measure] = {
    manipulability.NAME: "manipulability",
    condition.NAME: "condition",
}
# Number of nodes at which a branch-and-bound search gives up. The longest search on record
# looks at 7 877.
_MOST_NODES = 10_000
# A rational number above π by less than 1e-21.
_ABOVE_PI = Fraction(3141592653589793238463, 10**21)
# Number of terms of the sine's power series at this number over 2 or more. The last one is
# positive, so that their sum is above the sine; with fewer terms it would be farther above.
_SINE_TERMS = 9
# Name of the certificate of the residual.
_RESIDUAL = "residual_tight.json"
# Name of the certificate of the worst case.
_MAX_MIN = "max_min_null_vector.json"
# Name of the certificate of isotropic lever arms.
_ISOTROPY = "isotropy_turned.json"
# What each certificate bounds.
_QUANTITIES = {_RESIDUAL: "residual", _MAX_MIN: "max-min", _ISOTROPY: "isotropy"}


class BoundProver:
    """Proves bounds of entries.

    Certificates are files of the folder `certificates`. Each is verified once, when a bound
    needs it, its sums on the executor; `progress` is told how far that is.
    """

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
        """Prove a bound of the entry of a page, or raise CertificateError.

        Of a bound that is only numerical it is checked that the value is not above it.
        """
        asked, square = page.entry, Fraction(bound.value) ** 2 * _ROUNDING
        if float(page.value) > bound.value + RESOLUTION:
            raise CertificateError(
                f"the value {page.value} is above the bound {bound.value!r}."
            )
        if not bound.certified:
            return
        if not self._is_proved(asked, bound, square):
            raise CertificateError(f"the bound {bound.value!r} is not proved.")

    def _is_proved(self, asked: Entry, bound: Bound, square: Fraction) -> bool:
        """Whether a certified bound is proved, by the argument that its kind names."""
        isotropic = asked.formulation == isotropy.NAME
        if bound.kind == "closed form":
            return closed_form_proves(asked, square)
        if bound.kind == KIND:
            return _relaxation_proves(asked, square)
        if "two-point" in bound.kind:
            return self._two_point_proves(asked, square)
        if bound.kind == FIVE_LEVERS:
            return isotropic and has_five_levers(asked.arm) and proves_five_levers(square)
        if "branch and bound" in bound.kind:
            return _projection_proves(asked, bound.value)
        if "null-vector" in bound.kind:
            return bound.value >= self._stated(_MAX_MIN, asked.joints)
        if "turned" in bound.kind:
            return isotropic and bound.value >= self._stated(_ISOTROPY, asked.joints)
        # What is left follows from the least residual ½‖JJᵀ − (T/m)I‖².
        excludes = excludes_isotropic if isotropic else excludes_max_min
        residual = self._stated(_RESIDUAL, asked.joints)
        return excludes(residual, bound.value, asked.joints)

    def _two_point_proves(self, asked: Entry, square: Fraction) -> bool:
        """Whether t ≤ `square` follows from what any two joints leave.

        With G = Jᵀ(JJᵀ − tI)⁻¹J, t ≤ (T/m)(1 − m/tr G). A limit on tr G for fewer joints of
        which two lock, from multipliers on record, leads to one for one joint and one failure
        more at a time (docs/several_failures.md).
        """
        m, n = asked.task_dimension, asked.joints
        for failures in range(2, asked.failures + 1):
            limit = _two_point_limit(m, n - failures + 2)
            if limit is None:
                continue
            for joints in range(n - failures + 3, n + 1):
                # tr G = m + s with (a − s)(b − s) ≥ s + s²/m, s ≤ a and s ≤ b: the largest s is
                # 2ab/(a + b + 1 + root).
                a, b = joints - m, limit - m
                root = root_below((a + b + 1) ** 2 - 4 * (1 - Fraction(1, m)) * a * b)
                limit = m + 2 * a * b / (a + b + 1 + root)
            if square >= Fraction(asked.arm.largest_trace) / m * (1 - m / limit):
                return True
        return False

    def _stated(self, name: str, joints: int) -> float:
        """Return the bound of a certificate, verified; `name` is that of its file."""
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
    """Return the limit on tr G that is proved from multipliers on record, None without any.

    It holds for `joints` columns of which any two lock at once.
    """
    known = two_point_on_record(task_dimension, joints)
    if known is None:
        return None
    prove_two_point(**{name: known[name] for name in signature(prove_two_point).parameters})
    return Fraction(known["trace_limit"])


def _projection_proves(asked: Entry, level: float) -> bool:
    """Whether a search proves a level, of J itself or of J seen along m − 2 of its columns.

    `level` is a bound on the measure itself, not on its square. The m − 2 columns leave n − m +
    2 columns in the plane: their worst case is no smaller, their condition numbers are no
    larger, and of the trace at most 2/m is left (docs/several_failures.md).
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
    """Whether a new search proves a level of a planar arm, for all models of free columns."""
    return planar_bound(joints, failures, level, measure, most_nodes=most_nodes).proved


def _relaxation_proves(asked: Entry, square: Fraction) -> bool:
    """Whether multipliers, found anew and checked in rational arithmetic, prove t ≤ `square`.

    A bound for all Jacobians is one for isotropic ones; a bound after fewer failures is one
    after k, which leave less.
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
    """Whether a closed form proves that an entry's squared measure is at most `square`."""
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
    # Isotropic: JJᵀ = (T/m)I, and after the loss of column j its least eigenvalue is T/m −
    # |j|². The three rotational rows have r, so that T = 2r, and some column has at least the
    # mean of the squared norm that fixed ones leave.
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
    of T at most. The closed forms of one pair of m and n each are derived in
    docs/several_failures.md.
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

    Its least root is then at most y, and some A_F has no larger eigenvalue. The mean starts
    with p = (x − 1)^m; after the loss of one of N columns it is p + (xp′ − mp)/N. `p` has its
    coefficients, that of x⁰ first.
    """
    p = [Fraction((-1) ** (m - i) * comb(m, i)) for i in range(m + 1)]
    for columns in range(n, n - k, -1):
        p = [c * (1 + Fraction(i - m, columns)) for i, c in enumerate(p)]
    value = sum(c * y**i for i, c in enumerate(p))
    return value == 0 or (value > 0) != (p[0] > 0)


def _minors_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether no least squared relative manipulability is above `square`.

    The squares of all k-failures have the mean C(n − k, m)/C(n, m) (Cauchy and Binet). The
    other conditions are those of docs/several_failures.md.
    """
    if square >= Fraction(comb(n - k, m), comb(n, m)):
        return True
    if k == n - m > 1 and 2 in (m, k) and square >= (2 * _sine_above(n) / n) ** 2:
        return True
    r = n - m
    if k == 2 and 2 * n > r * (r + 1) and square * (r + 2) * n * m >= r**2 * (r - 1):
        return True
    return k > 1 and _minors_prove(m, n - 1, k - 1, square * n / (n - m))


def _unit_columns_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether t ≤ `square` is proved of isotropic columns of length 1: by cosines of lines.

    T = n, so that JJᵀ = (n/m)I, and the loss of columns leaves n/m less their largest
    eigenvalue: for two columns 1 + |cosine|. n lines in m dimensions have a pair with at least
    a certain cosine (`largest`); in the plane more columns than two are bounded likewise.
    """
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
    """Whether no least λ_min/λ_max of A_F, over all sets F of k joints, is above `square`.

    An A_F of trace τ and at least this ratio ρ has at least the determinant c τ^m, with
    c = min_p ρ^p/(pρ + m − p)^m over the number p of small eigenvalues. The mean of the
    determinants is known (docs/atlas_names.md).
    """
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

    Of five columns in space, any three of which have to remain, no least σ_min/σ_max is above
    tan(θ/2) (docs/several_failures.md). sin²θ = (3 − √5)/2 is to be at most the squared sine of
    2 arctan κ, 4κ²/(1 + κ²)²; `rest` is 3 less twice this square, to be at most √5.
    """
    rest = 3 - 8 * square / (1 + square) ** 2
    return square >= 1 or rest <= 0 or rest**2 <= 5


def _sine_above(parts: int | Fraction) -> Fraction:
    """Return a number above sin(π/parts), by less than 1e-13, for at least two parts."""
    x = _ABOVE_PI / parts
    terms = ((-1) ** i * x ** (2 * i + 1) / factorial(2 * i + 1) for i in range(_SINE_TERMS))
    return sum(terms, Fraction(0))
