"""Front and back faces with stencil states of their own, under every early-test policy.

Plan
- Triangles over the whole target, front and back in random order, leave what quads leave that are drawn one after the
  other by the slow pipeline, each with the stencil state of the triangle's face: targets, depth, stencil, shader runs
  and the fates of all fragments. Both loops, one and two threads.
- The states are a seeded sample in which policy, discard, depth output and depth test vary independently, and a few by
  hand in which each face alone can be rejected early.
- A state that is the same on both sides gives the same bits as on one side, whichever way triangles face.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import VertexBuffer
from refsim.pipeline.state import (
    CompareFunction,
    DepthStencilFormat,
    DepthStencilState,
    DynamicState,
    EarlyTests,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
)
from tests.pipeline.pipelines import Rules, Sprite, pipeline, ruled_twin
from tests.pipeline.scenes import planes, random_scene, target_of
from tests.pipeline.slow_pipeline import slow_draw

C, S, D = CompareFunction, StencilOperation, DepthStencilFormat
WIDTH, HEIGHT, COUNT = 13, 9, 24
FATES = ("raster.fragments", "fragment.invocations", "fragment.discarded", "fragment.written", "stencil.failed",
         "stencil.failed_early", "depth.failed", "depth.failed_early")  # fmt: skip
KEEPS = StencilFaceState(C.EQUAL, S.KEEP, S.KEEP, S.INCREMENT_WRAP)
COUNTS = StencilFaceState(C.NOT_EQUAL, S.INCREMENT_CLAMP, S.INVERT, S.REPLACE)


def state(front, back, compare=C.ALWAYS) -> DepthStencilState:
    """Depth written, two faces."""
    return DepthStencilState(D.DEPTH32FLOAT_STENCIL8, True, compare, front, back)


def sampled(seed: int):
    """A pipeline of which everything is drawn by lot."""
    rng = np.random.default_rng(seed)
    front, back = (
        StencilFaceState(C(rng.integers(8)), *(S(part) for part in rng.choice(8, 3, p=[0.44] + [0.08] * 7)))
        for _ in range(2)
    )
    policy = list(EarlyTests)[rng.integers(4)]
    depth = state(front, back, C(rng.integers(8)))
    return pipeline(depth, discards=bool(rng.integers(2)), writes_depth=bool(rng.integers(2)), policy=policy)


PIPES = {
    "both reject early, discards": pipeline(state(KEEPS, KEEPS._replace(compare=C.NOT_EQUAL)), writes_depth=False),
    "front rejects early": pipeline(state(KEEPS, StencilFaceState()), discards=False, writes_depth=False),
    "back rejects early, depth": pipeline(state(COUNTS, KEEPS, C.LESS), writes_depth=False),
    "only the back is tested": pipeline(state(StencilFaceState(), KEEPS, C.LESS)),
    **{f"sampled {seed}": sampled(seed) for seed in range(2)},
}


def scene_of(seed: int):
    """Run-time state and stored planes by lot; depths and numbers of COUNT primitives, and which of them face back."""
    rng = np.random.default_rng(seed)
    scene = random_scene(seed, count=1, width=WIDTH, height=HEIGHT)
    dynamic = DynamicState(None, None, int(rng.choice([0, 1, 3])), int(rng.choice([255, 3])), 255)
    scene = scene._replace(dynamic=dynamic, rules=Rules(3, 0.25), stencil=rng.integers(0, 4, (HEIGHT, WIDTH), np.uint8))
    rows = {
        "z": rng.choice([0.25, 0.5, 0.75], COUNT).astype(np.float32),
        "base": rng.choice([0.0, 0.25, 0.5, 0.75, 1.0], COUNT).astype(np.float32),
        "color": rng.integers(-8, 8, (COUNT, 2)).astype(np.float32),
        "id": np.arange(COUNT, dtype=np.int32),
    }
    return scene, rows, rng.random(COUNT) < 0.5


def primitives(rows, corners) -> dict[str, np.ndarray]:
    """Columns of primitives with these corners i32[COUNT, c, 2] in clip space."""
    each = corners.shape[1]
    position = np.ones((COUNT, each, 4), np.float32)
    position[..., :2], position[..., 2] = corners, rows["z"][:, None]
    columns = {name: np.repeat(rows[name], each, axis=0) for name in ("base", "color", "id")}
    return {"position": position.reshape(-1, 4), "size": np.zeros(COUNT * each, np.float32), **columns}


def triangles(rows, back) -> dict[str, np.ndarray]:
    """A triangle around the target each, counter-clockwise unless it faces back."""
    front = np.array([[-1, -1], [3, -1], [-1, 3]])
    return primitives(rows, np.where(back[:, None, None], front[[0, 2, 1]], front))


def slow_faces(pipe, scene, rows, back):
    """The slow pipeline, one quad after the other with the state of its face: target and counts."""
    target, counts = target_of(pipe, scene), Counter()
    quad = np.broadcast_to(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), (COUNT, 4, 2))
    columns = primitives(rows, quad)
    buffer = VertexBuffer.of(Sprite, **columns)
    assert buffer.count == 4 * COUNT
    for k in range(COUNT):
        faces = pipe.depth_stencil
        face = faces.stencil_back if back[k] else faces.stencil_front
        one = replace(pipe, topology=PrimitiveTopology.QUAD_LIST, depth_stencil=faces._replace(stencil_front=face))
        varyings = Flat(columns, 4 * k)
        vertices = [(columns["position"][4 * k + j], 0.0, varyings) for j in range(4)]
        found, _ = slow_draw(one, target, vertices, scene.rules, scene.images, scene.dynamic, ruled_twin)
        counts.update(found)
    return target, counts


class Flat:
    """Varyings as the slow pipeline reads them."""

    def __init__(self, columns, row):
        self.base, self.color, self.id = columns["base"][row], columns["color"][row], int(columns["id"][row])


@pytest.mark.parametrize("name", PIPES)
def test_each_face_has_its_own_stencil(name):
    pipe = replace(PIPES[name], topology=PrimitiveTopology.TRIANGLE_LIST)
    early = Counter()
    for seed in range(6):
        scene, rows, back = scene_of(seed)
        expected, counts = slow_faces(PIPES[name], scene, rows, back)
        vertices = VertexBuffer.of(Sprite, **triangles(rows, back))
        for loop, threads in (("dense", 1), ("list", 1), ("dense", 2)):
            target, counters = target_of(pipe, scene), Counters()
            draw(pipe, framebuffer=target, counters=counters, vertices=vertices, uniforms=scene.rules,
                 textures=scene.images, dynamic=scene.dynamic, loop=loop, threads=threads)  # fmt: skip
            counters.check()
            for plane, values in planes(expected).items():
                assert planes(target)[plane].tobytes() == values.tobytes(), (seed, loop, plane)
            assert {fate: counters[fate] for fate in FATES} == {fate: counts[fate] for fate in FATES}, (seed, loop)
        early.update({fate: counts[fate] for fate in FATES})
    if "early" in name:
        assert early["stencil.failed_early"] > 0


def test_equal_faces_are_one():
    scene, rows, back = scene_of(7)
    pipe = replace(PIPES["both reject early, discards"], topology=PrimitiveTopology.TRIANGLE_LIST)
    pipe = replace(pipe, depth_stencil=pipe.depth_stencil._replace(stencil_back=KEEPS))
    found = []
    for faces in (back, ~back, np.zeros(COUNT, bool)):
        target, counters = target_of(pipe, scene), Counters()
        draw(pipe, framebuffer=target, counters=counters, vertices=VertexBuffer.of(Sprite, **triangles(rows, faces)),
             uniforms=scene.rules, textures=scene.images, dynamic=scene.dynamic, loop="dense")  # fmt: skip
        found.append([values.tobytes() for values in planes(target).values()] + [dict(counters)])
    assert found[0] == found[1] == found[2]
