"""Plan: rows do not depend on the processor. What it could change is taken away, and the committed rows come again.

- NumPy without its vectorised kernels (whose arc tangents and logarithms have other bits), OpenBLAS for an old
  processor, and numba for the plainest processor of its family (of x86-64 one without fused multiply-add, and with
  vectors of four): the rows of figures that measure angles, build structures and trace rays are those committed.
- That NumPy then works otherwise, or has nothing to switch off, is asked too: else the test would prove nothing.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Each measures angles of cones, in the engine and in its twin; the last two fit and search in float64
FIGURES = ("glass-mirrors", "figure-2", "figure-3", "tightest-cone", "bsh-equations", "gsr-equations")
PROGRAM = """
import json, sys
from pathlib import Path

import numpy
from refsim.experiments import ledger, topics
from refsim.experiments.outcome import Outcome

known = {experiment.id: experiment for own in topics.TOPICS.values() for experiment in own}
found = {}
for name in sys.argv[1:]:
    cases = [case for case in known[name].cases(True) if case.get("mesh", "made") == "made"][:2]
    found[name] = {json.dumps(case, sort_keys=True): known[name].measure(**case) for case in cases}
differs = ledger.judge(Outcome(True, Path(), cases=found, tables={})).differs
# A float32 arc tangent, which has one value in NumPy's vectorised kernel and another in the system's library
x = numpy.linspace(0.1, 1.0, 1001, dtype=numpy.float32)
print(json.dumps({"differs": [line for line in differs if "other rows" in line], "cases": sum(map(len, found.values())),
                  "arc_tangents": numpy.arctan2(x, numpy.float32(1) - x).tobytes().hex()}))
"""


def ran(figures: tuple[str, ...], **changes: str) -> dict[str, object]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **changes}
    command = [sys.executable, "-c", PROGRAM, *figures]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def dispatched() -> list[str]:
    """What NumPy would use of this processor beyond what it was built for."""
    import numpy as np

    umath = np._core._multiarray_umath
    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]]


@pytest.mark.parametrize("figure", FIGURES)
def test_rows_of_an_old_numpy_kernel(figure: str) -> None:
    found = ran((figure,), NPY_DISABLE_CPU_FEATURES=" ".join(dispatched()), OPENBLAS_CORETYPE="Nehalem")
    assert found["cases"] and found["differs"] == []


def test_switching_off_changes_numpy() -> None:
    wide = {name for name in dispatched() if name.startswith(("AVX512", "X86_V4"))}
    before, after = (ran((), NPY_DISABLE_CPU_FEATURES=off)["arc_tangents"] for off in ("", " ".join(dispatched())))
    assert (before != after) == bool(wide)


def test_rows_of_the_oldest_processor(tmp_path: Path) -> None:
    """The smallest run with all stages at work; its kernels are compiled anew."""
    found = ran(("figure-2",), NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    assert found["cases"] and found["differs"] == []
