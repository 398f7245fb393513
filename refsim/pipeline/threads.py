"""Threads of a draw: a pool that is kept, and tasks whose results come back in order.

The kernels release the GIL; work is divided before it is handed out, so that no result depends on the number of
threads.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from refsim.errors import InputError


def default_threads() -> int:
    """The processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@lru_cache(maxsize=8)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="refsim")


def run_all(label: str, threads: int, tasks: list[Any]) -> list[Any]:
    """Results of the tasks, in order; the kernels inside release the GIL. A shader that does not compile is named."""
    try:
        return _results(threads, tasks)
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        telling = ("Unknown attribute", "wrong tuple length", "missing a required", "too many positional", "No ")
        cause = next((line for line in lines if any(word in line for word in telling)), lines[0])
        raise InputError(f"{label}: a shader does not compile: {cause}") from error


def _results(threads: int, tasks: list[Any]) -> list[Any]:
    if threads == 1 or len(tasks) == 1:
        return [task() for task in tasks]
    return [future.result() for future in [_pool(threads).submit(task) for task in tasks]]


def checked_threads(threads: int | None) -> int:
    """The number asked for, or all processors. Raises `InputError`."""
    if threads is None:
        return default_threads()
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= 1024:
        raise InputError(f"threads must be a whole number from 1 to 1024, not {threads!r}.")
    return int(threads)
