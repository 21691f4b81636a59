"""``lockedjoint codegen``: the worst case and its gradient as a C function.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

from pathlib import Path

from lockedjoint.commands.output import Answer
from lockedjoint.commands.shared import OneTask, source_file


def codegen(robot: OneTask, name: str = "worst_case", out_dir: Path = Path()) -> Answer:
    """Write a C function: worst-case singular value, its gradient, the worst joint.

    It needs no library, allocates no memory, and takes the same time at every posture. The
    Jacobian is that of `measure`.

    Parameters
    ----------
    name
        Name of the files; the function is NAME_sigma.
    out_dir
        It gets NAME.c and NAME.h.
    """
    from lockedjoint.formulations.io.files import prepare_file
    from lockedjoint.robots.worst_case_code import codegen as made

    code = made(robot, name)
    files = [out_dir / file for file in code.files]
    for file in files:
        prepare_file(file, "--out-dir", [source_file(robot)])
    code.write(out_dir)
    plain = {
        "robot": robot.name,
        "tip": robot.tip,
        "function": code.declaration,
        "joints": list(robot.chain.names),
        "files": [str(file) for file in files],
    }
    return Answer(plain, notes=robot.chain.notes)
