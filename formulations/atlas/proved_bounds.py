"""The bounds of the atlas, proved anew: of what an entry states, not of how it was computed.

A closed form is decided in rational arithmetic, see `proved_closed_forms`. The relaxation is
solved again, and its multipliers are checked in rational arithmetic. Branch and bound is
searched again at the number that is stated, or at one that implies it. A two-point bound is
proved from multipliers. What follows from the least residual needs its certificate, and so do
the worst cases of unit revolute 7R and of isotropic 7R.

J is a Jacobian of shape (m, n), one column per joint; F is any set of k joints that lock, and
A_F = J_F̄J_F̄ᵀ without their columns. T = ‖J‖_F². What is bounded is the entry's measure: the
worst case σ = √t, t the least eigenvalue of all A_F; or the least relative manipulability,
√(det A_F/det JJᵀ); or the least reciprocal condition number of J_F̄. `square` is the square of
a stated bound, and a function ``…_proves`` says whether it is proved that no squared measure is
above it; False says that *this* argument does not prove it. All numbers are fractions, and but
for the searches and certificates, which bound their own rounding, nothing is rounded except
roots, down.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from fractions import Fraction
from functools import cache
from inspect import signature
from pathlib import Path

from lockedjoint.formulations import condition, isotropy, manipulability
from lockedjoint.formulations.atlas.entry import RESOLUTION, Entry, EntryPage
from lockedjoint.formulations.atlas.proved_closed_forms import closed_form_proves
from lockedjoint.formulations.bounds.certified import (
    FIVE_LEVERS,
    LEVER_CELLS,
    Bound,
    planar_on_record,
    two_point_on_record,
)
from lockedjoint.formulations.bounds.five_levers import has_five_levers, proves_five_levers
from lockedjoint.formulations.bounds.lever_certificate import (
    JOINTS,
    LeverCertificate,
    verify_levers,
)
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
from lockedjoint.formulations.bounds.two_point_proof import prove_two_point
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.parts import Statement
from lockedjoint.nlp.errors import FileError

# Factor on the square of a stated bound, which is right to the last digits of a double. At 1
# some bounds would be refused for their last digit; a larger one accepts bounds that are lower
# than what is proved.
_ROUNDING = 1 + Fraction(1, 10**14)
# The measure that branch and bound bounds, of formulations other than max-min.
_PLANAR_MEASURES: dict[str, Measure] = {
    manipulability.NAME: "manipulability",
    condition.NAME: "condition",
}
# Number of nodes at which a branch-and-bound search gives up, so that the bound counts as not
# proved. The longest search on record looks at 7 877.
_MOST_NODES = 10_000
# Name of the certificate of the residual.
_RESIDUAL = "residual_tight.json"
# Name of the certificate of the worst case.
_MAX_MIN = "max_min_null_vector.json"
# Name of the certificate of isotropic lever arms.
_LEVERS = "isotropic_levers.json"
# What each certificate bounds.
_QUANTITIES = {_RESIDUAL: "residual", _MAX_MIN: "max-min"}


class BoundProver:
    """Proves bounds of entries.

    Parameters
    ----------
    certificates
        A folder with the files of `_QUANTITIES`, and `_LEVERS`. Each is verified once, when a
        bound needs it.
    executor
        Where the sums of a certificate are computed; by default in this process.
    progress
        A function that is told how far the verification is.

    Raises
    ------
    FileError
        If the folder lacks one of the files.
    """

    def __init__(
        self,
        certificates: Path,
        executor: Executor | None = None,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        if not all((certificates / name).is_file() for name in (*_QUANTITIES, _LEVERS)):
            names = ", ".join((*_QUANTITIES, _LEVERS))
            allowed = f"a folder with {names}, as results/bounds/certificates in a clone"
            raise FileError("--certificates", str(certificates), allowed)
        self._certificates, self._executor, self._progress = certificates, executor, progress
        self._verified: dict[str, BoundCertificate] = {}
        self._levers: LeverCertificate | None = None

    def prove(self, page: EntryPage, bound: Bound) -> None:
        """Prove a bound of the entry of a page, or raise CertificateError.

        The value on the page must not be above any bound, up to `RESOLUTION`. A bound that is
        only numerical (not `certified`) is not proved.
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
        if bound.kind == LEVER_CELLS:
            return isotropic and bound.value >= self._stated_levers(asked.joints)
        if bound.kind == FIVE_LEVERS:
            return isotropic and has_five_levers(asked.arm) and proves_five_levers(square)
        if "branch and bound" in bound.kind:
            return _projection_proves(asked, bound.value)
        if "null-vector" in bound.kind:
            return bound.value >= self._stated(_MAX_MIN, asked.joints)
        # What is left follows from the least residual ½‖JJᵀ − (T/m)I‖².
        excludes = excludes_isotropic if isotropic else excludes_max_min
        residual = self._stated(_RESIDUAL, asked.joints)
        return excludes(residual, bound.value, asked.joints)

    def _two_point_proves(self, asked: Entry, square: Fraction) -> bool:
        """Whether t ≤ `square` follows from what any two joints leave.

        With G = Jᵀ(JJᵀ − tI)⁻¹J, t ≤ (T/m)(1 − m/tr G). `limit` is what tr G can at most be.
        The first one is for two failures of n − k′ + 2 joints, from multipliers on record, for
        each k′ = `failures` up to k. One joint and one failure more at a time lead to n joints
        and k′ failures, which leave no less than k (docs/several_failures.md).
        """
        m, n = asked.task_dimension, asked.joints
        for failures in range(2, asked.failures + 1):
            limit = _two_point_limit(m, n - failures + 2)
            if limit is None:
                continue
            for joints in range(n - failures + 3, n + 1):
                # tr G = m + s with (a − s)(b − s) ≥ s + s²/m, s ≤ a and s ≤ b, where a is n − m
                # for these joints, and b the last limit less m. The largest s is
                # 2ab/(a + b + 1 + root), and a root that is rounded down makes it larger.
                a, b = joints - m, limit - m
                root = root_below((a + b + 1) ** 2 - 4 * (1 - Fraction(1, m)) * a * b)
                limit = m + 2 * a * b / (a + b + 1 + root)
            if square >= Fraction(asked.arm.largest_trace) / m * (1 - m / limit):
                return True
        return False

    def _stated(self, name: str, joints: int) -> float:
        """Return the bound of a certificate, by the name of its file, after its verification.

        CertificateError if it is not valid, or is for another number of joints.
        """
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

    def _stated_levers(self, joints: int) -> float:
        """Return the bound of the certificate by branch and bound, after its verification.

        CertificateError if it is not valid, or for another number of joints than 7.
        """
        if self._levers is None:
            read = read_any(self._certificates / _LEVERS)
            if not isinstance(read, LeverCertificate):
                raise CertificateError(f"{_LEVERS} is not one of isotropic lever arms.")
            verify_levers(read, executor=self._executor, progress=self._progress)
            self._levers = read
        if joints != JOINTS:
            raise CertificateError(f"{_LEVERS} is for {JOINTS} joints.")
        return self._levers.bound


@cache
def _two_point_limit(task_dimension: int, joints: int) -> Fraction | None:
    """Return the limit on tr G that is proved from multipliers on record, None without any.

    It holds for `joints` columns in `task_dimension` rows, of which any two lock at once.
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
    # Here n is the number of columns that are seen in the plane.
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
