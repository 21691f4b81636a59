"""Where a campaign runs: processes of this machine, a Dask cluster, or the ranks of MPI."""

from __future__ import annotations

import gc
import logging
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, suppress

from nlp.errors import MissingLibraryError, WorkerError

_CONNECT_SECONDS = 12.0  # after which a cluster that does not answer is given up


def chosen_executor(
    workers: int | None, scheduler: str | None, mpi: bool
) -> AbstractContextManager[Executor]:
    """Return the executor that the options of a command ask for.

    Raises
    ------
    MissingLibraryError
        If Dask or mpi4py is not installed.
    """
    from nlp.executors import LocalExecutor, default_workers

    if scheduler is not None:
        return dask_executor(scheduler)
    if mpi:
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError:
            raise MissingLibraryError("mpi4py") from None
        executor: Executor = MPIPoolExecutor()
        return executor
    return LocalExecutor(workers or default_workers())


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yield the executor of a running Dask cluster, and leave the cluster at the end.

    Start workers with one thread each. Whoever reaches the scheduler can run code on the
    scheduler and on the workers.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    MissingLibraryError
        If Dask is not installed.
    WorkerError
        If no Dask scheduler answers there.
    """
    try:
        from distributed import Client
    except ImportError:
        raise MissingLibraryError("distributed", "dask distributed") from None
    for part in ("distributed", "distributed.client", "tornado"):
        logging.getLogger(part).setLevel(logging.CRITICAL)  # our own errors say what ended
    failure = ""
    try:
        client = Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, TypeError, ValueError) as reason:
        failure = f"No Dask scheduler answers at {address} ({reason})."
    if failure:
        gc.collect()  # the half-made client ends now: while another begins it would wait for it
        raise WorkerError(failure)
    try:
        yield client.get_executor(pure=False)
    finally:
        with suppress(Exception):  # a scheduler that has ended does not answer
            client.close(timeout=1.0)
