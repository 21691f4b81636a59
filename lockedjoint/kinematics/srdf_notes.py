"""What was read of an SRDF file, in sentences for notes of a robot."""

from __future__ import annotations

from lockedjoint.kinematics.chain import listed
from lockedjoint.kinematics.srdf import Srdf
from lockedjoint.kinematics.tree import RobotTree


def srdf_notes(
    srdf: Srdf, tree: RobotTree, group: str | None, base: str, tip: str
) -> tuple[str, ...]:
    """Return sentences on what a file gives to a robot, and on what of it is left aside.

    The group is the one that was chosen, if any; base and tip are the links of the arm.
    """
    parts = [f"groups {listed(list(srdf.groups))}"] if srdf.groups else []
    states = list(srdf.states_of(group))
    parts += [f"states {listed(states)}"] if states else []
    pairs = len(srdf.touching)
    parts += [f"{pairs} pairs of links whose distance is not looked at"] if pairs else []
    parts += [f"end effector {one.name} at {one.parent_link}" for one in srdf.end_effectors]
    said = [f"{srdf.name} states {'; '.join(parts) or 'nothing that is read'}."]
    if group is not None:
        said.append(f"Group {group} moves {tip} relative to {base}.")
    on_way = {joint.name for joint in tree.path(tip)}
    passive = [name for name in srdf.passive if name in on_way]
    if passive:
        said.append(
            f"Joints on the way that no motor moves, as {srdf.name} says: {listed(passive)}."
        )
    if srdf.virtual:
        said.append(f"Virtual joints of {srdf.name} are left aside: {listed(srdf.virtual)}.")
    return (*said, *srdf.notes, *srdf.unknown(tree))
