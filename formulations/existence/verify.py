"""Verify a certificate of nonexistence, and the theorem, which rests on that.

`verify` expands Σ weight · |Σ terms|² + constant − Σ coefficient · monomial · equation; in each
monomial the joints are renamed, and W and conj(W) exchanged, which changes no mean over all
orders; then everything cancels. docs/nonexistence.md, section 5, says why that is a proof.
Nothing of the derivation is shared. The letters are those of `certificate`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import cache, lru_cache
from importlib.resources import as_file, files
from itertools import chain, permutations, product
from typing import Any, TypeAlias

from lockedjoint.formulations.existence.certificate import (
    Certificate,
    CertificateError,
    Multiplier,
    Pairs,
    Square,
)
from lockedjoint.formulations.existence.reading import read_certificate

#: The factors of a monomial: the pairs (i, j) of entries of W, and those of conj(W).
Factors: TypeAlias = tuple[Pairs, Pairs]
#: A description of a joint that does not depend on the names of joints: nested tuples.
Signature: TypeAlias = tuple[Any, ...]
# Largest number of characters of a fraction in a message; a longer one is shown as a decimal.
_SHOWN_CHARACTERS = 40
# Number of rounds in which joints are told apart by their partners. With fewer rounds there are
# more ties, and more orders to try; what is proved is the same.
_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class TheoremReport:
    """What was verified: the sizes of the certificate and its constant."""

    joints: int
    #: The positive number that a sum of squares was shown to be the negative of.
    constant: Fraction
    squares: int
    multipliers: int
    #: How many different averages of monomials occurred, all of which cancelled.
    monomials: int

    def to_dict(self) -> dict[str, int | str]:
        """Return plain values for tables and JSON, the constant as a fraction in text."""
        return {**asdict(self), "constant": str(self.constant)}


def verify_nonexistence(certificate: Certificate) -> TheoremReport:
    """Verify a certificate of nonexistence, in exact arithmetic.

    Parameters
    ----------
    certificate
        The certificate, as `read_certificate` returns it.

    Returns
    -------
    TheoremReport
        What the certificate proves, with its sizes.

    Raises
    ------
    CertificateError
        If the identity does not hold.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> from importlib.resources import files
    >>> shipped = files("lockedjoint.formulations.existence") / "certificate.json"
    >>> lj.verify_nonexistence(lj.read_certificate(shipped)).joints
    7
    """
    expanded = _added(
        chain(
            *map(_expanded_square, certificate.squares),
            [(((), ()), certificate.constant)],
            *map(_expanded_multiplier, certificate.multipliers),
        )
    )
    total = _added((_renamed(*factors), value) for factors, value in expanded.items())
    left = {name: value for name, value in total.items() if value}
    if left:
        (w, wbar), value = min(left.items())
        names = [f"W{i}{j}" for i, j in w] + [f"conj(W{i}{j})" for i, j in wbar]
        short = len(str(value)) <= _SHOWN_CHARACTERS
        number = str(value) if short else f"about {float(value):.3g}"
        raise CertificateError(
            f"the identity does not hold: {len(left)} of {len(total)} averages of monomials do "
            f"not cancel, the first being {number} times that of {'·'.join(names) or '1'}."
        )
    sizes = len(certificate.squares), len(certificate.multipliers), len(total)
    return TheoremReport(certificate.joints, certificate.constant, *sizes)


def _added(terms: Iterable[tuple[Factors, Fraction]]) -> dict[Factors, Fraction]:
    """Return the sum of terms, by monomial; also coefficients that became 0."""
    total: dict[Factors, Fraction] = {}
    for (w, wbar), value in terms:
        factors = _ascending(w), _ascending(wbar)
        total[factors] = total[factors] + value if factors in total else value
    return total


def _expanded_square(square: Square) -> Iterator[tuple[Factors, Fraction]]:
    """Expand weight · p · conj(p); the products a·conj(b) and b·conj(a) have one real part."""
    for place, a in enumerate(square.terms):
        once = square.weight * a.coefficient
        twice = 2 * once
        for before, b in enumerate(square.terms[: place + 1]):
            value = (once if before == place else twice) * b.coefficient
            yield (a.w + b.wbar, a.wbar + b.w), value


def _expanded_multiplier(multiplier: Multiplier) -> Iterator[tuple[Factors, Fraction]]:
    """Expand −coefficient · monomial · equation."""
    for w, wbar, value in _equation(multiplier):
        factors = multiplier.w + w, multiplier.wbar + wbar
        yield factors, -multiplier.coefficient * value


def _equation(multiplier: Multiplier) -> Iterator[tuple[Pairs, Pairs, Fraction]]:
    """Yield the terms of a multiplier's equation: factors W, factors conj(W), coefficient."""
    one = Fraction(1)
    if multiplier.kind == "row-sum":
        (i,) = multiplier.place
        yield from ((((i, k),), (), one) for k in range(7) if k != i)
        return
    i, j = multiplier.place
    inner = [k for k in range(7) if k not in (i, j)]
    if multiplier.kind == "square":
        yield from ((((i, k), (k, j)), (), one) for k in inner)
        return
    yield from ((((i, k),), ((k, j),), one) for k in inner)
    yield from ((((k, j),), ((i, k),), one) for k in inner)
    yield (), (), -4 * (Fraction(i == j) - Fraction(1, 7))


def _ascending(pairs: Pairs) -> Pairs:
    """Return pairs in a fixed order, the smaller joint of each first: W is symmetric."""
    return tuple(sorted((i, j) if i < j else (j, i) for i, j in pairs))


def _renamed(w: Pairs, wbar: Pairs) -> Factors:
    """Return one name of all products that are renamings of this one or of its conjugate."""
    # Joints are first numbered as they occur, so that `_least` sees fewer different products.
    names = {joint: name for name, joint in enumerate(dict.fromkeys(chain(*w, *wbar)))}
    return _least(_with_names(w, names), _with_names(wbar, names))


@cache
def _least(w: Pairs, wbar: Pairs) -> Factors:
    """Return the least of some renamings of a product and of its conjugate."""
    return min(chain(_renamings(w, wbar), _renamings(wbar, w)))


def _with_names(pairs: Pairs, names: dict[int, int]) -> Pairs:
    """Return pairs of joints with other names, in a fixed order."""
    return _ascending(tuple((names[i], names[j]) for i, j in pairs))


def _renamings(w: Pairs, wbar: Pairs) -> Iterator[Factors]:
    """Yield the renamings that sort joints by their signatures, ties in all orders."""
    ties: dict[Signature, list[int]] = {}
    for joint, signature in _signatures(w, wbar).items():
        ties.setdefault(signature, []).append(joint)
    for orders in product(*(permutations(ties[signature]) for signature in sorted(ties))):
        names = {joint: name for name, joint in enumerate(chain(*orders))}
        yield _with_names(w, names), _with_names(wbar, names)


def _signatures(w: Pairs, wbar: Pairs) -> dict[int, Signature]:
    """Describe each joint by its factors, and by those of its partners."""
    around: dict[int, list[tuple[int, int]]] = {}
    for colour, pairs in enumerate((w, wbar)):
        for i, j in pairs:
            around.setdefault(i, []).append((colour, j))
            around.setdefault(j, []).append((colour, i))
    signatures: dict[int, Signature] = dict.fromkeys(around, ())
    for _ in range(_ROUNDS):
        signatures = {
            joint: tuple(sorted((colour, signatures[partner]) for colour, partner in factors))
            for joint, factors in around.items()
        }
    return signatures


def package_certificate() -> Certificate:
    """Read the certificate that the package includes, the one that `prove` derives."""
    with as_file(files("lockedjoint.formulations.existence") / "certificate.json") as path:
        found = read_certificate(path)
    assert isinstance(found, Certificate)
    return found


@lru_cache(maxsize=1)
def verified() -> TheoremReport:
    """Verify the certificate of nonexistence in the package, in exact arithmetic.

    Returns
    -------
    TheoremReport
        What the certificate proves, with its sizes.

    Raises
    ------
    CertificateError
        If the identity does not hold.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.verified().joints
    7
    """
    return verify_nonexistence(package_certificate())


def excludes(unit_revolute_joints: int) -> bool:
    """Whether it is proved that n revolute joints have no optimally failure-tolerant Jacobian.

    The task has six dimensions; docs/nonexistence.md has the proof.

    Parameters
    ----------
    unit_revolute_joints
        The number of joints n.

    Raises
    ------
    CertificateError
        If the certificate in the package does not hold.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.excludes(7), lj.excludes(8)
    (True, False)
    """
    return verified().joints == unit_revolute_joints
