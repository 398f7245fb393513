"""The disk cache of clones: numba's, with four changes, and pruning.

- The index is keyed by argument types and CPU alone: all else is in the clone's name.
- Each data file has a name of its own, so that two processes which compile one clone for different argument types at
  once cannot pair one's index with the other's code.
- What cannot be read is compiled anew, and what cannot be written (full disk) is not: a cache may be slow, not fatal.
- Of several processes that want one clone at once, one compiles it and the others wait for its file.

Clones pile up (65 KB each): whoever adds one removes those unused for `MAX_AGE_DAYS` and all but the `MAX_CLONES` used
last in that directory. A hit touches the index file, so its time is that of the last use. Where the installation is
read-only, numba puts the directory under the user's own cache, and the pruning follows.
"""

import contextlib
import os
import re
import time
import uuid
from typing import Any

from numba.core.caching import FunctionCache

from refsim.jit.turns import end_turn, take_turn

MARK = "_refsim_"
MAX_AGE_DAYS = 30.0
MAX_CLONES = 512

# <module>.<template>_refsim_<20 hex>-<line>.py<version>.nbi, .<name>.nbc, and what a killed writer left of either
_CLONE = re.compile(rf"(?P<clone>.+{MARK}[0-9a-f]{{20}}-\d+\.py\d+[a-z]*)\.(?:nbi|[0-9a-f]+\.nbc)(?:\.tmp\.[0-9a-f]+)?")


class CloneCache(FunctionCache):  # type: ignore[misc]
    """Disk cache of one clone, whose name holds a hash of all it depends on."""

    def __init__(self, clone: Any) -> None:
        super().__init__(clone)
        self._cache_file._data_name = lambda number: f"{self._impl.filename_base}.{uuid.uuid4().hex}.nbc"

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return sig, codegen.magic_tuple()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._load(sig, target_context)
        if found is None:
            take_turn(self.cache_path, self._cache_file._index_name)
            # Another process may have had it meanwhile. What is still lacking is compiled now, and saved in this turn.
            found = self._load(sig, target_context)
            if found is not None:
                end_turn()
        return found

    def _load(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super().load_overload(sig, target_context)
        except Exception:  # unpickling a damaged file may raise anything
            with contextlib.suppress(OSError):
                os.unlink(self._cache_file._index_path)
            return None
        if found is not None:
            with contextlib.suppress(OSError):
                os.utime(self._cache_file._index_path)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)
        end_turn()
        prune(self.cache_path)


def attach(dispatcher: Any) -> None:
    """Give `dispatcher` a :class:`CloneCache`; without a place to write it just compiles in every process."""
    with contextlib.suppress(RuntimeError):  # numba: no locator available
        dispatcher._cache = CloneCache(dispatcher.py_func)


def prune(directory: str, max_age_days: float = MAX_AGE_DAYS, max_clones: int = MAX_CLONES) -> None:
    """Remove clones of `directory` unused for `max_age_days`, and all but the `max_clones` used last; nothing else.

    Several processes may do so at once: a file that has gone already, or may not be removed, is passed over.
    """
    files: dict[str, list[str]] = {}
    used: dict[str, float] = {}
    with contextlib.suppress(OSError), os.scandir(directory) as entries:
        for entry in entries:
            match = _CLONE.fullmatch(entry.name)
            if match is None:
                continue
            with contextlib.suppress(OSError):
                clone, time_used = match["clone"], entry.stat().st_mtime
                files.setdefault(clone, []).append(entry.path)
                used[clone] = max(used.get(clone, 0.0), time_used)
    oldest = time.time() - max_age_days * 86400
    for rank, clone in enumerate(sorted(used, key=used.__getitem__, reverse=True)):
        if rank >= max_clones or used[clone] < oldest:
            for path in files[clone]:
                with contextlib.suppress(OSError):
                    os.unlink(path)
