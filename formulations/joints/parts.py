"""Parts of an arm for the relaxation: joints that are alike, failures, blocks of rows.

What comes in: an `Arm` of n joints with m rows, and how its joints fail. What goes out:
`Parts`. These are the kinds g of joints, the sets F of joints that may lock, and the blocks B
of rows. The letters are those of `lockedjoint.formulations.relaxation`; X_g, shape (m, m), is
the mean of jjᵀ over the joints of kind g, where j is the column of a joint. M = JJᵀ.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.gram_conditions import (
    LINEAR,
    ROTATIONAL,
    SPATIAL,
    GramCondition,
    checked_conditions,
    in_units,
    is_sum_of_squares,
    units_of_rows,
    with_mean_limits,
)
from lockedjoint.formulations.measures.jacobian import check_locked
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.errors import InputError, of_kind

#: What is relaxed.
Statement: TypeAlias = Literal["max-min", "isotropy", "residual"]


@dataclass(frozen=True)
class JointKind:
    """Joints that are alike: they share one X.

    Attributes
    ----------
    conditions
        What the matrix X of each satisfies, in the units of the rows.
    odds
        The odds p/(1 − p) of their failure, 0 if they never fail.
    count
        How many there are.
    """

    conditions: tuple[GramCondition, ...]
    odds: float
    count: int

    @cached_property
    def support(self) -> list[int]:
        """The rows of the column that its conditions do not say to be 0, by number."""
        zero: set[int] = set()
        for one in self.conditions:
            if one.equal and one.limit == 0 and is_sum_of_squares(one):
                zero |= set(np.flatnonzero(np.diag(one.matrix)).tolist())
        return [row for row in range(len(self.conditions[0].matrix)) if row not in zero]

    def reaches(self, rows: slice) -> bool:
        """Whether some of these rows of the column can be other than 0."""
        return any(rows.start <= row < rows.stop for row in self.support)

    def on_support(self, matrix: NDArray[Any]) -> NDArray[Any]:
        """Return the rows and columns of a matrix that are in the support."""
        return matrix[np.ix_(self.support, self.support)]


@dataclass(frozen=True)
class LockedSet:
    """Sets of joints that lock at once, alike but for the choice among equal joints.

    Attributes
    ----------
    counts
        How many joints of each kind lock.
    weight
        w_F: how likely the set is, over the likeliest.
    """

    counts: tuple[int, ...]
    weight: float


@dataclass(frozen=True)
class Block:
    """Rows of J for which the conditions of all failures add up.

    If one joint locks at once they add up to tr (M_B/t − I)⁻¹ ≤ n_B − m_B, where t is the
    square of the worst case, and M_B is JJᵀ of these rows.

    Attributes
    ----------
    name
        ``all``, ``linear`` or ``rotational``.
    rows
        The rows.
    joints
        n_B: how many joints reach them; all of these may fail.
    """

    name: str
    rows: slice
    joints: int

    @property
    def size(self) -> int:
        """m_B, the number of rows."""
        return self.rows.stop - self.rows.start  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Parts:
    """What the program is made of, without any numbers of a solver.

    Attributes
    ----------
    task_dimension
        m.
    failures
        k, how many joints lock at once.
    kinds, sets, blocks
        Joints, the sets of them that may fail, and rows.
    units
        The unit of each row, a power of 2.
    """

    task_dimension: int
    failures: int
    kinds: tuple[JointKind, ...]
    sets: tuple[LockedSet, ...]
    blocks: tuple[Block, ...]
    units: tuple[float, ...]

    def alike(self, number: int) -> tuple[int, ...]:
        """Return the numbers of all kinds with the conditions of one, with any odds."""
        same = self.kinds[number].conditions
        return tuple(k for k, kind in enumerate(self.kinds) if kind.conditions == same)

    def condition_name(self, number: int, condition: GramCondition) -> str:
        """Return the name of the constraint of a condition on a kind of joint.

        `relaxation.build` gives the constraint this name, and `bounds.relaxation_rounding`
        finds its multiplier by it.
        """
        sharing = self.alike(number) if condition.shared else (number,)
        return f"joint {', '.join(map(str, sharing))}: {condition.name}"

    @property
    def least_weight(self) -> float:
        """w, the least weight of a failure."""
        return min(failure.weight for failure in self.sets)

    @property
    def lost_rows(self) -> str:
        """Name of a block that any k of its joints leave without full rank; or nothing.

        `bounds.relaxed` refuses an arm that has such a block.
        """
        lost = (one.name for one in self.blocks if one.joints - self.failures < one.size)
        return next(lost, "")


def parts_of(
    arm: Arm,
    failures: int | FailureModel = 1,
    statement: Statement = "max-min",
    *,
    coarse: bool = False,
) -> Parts:
    """Return the parts of the relaxation of an arm.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, or how likely each fails.
    statement
        ``max-min``, ``isotropy`` or ``residual``.
    coarse
        Whether joints whose conditions differ in the limits alone share one X too, which has
        the mean limits. The program is smaller, and its bound holds as well.

    Raises
    ------
    InputError
        If so many joints cannot lock, or probabilities are not one for each joint; or if a
        joint's conditions are no conditions on its column.
    """
    of_kind("arm", arm, Arm, "an Arm, such as arm('unit-revolute', 7)")
    m, n = arm.shape
    if not isinstance(failures, FailureModel):
        check_locked(n - m, n, failures)
        failures = FailureModel.equally_likely(n, failures)
    elif failures.joints != n:
        raise InputError("failures", f"of {failures.joints} joints", f"of {n} joints")
    stated = [checked_conditions(joint.gram_conditions, m) for joint in arm.joints]
    if coarse:
        stated = with_mean_limits(stated)
    # The other statements ask that M is near a multiple of I, which has all rows in one unit.
    units = units_of_rows(stated, m) if statement == "max-min" else (1.0,) * m
    scaled = {one: tuple(in_units(of_one, units) for of_one in one) for one in set(stated)}
    each = [(scaled[one], odds) for one, odds in zip(stated, failures.odds, strict=True)]
    counted = Counter(each)
    kinds = tuple(JointKind(*alike, count) for alike, count in counted.items())
    place = {alike: number for number, alike in enumerate(counted)}
    weights: dict[tuple[int, ...], float] = {}
    for joints, weight in failures.weights().items():
        chosen = Counter(place[each[joint]] for joint in joints)
        # Joints of one kind have the same odds, so all sets with these counts have this weight.
        weights.setdefault(tuple(chosen[number] for number in range(len(kinds))), weight)
    blocks = []
    for name, rows in _named_rows(m).items():
        reaching = [kind for kind in kinds if kind.reaches(rows)]
        if all(kind.odds > 0 for kind in reaching):
            blocks.append(Block(name, rows, sum(kind.count for kind in reaching)))
    sets = tuple(LockedSet(counts, weight) for counts, weight in weights.items())
    return Parts(m, failures.failures, kinds, sets, tuple(blocks), units)


def _named_rows(m: int) -> Mapping[str, slice]:
    """Return the blocks of rows by name: all, and with six rows also linear and rotational."""
    named = {"all": slice(0, m)}
    if m == SPATIAL:
        named |= {"linear": LINEAR, "rotational": ROTATIONAL}
    return named
