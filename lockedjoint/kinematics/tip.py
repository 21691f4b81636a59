"""The link that carries the tool, where nobody says which one it is."""

from __future__ import annotations

from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.errors import InputError


def chosen_tip(tree: RobotTree, base: str | None = None) -> str:
    """Return the last link of a robot, if there is only one.

    Raises
    ------
    InputError
        If there are several: it lists all of them with the number of joints that move each.
    """
    leaves = tree.leaves
    if len(leaves) == 1:
        return leaves[0]
    counts = {leaf: _joints_to(tree, leaf, base) for leaf in leaves}
    listed = [f"{leaf} ({_joints(count)})" for leaf, count in counts.items()]
    allowed = f"a link of {tree.name}; its last ones are {', '.join(listed)}"
    raise InputError("tip", "missing", allowed)


def _joints_to(tree: RobotTree, tip: str, base: str | None) -> int | None:
    """Return how many free joints move a link; None if joints there cannot be in a chain."""
    if not tree.path(tip):
        return 0
    try:
        return len(chain_between(tree, tip, base).joints)
    except InputError as error:
        return 0 if "nothing moves" in str(error.value) else None


def _joints(count: int | None) -> str:
    """Return the count of `_joints_to` in words."""
    if count is None:
        return "joints of other kinds"
    return f"{count} joint{'' if count == 1 else 's'}"
