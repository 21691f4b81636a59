"""The worst case and its gradient as one expression of the joints' positions, and as C code.

For those who run no Python in their control loop. Everything is straight-line code, without
loops that may end early, so that it takes the same time everywhere. It has three parts:

1. J = UᵀG by one-sided Jacobi rotations of its rows (Hestenes, 1958), which also find small
   singular values to their own last digits: U is orthogonal, and the rows of G = UJ are
   orthogonal to each other, with the lengths s_i (`_orthogonal_rows`).
2. For each joint f the least eigenvalue λ of JJᵀ − j_f j_fᵀ, σ² after its failure, by Newton's
   method (`_root`), as in `measures.worst_case_sigma_batch`.
3. For the worst joint the weakest direction u, and right = uᵀJ without its entry at that joint:
   σ is its length, and ∂σ/∂J = u·right/σ (`_worst_failure`).

The letters: J is the arm's Jacobian in units of its characteristic length, m rows by n columns
j_f; q are the joints' positions, radians or (prismatic joints) metres; V_fi = G_if/s_i; s_m is
the least s_i; and r_i = s_m²/s_i².
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import combinations

import casadi as ca

from lockedjoint.formulations.io.escaping import c_string
from lockedjoint.formulations.io.files import prepare_folder, write_text
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.errors import InputError, as_path, of_kind
from lockedjoint.robot import Robot

# Number of sweeps of rotations after which up to six rows are orthogonal to rounding.
_SWEEPS = 6
# Number of Newton's steps after which the root is exact to rounding.
_NEWTON_STEPS = 14
# Words of C and C++ that no function can have as its name; `check_name` knows CasADi's own.
_KEYWORDS = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const
constexpr continue decltype default delete do double else enum explicit export extern false
float for friend goto if inline int long main mutable namespace new noexcept not not_eq nullptr
operator or or_eq private protected public register reinterpret_cast restrict return short
signed sizeof static static_assert static_cast struct switch template this thread_local throw
true try typedef typeid typename typeof union unsigned using virtual void volatile wchar_t
while xor xor_eq
"""
# Number added to divisors that may be 0.
_TINY = 1e-300
# Weight of the weakest direction if a joint has no part in it: it counts only if all weights
# are 0.
_WEAKEST_WEIGHT = 1e-100
# Largest position (radians or metres) and value of σ that do not count as infinite: beyond it
# squares of squares overflow.
_HUGE = 1e70
# End of the C code: the function that the user calls.
_WRAPPER = """
const char {name}_arm[] = {about};
const char* const {name}_joints[{joints}] = {{{names}}};

double {name}_sigma(const double* q, double* gradient, int* joint) {{
  const casadi_real* arg[{arg}] = {{0}};
  casadi_real* res[{res}] = {{0}};
  casadi_int iw[{iw}];
  casadi_real w[{w}], sigma = 0, failed = 0;
  arg[0] = q; res[0] = &sigma; res[1] = gradient; res[2] = &failed;
  {name}(arg, res, iw, w, 0);
  if (joint) *joint = (int) failed;
  return sigma;
}}
"""
# Header file of the C code.
_HEADER = """#ifdef __cplusplus
extern "C" {{
#endif
/* The arm in words, and the names of its joints, in UTF-8. */
extern const char {name}_arm[];
extern const char* const {name}_joints[{joints}];
/* The worst-case singular value with any one of {joints} joints locked.
   q: positions of the joints, in that order, radians or metres.
   gradient: of the value, {joints} numbers, or NULL. joint: the worst one, from 0, or NULL.
   If a position is NaN, infinite or huge: 0, a gradient of zeros, and joint -1. */
double {name}_sigma(const double* q, double* gradient, int* joint);
#ifdef __cplusplus
}}
#endif
"""


def worst_case_function(arm: RobotArm, name: str = "worst_case") -> ca.Function:
    """Return σ (eq. 5), its gradient and the worst joint as a function of the positions.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    name
        Name of the function; a name in C.

    Returns
    -------
    casadi.Function
        q, shape (n,), to σ, ∂σ/∂q, shape (n,), and the joint, counted from 0; where failures
        tie, those of one of them. Where a position is not finite, or σ is too large to be one:
        0, zeros, and −1, so that no limit of σ is kept.

    Raises
    ------
    InputError
        If C or CasADi does not allow the name.
    """
    of_kind("arm", arm, RobotArm, "a RobotArm")
    check_name("name", name)
    q = arm.symbols()
    matrix = ca.densify(arm.matrix(q))
    left, right, joint = _worst_failure(matrix)
    sigma = ca.norm_2(right)
    # ∂σ/∂q is the gradient of ⟨W, J(q)⟩ for W held at ∂σ/∂J.
    weights, sigma_by_matrix = ca.SX.sym("W", *arm.shape), left @ right.T / (sigma + _TINY)
    slope = ca.gradient(ca.dot(matrix, weights), q)
    gradient = ca.substitute(slope, weights, sigma_by_matrix)
    # The larger of NaN and 0 is 0 in C: the code must ask q itself whether it is finite.
    usable = sigma <= _HUGE
    for k in range(arm.size):
        usable = ca.logic_and(usable, ca.fabs(q[k]) <= _HUGE)
    sigma, gradient = (ca.if_else(usable, found, 0) for found in (sigma, gradient))
    joint = ca.if_else(usable, joint, -1)
    return ca.Function(name, [q], [sigma, gradient, joint], ["q"], ["s", "g", "f"])


@dataclass(frozen=True)
class Code:
    """A C function of the worst case: the content of its files, and how it is called."""

    name: str  #: Name of the files; the function is NAME_sigma.
    source: str  #: Content of NAME.c.
    header: str  #: Content of NAME.h.

    @property
    def declaration(self) -> str:
        """How the function is called."""
        return f"double {self.name}_sigma(const double* q, double* gradient, int* joint)"

    @property
    def files(self) -> dict[str, str]:
        """The content of the files by their names."""
        return {f"{self.name}.h": self.header, f"{self.name}.c": self.source}

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write the files into a folder, which is made if missing."""
        where = prepare_folder(as_path("folder", folder))
        for name, text in self.files.items():
            write_text(where / name, text)

    def __repr__(self) -> str:
        """Say in one line how the function is called."""
        return f"<Code: {self.declaration}>"


def codegen(robot: object, name: str = "worst_case") -> Code:
    """Make a C function of the worst-case singular value, its gradient and the worst joint.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one.
    name
        Name of the files; the function is NAME_sigma.

    Raises
    ------
    InputError
        If C or CasADi does not allow the name.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> code = lj.codegen("example")
    >>> code
    <Code: double worst_case_sigma(const double* q, double* gradient, int* joint)>
    """
    check_name("name", name)
    return Code(name, *worst_case_code(Robot.of(robot).arm, name))


def worst_case_code(arm: RobotArm, name: str = "worst_case") -> tuple[str, str]:
    """Return `worst_case_function` as C, which needs no library, and its header file.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    name
        Name of the files, and the beginning of the function's name; a name in C.

    Raises
    ------
    InputError
        If C or CasADi does not allow the name.
    """
    function = worst_case_function(arm, name)
    generator = ca.CodeGenerator(name)
    generator.add(function)
    sizes = {"arg": function.sz_arg(), "res": function.sz_res()}
    sizes |= {"iw": function.sz_iw() or 1, "w": function.sz_w() or 1}
    # Names come from the robot's file: they are strings, and nowhere else in the code.
    about, names = c_string(arm.description), ", ".join(map(c_string, arm.chain.names))
    head: dict[str, object] = {"name": name, "joints": arm.size}
    wrapper = _WRAPPER.format(about=about, names=names, **head, **sizes)
    return str(generator.dump()) + wrapper, _HEADER.format(**head)


def check_name(argument: str, name: str) -> None:
    """Raise InputError, which names the argument, unless a text is a name in C."""
    fits = isinstance(name, str) and re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)
    if not fits or name in _KEYWORDS.split() or not ca.Function.check_name(name):
        allowed = "a name in C: letters, digits and single _, a letter first, no keyword"
        raise InputError(argument, name, allowed)


def _worst_failure(matrix: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the weakest direction after the worst failure of J, what is left of it, the joint.

    The direction u has length 1 and shape (m, 1). What is left is Jᵀu with a 0 at the joint
    that locks, shape (n, 1): its length is σ. The joint is counted from 0.

    u is an eigenvector of JJᵀ − j_f j_fᵀ for λ. In the basis of U it is proportional to
    (diag s² − λI)⁻¹ U j_f, with entries V_fi s_i/(s_i² − λ). `weights` has these entries
    over 1 + ρ, with ρ = λ/(s_m² − λ), so that nothing cancels:
    1/(s_i² − λ) = (1 + ρ)/(s_i² (1 + ρ (1 − r_i))).
    """
    m, n = matrix.shape
    rows, orthogonal = _orthogonal_rows(matrix)
    squares = [ca.sumsqr(row) + _TINY for row in rows]
    least = squares[0]
    for square in squares[1:]:
        least = ca.fmin(least, square)
    ratios = [least / square for square in squares]
    best, joint, weights = ca.SX.inf(), ca.SX(0), ca.SX.zeros(m)
    for f in range(n):
        shares = [row[f] ** 2 / square for row, square in zip(rows, squares, strict=True)]
        root = _root(shares, ratios)
        own = [
            row[f] / square * ratio / (1 + root * (1 - ratio)) * square / least
            for row, square, ratio in zip(rows, squares, ratios, strict=True)
        ]
        worse = root < best
        best = ca.if_else(worse, root, best)
        joint = ca.if_else(worse, f, joint)
        weights = ca.if_else(worse, ca.vertcat(*own), weights)
    none = ca.vertcat(*(ca.if_else(square <= least, _WEAKEST_WEIGHT, 0) for square in squares))
    left = orthogonal.T @ (weights + none)
    left = left / ca.norm_2(left)
    right = matrix.T @ left
    kept = [ca.if_else(joint == f, 0, right[f]) for f in range(n)]
    return left, ca.vertcat(*kept), joint


def _orthogonal_rows(matrix: ca.SX) -> tuple[list[ca.SX], ca.SX]:
    """Return m orthogonal rows G, shape (1, n) each, and U, shape (m, m), with UJ = G.

    Each row carries its row of U behind it, so that a rotation turns both. Rows p and r become
    orthogonal when they are turned by the angle whose tangent t is the smaller root of
    t² + 2 ζ t = 1, with ζ = (‖r‖² − ‖p‖²)/(2 p·r).
    """
    m = matrix.shape[0]
    rows = [ca.horzcat(matrix[i, :], ca.SX.eye(m)[i, :]) for i in range(m)]
    n = matrix.shape[1]
    for _ in range(_SWEEPS):
        for p, r in combinations(range(m), 2):
            product = ca.dot(rows[p][:n], rows[r][:n])
            longer = ca.sumsqr(rows[r][:n]) - ca.sumsqr(rows[p][:n])
            sign = ca.if_else(longer >= 0, 1, -1)
            root = ca.sqrt(longer**2 + 4 * product**2)
            tangent = 2 * product / (longer + sign * (root + _TINY))
            cosine = 1 / ca.sqrt(1 + tangent**2)
            sine = cosine * tangent
            rows[p], rows[r] = (
                cosine * rows[p] - sine * rows[r],
                sine * rows[p] + cosine * rows[r],
            )
    return [row[:n] for row in rows], ca.vertcat(*(row[n:] for row in rows))


def _root(shares: list[ca.SX], ratios: list[ca.SX]) -> ca.SX:
    """Return ρ = λ/(s_m² − λ) for one joint f, from `shares`, V_fi², and `ratios`, r_i.

    The secular equation 1 = Σ V_fi² s_i²/(s_i² − λ) of the least eigenvalue λ becomes
    Σ V_fi² r_i ρ/(1 + ρ (1 − r_i)) = 1 − Σ V_fi². Its left side grows with ρ and is concave, so
    that Newton's method rises to the root from the first guess, which is not above it.
    """
    target = ca.fmax(1 - ca.sum1(ca.vertcat(*shares)), 0)
    scaled = [share * ratio for share, ratio in zip(shares, ratios, strict=True)]
    root = target / (ca.sum1(ca.vertcat(*scaled)) + _TINY)
    for _ in range(_NEWTON_STEPS):
        below = [1 + root * (1 - ratio) for ratio in ratios]
        value = sum(part / one for part, one in zip(scaled, below, strict=True))
        steep = sum(part / one**2 for part, one in zip(scaled, below, strict=True))
        root = root + ca.fmax(target - root * value, 0) / (steep + _TINY)
    return root
