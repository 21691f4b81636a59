"""``lockedjoint codegen``: a robot's worst case and its gradient as C."""

from __future__ import annotations

from pathlib import Path

from formulations.commands.arguments import Json, option
from formulations.commands.output import show, warn
from formulations.commands.robot_arguments import ArmOptions
from nlp.errors import InputError


def codegen(
    robot: ArmOptions,
    *,
    out: Path = option("DIR", "Write NAME.c and NAME.h there.", Path()),
    name: str = option("NAME", "Of the files; the function is NAME_sigma.", "worst_case"),
    as_json: Json = False,
) -> None:
    """Write a C function: worst-case singular value, its gradient, the worst joint.

    It needs no library, allocates nothing, and takes as long at every posture. The Jacobian is
    that of measure-robot.
    """
    from formulations.io.files import prepare_file, write_text
    from formulations.robots.worst_case_code import worst_case_code

    if not (name.isidentifier() and name.isascii()):
        raise InputError("--name", name, "a name in C: letters, digits and _")
    arm = robot.arm()
    files = out / f"{name}.h", out / f"{name}.c"
    for file in files:
        prepare_file(file, inputs=[robot.file])
    code, header = worst_case_code(arm, name)
    for file, text in zip(files, (header, code), strict=True):
        write_text(file, text)
    warn(*(f"Note: {note}" for note in arm.chain.notes))
    plain = {
        "robot": arm.chain.robot,
        "tip": arm.chain.tip,
        "function": f"double {name}_sigma(const double* q, double* gradient, int* joint)",
        "joints": list(arm.chain.names),
        "files": [str(file) for file in files],
    }
    show(plain, as_json)
