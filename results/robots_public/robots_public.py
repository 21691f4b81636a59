"""Every robot of eight public packages: read or refused, and its Jacobian by others.

What comes in: the URDF and MJCF files of `packages`. What goes out: ``robots_public.csv``, a
`PublicRow` for each file in which something moves. J, shape (6, n), has the tool's velocity
above and its rotation below, in the base's axes; `references` computes it in three other ways.
The study complains if one of them differs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.io.table import HIDDEN, column
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.scaled_chain import ScaledChain
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.kinematics.tree import MOVING, RobotTree
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LockedJointError
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.search import Search
from results.robots_public.packages import PACKAGES
from results.robots_public.references import by_differences, by_mujoco, by_pinocchio
from results.script import main, study_of

# Jacobians are compared at so many random configurations.
_CONFIGURATIONS = 5
# The search for a posture makes so many starts.
_STARTS = 20
# Entries of J that agree up to this share of the largest are the same by another program.
SAME_SHARE = 1e-9
# Entries of J that agree up to this share of the largest are the same by differences.
SAME_BY_DIFFERENCES = 1e-6
# Arms of so many joints have a joint to spare for positions.
_LEAST_JOINTS = 4
# Arms of so many joints have a joint to spare for poses.
_JOINTS_OF_ALL = 7
# So many characters of what another program says are shown.
_SHOWN = 80

#: What became of a file.
READ = "read"
REFUSED = "refused"
NOTHING_MOVES = "nothing moves"


@dataclass(frozen=True)
class PublicRow:
    """One file: the columns of ``robots_public.csv``; NaN where one has no value.

    A file is *read* if its longest chain is; then errors of J are the largest at five random
    configurations, as a share of its largest entry. `by` names the other program. σ is eq. (5)
    in units of ℓ, midway between the limits, and at the best posture of a short search, of
    arms that have more joints than their task; else `note` says why there is none.
    """

    package: str
    file: str
    verdict: str
    robot: str = field(metadata=HIDDEN)
    base: str = field(metadata=HIDDEN)
    tip: str
    joints: int
    task: str = field(metadata=column(empty="–"))
    difference_error: float = field(metadata=column("J, differences", ".0e"))
    by: str = field(metadata=column(empty="–"))
    reference_error: float = field(metadata=column("J, other program", ".0e"))
    mid_range_sigma: float = field(metadata=column("σ at mid-range", ".4f"))
    posture_sigma: float = field(metadata=column("σ at the best posture", ".4f"))
    note: str = field(metadata=column(empty="–"))

    @property
    def right(self) -> bool:
        """Whether no comparison finds J wrong."""
        pairs = (
            (self.difference_error, SAME_BY_DIFFERENCES),
            (self.reference_error, SAME_SHARE),
        )
        return all(not error > limit for error, limit in pairs)


def compute(effort: Effort, folder: Path) -> Iterator[PublicRow]:  # noqa: ARG001
    """Yield a row for each file with joints that move, and one for all others of a package."""
    for package in PACKAGES:
        still = 0
        for name, path in package.files():
            effort.progress(f"{package.name}, {name}")
            row = row_of(package.name, name, path, effort)
            still += row.verdict == NOTHING_MOVES
            if row.verdict != NOTHING_MOVES:
                yield row
        if still:
            yield _row(package.name, f"{still} files", NOTHING_MOVES)


def row_of(package: str, name: str, path: Path, effort: Effort) -> PublicRow:
    """Return what becomes of one file."""
    try:
        tree = read_robot(path)
        chain = longest_chain(tree)
    except LockedJointError as error:
        return _row(package, name, REFUSED, note=_sentence(error, path))
    if chain is None:
        return _row(package, name, NOTHING_MOVES)
    points = _configurations(chain, effort.seed)
    by = "pinocchio" if path.suffix == ".urdf" else "mujoco"
    reference = by_pinocchio if by == "pinocchio" else by_mujoco
    whole = ScaledChain(chain, TaskSpace())
    own = [whole.metric_jacobian(q) for q in points]
    notes, missed = list[str](), float("nan")
    try:
        others = [reference(path, tree, chain, q) for q in points]
        missed = _error(own, others)
    except Exception as failure:  # whatever the other program raises
        notes.append(f"{by} refuses it: {' '.join(str(failure).split())[:_SHOWN]}")
        by = ""
    task, sigmas, why = _sigmas(chain, effort)
    return _row(
        package,
        name,
        READ,
        robot=tree.name,
        base=chain.base,
        tip=chain.tip,
        joints=len(chain.joints),
        task=task,
        difference_error=_error(own, [by_differences(chain, q) for q in points]),
        by=by,
        reference_error=missed,
        mid_range_sigma=sigmas[0],
        posture_sigma=sigmas[1],
        note="; ".join([*notes, *filter(None, [why])]),
    )


def longest_chain(tree: RobotTree) -> Chain | None:
    """Return the chain of the most free joints to a last link, None if nothing moves.

    A chain begins after joints that no chain can have, such as a floating base.
    LockedJointError if there are moving joints, and none is in a chain.
    """
    best: Chain | None = None
    refused: LockedJointError | None = None
    for tip in tree.leaves:
        path = tree.path(tip)
        others = [joint.child for joint in path if joint.type not in (*MOVING, "fixed")]
        try:
            chain = chain_between(tree, tip, others[-1] if others else None)
        except LockedJointError as error:
            if any(joint.type in MOVING for joint in path) and "nothing moves" not in str(
                error
            ):
                refused = refused or error
            continue
        if best is None or len(chain.joints) > len(best.joints):
            best = chain
    if best is None and refused is not None:
        raise refused
    return best


def _configurations(chain: Chain, seed: int) -> list[FloatArray]:
    """Draw configurations within the limits, each (n,), in radians or metres."""
    least, largest = (side[:, 0] for side in chain.ranges)
    rng = np.random.default_rng(seed)
    return list(rng.uniform(least, largest, (_CONFIGURATIONS, len(least))))


def _error(ours: list[FloatArray], others: list[FloatArray]) -> float:
    """Return the largest difference of entries, over the largest entry of J (at least 1)."""
    return max(
        float(np.max(np.abs(one - other)) / max(1.0, np.max(np.abs(one))))
        for one, other in zip(ours, others, strict=True)
    )


def _sigmas(chain: Chain, effort: Effort) -> tuple[str, tuple[float, float], str]:
    """Return the task, σ midway and at the best posture, or why there is none."""
    nan = float("nan")
    count = len(chain.joints)
    if count < _LEAST_JOINTS:
        return "", (nan, nan), ""
    task = "all" if count >= _JOINTS_OF_ALL else "position"
    try:
        arm = RobotArm(chain, TaskSpace.parse(task))
        middle = measures.worst_case_sigma(arm.jacobian(chain.mid_range))
        if task == "position":
            return task, (middle, nan), ""
        search = Search(starts=effort.starts or _STARTS, seed=effort.seed)
        found = best_posture(arm, search).assessment
        structural = [f.joint for f in found.structural if f.kind == "structural"]
        why = f"structural: {', '.join(structural)}" if structural else ""
        return task, (middle, found.worst_case_sigma), why
    except LockedJointError as error:
        return task, (nan, nan), " ".join(str(error).split())


def _sentence(error: LockedJointError, path: Path) -> str:
    """Return why a file is refused, without the folders of this machine."""
    text = " ".join(str(error).split())
    return re.sub(re.escape(str(path.parent)) + "/?", "", text)


def _row(package: str, name: str, verdict: str, **known: object) -> PublicRow:
    nan = float("nan")
    fields: dict[str, object] = {"robot": "", "base": "", "tip": "", "joints": 0, "task": ""}
    fields |= {"difference_error": nan, "by": "", "reference_error": nan}
    fields |= {"mid_range_sigma": nan, "posture_sigma": nan, "note": ""}
    make: Callable[..., PublicRow] = PublicRow
    return make(package=package, file=name, verdict=verdict, **{**fields, **known})


def _complaint(rows: Sequence[PublicRow]) -> str:
    wrong = [row for row in rows if not row.right]
    named = ", ".join(f"{row.package}/{row.file}" for row in wrong[:5])
    return f"J is wrong for {len(wrong)} robots: {named}" if wrong else ""


STUDY = study_of(
    __file__,
    compute,
    PublicRow,
    title="every robot of eight public packages: read or refused, and J by others",
    takes="ten minutes, and packages of robots",
    long=True,
    complain=_complaint,
    settings={"same": SAME_SHARE, "by_differences": SAME_BY_DIFFERENCES},
)

if __name__ == "__main__":
    main(STUDY, __file__)
