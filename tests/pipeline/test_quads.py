"""Quads: four corners, one rectangle, each pixel once.

Plan
- Any partition of the screen into rectangles is covered exactly once, whatever corner each begins with and whichever
  way round it goes.
- A full-screen quad covers each pixel once; its depth and its varyings are those of its first vertex.
- y points up in clip space: the upper half in clip space is the first rows.
- Quads that are no rectangle of the screen are refused in one sentence and nothing is drawn, in whichever slice they
  stand; quads of no width or height cover nothing; a quad with a corner outside the clip volume is clipped as a whole.
- Vertices left over after the last whole quad are ignored, in every instance.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline import rounds as rounds_module
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import DynamicState
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import POOL, Sprite, as_quads
from tests.pipeline.scenes import full_screen, planes, run, target_of, to_clip

QUADS = as_quads(POOL["nearest"])
WIDTH, HEIGHT = 24, 20


def quads(corners, *, width=WIDTH, height=HEIGHT, z=0.5):
    """A scene of quads at pixel coordinates [n, 4, 2]."""
    corners = np.asarray(corners, float)
    n = len(corners)
    scene = full_screen(width, height, base=[0.5] * (4 * n))
    flat = corners.reshape(-1, 2)
    scene.columns["position"] = to_clip(flat[:, 0], flat[:, 1], np.broadcast_to(z, 4 * n), 1.0, width, height)
    scene.columns["id"] = np.arange(1, 4 * n + 1)
    return scene


def rectangle(x0, y0, x1, y1, first=0, reverse=False):
    """Corners of a rectangle, from corner `first` on, either way round."""
    corners = np.roll([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], first, axis=0)
    return corners[::-1] if reverse else corners


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**31))
def test_a_partition_of_the_screen_covers_each_pixel_once(seed):
    rng = np.random.default_rng(seed)
    cuts_x = np.concatenate([[0], np.sort(rng.uniform(0, WIDTH, 3)), [WIDTH]])
    parts = []
    for x0, x1 in pairwise(cuts_x):
        cuts_y = np.concatenate([[0], np.sort(rng.uniform(0, HEIGHT, 3)), [HEIGHT]])
        for y0, y1 in pairwise(cuts_y):
            parts.append(rectangle(x0, y0, x1, y1, rng.integers(4), rng.random() < 0.5))
    framebuffer, counters = run(QUADS, quads(parts), loop="dense")
    assert (framebuffer.invocations == 1).all()
    assert counters["raster.primitives"] == 16 and counters["raster.clipped"] == 0


@pytest.mark.parametrize("first", range(4))
def test_a_full_screen_quad_takes_depth_and_varyings_from_its_first_vertex(first):
    scene = quads([rectangle(0, 0, WIDTH, HEIGHT, first)], z=[0.25, 0.5, 0.75, 1.0])
    framebuffer, counters = run(as_quads(POOL["counted"]), scene, loop="dense")
    assert (framebuffer.invocations == 1).all() and counters["raster.fragments"] == WIDTH * HEIGHT
    assert (framebuffer.color("id") == 1).all()
    assert (framebuffer.depth == np.floor(0.25 * (2**24 - 1) + 0.5)).all()


def test_y_points_up_in_clip_space():
    scene = quads([rectangle(0, 0, WIDTH, HEIGHT)])
    upper = np.array([[-1, 0, 0.5, 1], [1, 0, 0.5, 1], [1, 1, 0.5, 1], [-1, 1, 0.5, 1]], np.float32)
    scene.columns["position"] = upper
    framebuffer, _ = run(QUADS, scene, loop="dense")
    assert (framebuffer.invocations[: HEIGHT // 2] == 1).all() and (framebuffer.invocations[HEIGHT // 2 :] == 0).all()


CROOKED = {
    "a slanted edge": [[2, 2], [10, 2], [11, 9], [2, 9]],
    "a triangle": [[2, 2], [10, 2], [10, 9], [10, 9]],
    "a diamond": [[6, 2], [10, 6], [6, 10], [2, 6]],
    "a corner missing": [[2, 2], [10, 2], [10, 9], [10, 2]],
}


@pytest.mark.parametrize("corners", CROOKED.values(), ids=CROOKED)
@pytest.mark.parametrize("before", [0, 20])
def test_a_quad_that_is_no_rectangle_is_refused_and_nothing_drawn(corners, before, monkeypatch):
    monkeypatch.setattr(rounds_module, "ROUND_PRIMITIVES", 8)
    monkeypatch.setattr(rounds_module, "SMALLEST_SLICE", 8)
    scene = quads([rectangle(0, 0, WIDTH, HEIGHT)] * before + [corners])
    framebuffer, counters, taps = target_of(QUADS, scene), Counters(), Taps()
    with pytest.raises(InputError, match=r"1 quads? .*axis-aligned"):
        draw(QUADS, framebuffer=framebuffer, counters=counters, vertices=VertexBuffer.of(Sprite, **scene.columns),
             uniforms=scene.rules, textures=scene.images, threads=1, taps=taps)  # fmt: skip
    for name, plane in planes(target_of(QUADS, scene)).items():
        np.testing.assert_array_equal(planes(framebuffer)[name], plane, err_msg=name)
    assert not dict(counters) and not taps.vertex and not taps.fragment


FLAT = [
    ("control: a rectangle", rectangle(2, 2, 10, 9), "drawn"),
    ("no width", rectangle(2, 2, 2, 9), "empty"),
    ("no height", rectangle(2, 2, 10, 2), "empty"),
    ("a point", rectangle(2.5, 2.5, 2.5, 2.5), "empty"),
    ("between pixel centres", rectangle(2.625, 2, 3.375, 9), "empty"),
    ("a corner a pixel outside", rectangle(-1, 2, 10, 9), "clipped"),
    ("a corner that is no number", rectangle(np.nan, 2, 10, 9), "clipped"),
]


@pytest.mark.parametrize(("corners", "fate"), [row[1:] for row in FLAT], ids=[row[0] for row in FLAT])
def test_flat_and_clipped_quads(corners, fate):
    framebuffer, counters = run(QUADS, quads([corners]), loop="dense")
    assert counters[f"raster.{fate}"] == counters["raster.primitives"] == 1
    assert framebuffer.invocations.sum() == (8 * 7 if fate == "drawn" else 0)


@pytest.mark.parametrize("left_over", range(4))
def test_an_incomplete_last_quad_is_ignored_in_every_instance(left_over):
    scene = quads([rectangle(0, 0, 8, 8), rectangle(8, 8, 16, 16), rectangle(0, 0, 4, 4)])
    scene = scene._replace(dynamic=DynamicState())
    framebuffer, counters = run(QUADS, scene, loop="dense", instances=3, vertex_count=8 + left_over)
    assert (counters["raster.primitives"], counters["vertex.invocations"]) == (6, 3 * (8 + left_over))
    assert framebuffer.invocations.sum() == 3 * 128 and framebuffer.invocations.max() == 3
    assert set(np.unique(framebuffer.color("id"))) == {-7, 1, 5}  # of equal depths the first drawn stays
