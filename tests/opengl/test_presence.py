"""The witness is there, or its absence is told.

Plan
- It is there, and is what `refsim doctor` says. Where REFSIM_WITNESS=required this test fails without it.
- Without moderngl no test of this room exists, nothing fails, and the summary gives the reason; if the witness is
  required, one test fails.
- Its conventions can be refsim's: clip origin, depth range, 8 sub-pixel bits or some.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.opengl.conftest import FOUND

ROOT = Path(__file__).resolve().parents[2]


def test_the_witness_is_there():
    assert FOUND["present"], FOUND["reason"]


@pytest.mark.parametrize(("required", "code", "said"), [("", 5, "no tests ran"), ("required", 1, "1 failed")])
def test_absence_is_told(tmp_path, required, code, said):
    (tmp_path / "moderngl.py").write_text("raise ImportError\n")
    places = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "tests/opengl", "-q", "-k", "not absence", "-p", "no:cacheprovider"],
        cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": places, "REFSIM_WITNESS": required},
    )  # fmt: skip
    assert done.returncode == code, done.stdout
    assert "OpenGL witness: absent (the package moderngl is not installed)" in done.stdout and said in done.stdout


def test_the_driver_has_what_is_asked_of_it(witness):
    assert witness.renderer == FOUND["renderer"] and FOUND["version"] == witness.version
    assert witness.subpixel_bits >= 4  # OpenGL's least
