"""Turns at compiling: of several processes that want one clone at once, one compiles it and the others wait.

A turn is a lock on one byte of a file in the cache's directory, the byte being chosen by the clone's name. The system
ends the turn of a process that dies. Where there are no such locks, and after `PATIENCE_S`, everyone compiles: that is
slower and nothing worse. A process has one turn at a time, because numba compiles one kernel at a time.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# There is none on Windows
fcntl: Any = importlib.import_module("fcntl") if importlib.util.find_spec("fcntl") else None

NAME = "refsim.turns"
PATIENCE_S = 120.0
ASK_AGAIN_S = 0.02

_held: list[tuple[int, int]] = []  # file and byte of the turn that this process has


def take_turn(directory: str, clone: str) -> None:
    """Take the turn at the clone, after those who have it."""
    end_turn()
    file = _file(directory)
    if file is None:
        return
    byte = int.from_bytes(hashlib.sha256(clone.encode()).digest()[:4], "big") >> 1
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
        except (BlockingIOError, PermissionError):
            time.sleep(ASK_AGAIN_S)
        except OSError:  # a file system without locks
            break
        else:
            _held.append((file, byte))
            break


def end_turn() -> None:
    """End the turn of this process, if it has one."""
    while _held:
        file, byte = _held.pop()
        fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)


@contextmanager
def ended_on_error() -> Iterator[None]:
    """End the turn if the block fails: nothing will be saved for those who wait."""
    try:
        yield
    except BaseException:
        end_turn()
        raise


@functools.cache
def _file(directory: str) -> int | None:
    """The file of the directory's turns, open as long as the process lives; None where there can be none."""
    if fcntl is None:
        return None
    try:
        os.makedirs(directory, exist_ok=True)
        return os.open(os.path.join(directory, NAME), os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        return None
