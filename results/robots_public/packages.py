"""The packages of robots, and the files in them that state one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

# The root element of a file that states a robot.
_ROOT = re.compile(rb"<(robot|mujoco)[\s>]")
# The first bytes of a file have its root element.
_HEAD_BYTES = 20_000


@dataclass(frozen=True)
class Package:
    """A package of robots on the index of Python packages, and where it keeps them."""

    name: str
    folder: str
    #: Without the libraries that it needs to run: pip install --no-deps.
    alone: bool = False

    @property
    def path(self) -> Path | None:
        """The folder; None if the package is not installed."""
        try:
            folder = Path(str(distribution(self.name).locate_file(self.folder)))
        except PackageNotFoundError:
            return None
        return folder if folder.is_dir() else None

    def files(self) -> Iterator[tuple[str, Path]]:
        """Yield each URDF and MJCF file by its name within the folder, in order."""
        folder = self.path
        if folder is None:
            return
        for path in sorted(folder.rglob("*")):
            if path.suffix.lower() not in (".urdf", ".xml", ".mjcf") or not path.is_file():
                continue
            with path.open("rb") as file:
                head = re.sub(rb"<!--.*?-->", b"", file.read(_HEAD_BYTES), flags=re.DOTALL)
            if _ROOT.search(head):
                yield path.relative_to(folder).as_posix(), path


#: The packages, each of which pip installs without compiling anything.
PACKAGES = (
    Package("example-robot-data", "cmeel.prefix/share/example-robot-data/robots"),
    Package("rtb-data", "rtbdata/xacro"),
    Package("robosuite", "robosuite/models/assets", alone=True),
    Package("pybullet", "pybullet_data", alone=True),
    Package("icub-models", "share/iCub/robots", alone=True),
    Package("dexmate-urdf", "dexmate_urdf/robots", alone=True),
    Package("airo-models", "airo_models", alone=True),
    Package("gymnasium-robotics", "gymnasium_robotics/envs/assets", alone=True),
)
