"""Pipelines with blended, masked and 8-bit colour targets for the tests of the draw path, and random scenes for them.

One vertex shader and two fragment shaders: one writes four targets (two of four components, one of two, one of whole
numbers), the other one target and a second source. The states are a Latin sample, drawn with a seed that is printed:
every factor but the second source's stands at least once on each side of an equation, every operation is met, formats
take turns, and depth, stencil and discards are around it.
"""

from typing import NamedTuple

import numpy as np

from refsim.counters import Counters
from refsim.jit import func
from refsim.pipeline.draw import draw
from refsim.pipeline.layout import f32, i32, vec2, vec4
from refsim.pipeline.resources import Framebuffer, VertexBuffer
from refsim.pipeline.state import (
    BlendComponent,
    BlendFactor,
    BlendOperation,
    BlendState,
    ColorTargetState,
    ColorWrite,
    CompareFunction,
    DepthStencilState,
    DynamicState,
    FragmentState,
    Pipeline,
    PrimitiveTopology,
    StencilFaceState,
    StencilOperation,
    TextureFormat,
    VertexBufferLayout,
    VertexState,
)
from tests.pipeline.pipelines import LARGE, SEED
from tests.pipeline.scenes import random_scene
from tests.pipeline.slow_pipeline import slow_draw

T, F, O = TextureFormat, BlendFactor, BlendOperation  # noqa: E741
# Colours for shaders to return: ends, steps of 8 bits and halves of them, out of range, no number
COLORS = np.array([0, 1, 0.5, 0.25, 0.75, 51 / 255, 127.5 / 255, 0.3, -0.0, -0.5, 2, np.nan, np.inf], np.float32)


class Splash(NamedTuple):
    """A vertex: clip position, point size, depth, two colours, a number."""

    position: vec4
    size: f32
    base: f32
    first: vec4
    second: vec4
    id: i32


class Paint(NamedTuple):
    """What a fragment knows of its primitive."""

    base: f32
    first: vec4
    second: vec4
    id: i32


class Four(NamedTuple):
    """Four targets of three kinds."""

    color: vec4
    id: i32
    glow: vec2
    light: vec4


class Dual(NamedTuple):
    """One target and the second source."""

    color: vec4
    src1: vec4


class Rule(NamedTuple):
    """Every `modulus`-th fragment is discarded."""

    modulus: i32


@func
def splash_vertex(u, t, attributes, vertex_index, instance_index):
    """Passes a `Splash` on."""
    a = attributes[0]
    return a.position, a.size, Paint(a.base, a.first, a.second, a.id)


@func
def four_fragment(u, t, v, inputs, pixel):
    """Writes four targets."""
    keep = np.int32(pixel[0] * np.int32(7) + pixel[1] * np.int32(3) + v.id) % u.modulus != np.int32(0)
    return keep, v.base, Four(v.first, np.int32(v.id + pixel[0]), (v.second[0], v.first[1]), v.second)


@func
def dual_fragment(u, t, v, inputs, pixel):
    """Writes one target from two sources."""
    keep = np.int32(pixel[0] * np.int32(7) + pixel[1] * np.int32(3) + v.id) % u.modulus != np.int32(0)
    return keep, v.base, Dual(v.first, v.second)


def twin(u, v, inputs, pixel):
    """Both fragment shaders in plain Python: (keep, depth, {output: components})."""
    keep = (pixel[0] * 7 + pixel[1] * 3 + v.id) % u.modulus != 0
    outputs = {"color": v.first, "id": (v.id + pixel[0],), "glow": (v.second[0], v.first[1]), "light": v.second}
    return keep, np.float32(v.base), {**outputs, "src1": v.second}


VERTEX = VertexState(splash_vertex, Paint, (VertexBufferLayout(Splash),))
MARKED = DepthStencilState(
    depth_write_enabled=True,
    depth_compare=CompareFunction.LESS_EQUAL,
    stencil_front=StencilFaceState(CompareFunction.NOT_EQUAL, pass_op=StencilOperation.INCREMENT_WRAP),
)
NEAREST = DepthStencilState(depth_write_enabled=True, depth_compare=CompareFunction.LESS_EQUAL)
ALWAYS = DepthStencilState()


class Case(NamedTuple):
    """A pipeline and the formats of the framebuffer that it draws into."""

    pipe: Pipeline
    targets: dict[str, TextureFormat]


def case(shader, outputs, states, targets, depth_stencil=ALWAYS, *, discards=False, writes_depth=True) -> Case:
    """A pipeline with colour target states."""
    fragment = FragmentState(shader, outputs, None, writes_depth, discards, tuple(states))
    return Case(Pipeline(VERTEX, fragment, PrimitiveTopology.POINT_LIST, depth_stencil), targets)


def four_targets(k: int) -> dict[str, TextureFormat]:
    """Formats that take turns."""
    wide, narrow = (T.RGBA8UNORM, T.RGBA32FLOAT), (T.RG32FLOAT, T.RG8UNORM)
    return {"color": wide[k % 2], "id": T.R32SINT, "glow": narrow[k % 2], "light": wide[(k + 1) % 2]}


def latin_sample(seed: int = SEED) -> dict[str, Case]:
    """Four pipelines of four targets each, of which three are blended."""
    rng = np.random.default_rng(seed)
    plain = [factor for factor in F if "src1" not in factor]
    without_alpha = [factor for factor in plain if not ("src" in factor and "alpha" in factor)]
    sides = [[*rng.permutation(plain), *rng.permutation(plain)[:3]] for _ in range(2)]
    operations = [O.ADD, O.SUBTRACT, O.REVERSE_SUBTRACT] * 6
    masks = [15, 15, 7, 11, 14, 8, 5, 15]

    def part(k: int) -> BlendComponent:
        return BlendComponent(operations[k], F(sides[0][k]), F(sides[1][k]))

    made = {}
    for k in range(4):
        parts = [part(4 * k + j) for j in range(4)]
        glow = BlendComponent(operations[k], F(rng.choice(without_alpha)), F(rng.choice(without_alpha)))
        if k > 1:
            glow = BlendComponent((O.MIN, O.MAX)[k - 2], F.ONE, F.ONE)
        states = (
            ColorTargetState(BlendState(*parts[:2]), ColorWrite(masks[2 * k])),
            ColorTargetState(None, ColorWrite.NONE if k == 2 else ColorWrite.ALL),
            ColorTargetState(BlendState(glow, BlendComponent()), ColorWrite((3, 1, 2, 15)[k])),
            ColorTargetState(BlendState(*parts[2:]), ColorWrite(masks[2 * k + 1])),
        )
        state = (ALWAYS, MARKED, NEAREST, ALWAYS)[k]
        made[f"latin{k}"] = case(four_fragment, Four, states, four_targets(k), state, discards=k % 2 == 1)
    return made


OVER = BlendState(*[BlendComponent(O.ADD, F.SRC_ALPHA, F.ONE_MINUS_SRC_ALPHA)] * 2)
CONSTANT = BlendState(
    BlendComponent(O.ADD, F.CONSTANT, F.ONE_MINUS_CONSTANT), BlendComponent(O.SUBTRACT, F.ONE, F.CONSTANT)
)
DUAL = BlendState(BlendComponent(O.ADD, F.ONE, F.SRC1), BlendComponent(O.REVERSE_SUBTRACT, F.SRC1_ALPHA, F.ONE))
DUAL_MINUS = BlendState(
    BlendComponent(O.ADD, F.ONE_MINUS_SRC1, F.ONE_MINUS_SRC1_ALPHA), BlendComponent(O.ADD, F.SRC1, F.ONE_MINUS_SRC1)
)
BY_HAND = {
    # 8-bit and masked targets without blending
    "replaced": case(
        four_fragment, Four,
        (ColorTargetState(), ColorTargetState(), ColorTargetState(None, ColorWrite.GREEN),
         ColorTargetState(None, ColorWrite.RED | ColorWrite.ALPHA)),
        four_targets(0), NEAREST, discards=True,
    ),
    "over": case(
        four_fragment, Four,
        (ColorTargetState(OVER), ColorTargetState(), ColorTargetState(), ColorTargetState(CONSTANT)),
        four_targets(1),
    ),
    "dual": case(dual_fragment, Dual, [ColorTargetState(DUAL)], {"color": T.RGBA8UNORM}, NEAREST),
    "dual minus": case(dual_fragment, Dual, [ColorTargetState(DUAL_MINUS)], {"color": T.RGBA32FLOAT}),
}  # fmt: skip
CASES = {**BY_HAND, **latin_sample()}
# Compiling is what these tests cost: a case is run in these loops only
DENSE = ["dual", "latin1", "latin2", "over", "replaced"]
TAPPED = ["dual minus", "latin0", "latin1", "latin3", "over", "replaced"]
BOTH = sorted(set(DENSE) & set(TAPPED))


class Scene(NamedTuple):
    """All of a draw but the pipeline."""

    columns: dict[str, np.ndarray]
    rule: Rule
    dynamic: DynamicState
    size: tuple[int, int]
    seed: int


def blend_scene(seed: int, *, tame=False, **shape) -> Scene:
    """Sprites of random colours over a target that holds random ones; `tame`: no infinity and no NaN."""
    rng = np.random.default_rng([seed, 1])
    scene = random_scene(seed, **shape)
    columns = {name: scene.columns[name] for name in ("position", "size", "base", "id")}
    palette = COLORS[:8] if tame else COLORS
    for name in ("first", "second"):
        columns[name] = rng.choice(palette, (len(columns["id"]), 4))
    constant = tuple(float(part) for part in rng.choice([0.0, 1.0, 0.25, 0.3, -0.5, 1.5], 4))
    return Scene(columns, Rule(int(rng.choice([2, 3, LARGE]))), scene.dynamic._replace(blend_constant=constant),
                 scene.size, seed)


def target_of(made: Case, scene: Scene) -> Framebuffer:
    """A framebuffer that already holds colours, depths and stencil values."""
    rng = np.random.default_rng([scene.seed, 2])
    framebuffer = Framebuffer(*scene.size, made.targets, made.pipe.depth_stencil.format)
    for name, form in made.targets.items():
        planes = framebuffer.color(name)
        if form.is_unorm8:
            planes[:] = rng.integers(0, 256, planes.shape).astype(np.float32) / np.float32(255)
        else:
            planes[:] = rng.integers(-4, 9, planes.shape) * (0.25 if form.is_float else 1)
    framebuffer.depth[:] = rng.choice([0.25, 0.5, 0.75, 1.0], framebuffer.depth.shape)
    framebuffer.stencil[:] = rng.choice([0, 1, 127, 255], framebuffer.stencil.shape)
    return framebuffer


def run(made: Case, scene: Scene, *, threads=1, **options) -> tuple[Framebuffer, Counters]:
    """The scene drawn once."""
    framebuffer, counters = target_of(made, scene), Counters()
    draw(
        made.pipe, framebuffer=framebuffer, counters=counters, vertices=VertexBuffer.of(Splash, **scene.columns),
        uniforms=scene.rule, dynamic=scene.dynamic, threads=threads, **options,
    )  # fmt: skip
    counters.check()
    return framebuffer, counters


def restated(made: Case, scene: Scene) -> tuple[Framebuffer, dict[str, int], list]:
    """The scene drawn by the slow pipeline."""
    framebuffer, c = target_of(made, scene), scene.columns
    rows = zip(c["position"], c["size"], c["base"], c["first"], c["second"], c["id"], strict=True)
    vertices = [(position, size, Paint(*paint, int(number))) for position, size, *paint, number in rows]
    counts, log = slow_draw(made.pipe, framebuffer, vertices, scene.rule, (), scene.dynamic, twin)
    return framebuffer, counts, log
