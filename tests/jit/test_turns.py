"""Plan: processes that want one kernel at once compile it once, and none waits for ever.

- Of two cold processes that start together each kernel is compiled by one and loaded by the other; both compute the
  same, and a third compiles nothing.
- A turn ends with the kernel saved, with a kernel that does not compile, and with the process, however it dies.
- Who has waited long enough, and who has no locks, compiles.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.errors import NumbaError

from refsim.jit import func, specialise, turns

ROOT = Path(__file__).resolve().parents[2]

SCRIPT = '''
import json, sys, time
from pathlib import Path
import numpy as np
from refsim.jit import func, specialise

KERNELS = 4


def stage(columns):
    for i in range(columns.size):
        columns[i] = shader(columns[i]) + AMOUNT


@func
def shader(x):
    return x * 2.0 + 1.0


here, name = Path(sys.argv[1]), sys.argv[2]
(here / name).touch()
while not (here / "go").exists():
    time.sleep(0.001)
found = {"values": [], "loaded": 0, "compiled": 0}
for k in range(KERNELS):
    for dtype in (np.float32, np.float64):
        kernel = specialise(stage, {"shader": shader, "AMOUNT": float(k)})
        columns = np.arange(3, dtype=dtype)
        kernel(columns)
        found["values"].append(columns.tolist())
    found["loaded"] += sum(kernel.stats.cache_hits.values())
    found["compiled"] += sum(kernel.stats.cache_misses.values())
print(json.dumps(found))
'''


def stage(columns: Any) -> None:
    for i in range(columns.size):
        columns[i] = shader(columns[i])  # type: ignore[name-defined]  # noqa: F821


@func
def twice(x: float) -> float:
    return x + x


@func
def wrong(x: float) -> float:
    return x + "one"


def start(script: Path, here: Path, name: str, cache: Path) -> subprocess.Popen[str]:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(script), str(here), name]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def told(process: subprocess.Popen[str]) -> Any:
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return json.loads(out)


def test_two_cold_processes_compile_each_kernel_once(tmp_path: Path, cache: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    both = [start(script, tmp_path, name, cache) for name in ("a", "b")]
    while not ((tmp_path / "a").exists() and (tmp_path / "b").exists()):
        assert all(process.poll() is None for process in both)
        time.sleep(0.01)
    (tmp_path / "go").touch()
    first, second = map(told, both)
    assert first["values"] == second["values"]
    assert first["compiled"] + second["compiled"] == 8 == first["loaded"] + second["loaded"]
    third = told(start(script, tmp_path, "c", cache))
    assert (third["loaded"], third["compiled"], third["values"]) == (8, 0, first["values"])


def test_turn_ends_with_the_kernel() -> None:
    specialise(stage, {"shader": twice})(np.array([1.0]))
    assert turns._held == []
    with pytest.raises(NumbaError):
        specialise(stage, {"shader": wrong})(np.array([1.0]))
    assert turns._held == []


HOLDER = "from refsim.jit import turns; turns.take_turn({!r}, 'k'); print('held', flush=True); input()"


def test_turn_ends_with_its_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = HOLDER.format(str(tmp_path))
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        monkeypatch.setattr(turns, "PATIENCE_S", 0.1)
        turns.take_turn(str(tmp_path), "k")
        assert turns._held == []  # another has it, and patience has ended
        turns.take_turn(str(tmp_path), "other")
        assert len(turns._held) == 1
        monkeypatch.setattr(turns, "PATIENCE_S", 60.0)
        holder.kill()
        turns.take_turn(str(tmp_path), "k")
        assert len(turns._held) == 1
    turns.end_turn()


def test_without_locks_everyone_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    turns.take_turn(str(tmp_path / "file"), "k")  # no directory, no file in it
    assert turns._held == []
    monkeypatch.setattr(turns, "fcntl", None)
    turns.take_turn(str(tmp_path / "new"), "k")
    assert turns._held == [] and not (tmp_path / "new").exists()
