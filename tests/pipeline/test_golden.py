"""One small fixed scene: its counters and its picture, as numbers.

Plan
- Sprites and quads on whole and half pixels, drawn by four pipelines one after the other into one target: every counter
  and a checksum of every plane, the same in both loops.
- The numbers are those of the pipeline restated in Python.
- The scene is not trivial: every kind of fate occurs.
"""

import zlib
from collections import Counter

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import DynamicState, ScissorRect
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import POOL, TARGETS, Flat, Images, Rules, Sprite, as_quads, ruled_twin
from tests.pipeline.scenes import planes, to_clip
from tests.pipeline.slow_pipeline import slow_draw

WIDTH, HEIGHT = 32, 16  # powers of two: clip positions are exact
STEPS = [
    ("nearest", 3, None),
    ("marked", 2, ScissorRect(3, 2, 25, 13)),
    ("marked", 5, None),
    ("marked, forced", 4, None),
]

COUNTERS = {
    "draw.calls": 8,
    "vertex.invocations": 200, "assembly.primitives": 140,
    "raster.primitives": 140,
    "raster.clipped": 28,
    "raster.empty": 4,
    "raster.drawn": 108,
    "raster.fragments": 6105,
    "stencil.failed_early": 1342,
    "depth.failed_early": 549,
    "fragment.invocations": 4214,
    "fragment.discarded": 1361,
    "stencil.failed": 1342,
    "depth.failed": 2450,
    "fragment.written": 952,
}
CHECKSUMS = {
    "color": 615367291,
    "id": 1034832234,
    "where": 1897429729,
    "weight": 175929008,
    "depth": 4056448401,
    "stencil": 2757303698,
    "invocations": 2093308119,
}


def sprites(n=30):
    """Sprites of sizes 1 to 13 on a lattice that leaves the screen; depths in eighths."""
    k = np.arange(n)
    return {
        "position": to_clip(k * 17 % 36 - 1.5, k * 11 % 19 - 0.5, k * 5 % 9 / 8, 1.0, WIDTH, HEIGHT),
        "size": 1 + k % 13,
        "base": (k * 3 % 8 / 8).astype(np.float32),
        "color": np.stack([k, -k], axis=1),
        "id": k,
    }


def quads():
    """Four quads that share edges, and one over all of them."""
    boxes = [(0, 0, 20, 9), (20, 0, 32, 9), (0, 9, 20, 16), (20, 9, 32, 16), (5, 5, 27, 12)]
    corners = np.array([[[a, b], [c, b], [c, d], [a, d]] for a, b, c, d in boxes], float).reshape(-1, 2)
    k = np.repeat(np.arange(5), 4)
    return {
        "position": to_clip(corners[:, 0], corners[:, 1], 0.5 + k / 16, 1.0, WIDTH, HEIGHT),
        "size": np.ones(20),
        "base": (0.5 + k / 16).astype(np.float32),
        "color": np.stack([100 + k, k], axis=1),
        "id": 100 + k,
    }


def scene():
    """The steps: pipeline, vertices, uniforms, run-time state; and the textures of all."""
    y, x = np.indices((1, HEIGHT, WIDTH))[1:]
    images = Images(Texture(((x + y) % 4 * 0.25).astype(np.float32)), Texture((x * y % 5).astype(np.int32)))
    steps = []
    for name, modulus, scissor in STEPS:
        state = Rules(modulus, 0.125), DynamicState(None, scissor)
        steps += [(POOL[name], sprites(), *state), (as_quads(POOL[name]), quads(), *state)]
    return steps, images


def checksums(target):
    """CRC-32 of every plane."""
    return {name: zlib.crc32(np.ascontiguousarray(plane)) for name, plane in planes(target).items()}


@pytest.mark.parametrize("loop", ["dense", "list"])
def test_golden_counters_and_checksums(loop):
    (steps, images), target, counters = scene(), Framebuffer(WIDTH, HEIGHT, TARGETS), Counters()
    for pipe, columns, rules, dynamic in steps:
        vertices, taps = VertexBuffer.of(Sprite, **columns), Taps("fragment") if loop == "list" else None
        draw(pipe, framebuffer=target, counters=counters, vertices=vertices, uniforms=rules, textures=images,
             dynamic=dynamic, taps=taps, loop=loop)  # fmt: skip
    counters.check()
    assert dict(counters) == COUNTERS
    assert checksums(target) == CHECKSUMS


def test_the_numbers_are_those_of_the_restatement():
    (steps, images), target, total = scene(), Framebuffer(WIDTH, HEIGHT, TARGETS), Counter()
    for pipe, columns, rules, dynamic in steps:
        sprite = zip(*(np.asarray(columns[name]) for name in Sprite._fields), strict=True)
        vertices = [(p, s, Flat(base, c.astype(np.float32), int(k))) for p, s, base, c, k in sprite]
        counts, _ = slow_draw(pipe, target, vertices, rules, images, dynamic, ruled_twin)
        total += counts
    assert dict(total) == {name: count for name, count in COUNTERS.items() if count}
    assert checksums(target) == CHECKSUMS


def test_every_fate_occurs():
    assert all(count > 0 for count in COUNTERS.values()) and set(CHECKSUMS) == set(planes(Framebuffer(1, 1, TARGETS)))
