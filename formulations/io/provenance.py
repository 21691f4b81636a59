"""Where a table came from: command, versions, machine and date, for its header."""

import platform
import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("lockedjoint", "casadi", "numpy")


def provenance() -> Mapping[str, str]:
    """Return what it takes to run this again, in the order to print it."""
    program = Path(sys.argv[0])
    script = program.suffix == ".py" and program.stem != "__main__"
    arguments = [*(("python", sys.argv[0]) if script else (program.name,)), *sys.argv[1:]]
    return {
        "command": shlex.join(arguments),
        "versions": f"{versions(PACKAGES)}, Python {platform.python_version()}",
        "machine": f"{_processor()}, {platform.system()} {platform.machine()}",
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
    }


def header(extra: Mapping[str, object]) -> str:
    """Return the provenance and `extra` as lines of a Markdown list."""
    made = provenance()
    entries = {**made, "command": f"`{made['command']}`", **extra}
    lines = [f"- {name}: {value}" for name, value in entries.items()]
    return "\n".join(lines) + "\n"


def versions(packages: Sequence[str]) -> str:
    """Return the names of packages with the versions that are installed."""
    return ", ".join(f"{name} {_version(name)}" for name in packages)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "(not installed)"


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown processor"
