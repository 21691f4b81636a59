"""Run by every kernel as it starts: cells of ``%%bash`` whose output stays in one piece.

IPython's own sends it on in pieces of a hundred bytes, which a page then breaks into lines.
"""

import subprocess

from IPython.core.magic import register_cell_magic


@register_cell_magic
def bash(_: str, cell: str) -> None:
    """Run a cell with bash; a command that fails fails the cell."""
    done = subprocess.run(
        ["bash", "-e", "-c", cell], capture_output=True, text=True, check=False
    )
    print(done.stdout + done.stderr, end="")
    done.check_returncode()
