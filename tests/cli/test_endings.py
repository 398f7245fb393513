"""Plan: however a call ends, it ends well.

- Help and version go to stdout with exit code 0, and load neither NumPy nor numba.
- A refusal is one line whatever it quotes; Ctrl-C is one line and 130; a bug keeps its traceback.
- What the system refuses, and an output that takes nothing, are one line and 2.
- A reader that went away is nothing to talk about.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

import refsim
from refsim.errors import InputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",), ("render", "--help"), ("reproduce", "--help")])
def test_help(arguments: tuple[str, ...], refsim_main) -> None:
    answer = refsim_main(*arguments)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("Usage: refsim")


def test_every_command_is_in_the_help(refsim_main) -> None:
    out = refsim_main("--help").out
    assert {"render", "scenes", "doctor", "reproduce"} <= set(out.split())


def test_version(refsim_main) -> None:
    assert refsim_main("--version").out == f"refsim {refsim.__version__}\n"


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("render", "--help"), ("render", "--size", "0")])
def test_instant_answers_load_nothing_heavy(arguments: tuple[str, ...]) -> None:
    program = f"import sys; from refsim.cli import main; main({arguments!r}); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment()
    )
    loaded = done.stderr.splitlines()[-1].split()
    assert "refsim.cli" in loaded
    assert not {"numpy", "numba", "trimesh", "scipy", "matplotlib", "rich", "PIL"} & set(loaded)


def test_interrupt(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(refsim, "render", interrupt)
    answer = refsim_main("render", "ray_engine", "room")
    assert (answer.code, answer.out, answer.err) == (130, "", "refsim: interrupted\n")


def test_a_refusal_of_several_lines_is_one_line(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_, **__):
        raise InputError("file 'a.ply' is wrong:\n  line 3\n")

    monkeypatch.setattr(refsim, "render", refuse)
    answer = refsim_main("render", "ray_engine", "room")
    assert (answer.code, answer.out, answer.err) == (2, "", "refsim: file 'a.ply' is wrong: line 3\n")


def test_a_bug_keeps_its_traceback(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    def stumble(*_, **__):
        raise ValueError("a bug, not an input")

    monkeypatch.setattr(refsim, "render", stumble)
    with pytest.raises(ValueError, match="a bug"):
        refsim_main("render", "ray_engine", "room")


@pytest.mark.parametrize("arguments", [("--help",), ("scenes",), ("doctor", "--json")])
def test_reader_that_went_away(arguments: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "refsim", *arguments]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, env=environment())
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("arguments", [("--help",), ("scenes",), ("doctor", "--json")])
def test_output_that_takes_nothing(arguments: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    # A file that is open for reading alone refuses as a full disk does, on every system
    with (tmp_path / "out").open() as out:
        command = [sys.executable, "-m", "refsim", *arguments]
        done = subprocess.run(command, stdout=out, stderr=subprocess.PIPE, text=True, env=environment())
    assert (done.returncode, done.stderr) == (2, "refsim: Bad file descriptor\n")


def test_the_system_s_refusal_is_one_line(refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    for error, sentence in (
        (PermissionError(errno.EACCES, "Permission denied", "a.ply"), "'a.ply': Permission denied"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError("file 'a.ply'\nends early"), "file 'a.ply' ends early"),
        (OSError(), "OSError"),
    ):
        monkeypatch.setattr(refsim, "render", Mock(side_effect=error))
        answer = refsim_main("render", "ray_engine", "room")
        assert (answer.code, answer.out, answer.err) == (2, "", f"refsim: {sentence}\n")


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}
