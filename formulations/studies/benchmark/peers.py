"""All peers, this library first; a new one is one file and one line here."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from formulations.studies.benchmark import (
    floor,
    jax_residual,
    ours,
    pymanopt_residual,
    schatten,
    scipy_max_min,
    scipy_residual,
)
from formulations.studies.benchmark.peer import Peer

PEERS: Sequence[Peer] = (
    *ours.PEERS,
    *floor.PEERS,
    *scipy_residual.PEERS,
    *jax_residual.PEERS,
    *pymanopt_residual.PEERS,
    *scipy_max_min.PEERS,
    *schatten.PEERS,
)


def packages() -> list[str]:
    """Return the peers' packages and versions."""
    found = []
    for name in ("scipy", "jax", "pymanopt"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} (not installed)")
    return found
