"""Plan: reproduce.sh goes from nothing but Python to the figures, and says what is missing.

Python itself is played by a small script that notes how it is called, so nothing is installed and nothing computed.

- No Python, an old one, one without venv, a failed installation: one sentence, exit code 2, and no stamp.
- Sound: venv, installation, doctor, reproduce, in this order and in the script's own folder; parameters are passed on.
- Again: nothing is installed, unless the code is newer, the installation was cut off or the folder moved; a failed
  run's code is kept.
- PYTHON is one word, and a relative REFSIM_SCENES is counted from where the script was called.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = "reproduce.sh"
# What a shell script needs of a machine; Python is not among it.
PROGRAMS = ("bash", "cat", "chmod", "dirname", "env", "find", "grep", "mkdir", "touch")

# Plays python: `-c` asks version or modules, `-m venv` makes an environment of copies, `-m pip` installs a command.
PYTHON = """#!/usr/bin/env bash
say() { echo "$(basename_of "$0") $*" >> "$NOTES"; }
basename_of() { echo "${1##*/}"; }
case "$1 $2" in
    "-c import sys"*) exit "${OLD:-0}" ;;
    "-c import venv"*) exit "${BARE:-0}" ;;
    "-m venv") say venv; mkdir -p .venv/bin; cat "$0" > .venv/bin/python; chmod +x .venv/bin/python ;;
    "-m pip") say pip; [ -z "${CUT:-}" ] || exit 1; cat "$COMMAND" > .venv/bin/refsim; chmod +x .venv/bin/refsim ;;
esac
"""
COMMAND = """#!/usr/bin/env bash
[ "$1" != --version ] || exit 0
echo "refsim $*" >> "$NOTES"
if [ "$1" = doctor ]; then echo "  meshes missing  bunny"; exit 1; fi
echo "in $PWD with ${REFSIM_SCENES:-no folder}"
exit "${DIFFERS:-0}"
"""


class Machine:
    """A checkout of two files and a PATH that holds PROGRAMS and a played python3."""

    def __init__(self, folder: Path) -> None:
        self.notes = folder / "notes"
        self.checkout = folder / "a checkout"
        (self.checkout / "refsim").mkdir(parents=True)
        shutil.copy(ROOT / SCRIPT, self.checkout)
        self.code = self.checkout / "refsim" / "cli.py"
        for path in (self.code, self.checkout / "pyproject.toml"):
            path.touch()
            os.utime(path, (1_000_000_000, 1_000_000_000))
        self.path = folder / "bin"
        self.path.mkdir()
        for name in PROGRAMS:
            (self.path / name).symlink_to(shutil.which(name))
        for name, text in {"python3": PYTHON, "command": COMMAND}.items():
            (self.path / name).write_text(text)
            (self.path / name).chmod(0o755)

    def run(self, *arguments: str, **changes: str) -> subprocess.CompletedProcess[str]:
        self.notes.write_text("")
        environment = {"PATH": str(self.path), "NOTES": str(self.notes), "COMMAND": str(self.path / "command")}
        script = [shutil.which("bash"), str(self.checkout / SCRIPT), *arguments]
        return subprocess.run(script, cwd=self.path, env={**environment, **changes}, capture_output=True, text=True)

    def done(self) -> list[str]:
        return self.notes.read_text().splitlines()


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


INSTALLS = ["python3 venv", "python pip"]
RUNS = ["refsim doctor", "refsim reproduce"]


def test_from_nothing_and_again(machine: Machine) -> None:
    first = machine.run()
    assert (first.returncode, first.stderr, machine.done()) == (0, "", INSTALLS + RUNS)
    assert "meshes missing  bunny" in first.stdout and f"in {machine.checkout}" in first.stdout
    again = machine.run("--quick")
    assert (again.returncode, machine.done()) == (0, ["refsim doctor", "refsim reproduce --quick"])


def test_newer_code_is_installed(machine: Machine) -> None:
    machine.run()
    os.utime(machine.code, (4_000_000_000, 4_000_000_000))
    assert (machine.run().returncode, machine.done()) == (0, INSTALLS + RUNS)


def test_a_moved_folder_is_installed_anew(machine: Machine) -> None:
    """What pip writes names the interpreter by its path, which leads nowhere once the folder has another name."""
    machine.run()
    program = machine.checkout / ".venv" / "bin" / "refsim"
    program.write_text(f"#!{machine.checkout.parent}/before/.venv/bin/python\n")
    assert os.access(program, os.X_OK)
    assert (machine.run().returncode, machine.done()) == (0, INSTALLS + RUNS)


def test_a_python_in_a_folder_with_a_space(machine: Machine) -> None:
    named = machine.checkout / "python of mine"
    named.write_text(PYTHON)
    named.chmod(0o755)
    assert (machine.run(PYTHON=str(named)).returncode, machine.done()[0]) == (0, "python of mine venv")


@pytest.mark.parametrize("scenes", ["meshes of mine", "../meshes", "", "ABSOLUTE"])
def test_meshes_are_found_from_where_one_is(machine: Machine, scenes: str) -> None:
    folder = scenes.replace("ABSOLUTE", str(machine.checkout))
    meant = str(machine.path / folder) if folder else "no folder"
    assert f"in {machine.checkout} with {meant}\n" in machine.run(REFSIM_SCENES=folder).stdout


def test_compiled_kernels_are_no_newer_code(machine: Machine) -> None:
    machine.run()
    kernel = machine.code.parent / "__pycache__" / "kernel.nbi"
    kernel.parent.mkdir()
    kernel.touch()
    os.utime(kernel, (4_000_000_000, 4_000_000_000))
    machine.run()
    assert machine.done() == RUNS


def test_the_code_of_the_run_is_kept(machine: Machine) -> None:
    assert machine.run(DIFFERS="1").returncode == 1


def test_failed_installation_is_tried_again(machine: Machine) -> None:
    cut = machine.run(CUT="yes")
    assert (cut.returncode, machine.done()) == (2, INSTALLS)
    assert cut.stderr.count("\n") == 1 and "is there a network?" in cut.stderr
    assert (machine.run().returncode, machine.done()) == (0, INSTALLS + RUNS)


# What is wrong with the machine, and what the sentence must say.
LACKS = {
    "no Python": ({"PYTHON": "python-of-nowhere"}, "no Python 3.11 or newer is found as python-of-nowhere"),
    "an old Python": ({"OLD": "1"}, "no Python 3.11 or newer is found; install one"),
    "no venv": ({"BARE": "1"}, "python3-venv"),
}


@pytest.mark.parametrize("row", LACKS)
def test_what_is_missing_is_said(row: str, machine: Machine) -> None:
    changes, sentence = LACKS[row]
    refused = machine.run(**changes)
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n"), machine.done()) == (2, "", 1, [])
    assert sentence in refused.stderr
    assert not (machine.checkout / ".venv").exists()


def test_the_version_asked_for_is_the_package_s() -> None:
    text = (ROOT / SCRIPT).read_text(encoding="utf-8")
    assert "sys.version_info < (3, 11)" in text
    assert 'requires-python = ">=3.11"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert os.access(ROOT / SCRIPT, os.X_OK) or sys.platform == "win32"
