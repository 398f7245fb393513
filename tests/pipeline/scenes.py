"""Random and plain scenes for the shared pipelines: vertices, textures, run-time state, stored planes; and one draw of
a scene.
"""

from typing import NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.pipeline.draw import draw
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import DynamicState, Pipeline, ScissorRect
from tests.pipeline.one_fragment import BOUNDARY
from tests.pipeline.pipelines import D24, LARGE, TARGETS, Images, Rules, Sprite

# Depths for shaders to write: ties, both ends, out of range, no number, two that differ in float32 but not in 24 bits
DEPTHS = np.array(
    [0.25, 0.5, 0.5 + 2**-24, 0.75, 0.0, -0.0, 1.0, -1.0, 2.0, 1e-40, 2**-25, np.nan, np.inf, -np.inf], np.float32
)


class Scene(NamedTuple):
    """All of a draw but the pipeline: rows of `Sprite` columns, uniforms, textures, run-time state, stored planes."""

    columns: dict[str, np.ndarray]
    rules: Rules
    images: Images
    dynamic: DynamicState
    depth: np.ndarray
    stencil: np.ndarray

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the target."""
        return self.depth.shape[1], self.depth.shape[0]


def to_clip(x, y, z, w, width, height):
    """Clip positions f32[n, 4] of pixel coordinates."""
    ndc = np.stack([2 * np.asarray(x) / width - 1, 1 - 2 * np.asarray(y) / height, z], axis=-1)
    w = np.broadcast_to(w, ndc.shape[:1])[:, None]
    return np.concatenate([ndc * w, w], axis=1).astype(np.float32)


def random_scene(seed: int, *, count=40, width=37, height=21, largest=70.0, quads=False) -> Scene:
    """A stream of points (or quads) over a target that already holds depths and stencil values.

    Centres off the grid and off the screen, sizes from 0.3 to `largest` and absurd ones, NaN, vertices outside the clip
    volume. No edge comes nearer to a pixel centre than 1/256: what is covered is not in doubt.
    """
    rng = np.random.default_rng(seed)
    z = rng.choice([0.0, 0.25, 0.5, 0.75, 1.0, -0.25, 1.25], count, p=[0.1, 0.25, 0.25, 0.2, 0.1, 0.05, 0.05])
    w = rng.choice([1.0, 2.0, 0.5, 3.0], count)
    x, y = rng.uniform(-4, width + 4, count), rng.uniform(-4, height + 4, count)
    size = np.exp(rng.uniform(np.log(0.3), np.log(largest), count))
    if quads:
        columns = _quad_columns(rng, x, y, z, w, size, width, height)
    else:
        odd = rng.random(count) < 0.1
        size = np.where(odd, rng.choice([0.0, -3.0, np.nan, np.inf, 1e30], count), size).astype(np.float32)
        position = to_clip(x, y, z, w, width, height)
        position[rng.random(count) < 0.03, rng.integers(4)] = np.nan
        half = np.where(np.isfinite(size), size, 0.3) / 2.0
        clear = away_from_centres(x - half, x + half, y - half, y + half)
        columns = {"position": position[clear], "size": size[clear]}
    n = len(columns["size"])
    owner = np.arange(n) // (4 if quads else 1)
    primitives = owner[-1] + 1 if n else 0
    columns["base"] = rng.choice(DEPTHS, primitives)[owner]
    columns["color"] = rng.integers(-8, 8, (primitives, 2)).astype(np.float32)[owner]
    columns["id"] = owner.astype(np.int32)
    return Scene(columns, _random_rules(rng), _random_images(rng, width, height), _random_dynamic(rng, width, height),
                 rng.choice(DEPTHS, (height, width)), rng.choice(BOUNDARY, (height, width)).astype(np.uint8))


def away_from_centres(*edges) -> np.ndarray:
    """Rows of which no edge is near a pixel centre."""
    return np.all([np.abs((edge - 0.5) - np.rint(edge - 0.5)) > 1 / 256 for edge in edges], axis=0)


def _quad_columns(rng, x, y, z, w, size, width, height):
    """Rectangles between the points and other points of the screen; corners in order, from any first corner."""
    inside = (np.clip(x, 0, width), np.clip(y, 0, height))
    x, y = inside
    right, bottom = np.minimum(x + size, width), np.minimum(y + size * rng.uniform(0.2, 1, len(x)), height)
    clear = away_from_centres(x, right, y, bottom) & (right > x) & (bottom > y)
    x, y, right, bottom, z = x[clear], y[clear], right[clear], bottom[clear], z[clear]
    around = np.stack([np.stack([x, right, right, x]), np.stack([y, y, bottom, bottom])])
    around = np.roll(around, rng.integers(4), axis=1)
    corners = around.transpose(2, 1, 0).reshape(-1, 2)
    position = to_clip(corners[:, 0], corners[:, 1], np.repeat(z, 4), 1.0, width, height)
    return {"position": position, "size": np.zeros(len(position), np.float32)}


def _random_rules(rng) -> Rules:
    return Rules(int(rng.choice([2, 3, 5, LARGE])), float(rng.choice([0.0, 0.25, -0.5])))


def _random_images(rng, width, height) -> Images:
    heights = rng.integers(-2, 3, (1, height, width)) * 0.25
    return Images(Texture(heights.astype(np.float32)), Texture(rng.integers(0, 4, (1, height, width), np.int32)))


def _random_dynamic(rng, width, height) -> DynamicState:
    scissor = None
    if rng.random() < 0.5:
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        scissor = ScissorRect(x, y, int(rng.integers(1, width - x + 1)), int(rng.integers(1, height - y + 1)))
    reference, read_mask, write_mask = (int(value) for value in rng.choice(BOUNDARY, 3))
    if rng.random() < 0.5:  # masks of which something is seen
        read_mask, write_mask = int(rng.choice([255, 1, 127])), 255
    return DynamicState(None, scissor, reference, read_mask, write_mask)


def target_of(pipe: Pipeline, scene: Scene) -> Framebuffer:
    """A framebuffer that holds the scene's depths (as its format stores them) and stencil values, colours at −7."""
    framebuffer = Framebuffer(*scene.size, TARGETS, pipe.depth_stencil.format)
    framebuffer.floats[:], framebuffer.ints[:] = -7, -7
    unit = np.nan_to_num(np.clip(scene.depth, 0, 1), nan=1.0).astype(np.float64) + 0.0
    is24 = pipe.depth_stencil.format == D24
    framebuffer.depth[:] = np.floor(unit * (2**24 - 1) + 0.5) if is24 else unit
    framebuffer.stencil[:] = scene.stencil
    return framebuffer


def run(pipe: Pipeline, scene: Scene, *, threads=1, **options) -> tuple[Framebuffer, Counters]:
    """The scene drawn once: what the target and the counters hold afterwards. Laws are checked."""
    framebuffer, counters = target_of(pipe, scene), Counters()
    draw(
        pipe, framebuffer=framebuffer, counters=counters, vertices=VertexBuffer.of(Sprite, **scene.columns),
        uniforms=scene.rules, textures=scene.images, dynamic=scene.dynamic, threads=threads, **options,
    )  # fmt: skip
    counters.check()
    return framebuffer, counters


def full_screen(width=16, height=12, *, base=(0.5,), z=None, size=1000.0, **dynamic) -> Scene:
    """Sprites over the whole of an empty target, one for each depth in `base`; nothing is discarded."""
    n = len(base)
    columns = {
        "position": to_clip([width / 2] * n, [height / 2] * n, base if z is None else z, 1.0, width, height),
        "size": np.full(n, size, np.float32),
        "base": np.array(base, np.float32),
        "color": np.ones((n, 2), np.float32),
        "id": np.arange(1, n + 1, dtype=np.int32),
    }
    shape = (height, width)
    flat = Images(Texture(np.zeros((1, *shape), np.float32)), Texture(np.zeros((1, *shape), np.int32)))
    empty = np.ones(shape, np.float32), np.zeros(shape, np.uint8)
    return Scene(columns, Rules(LARGE, 0.0), flat, DynamicState(**dynamic), *empty)


def planes(framebuffer: Framebuffer) -> dict[str, np.ndarray]:
    """Everything a draw may change."""
    named = {name: framebuffer.color(name) for name in framebuffer.targets}
    return {**named, "depth": framebuffer.depth, "stencil": framebuffer.stencil, "invocations": framebuffer.invocations}


def assert_same(a: tuple[Framebuffer, Counters], b: tuple[Framebuffer, Counters]) -> None:
    """Same bits in every plane, same counters."""
    for (name, first), second in zip(planes(a[0]).items(), planes(b[0]).values(), strict=True):
        assert first.tobytes() == second.tobytes(), f"{name} differs"
    assert dict(a[1]) == dict(b[1])
