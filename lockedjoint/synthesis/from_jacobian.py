"""From the columns of a Jacobian to joint axes about the end effector.

A revolute joint with direction ω through a point a moves the end effector p with
v = ω × (p − a). Hence ω × v is the part of a − p orthogonal to ω: the axis passes through
a = p + ω × v = p − v × ω, its point nearest to p, at the distance |v|. Axes of unit revolute
joints are tangent to the unit sphere about p.

A column of a Jacobian, m × n, becomes (v; ω), shape (6,): v is in the robot's unit of length
(`metres` of it to one of the Jacobian), ω has no unit. Axes are unit directions, shape (n, 3).

What a task does not say is chosen so. Planar tasks: ω = z. Positional tasks: v alone leaves
the direction of the axis open in the plane orthogonal to v; by default it is the direction of
that plane nearest to z (x where v is along z), so that planar arms are a special case.
Rotational tasks: axes pass through p. These, and prismatic joints, of which only the direction
matters, sit one unit of length from p, at p − ω or p − v.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.joints.joint import NotInModelError
from lockedjoint.formulations.measures import as_jacobian
from lockedjoint.nlp.arrays import FloatArray, as_floats, check_length, finite_vector
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.synthesis.manipulator import Manipulator, TaskRows

# Default of `tolerance`, see `realise`: digits that files of Jacobians have at least.
TOLERANCE = 1e-6
# Smallest entry other than 0: products of smaller ones underflow.
SMALLEST = 1e-40
# Largest entry: products of larger ones overflow.
LARGEST = 1e40
# Largest number of joints: symmetries and criteria of more would take minutes, then hours.
MOST_JOINTS = 50
# Largest error of a column for which the message suggests a tolerance that allows it.
_SMALL_ERROR = 0.1
_X = np.array([1.0, 0.0, 0.0])
_Z = np.array([0.0, 0.0, 1.0])


def realise(
    jacobian: npt.ArrayLike,
    *,
    space: str | None = None,
    kinds: str | None = None,
    directions: npt.ArrayLike | None = None,
    metres: float = 1.0,
    end_effector: npt.ArrayLike = (0.0, 0.0, 0.0),
    tolerance: float = TOLERANCE,
) -> Manipulator:
    """Return the manipulator whose joint i contributes column i.

    Parameters
    ----------
    jacobian
        Shape (m, n): (vx, vy), (vx, vy, vz) or (vx, vy, vz, ωx, ωy, ωz); other tasks by name.
    space
        What the rows are: the name of a `TaskRows` with m rows; where left out, the planar,
        positional or spatial one.
    kinds
        ``R`` (revolute) or ``P`` (prismatic) for each joint. Where left out, columns without
        rotational velocity are prismatic in spatial and planar-pose tasks; otherwise all
        joints are revolute.
    directions
        Directions of the revolute axes of a positional task, shape (n, 3), each orthogonal
        to its column; rows of prismatic joints are not read.
    metres
        Length of the robot per unit of the Jacobian's linear velocity.
    end_effector
        Position of p in the frame of the base, shape (3,), in the robot's unit of length.
    tolerance
        Largest | |ω| − 1 | and |v·ω| of a column that is taken for a revolute joint's. The
        manipulator is then the nearest. A prismatic joint has any `Manipulator.speeds`; one
        as near to 1 is 1.

    Raises
    ------
    NotInModelError
        If no joint of its kind can contribute a column.
    InputError
        If another argument is not allowed.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> robot = lj.realise(lj.optimal_jacobian(8))
    >>> robot.joints
    8
    >>> robot.points.shape
    (8, 3)
    """
    matrix = as_jacobian(jacobian)
    n = matrix.shape[1]
    if n > MOST_JOINTS:
        raise InputError("jacobian", f"of {n} columns", f"at most {MOST_JOINTS}")
    chosen = TaskRows.of(matrix.shape[0], space)
    check_length("metres", metres)
    check_length("tolerance", tolerance)
    columns = chosen.embed(matrix)
    with np.errstate(over="ignore"):  # what overflows is refused
        columns[:3] *= metres
    _check_size("linear velocity", columns[:3], SMALLEST)
    _check_size("rotational velocity", columns[3:], 0.0)
    tip = finite_vector("end effector", end_effector, 3)
    prismatic = _prismatic(columns, chosen, kinds, tolerance)
    wanted = _wanted(directions, chosen, n)
    axes = np.empty((n, 3))
    for i, (column, slides) in enumerate(zip(columns.T, prismatic, strict=True)):
        if slides or chosen not in (TaskRows.PLANAR, TaskRows.POSITIONAL):
            axes[i] = _from_column(i, column, slides, tolerance)
        else:
            planar = chosen is TaskRows.PLANAR
            axes[i] = _Z if planar else _across(i, column[:3], wanted[i], tolerance)
    unplaced = prismatic | (chosen is TaskRows.ROTATIONAL)
    offsets = np.where(unplaced[:, None], -axes, np.cross(axes, columns[:3].T))
    speeds = np.where(prismatic, np.linalg.norm(columns[:3], axis=0), 1.0)
    # What rounding makes of 1 is 1.
    speeds = np.where(np.abs(speeds - 1) <= tolerance, 1.0, speeds)
    return Manipulator(axes, tip + offsets, prismatic, tip, chosen, speeds=speeds)


def deviation(manipulator: Manipulator, jacobian: npt.ArrayLike, length: float = 1.0) -> float:
    """Return the largest difference of a manipulator's Jacobian at q = 0 from the given one.

    Columns are compared in the manipulator's order and up to their signs, linear velocities in
    the robot's unit of length: `length` of it is one unit of the Jacobian, of shape (m, n).
    """
    wanted = manipulator.task.embed(as_jacobian(jacobian))[:, list(manipulator.columns)]
    wanted[:3] *= length
    wanted, own = wanted[manipulator.task.rows], manipulator.jacobian()
    signs = np.where(np.sum(wanted * own, axis=0) < 0, -1.0, 1.0)
    return float(np.max(np.abs(own - signs * wanted)))


def _prismatic(
    columns: FloatArray, task: TaskRows, kinds: str | None, tolerance: float
) -> npt.NDArray[np.bool_]:
    """Return which columns, (6, n), are those of prismatic joints, shape (n,)."""
    n = columns.shape[1]
    if kinds is not None:
        of_kind("kinds", kinds, str, "letters R or P, one per joint")
        if len(kinds) != n or set(kinds.upper()) - set("RP"):
            raise InputError("kinds", kinds, f"{n} letters R or P, one per joint")
        if task is TaskRows.ROTATIONAL and "P" in kinds.upper():
            raise InputError("kinds", kinds, "revolute joints only, for a rotational task")
        return np.array([kind == "P" for kind in kinds.upper()])
    if task in (TaskRows.SPATIAL, TaskRows.PLANAR_POSE):
        return np.asarray(np.linalg.norm(columns[3:], axis=0) <= tolerance)
    return np.zeros(n, dtype=bool)


def _wanted(
    directions: npt.ArrayLike | None, task: TaskRows, n: int
) -> Sequence[FloatArray | None]:
    """Return the direction that is wanted for each of n axes, (3,), or None."""
    if directions is None:
        return [None] * n
    if task is not TaskRows.POSITIONAL:
        raise InputError("directions", "given", f"none for a {task.value} task")
    rows = as_floats("directions", directions)
    if rows.shape != (n, 3) or not np.all(np.isfinite(rows)):
        raise InputError("directions", f"of shape {rows.shape}", f"{n} rows of 3 numbers")
    return list(rows)


def _from_column(i: int, column: FloatArray, slides: bool, tolerance: float) -> FloatArray:
    """Return the direction, (3,), of a prismatic joint, or of a revolute one whose ω is known.

    NotInModelError if no such joint has column i, (6,).
    """
    velocity, spin = column[:3], column[3:]
    speed, rate = float(np.linalg.norm(velocity)), float(np.linalg.norm(spin))
    if slides:
        if rate > tolerance:
            raise _outside(i, spin, "rotational velocity 0 (prismatic joint)")
        if speed == 0:
            raise _outside(i, velocity, "a linear velocity other than 0 (prismatic joint)")
        return np.asarray(velocity / speed)
    if (off := abs(rate - 1)) > tolerance:
        allowed = "rotational velocity of norm 1 (revolute joint) or 0 (prismatic joint)"
        raise _outside(i, spin, allowed + _remedy(off))
    if (pitch := float(abs(velocity @ spin)) / max(1.0, speed)) > tolerance:
        allowed = "v·ω = 0: a joint with pitch is neither revolute nor prismatic"
        raise _outside(i, column, allowed + _remedy(pitch))
    return np.asarray(spin / rate)


def _across(
    i: int, velocity: FloatArray, wanted: FloatArray | None, tolerance: float
) -> FloatArray:
    """Return a unit vector orthogonal to v: the one wanted, or the nearest to z (else to x).

    InputError if the wanted direction is 0 or not orthogonal.
    """
    speed = float(np.linalg.norm(velocity))
    along = velocity / speed if speed > 0 else np.zeros(3)
    if wanted is None:
        wanted = _Z if np.linalg.norm(_Z - (along @ _Z) * along) > TOLERANCE else _X
    elif not abs(along @ wanted) <= tolerance * np.linalg.norm(wanted) > 0:
        shown = f"{_shown(wanted)} for joint {i}"
        allowed = f"orthogonal to its column {_shown(velocity)}, and not 0"
        raise InputError("direction", shown, allowed)
    across = wanted - (along @ wanted) * along
    return np.asarray(across / np.linalg.norm(across))


def _check_size(name: str, velocities: FloatArray, smallest: float) -> None:
    """Raise InputError for entries other than 0 that are smaller or larger than allowed."""
    sizes = np.abs(velocities[velocities != 0])
    if sizes.size and not (np.min(sizes) >= smallest and np.max(sizes) <= LARGEST):
        shown = f"entries from {np.min(sizes):.3g} to {np.max(sizes):.3g} in size"
        allowed = f"0, or {smallest:g} to {LARGEST:g}" if smallest else f"at most {LARGEST:g}"
        raise InputError(name, shown, allowed)


def _outside(i: int, part: FloatArray, allowed: str) -> NotInModelError:
    """Return the error of column i, of which a part is not allowed."""
    return NotInModelError(f"column {i}", f"{_shown(part)} in part", allowed)


def _remedy(off: float) -> str:
    """Say how far a column is off and, if that is little, which tolerance allows it."""
    enough = 10.0 ** np.ceil(np.log10(off))
    return (
        f"; off by {off:.1e}, try --relative-tolerance {enough:.0e}"
        if off < _SMALL_ERROR
        else ""
    )


def _shown(vector: FloatArray) -> str:
    """Return a vector as text."""
    return "(" + ", ".join(f"{entry:.6g}" for entry in vector) + ")"
