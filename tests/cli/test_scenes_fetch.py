"""Plan: `refsim scenes fetch` says what it fetched, from where and on what terms; `refsim scenes` lists as ever.

- Fetched, then found there; the terms are printed both times, and the list has the mesh afterwards.
- What cannot be done is one line on stderr and 2, an interruption 130; the folder is as before.
- Help loads neither NumPy nor pooch.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from refsim.scene import fetch
from refsim.scene.archives import ORIGINALS
from tests.scene.archive_server import WANTED, known_at, serving


@pytest.fixture
def archive(here: Path, monkeypatch: pytest.MonkeyPatch):
    with serving() as server:
        url = f"http://127.0.0.1:{server.server_port}/good.tar.gz"
        known_at(monkeypatch, url)
        yield url


def test_fetched_and_then_there(archive: str, here: Path, refsim_main, monkeypatch) -> None:
    for said in ("fetched and checked", "was there already"):
        answer = refsim_main("scenes", "fetch", "stone", "--to", "meshes")
        assert (answer.code, answer.err) == (0, "")
        for words in (said, archive, "the mason", "free for all", "Stone, a made-up archive"):
            assert words in answer.out
    assert (here / "meshes" / "stone.ply").read_bytes() == WANTED
    monkeypatch.setenv("REFSIM_SCENES", "meshes")
    assert "stone" in refsim_main("scenes").out.split()
    assert "cornell_box" in json.dumps(json.loads(refsim_main("scenes", "--json").out))


def test_several_and_the_cache(archive: str, here: Path, refsim_main) -> None:
    answer = refsim_main("scenes", "fetch", "stone", "pebble")
    assert (answer.code, answer.err, answer.out.count("fetched and checked")) == (0, "", 2)
    for name in ("stone", "pebble"):
        assert (here / "cache" / f"{name}.ply").read_bytes() == WANTED
    assert {"stone", "pebble"} <= set(refsim_main("scenes").out.split())
    assert str(here / "cache") in refsim_main("doctor").out


def test_wrong_file_needs_force(archive: str, here: Path, refsim_main) -> None:
    (here / "stone.ply").write_bytes(b"mine")
    answer = refsim_main("scenes", "fetch", "stone", "--to", ".")
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1) and "--force" in answer.err
    assert (here / "stone.ply").read_bytes() == b"mine"
    assert refsim_main("scenes", "fetch", "stone", "--to", ".", "--force").code == 0
    assert (here / "stone.ply").read_bytes() == WANTED


REFUSED = {
    "no name": ((), "NAME"),
    "unknown name": (("stoen", "--to", "new"), "stoen"),
    "no original": (("suzanne", "--to", "new"), "suzanne"),
    "unseen": (("stone", "happy_buddha", "--to", "new"), "happy_buddha"),
    "a file for a folder": (("stone", "--to", "taken"), "taken"),
    "unknown option": (("stone", "--form", "new"), "--form"),
}


@pytest.mark.parametrize("row", REFUSED)
def test_refusals_are_one_line(row: str, archive: str, here: Path, refsim_main) -> None:
    arguments, culprit = REFUSED[row]
    (here / "taken").touch()
    answer = refsim_main("scenes", "fetch", *arguments)
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1) and culprit in answer.err
    assert list(here.iterdir()) == [here / "taken"]


def test_unknown_subcommand(refsim_main) -> None:
    answer = refsim_main("scenes", "fetsch")
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1) and "fetsch" in answer.err


def test_interrupt(archive: str, here: Path, refsim_main, monkeypatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(fetch, "_content", interrupt)
    answer = refsim_main("scenes", "fetch", "stone", "--to", "new")
    assert (answer.code, answer.out, answer.err) == (130, "", "refsim: interrupted\n")
    assert list(here.iterdir()) == []


def test_help_loads_nothing_heavy() -> None:
    program = "import sys; from refsim.cli import main; main(('scenes', 'fetch', '--help')); print(*sys.modules)"
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout.startswith("Usage: refsim scenes fetch")
    assert set(ORIGINALS) <= set(re.findall(r"\w+", done.stdout))
    assert not {"numpy", "pooch", "requests", "trimesh"} & set(done.stdout.splitlines()[-1].split())
