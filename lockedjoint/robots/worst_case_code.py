"""The worst case and its gradient as one expression of the joints' positions, and as C code.

For those who run no Python in their control loop. Everything is straight-line code, without
loops that may end early, so that it takes the same time everywhere: J = UᵀG by one-sided Jacobi
rotations of its rows (Hestenes, 1958), which also finds small singular values to their own last
digits; then for each joint the least eigenvalue of JJᵀ − jjᵀ by Newton's method, as in
`measures.worst_case_sigma_batch`.
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

# Rows of up to six entries are orthogonal after so many sweeps.
_MOST_SWEEPS = 6
# Newton's method has converged after so many steps.
_NEWTON_STEPS = 14
# No function can have these words of C and C++ as its name; `check_name` knows CasADi's own.
_KEYWORDS = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char class compl const
constexpr continue decltype default delete do double else enum explicit export extern false
float for friend goto if inline int long main mutable namespace new noexcept not not_eq nullptr
operator or or_eq private protected public register reinterpret_cast restrict return short
signed sizeof static static_assert static_cast struct switch template this thread_local throw
true try typedef typeid typename typeof union unsigned using virtual void volatile wchar_t
while xor xor_eq
"""
# Divisors that may be 0 have this added.
_TINY = 1e-300
# Positions and values beyond this count as infinite.
_HUGE = 1e70
# The C code ends with this wrapper.
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
# The header of the C code is this.
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
        Of the function; a name in C.

    Returns
    -------
    casadi.Function
        q, shape (n,), to σ, ∂σ/∂q, shape (n,), and the joint, counted from 0; where failures
        tie, those of one of them. Where a position is not finite, or σ is too large to be one:
        0, zeros, and −1, so that no limit of σ is kept.

    Raises
    ------
    InputError
        If the name is none that C and CasADi take.
    """
    of_kind("arm", arm, RobotArm, "a RobotArm")
    check_name("name", name)
    q = arm.symbols()
    matrix = ca.densify(arm.matrix(q))
    left, right, joint = _worst(matrix)
    sigma = ca.norm_2(right)
    weights, found = ca.SX.sym("W", *arm.shape), left @ right.T / (sigma + _TINY)
    slope = ca.gradient(ca.dot(matrix, weights), q)
    gradient = ca.substitute(slope, weights, found)
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
    """Write a C function: worst-case singular value, its gradient, the worst joint.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one.
    name
        Of the files; the function is NAME_sigma.

    Raises
    ------
    InputError
        If the name is none that C and CasADi take.

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
    """Return that function as C, which needs no library, and its header.

    Parameters
    ----------
    arm
        The robot, the task and the characteristic length.
    name
        Of the files, and the beginning of the function's name; a name in C.

    Raises
    ------
    InputError
        If the name is none that C and CasADi take.
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


def _worst(matrix: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return u, J_Fᵀu with a 0 at the locked joint, and which that is."""
    m, n = matrix.shape
    rows, turned = _orthogonal_rows(matrix)
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
    # The weakest direction has a tiny weight, which counts where the joint has no part in it.
    none = ca.vertcat(*(ca.if_else(square <= least, 1e-100, 0) for square in squares))
    left = turned.T @ (weights + none)
    left = left / ca.norm_2(left)
    right = matrix.T @ left
    kept = [ca.if_else(joint == f, 0, right[f]) for f in range(n)]
    return left, ca.vertcat(*kept), joint


def _orthogonal_rows(matrix: ca.SX) -> tuple[list[ca.SX], ca.SX]:
    """Return orthogonal rows G, and U with UJ = G."""
    m = matrix.shape[0]
    rows = [ca.horzcat(matrix[i, :], ca.SX.eye(m)[i, :]) for i in range(m)]
    n = matrix.shape[1]
    for _ in range(_MOST_SWEEPS):
        for p, r in combinations(range(m), 2):
            product = ca.dot(rows[p][:n], rows[r][:n])
            apart = ca.sumsqr(rows[r][:n]) - ca.sumsqr(rows[p][:n])
            sign = ca.if_else(apart >= 0, 1, -1)
            root = ca.sqrt(apart**2 + 4 * product**2)
            tangent = 2 * product / (apart + sign * (root + _TINY))
            cosine = 1 / ca.sqrt(1 + tangent**2)
            sine = cosine * tangent
            rows[p], rows[r] = (
                cosine * rows[p] - sine * rows[r],
                sine * rows[p] + cosine * rows[r],
            )
    return [row[:n] for row in rows], ca.vertcat(*(row[n:] for row in rows))


def _root(shares: list[ca.SX], ratios: list[ca.SX]) -> ca.SX:
    """Return λ/(s_m² − λ), the root of Σ V_fi² r_i t/(1 + t(1 − r_i)) = 1 − Σ V_fi²."""
    target = ca.fmax(1 - ca.sum1(ca.vertcat(*shares)), 0)
    scaled = [share * ratio for share, ratio in zip(shares, ratios, strict=True)]
    root = target / (ca.sum1(ca.vertcat(*scaled)) + _TINY)
    for _ in range(_NEWTON_STEPS):
        below = [1 + root * (1 - ratio) for ratio in ratios]
        value = sum(part / one for part, one in zip(scaled, below, strict=True))
        steep = sum(part / one**2 for part, one in zip(scaled, below, strict=True))
        root = root + ca.fmax(target - root * value, 0) / (steep + _TINY)
    return root
