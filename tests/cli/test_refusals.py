"""Plan: whatever the command cannot do, it refuses in one line of stderr.

- A bad input gives exit code 2, exactly one line on stderr that names the culprit, nothing on stdout, and no file.
- The control row beside it differs only in that input, and gives 0.
- In a process of its own the refusal is the same: no traceback, no usage block.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import pytest

RENDER = ("render", "hierarchical_ray_engine", "cornell_box", "--size", "6", "--generations", "2", "--backend", "numpy")


def changed(**changes: str) -> tuple[str, ...]:
    """The control row with its method, scene or options changed; a name with value '' is an option without a value."""
    row = list(RENDER)
    for name, value in changes.items():
        option = "--" + name.replace("_", "-")
        if name in ("method", "scene"):
            row[("method", "scene").index(name) + 1] = value
        elif option in row:
            row[row.index(option) + 1] = value
        else:
            row += [option, value]
    return tuple(row)


# What is wrong, and what the sentence must name.
REFUSED = {
    "no such command": (("draw",), "draw"),
    "no such option": ((*RENDER, "--colour", "red"), "--colour"),
    "no method": (("render",), "METHOD"),
    "no scene": (("render", "ray_engine"), "SCENE"),
    "an argument too many": ((*RENDER, "surplus"), "surplus"),
    "option without value": ((*RENDER, "--out"), "--out"),
    "unknown method": (changed(method="ray_motor"), "ray_motor"),
    "unknown scene": (changed(scene="cornel_bocks"), "cornel_bocks"),
    "size 0": (changed(size="0"), "0"),
    "size -3": (changed(size="-3"), "-3"),
    "size 0 high": (changed(size="6x0"), "6x0"),
    "size of three": (changed(size="6x6x6"), "6x6x6"),
    "size in words": (changed(size="large"), "large"),
    "absurd size": (changed(size="1000000x1000000"), "1000000"),
    "generations in words": (changed(generations="few"), "few"),
    "generations 0": (changed(generations="0"), "generations"),
    "ior not a number": (changed(ior="nan"), "ior"),
    "ior negative": (changed(ior="-1"), "ior"),
    "unknown material": (changed(material="jelly"), "jelly"),
    "unknown environment": (changed(environment="dungeon"), "dungeon"),
    "unknown facing": (changed(facing="back"), "back"),
    "unknown shading": (changed(shading="cubist"), "cubist"),
    "unknown submission": (changed(submission="pixel"), "pixel"),
    "unknown early tests": (changed(early_tests="late"), "late"),
    "unknown errata": (changed(errata="E99"), "E99"),
    "unknown backend": (changed(backend="abacus"), "abacus"),
    "tile size 0": (changed(tile_size="0"), "tile_size"),
    "threads 0": (changed(threads="0"), "threads"),
    "view of two": (changed(view="1,2"), "1,2"),
    "view without direction": (changed(view="0,0,0"), "view"),
    "fov of 180": (changed(fov="180"), "fov"),
    "fill 0": (changed(fill="0"), "fill"),
    "an option of another method": (changed(method="ray_engine", tile_size="8"), "tile_size"),
    "mesh missing": (changed(scene="nowhere.ply"), "nowhere.ply"),
    "mesh corrupt": (changed(scene="corrupt.ply"), "corrupt.ply"),
    "mesh empty": (changed(scene="empty.ply"), "empty.ply"),
    "real mesh missing": (changed(scene="bunny"), "bunny"),
    "out in no directory": (changed(out="nowhere/image.png"), "nowhere/image.png"),
    "out in a file": (changed(out="corrupt.ply/image.png"), "corrupt.ply/image.png"),
    "out is a directory": (changed(out="folder.png"), "folder.png"),
    "out is no PNG": (changed(out="image.gif"), "image.gif"),
    "out empty": ((*RENDER, "--out", ""), "--out"),
    "folder empty": (("reproduce", "--quick", "--out", ""), "'--out': an empty name"),
    "folder of meshes empty": (("scenes", "fetch", "bunny", "--to", ""), "'--to': an empty name"),
    "paper unknown": (("reproduce", "xyz"), "xyz"),
    "figure unknown": (("reproduce", "hre", "--quick", "--only", "figure-99"), "figure-99"),
    "figure misspelt": (("reproduce", "hre", "--only", "figre-7"), "did you mean 'figure-7'?"),
    "figure of another paper": (("reproduce", "hre", "--only", "gsr-table-1"), "'gsr'"),
    "command unknown": (("nonsense",), "choose from render, scenes, doctor, reproduce"),
    "command misspelt": (("rendr",), "did you mean 'render'?"),
    "command of scenes misspelt": (("scenes", "fech"), "did you mean 'fetch'?"),
}

ACCEPTED = {
    "control": RENDER,
    "size of two": changed(size="6x4"),
    "ior": changed(ior="1.3"),
    "material": changed(material="mirror"),
    "facing": changed(facing="front"),
    "shading": changed(shading="smooth"),
    "submission": changed(submission="primitive"),
    "early tests": changed(early_tests="none"),
    "errata": changed(errata="as_printed"),
    "tile size": changed(tile_size="4"),
    "threads": changed(threads="1"),
    "view": changed(view="-1,0.5,2"),
    "fov and fill": changed(fov="60", fill="0.8"),
    "mesh": changed(scene="square.ply"),
    "out": changed(out="image.png"),
    "another method": changed(method="ray_engine"),
}

SQUARE = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-1 -1 0
1 -1 0
1 1 0
-1 1 0
3 0 1 2
3 0 2 3
"""


@pytest.fixture
def furnished(here: Path) -> Path:
    """A working directory with one good mesh, a corrupt and an empty one, and a directory named like a picture."""
    (here / "square.ply").write_text(SQUARE)
    (here / "corrupt.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n\x00\xff\x13")
    (here / "empty.ply").touch()
    (here / "folder.png").mkdir()
    return here


def assert_refused(answer, culprit: str) -> None:
    assert answer.code == 2, answer
    assert answer.out == ""
    assert answer.err.startswith("refsim: ") and answer.err.endswith("\n") and answer.err.count("\n") == 1, answer.err
    assert culprit in answer.err


@pytest.mark.parametrize("row", REFUSED)
def test_bad_input_is_refused_in_one_line(row: str, furnished: Path, refsim_main) -> None:
    arguments, culprit = REFUSED[row]
    before = sorted(furnished.rglob("*"))
    assert_refused(refsim_main(*arguments), culprit)
    assert sorted(furnished.rglob("*")) == before


def test_folder_of_meshes_that_is_none(furnished: Path, refsim_main, monkeypatch: pytest.MonkeyPatch) -> None:
    for place in ("nowhere", "square.ply"):
        monkeypatch.setenv("REFSIM_SCENES", place)
        before = sorted(furnished.rglob("*"))
        assert_refused(refsim_main("reproduce", "--quick"), f"REFSIM_SCENES names {place!r}")
        assert sorted(furnished.rglob("*")) == before


@pytest.mark.parametrize("row", ACCEPTED)
def test_control_row_passes(row: str, furnished: Path, refsim_main) -> None:
    before = set(furnished.rglob("*"))
    answer = refsim_main(*ACCEPTED[row])
    assert (answer.code, answer.err) == (0, "")
    (image,) = set(furnished.rglob("*")) - before
    assert image.suffix == ".png" and image.stat().st_size > 0


@pytest.mark.parametrize(
    "row", ["no such option", "unknown method", "unknown scene", "mesh corrupt", "out in no directory"]
)
def test_a_process_of_its_own_refuses_alike(row: str, furnished: Path, refsim_process) -> None:
    arguments, culprit = REFUSED[row]
    assert_refused(refsim_process(*arguments), culprit)


def test_directory_that_takes_no_file(furnished: Path, refsim_main) -> None:
    locked = furnished / "locked"
    locked.mkdir(mode=0o555)
    try:
        tempfile.TemporaryFile(dir=locked).close()
        # Modes do not bind the superuser; the process table takes a file from nobody.
        locked = Path("/proc" if sys.platform == "linux" else os.devnull)
    except PermissionError:
        pass
    assert_refused(refsim_main(*changed(out=str(locked / "image.png"))), str(locked))
