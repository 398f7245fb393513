"""Threads of a draw: a pool that is kept, and tasks whose results come back in order.

The kernels release the GIL; work is divided before it is handed out, so that no result depends on the number of
threads.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np
from numba import config

from refsim.errors import InputError
from refsim.pipeline.compile_errors import COMPILE_ERRORS, lacks_attribute, lacks_return, refusal


def default_threads() -> int:
    """The processors this process may use, or as many of them as NUMBA_NUM_THREADS says."""
    return int(config.NUMBA_NUM_THREADS)


@lru_cache(maxsize=8)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="refsim")


def run_all(label: str, threads: int, tasks: list[Any]) -> list[Any]:
    """Results of the tasks, in order; the kernels inside release the GIL. A shader that does not compile is named."""
    try:
        return _results(threads, tasks)
    except COMPILE_ERRORS as error:
        raise refusal(label, error) from error
    except TypeError as error:
        if not lacks_return(error):
            raise
        raise InputError(f"{label}: a shader returned nothing: a path through it ends without return.") from error
    except AttributeError as error:
        if not lacks_attribute(error):
            raise
        raise InputError(f"{label}: a shader does not compile: {error}.") from error


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
