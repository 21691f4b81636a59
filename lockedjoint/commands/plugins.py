"""``--plugin FILE.py``: formulations, joints and criteria of a user's own."""

from __future__ import annotations

from pathlib import Path

from lockedjoint.commands.output import warn


def load(file: Path) -> None:
    """Run a plugin; a note on standard error if it registers nothing.

    FileError if it cannot be run.
    """
    from lockedjoint.formulations.joints.models import MODELS
    from lockedjoint.formulations.registry import FORMULATIONS, load_plugin
    from lockedjoint.synthesis.criteria import CRITERIA

    before = {*FORMULATIONS}, {*MODELS}, {*CRITERIA}
    load_plugin(file)
    if before == ({*FORMULATIONS}, {*MODELS}, {*CRITERIA}):
        warn(f"Note: {file} registered nothing; it ends with lj.register(YourClass).")
