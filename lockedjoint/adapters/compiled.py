"""The smooth worst case of an arm as machine code, for control loops in Python.

s(q) and its gradient ∂s/∂q, shape (n,), are computed at one configuration q, shape (n,): see
the head of this folder for the words. CasADi writes the functions around the decomposition as
C; the eigenvalues of small symmetric matrices are a page of C beside this file. The system's
compiler takes a second, once: libraries are kept in the user's cache.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lockedjoint.adapters import checked
from lockedjoint.formulations.measures.smooth_worst_case import checked_width
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.smooth_of_one import smooth_parts
from lockedjoint.kinematics.worst_cases import smooth_from_jacobian
from lockedjoint.nlp.arrays import FloatArray, as_floats, finite_vector
from lockedjoint.nlp.compiled import library_of
from lockedjoint.nlp.errors import of_kind

#: A function takes q and returns s and its gradient.
Smooth = Callable[[npt.ArrayLike], tuple[float, FloatArray]]
# Options of the compiler. The code is straight lines and short loops: -O3 runs no faster.
_FLAGS = ("-O2", "-fPIC", "-shared")


def smooth_worst_case(robot: object, width: float = 0.01) -> Smooth:
    """Return the function from a configuration to s and its gradient, compiled.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one.
    width
        w > 0: singular values that are closer count together.

    Returns
    -------
    Callable
        What `RobotArm.smooth_worst_case` does for one configuration, of shape (n,), several
        times as fast. The same, with a warning, where there is no C compiler.

    Raises
    ------
    InputError
        If an argument is not allowed; the function, if the configuration is not.
    """
    function, width = smooth_of(checked(robot, width), compiled=True), checked_width(width)
    return lambda q: function(q, width)


class LastValue:
    """s and ∂s/∂q at the last positions that were asked for.

    A host asks for the error and the Jacobian of a task one after the other, at the same q: it
    is computed once.

    Parameters
    ----------
    arm
        The arm, with n joints.
    compiled, width
        Whether to use machine code, and w.
    columns
        The column of each joint in the host's Jacobian, shape (n,).
    count
        Number of columns of the host's Jacobian.
    """

    def __init__(
        self, arm: RobotArm, compiled: bool, width: float, columns: Sequence[int], count: int
    ) -> None:
        of_kind("compiled", compiled, bool, "True or False")
        self._smooth, self._width = smooth_of(arm, compiled), float(width)
        self._columns, self._count = np.array(columns, dtype=int), count
        self._at, self._value, self._row = b"", 0.0, np.zeros((1, count))

    def at(self, q: FloatArray) -> tuple[float, FloatArray]:
        """Return s and its row of the host's Jacobian, (1, count), at q, (n,).

        The caller may not change the row.
        """
        raw = q.tobytes()
        if raw != self._at:
            self._value, slope = self._smooth(q, self._width)
            self._row = np.zeros((1, self._count))
            self._row[0, self._columns] = slope
            self._at = raw
        return self._value, self._row


def smooth_of(arm: RobotArm, compiled: bool) -> Callable[..., tuple[float, FloatArray]]:
    """Return the function of q, (n,), and w that returns s and its gradient, (n,).

    It is in Python where there is no C compiler.
    """
    library = _library(arm) if compiled else None
    if library is not None:
        return Compiled(arm, library)

    def in_python(q: npt.ArrayLike, width: float) -> tuple[float, FloatArray]:
        point = as_floats("configuration", q)
        if point.shape != (arm.size,):
            finite_vector("configuration", point, arm.size)  # says what is wrong
        value, slope = arm.smooth_worst_case(point, width)
        return float(value), slope

    return in_python


class Compiled:
    """The function of a compiled library, with arrays that are made once, for all calls.

    One thread at a time may use the arrays (`_lock`).
    """

    def __init__(self, arm: RobotArm, library: Path) -> None:
        function = ctypes.PyDLL(str(library)).smooth_worst_case
        function.restype = ctypes.c_double
        pointer = ctypes.c_void_p
        function.argtypes = [pointer, ctypes.c_double, pointer, pointer]
        self._arm, self._function, self._lock = arm, function, threading.Lock()
        self._q, self._found, self._slope = np.zeros(arm.size), np.zeros(2), np.zeros(arm.size)
        arrays = (self._q, self._found, self._slope)
        self._places = tuple(array.ctypes.data for array in arrays)

    def __call__(self, q: npt.ArrayLike, width: float) -> tuple[float, FloatArray]:
        """Return s, and its gradient, shape (n,), at a configuration, shape (n,)."""
        given = as_floats("configuration", q)
        if given.shape != self._q.shape:
            finite_vector("configuration", given, self._arm.size)  # says what is wrong
        point, found, slope = self._places
        with self._lock:
            self._q[:] = given
            if self._function(point, width, found, slope) > 0:
                return float(self._found[0]), self._slope.copy()
        # The C code gives up near singularity, and where a number is not finite.
        given = finite_vector("configuration", given, self._arm.size)
        value, gradient = smooth_from_jacobian(self._arm, given, width)
        return float(value), gradient


def _library(arm: RobotArm) -> Path | None:
    """Compile the functions of an arm; return the library's file, None without a compiler."""
    parts = smooth_parts(arm)
    functions = (parts.before, parts.after)
    rows, joints = arm.shape
    sizes = {"ROWS": rows, "JOINTS": joints, "MOTIONS": len(arm.chain.motions)}
    sizes |= {
        "GIVEN": max(one.sz_arg() for one in functions),
        "RESULTS": max(one.sz_res() for one in functions),
        "WHOLE": max(1, *(one.sz_iw() for one in functions)),
        "WORK": max(1, *(one.sz_w() for one in functions)),
    }
    defined = "".join(f"\n#define {name} {size}" for name, size in sizes.items())
    entry = Path(__file__).with_name("smooth_worst_case.c").read_text(encoding="utf-8")
    return library_of(functions, _FLAGS, f"{defined}\n{entry}")
