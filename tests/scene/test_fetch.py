"""Plan: a mesh is fetched whole and checked, or the folder stays as it was.

- From a tar archive, a compressed file, one that the transfer has unpacked already, and one that is inside out: the
  bytes are those that the known SHA-256 is of, and the folder holds nothing else.
- A right file is left alone and nobody is asked; a wrong one stays, unless it is to be replaced.
- Several at once: an archive that they share is asked for once, and one wrong name stops them before the first.
- Each thing that may go wrong is one sentence that names it; folder, old file and folders above are as before. Nothing
  of an archive lands where its names lead, and a small one that swells is refused.
- Without REFSIM_SCENES meshes go to the user's cache, and are found there.
"""

from __future__ import annotations

import errno
import io
import os
import socket
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from refsim.errors import InputError
from refsim.scene import download, fetch, load_scene
from refsim.scene.fetch import Fetched, fetch_meshes
from refsim.scene.known import find_mesh
from tests.scene.archive_server import FACES, STONE, VERTICES, WANTED, known_at, serving


@pytest.fixture(scope="module")
def server():
    with serving() as running:
        yield running


@pytest.fixture
def base(server) -> str:
    server.asked.clear()
    return f"http://127.0.0.1:{server.server_port}"


def fetch_mesh(name: str, folder: Path | None = None, **options: object) -> Fetched:
    (got,) = fetch_meshes([name], folder, **options)
    return got


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


RIGHT = ("good.tar.gz", "sly.tar.gz", "good.ply.gz", "coded/good.tar.gz", "coded/good.ply.gz")


@pytest.mark.parametrize("archive", RIGHT)
def test_fetched_mesh_is_the_known_one(archive: str, base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/{archive}")
    got = fetch_mesh("stone", tmp_path / "scenes" / "new")
    assert (got.already_there, got.mesh) == (False, STONE)
    assert contents(tmp_path) == {**dict.fromkeys(map(str, got.path.parents[:2])), str(got.path): WANTED}
    np.testing.assert_array_equal(load_scene(got.path).triangles, VERTICES[FACES])


def test_mesh_inside_out_is_turned(base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/turned.ply.gz", turned=True)
    assert fetch_mesh("stone", tmp_path).path.read_bytes() == WANTED
    known_at(monkeypatch, f"{base}/turned.ply.gz")
    with pytest.raises(InputError, match="SHA-256"):
        fetch_mesh("stone", tmp_path / "other")


def test_folder_of_the_environment(base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    monkeypatch.setenv("REFSIM_SCENES", str(tmp_path))
    assert fetch_mesh("stone").path == tmp_path / "stone.ply"


def test_cache_of_the_user(base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    monkeypatch.setenv("REFSIM_SCENES", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    assert find_mesh("stone") is None
    assert fetch_mesh("stone").path == tmp_path / "mine" / "refsim" / "scenes" / "stone.ply"
    assert load_scene("stone").name == "stone" and find_mesh("stone").read_bytes() == WANTED
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert find_mesh("stone") is None
    assert fetch_mesh("stone").path == tmp_path / "home" / ".cache" / "refsim" / "scenes" / "stone.ply"
    monkeypatch.setenv("REFSIM_SCENES", str(tmp_path / "empty"))
    assert find_mesh("stone") is None


def test_user_without_a_home(base: str, server, monkeypatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    known_at(monkeypatch, f"{base}/good.tar.gz")
    monkeypatch.setenv("REFSIM_SCENES", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(Path, "home", homeless)
    with pytest.raises(InputError, match="no folder for meshes: set REFSIM_SCENES"):
        fetch_mesh("stone")
    assert find_mesh("stone") is None and server.asked == []


def test_several_share_an_archive(base: str, server, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    got = list(fetch_meshes(["pebble", "stone", "pebble"], tmp_path))
    assert [(each.path.name, each.already_there) for each in got] == [("pebble.ply", False), ("stone.ply", False)]
    assert contents(tmp_path) == {str(tmp_path / f"{name}.ply"): WANTED for name in ("pebble", "stone")}
    assert server.asked == ["/good.tar.gz"]
    (tmp_path / "stone.ply").unlink()
    assert [each.already_there for each in fetch_meshes(["pebble", "stone"], tmp_path)] == [True, False]


def test_one_wrong_name_stops_all(base: str, server, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    with pytest.raises(InputError, match="did you mean pebble"):
        list(fetch_meshes(["stone", "peble"], tmp_path))
    assert (contents(tmp_path), server.asked) == ({}, [])


def test_what_came_before_a_failure_stays(base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    coming = fetch_meshes(["stone", "pebble"], tmp_path / "new")
    assert next(coming).path.read_bytes() == WANTED
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match="the disk is full"):
        next(coming)
    assert contents(tmp_path) == {str(tmp_path / "new"): None, str(tmp_path / "new" / "stone.ply"): WANTED}


def test_right_file_is_left_alone(base: str, server, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    monkeypatch.setitem(sys.modules, "pooch", None)  # not even needed
    (tmp_path / "stone.ply").write_bytes(WANTED)
    before = (tmp_path / "stone.ply").stat()
    for force in (False, True):
        assert fetch_mesh("stone", tmp_path, force=force).already_there
    assert (tmp_path / "stone.ply").stat().st_mtime_ns == before.st_mtime_ns and server.asked == []


def test_wrong_file_is_replaced_only_if_told(base: str, server, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    (tmp_path / "stone.ply").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"stone\.ply.*--force"):
        fetch_mesh("stone", tmp_path)
    assert (tmp_path / "stone.ply").read_bytes() == b"mine" and server.asked == []
    fetch_mesh("stone", tmp_path, force=True)
    assert contents(tmp_path) == {str(tmp_path / "stone.ply"): WANTED}


# What the server has, and what the sentence must say.
WRONG = {
    "linked.tar.gz": r"has no file 'stone/reconstruction/stone\.ply'",
    "looped.tar.gz": r"has no file 'stone/reconstruction/stone\.ply'",
    "swollen.ply.gz": r"swells to more than 8,000 bytes",
    "swollen.tar.gz": r"swells to more than 8,000 bytes",
    "moved.tar.gz": r"does not hold the mesh 'stone': its SHA-256 is not",
    "fewer.tar.gz": r"89 triangles and 60 vertices, not 90 and 60",
    "empty.tar.gz": r"has no file 'stone/reconstruction/stone\.ply'",
    "truncated.tar.gz": r"broken or cut off",
    "truncated.ply.gz": r"broken or cut off",
    "page.tar.gz": r"broken or cut off",
    "nonsense.tar.gz": r"not a PLY file",
    "cut/good.tar.gz": r"the download of .* was cut off",
    "cut/good.ply.gz": r"the download of .* was cut off",
    "stalled/good.tar.gz": r"the download of .* was cut off",
    "silent/good.tar.gz": r"the server does not answer in time",
    "absent.tar.gz": r"the server answers 404",
}


@pytest.mark.parametrize("archive", WRONG)
@pytest.mark.parametrize("old", [False, True])
def test_wrong_answers_change_nothing(archive: str, old: bool, base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/{archive}")
    monkeypatch.setattr(fetch, "LARGEST", 8_000)
    monkeypatch.setattr(download, "TIMEOUT", 0.3)
    folder = tmp_path / "a" / "b"
    if old:
        folder.mkdir(parents=True)
        (folder / "stone.ply").write_bytes(b"mine")
    before = contents(tmp_path)
    with pytest.raises(InputError, match=WRONG[archive]):
        fetch_mesh("stone", folder, force=True)
    assert contents(tmp_path) == before


def test_no_network(tmp_path: Path, monkeypatch) -> None:
    with socket.socket() as taken:  # bound and not listening: whoever calls is turned away
        taken.bind(("127.0.0.1", 0))
        known_at(monkeypatch, f"http://127.0.0.1:{taken.getsockname()[1]}/good.tar.gz")
        with pytest.raises(InputError, match="cannot be reached"):
            fetch_mesh("stone", tmp_path)
    assert contents(tmp_path) == {}


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class FullFile(io.FileIO):
    write = full


@pytest.mark.parametrize("moment", ["download", "mesh"])
def test_full_disk(moment: str, base: str, tmp_path: Path, monkeypatch) -> None:
    import pooch.downloaders

    known_at(monkeypatch, f"{base}/good.tar.gz")
    if moment == "download":
        monkeypatch.setattr(pooch.downloaders, "open", FullFile, raising=False)
    else:
        monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"stone.*the disk is full"):
        fetch_mesh("stone", tmp_path / "new")
    assert contents(tmp_path) == {}


def test_folder_that_takes_no_file(base: str, server, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    (tmp_path / "file").touch()
    (tmp_path / "stone.ply").mkdir()
    # The process table takes a file from nobody, the superuser included.
    for folder in ([Path("/proc")] if sys.platform == "linux" else []) + [tmp_path / "file", tmp_path / "file" / "new"]:
        with pytest.raises(InputError, match=f"stone cannot be put into folder '{folder}'"):
            fetch_mesh("stone", folder)
    with pytest.raises(InputError, match="is a folder"):
        fetch_mesh("stone", tmp_path)
    assert server.asked == []


@pytest.mark.parametrize("moment", ["advance", "replace"])
def test_interrupted(moment: str, base: str, tmp_path: Path, monkeypatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    @contextmanager
    def progress(total, description):
        yield interrupt if moment == "advance" else lambda steps=1: None

    known_at(monkeypatch, f"{base}/good.tar.gz")
    if moment == "replace":
        monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        fetch_mesh("stone", tmp_path / "new", progress=progress)
    assert contents(tmp_path) == {}


def test_pooch_itself_says_nothing(base: str, tmp_path: Path, monkeypatch) -> None:
    import pooch

    said: list[str] = []
    monkeypatch.setattr(pooch.get_logger(), "handle", lambda record: said.append(record.getMessage()))
    pooch.get_logger().setLevel("INFO")
    known_at(monkeypatch, f"{base}/good.tar.gz")
    fetch_mesh("stone", tmp_path)
    assert said == []


def test_progress_counts_the_bytes(base: str, tmp_path: Path, monkeypatch) -> None:
    told: list[float] = []

    @contextmanager
    def progress(total, description):
        assert (total, description) == (None, "fetching stone, bytes")
        yield lambda steps=1: told.append(steps)

    known_at(monkeypatch, f"{base}/good.tar.gz")
    fetch_mesh("stone", tmp_path, progress=progress)
    assert told and all(step > 0 for step in told)


def test_without_pooch(base: str, tmp_path: Path, monkeypatch) -> None:
    known_at(monkeypatch, f"{base}/good.tar.gz")
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(InputError, match=r"pip install 'refsim\[fetch\]'"):
        fetch_mesh("stone", tmp_path / "new")
    assert contents(tmp_path) == {}
