"""Plan: old clones go, nothing else does, and a damaged or unwritable cache costs time only.

- Of random directories `prune` removes exactly the clones unused for too long or beyond the newest few, whole clones
  at a time; foreign files, some one character off a clone's name, all stay.
- A file that vanishes or cannot be removed meanwhile is passed over; a directory that does not exist is empty.
- A kernel compiled anew prunes; one found on disk is touched.
- Damaged index and data files are replaced; a failing write leaves the kernel working.
- Data files never share a name, whatever another process wrote into the index.
"""

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.jit import disk, func, specialise, turns

DAY = 86400.0
KEY = "0123456789abcdef0123"


def stage(columns):
    for i in range(columns.size):
        columns[i] = shader(columns[i])  # noqa: F821


def kernel(k: float = 1.0) -> Any:
    @func
    def shader(x):
        return x + k
    return specialise(stage, {"shader": shader})


def place(directory: Path, name: str, days: float) -> Path:
    path = directory / name
    path.write_text("")
    os.utime(path, (time.time() - days * DAY,) * 2)
    return path


def clone_files(number: int) -> list[str]:
    base = f"dense.dense_bins_refsim_{number:020x}-12.py311"
    return [f"{base}.nbi", f"{base}.{number:032x}.nbc", f"{base}.1.nbc", f"{base}.nbi.tmp.00ff"]


FOREIGN = [
    "dense.cpython-311.pyc", "dense.dense_bins-12.py311.nbi", "dense.dense_bins-12.py311.1.nbc",
    f"dense.dense_bins_{KEY}-12.py311.nbi", f"dense.dense_bins_refsim_{KEY[:-1]}-12.py311.nbi",
    f"dense.dense_bins_refsim_{KEY}0-12.py311.nbi", f"dense.dense_bins_refsim_{KEY[:-1]}g-12.py311.nbi",
    f"dense.dense_bins_refsim_{KEY}-12.py311.nbi.bak", f"dense.dense_bins_refsim_{KEY}-12.py311.txt",
    f"dense.dense_bins_refsim_{KEY}.py311.nbi", f"dense.dense_bins_refsim_{KEY}", f"_refsim_{KEY}-12.py311.nbi",
    f"dense.dense_bins_refsim_{KEY}-12.py311.1.nbc.mine", "notes.txt",
]


@settings(max_examples=60, deadline=None)
@given(ages=st.lists(st.lists(st.integers(0, 60), min_size=4, max_size=4), max_size=6), limit=st.integers(1, 59),
       most=st.integers(0, 6))
def test_exactly_the_old_and_the_surplus_clones_go(tmp_path_factory: Any, ages: Any, limit: int, most: int) -> None:
    directory = tmp_path_factory.mktemp("cache")
    for name in FOREIGN:
        place(directory, name, 1000)
    for number, row in enumerate(ages):
        for name, age in zip(clone_files(number), row, strict=True):
            place(directory, name, age + number / 100)  # no two of the same age
    last_use = sorted((min(row) + number / 100, number) for number, row in enumerate(ages))
    kept = {number for age, number in last_use[:most] if age < limit}
    disk.prune(str(directory), limit, most)
    expected = {name for number in kept for name in clone_files(number)} | set(FOREIGN)
    assert {path.name for path in directory.iterdir()} == expected


def test_files_that_vanish_or_resist_are_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = (place(tmp_path, clone_files(n)[0], 100) for n in (1, 2))
    remove = os.unlink

    def unlink(path: str) -> None:
        if path == str(first):
            raise PermissionError(path)
        remove(path)
        remove(path)  # as if another process had been quicker

    monkeypatch.setattr(os, "unlink", unlink)
    disk.prune(str(tmp_path))
    assert first.exists()
    assert not second.exists()
    disk.prune(str(tmp_path / "nowhere"))


def call(k: float = 1.0, dtype: Any = np.float64) -> Any:
    made = kernel(k)
    columns = np.array([1.0], dtype)
    made(columns)
    assert columns[0] == 1.0 + k
    return made


def counts(made: Any) -> tuple[int, int]:
    return sum(made.stats.cache_hits.values()), sum(made.stats.cache_misses.values())


def test_a_miss_prunes_and_a_hit_touches(forget: Any) -> None:
    made = call()
    directory = Path(made.stats.cache_path)
    files = sorted(path for path in directory.iterdir() if path.name != turns.NAME)
    assert [path.suffix for path in files] == [".nbc", ".nbi"]
    old, young, foreign = (place(directory, *row) for row in (
        (clone_files(1)[0], disk.MAX_AGE_DAYS + 1), (clone_files(2)[0], disk.MAX_AGE_DAYS - 1), (FOREIGN[0], 1000)))
    for path in files:
        os.utime(path, (time.time() - 29 * DAY,) * 2)
    forget()
    assert counts(call()) == (1, 0)
    assert time.time() - files[1].stat().st_mtime < DAY
    assert old.exists()
    assert counts(call(2.0)) == (0, 1)
    assert (old.exists(), young.exists(), foreign.exists()) == (False, True, True)
    assert all(path.exists() for path in files)


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"", b"rubbish", None])
def test_damaged_files_are_replaced(suffix: str, content: bytes | None, forget: Any) -> None:
    directory = Path(call().stats.cache_path)
    [path] = directory.glob(f"*{suffix}")
    path.write_bytes(path.read_bytes()[:-20] if content is None else content)
    forget()
    assert counts(call()) == (0, 1)
    forget()
    assert counts(call()) == (1, 0)


def test_a_failing_write_leaves_the_kernel_working(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Any, *_: Any) -> None:
        raise OSError(28, "No space left on device")

    made = kernel()
    monkeypatch.setattr(type(made._cache._cache_file), "_save_data", refuse)
    columns = np.array([1.0])
    made(columns)
    assert columns[0] == 2.0


def test_code_for_other_arguments_is_never_overwritten(forget: Any) -> None:
    directory = Path(call().stats.cache_path)
    [index] = directory.glob("*.nbi")
    [data] = directory.glob("*.nbc")
    content = index.read_bytes(), data.read_bytes()
    index.unlink()  # another process reads the index before ours is written ...
    forget()
    assert counts(call(dtype=np.float32)) == (0, 1)
    index.write_bytes(content[0])  # ... and ours is written last
    assert data.read_bytes() == content[1]
    forget()
    assert counts(call()) == (1, 0)
