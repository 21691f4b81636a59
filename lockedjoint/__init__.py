"""Design and certify optimally failure-tolerant manipulator Jacobians.

::

    import lockedjoint as lj

    outcome = lj.solve("max-min", "unit-revolute", joints=7)
    lj.measure(outcome.best.jacobian)

This folder is the upper layer: robots and the command line. Each command is a function in
`commands`, and uses these folders (*rooms*):

=====================================  ======================================================
command                                rooms
=====================================  ======================================================
solve, compare, reproduce, bound,      `formulations`: the mathematics
prove, verify, campaign, show, atlas
realise                                `synthesis`: from a Jacobian to axes, links and URDF
measure, posture, codegen              `robot`: one robot, its tool and task; `robots`:
                                       functions that measure it and find postures;
                                       `kinematics`: files and chains; `clearance`: distances
                                       between links
path                                   `paths`: trajectories that survive a failure
recover                                `recovery`: trajectories after a failure, and proofs
                                       that there is none
workspace, prove-workspace             `workspaces`: what failures leave of the workspace
view                                   `viewer`: a robot in a web page
figure, and pictures of other answers  `figures`
none                                   `adapters`: the worst case inside pink, mink, placo
                                       and JAX
=====================================  ======================================================

Below are `formulations`, the mathematics, and `nlp`, the engine: folders beside this one, and
modules of this package. Imports go down only.

The public names are listed in ``__init__.pyi``, which type checkers and editors read. That file
is the only list: each name is imported from the module that it states there when it is first
used, so that ``import lockedjoint`` loads neither CasADi nor cvxpy. What is listed keeps its
name and meaning as docs/versions.md promises.

``lazy_loader.attach_stub`` does the same for modules just below a package. These are deeper.
"""

import ast
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

# A clone without symbolic links (Windows) and the sdist have these folders beside this one.
if not (Path(__file__).parent / "nlp").is_dir():
    __path__.append(str(Path(__file__).parents[1]))

# The module that each public name lives in, read from the stub beside this file.
_HOMES = {
    alias.name: statement.module
    for statement in ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")).body
    if isinstance(statement, ast.ImportFrom) and statement.module
    for alias in statement.names
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # This is what `from home import name` does, also where the name is a module.
    globals()[name] = value = getattr(__import__(_HOMES[name], fromlist=[name]), name)
    return value


def __dir__() -> list[str]:
    """List the public names, whether or not they are imported yet."""
    return [*__all__, "__version__"]
