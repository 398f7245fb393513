"""Plan: `refsim render` hands over what was given, writes one picture whole or not at all, and prints what was counted.

- Only the options on the command line reach the method, under their Python names and types.
- The picture is the image in sRGB, row 0 on top; its default name is the scene's.
- `--json` prints one object with the counters; without it a person can read them.
- A destination that cannot be written is refused before the method runs; a write that fails leaves the older picture.
- The real thing: the command's picture and counters are those of `refsim.render`.
"""

from __future__ import annotations

import errno
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import refsim
from refsim.image import encode_srgb

GRADIENT = np.linspace(0, 1, 3 * 4 * 3, dtype=np.float32).reshape(3, 4, 3)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[tuple, dict]]:
    """Put a method that renders a gradient in place of all; the list collects how it was called."""
    made: list[tuple[tuple, dict]] = []

    def render(*args, **options):
        made.append((args, options))
        return SimpleNamespace(rgb=GRADIENT, trace=SimpleNamespace(counters={"fragment.written": np.int64(12345)}))

    monkeypatch.setattr(refsim, "render", render)
    return made


@pytest.mark.parametrize(
    ("given", "size", "options"),
    [
        ((), (256, 256), {}),
        (("--size", "64"), (64, 64), {}),
        (("--size", "320x240"), (320, 240), {}),
        (("--generations", "3", "--ior", "1.25"), (256, 256), {"generations": 3, "ior": 1.25}),
        (
            ("--material", "mirror", "--environment", "sky.png"),
            (256, 256),
            {"material": "mirror", "environment": "sky.png"},
        ),
        (("--facing", "front", "--shading", "smooth"), (256, 256), {"facing": "front", "shading": "smooth"}),
        (
            ("--view", "-1,0.5,2", "--fov", "60", "--fill", "0.5"),
            (256, 256),
            {"view": (-1.0, 0.5, 2.0), "fov": 60.0, "fill": 0.5},
        ),
        (("--tile-size", "8", "--submission", "tile"), (256, 256), {"tile_size": 8, "submission": "tile"}),
        (
            ("--early-tests", "mesa", "--errata", "as_printed"),
            (256, 256),
            {"early_tests": "mesa", "errata": "as_printed"},
        ),
        (("--backend", "numpy", "--threads", "0"), (256, 256), {"backend": "numpy", "threads": 0}),
    ],
)
def test_only_what_was_given_reaches_the_method(given, size, options, calls, refsim_main) -> None:
    assert refsim_main("render", "ray_engine", "room", *given).code == 0
    assert calls == [(("ray_engine", "room", *size), options)]


@pytest.mark.parametrize(
    ("scene", "given", "name"),
    [
        ("room", (), "room.png"),
        ("some/where/mesh.v2.ply", (), "mesh.v2.png"),
        ("room", ("--out", "a.png"), "a.png"),
        ("room", ("--out", "A.PNG"), "A.PNG"),
    ],
)
def test_picture_is_the_image_in_srgb(scene, given, name, calls, here: Path, refsim_main) -> None:
    assert refsim_main("render", "ray_engine", scene, *given).code == 0
    assert [path.name for path in here.iterdir()] == [name]
    with Image.open(name) as picture:
        assert (picture.format, picture.mode) == ("PNG", "RGB")
        np.testing.assert_array_equal(np.asarray(picture), encode_srgb(GRADIENT))


def test_json_is_one_object(calls, refsim_main) -> None:
    report = json.loads(refsim_main("render", "ray_engine", "room", "--size", "4x3", "--ior", "1.25", "--json").out)
    assert set(report.pop("seconds")) == {"render", "write"}
    assert report == {
        "method": "ray_engine",
        "scene": "room",
        "width": 4,
        "height": 3,
        "options": {"ior": 1.25},
        "counters": {"fragment.written": 12345},
        "image": "room.png",
    }


def test_summary_is_for_people(calls, refsim_main) -> None:
    first, counter = refsim_main("render", "ray_engine", "room", "--size", "4x3").out.splitlines()
    assert first.startswith("ray_engine on room, 4 x 3: room.png in ")
    assert counter.split() == ["fragment.written", "12,345", "fragments"]


@pytest.mark.parametrize("out", ["nowhere/image.png", "image.gif", "folder.png"])
def test_destination_is_checked_before_the_work(out, calls, here: Path, refsim_main) -> None:
    (here / "folder.png").mkdir()
    assert refsim_main("render", "ray_engine", "room", "--out", out).code == 2
    assert calls == []


@pytest.mark.parametrize("step", ["PIL.Image.Image.save", "os.replace"])
def test_failed_write_leaves_the_older_picture(step, calls, here: Path, refsim_main, monkeypatch) -> None:
    (here / "room.png").write_bytes(b"older")

    def fail(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(step, fail)
    answer = refsim_main("render", "ray_engine", "room")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err == "refsim: cannot write the image 'room.png': No space left on device\n"
    assert [path.name for path in here.iterdir()] == ["room.png"]
    assert (here / "room.png").read_bytes() == b"older"


def test_interrupted_write_leaves_the_older_picture(calls, here: Path, refsim_main, monkeypatch) -> None:
    (here / "room.png").write_bytes(b"older")

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", interrupt)
    assert refsim_main("render", "ray_engine", "room").code == 130
    assert [(path.name, path.read_bytes()) for path in here.iterdir()] == [("room.png", b"older")]


def test_command_does_what_the_function_does(here: Path, refsim_process) -> None:
    answer = refsim_process("render", "hierarchical_ray_engine", "cornell_box", "--size", "24x20", "--json")
    assert (answer.code, answer.err) == (0, "")
    image = refsim.render("hierarchical_ray_engine", "cornell_box", 24, 20)
    assert json.loads(answer.out)["counters"] == {name: int(count) for name, count in image.trace.counters.items()}
    with Image.open(here / "cornell_box.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), encode_srgb(image.rgb))
