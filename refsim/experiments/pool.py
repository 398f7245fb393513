"""Where tasks run: in this process, in processes of this machine (joblib's loky), or on a Dask cluster.

Each is an executor of the standard library's kind, and says how many tasks it runs at a time.
"""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from typing import Any

from refsim.errors import InputError

BACKENDS = ("joblib", "dask")
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
WATCH_S = 0.2
FIRST_WORKER_S = 60
# A worker that has grown by more is replaced. Kept scenes and kernels are no leak, and a new worker would need them too
GROWTH_BYTES = 4_000_000_000


def processors() -> int:
    """The processors that this process may use, quotas of containers included."""
    import joblib

    return int(joblib.cpu_count())


def checked(jobs: int | None, backend: str) -> int:
    """The number of processes: one if not given. Raises `InputError`, also for a backend that is not there."""
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or not 1 <= jobs <= 1024):
        raise InputError(f"jobs must be a whole number from 1 to 1024, not {jobs!r}.")
    if backend not in BACKENDS:
        raise InputError(f"there is no backend {backend!r}; choose from {', '.join(BACKENDS)}.")
    if backend == "dask":
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            raise InputError("the backend dask needs Dask: pip install 'refsim[dask]'.") from error
    return jobs or 1


@contextmanager
def pool(jobs: int, backend: str) -> Iterator[tuple[Executor, int]]:
    """An executor, and how many tasks it runs at a time. It ends with the block, and work that is under way with it."""
    if backend == "dask":
        with _dask(jobs) as found:
            yield found
    elif jobs == 1:
        yield Here(), 1
    else:
        with _processes(jobs) as executor:
            yield executor, jobs


class Here(Executor):
    """Runs what is submitted at once, in this process, with all its threads."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A future that is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def _shares(jobs: int) -> dict[str, str]:
    """The environment of one of so many processes: together they have no more threads than there are processors."""
    return dict.fromkeys(THREADS, str(max(1, processors() // jobs)))


@contextmanager
def _processes(jobs: int) -> Iterator[Executor]:
    from joblib.externals.loky import ProcessPoolExecutor

    with warnings.catch_warnings():
        # Replacing a worker that has grown is as it should be
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs were given to the executor")
        executor = ProcessPoolExecutor(jobs, env=_shares(jobs), initializer=_serve, initargs=(os.getpid(),))
        try:
            with _deaf_children():
                executor.submit(os.getpid)  # starts them
            yield executor
        finally:
            # All is done, or what is left is not wanted any more
            executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes started meanwhile ignore Ctrl-C: a terminal sends it to them too, and it is their master's to hear."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _serve(master: int) -> None:
    """What a worker does first: see to it that it ends when its master is gone, however that went."""
    from joblib.externals.loky import process_executor

    process_executor._MAX_MEMORY_LEAK_SIZE = GROWTH_BYTES
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # one that took the place of another heard it till now

    def watch() -> None:
        while os.getppid() == master:
            time.sleep(WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _dask(jobs: int) -> Iterator[tuple[Executor, int]]:
    """Workers of the cluster that Dask's configuration names (DASK_SCHEDULER_ADDRESS), or of one made for the run."""
    import dask
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        address = dask.config.get("scheduler-address", None)
        if address is None:
            # Dask gives up a process that takes more memory than its share; the system knows better
            local = {"threads_per_worker": 1, "memory_limit": 0, "dashboard_address": None, "silence_logs": "CRITICAL"}
            with _deaf_children():
                address = stack.enter_context(LocalCluster(n_workers=jobs, env=_shares(jobs), **local))
        try:
            client = stack.enter_context(Client(address))
            client.wait_for_workers(1, timeout=FIRST_WORKER_S)
        except (OSError, ValueError, TypeError) as error:  # the last two of what is no address, or lacks certificates
            raise InputError(f"no Dask worker answers: {error}") from error
        executor = client.get_executor(pure=False)
        stack.callback(executor.shutdown, wait=False)
        yield executor, len(client.nthreads())
