"""What a draw refuses: one sentence that names the field, and nothing has happened.

Plan
- Every refusal has a row beside a control that draws: the sentence matches, targets, depth, stencil, invocations,
  counters and taps are untouched.
- Feedback: a texture (nested too), an input attachment or a uniform array that shares memory with a colour target,
  depth or stencil is refused; a copy of it is not.
- Framebuffers refuse absurd sizes, unknown targets and colours of the wrong width; clears store what they are given.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.pipeline import draw as draw_module
from refsim.pipeline import rounds as rounds_module
from refsim.pipeline import taps as taps_module
from refsim.pipeline.resources import MAX_TARGET_PIXELS, Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import DepthStencilFormat, DynamicState, ScissorRect, TextureFormat, Viewport
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import POOL, TARGETS, Images, Rules, Sprite
from tests.pipeline.scenes import full_screen, planes
from tests.pipeline.test_vertices import STEPPING, stepping_buffers

PIPE = POOL["nearest"]
SCENE = full_screen(base=(0.5, 0.5, 0.5))
WIDTH, HEIGHT = SCENE.size
HEIGHTS, FLAGS = SCENE.images


def buffer():
    """Three sprites."""
    return VertexBuffer.of(Sprite, **SCENE.columns)


def framebuffer(targets=TARGETS, form=DepthStencilFormat.DEPTH32FLOAT_STENCIL8, width=WIDTH):
    """A target of the scene's size."""
    return Framebuffer(width, HEIGHT, targets, form)


def texture(shape=(1, HEIGHT, WIDTH), dtype=np.float32):
    """An empty texture."""
    return Texture(np.zeros(shape, dtype))


def reordered(*names):
    """The targets in another order."""
    return {name: TARGETS[name] for name in names}


def dynamic(**state):
    """Run-time state as an argument of the draw."""
    return {"dynamic": DynamicState(**state)}


def viewport(*values):
    """A viewport as an argument of the draw."""
    return dynamic(viewport=Viewport(*values))


STEPS = {"pipeline": STEPPING, "vertices": stepping_buffers(instances=2)}
NAN, INF = float("nan"), float("inf")
ROWS = [
    ("loop", {"loop": "sparse"}, "loop must be"),
    ("no thread", {"threads": 0}, "threads must be"),
    ("half a thread", {"threads": 1.5}, "threads must be"),
    ("threads: true", {"threads": True}, "threads must be"),
    ("a great many threads", {"threads": 1025}, "threads must be"),
    ("instances below 0", {"instances": -1}, "instances must be"),
    ("half an instance", {"instances": 1.5}, "instances must be"),
    ("instances: true", {"instances": True}, "instances must be"),
    ("instances: text", {**STEPS, "instances": "2"}, "instances must be"),
    ("more instances than rows", {**STEPS, "instances": 3}, "3 instances .*2"),
    ("no buffer", {"vertices": ()}, "1 vertex buffers are declared, 0"),
    ("two buffers", {"vertices": (buffer(), buffer())}, "1 vertex buffers are declared, 2"),
    ("a list of buffers", {"vertices": [buffer()]}, "vertices"),
    ("an array of vertices", {"vertices": np.zeros((3, 4))}, "vertices"),
    ("buffers of another class", {"vertices": stepping_buffers()[0]}, "Sprite is declared, one of Place"),
    ("buffers in another order", {**STEPS, "vertices": stepping_buffers()[::-1]}, "Place is declared, one of Kind"),
    ("vertex_count beyond the buffer", {"vertex_count": 4}, "vertex_count is 4, but there are 3"),
    ("vertex_count below 0", {"vertex_count": -1}, "vertex_count"),
    ("vertex_count: half", {"vertex_count": 1.5}, "vertex_count"),
    ("vertex_count: text", {"vertex_count": "1"}, "vertex_count"),
    ("index beyond the buffer", {"indices": np.array([0, 2, 3])}, "index 2 is 3, but there are 3"),
    ("index below 0", {"indices": np.array([0, -1])}, "index 1 is -1"),
    ("index beyond int64", {"indices": np.array([2**64 - 1], np.uint64)}, "index 0 is 18446744073709551615"),
    ("indices with fractions", {"indices": np.array([0.0, 1.5])}, "indices"),
    ("indices as truths", {"indices": np.array([True, False])}, "indices"),
    ("indices and vertex_count", {"indices": np.array([0]), "vertex_count": 1}, "vertex_count"),
    ("a target missing", {"framebuffer": framebuffer(reordered("color", "id", "where"))}, "output 'weight' has no"),
    ("a target too many", {"framebuffer": framebuffer({**TARGETS, "more": TextureFormat.R32FLOAT})}, "target 'more'"),
    ("targets in another order", {"framebuffer": framebuffer(reordered("id", "color", "where", "weight"))}, "order"),
    ("a target of another kind", {"framebuffer": framebuffer({**TARGETS, "id": TextureFormat.R32FLOAT})}, "'id'"),
    ("a target too wide", {"framebuffer": framebuffer({**TARGETS, "id": TextureFormat.RG32SINT})}, "'id' has 1 .*i"),
    ("depth format", {"framebuffer": framebuffer(form=DepthStencilFormat(1))}, r"depth_stencil\.format is DEPTH32"),
    ("no textures for the inputs", {"textures": None}, "input attachment 'height'"),
    ("textures without names", {"textures": (HEIGHTS, FLAGS)}, "input attachment 'height'"),
    ("an input that is an array", {"textures": Images(HEIGHTS.data, FLAGS)}, "input attachment 'height'"),
    ("an input of another kind", {"textures": Images(HEIGHTS, texture())}, "texture 'flags' does not hold 1 int32"),
    ("an input of float64", {"textures": Images(texture(dtype=np.float64), FLAGS)}, "'height' is float64 of shape"),
    ("an input without planes", {"textures": Images(texture((0, HEIGHT, WIDTH)), FLAGS)}, "'height' does not hold"),
    ("an input without layers", {"textures": Images(texture((HEIGHT, WIDTH)), FLAGS)}, "'height' is float32 of"),
    ("an input too small", {"textures": Images(texture((1, HEIGHT, WIDTH - 1)), FLAGS)}, "'height' is not of .* size"),
    ("an input on its side", {"textures": Images(texture((1, WIDTH, HEIGHT)), FLAGS)}, "'height' is not of .* size"),
    ("viewport of no width", viewport(0, 0, 0, 5), "Viewport"),
    ("viewport of negative height", viewport(0, 0, 5, -5), "Viewport"),
    ("viewport of no number", viewport(NAN, 0, 5, 5), "Viewport"),
    ("viewport without end", viewport(0, 0, INF, 5), "Viewport"),
    ("depth range turned over", viewport(0, 0, 5, 5, 0.75, 0.25), "min_depth"),
    ("depth range beyond 1", viewport(0, 0, 5, 5, 0, 1.5), "max_depth"),
    ("depth range below 0", viewport(0, 0, 5, 5, -0.5, 1), "min_depth"),
    ("depth range of no number", viewport(0, 0, 5, 5, NAN, 1), "min_depth"),
    ("scissor left of the target", dynamic(scissor=ScissorRect(-1, 0, 5, 5)), "scissor .* leaves the framebuffer"),
    ("scissor beyond the target", dynamic(scissor=ScissorRect(0, 0, WIDTH + 1, 5)), "scissor .* leaves"),
    ("scissor below the target", dynamic(scissor=ScissorRect(0, 1, 5, HEIGHT)), "scissor .* leaves"),
    ("scissor of negative height", dynamic(scissor=ScissorRect(0, 5, 5, -1)), "scissor"),
    ("scissor with fractions", dynamic(scissor=ScissorRect(0.5, 0, 5, 5)), "scissor"),
    ("reference of 9 bits", dynamic(stencil_reference=256), "8-bit"),
    ("reference below 0", dynamic(stencil_reference=-1), "8-bit"),
    ("read mask of 9 bits", dynamic(stencil_read_mask=256), "8-bit"),
    ("write mask of 9 bits", dynamic(stencil_write_mask=511), "8-bit"),
    ("write mask with a fraction", dynamic(stencil_write_mask=1.5), "8-bit"),
    ("uniforms as a list", {"uniforms": [1, 2]}, "uniform of type list"),
    ("a uniform that is text", {"uniforms": Rules("3", 0.0)}, "uniform of type str"),
]  # fmt: skip


def refused(sentence, *, taps=None, **changes):
    """Draws with `changes`, which must be refused with `sentence` and leave everything as it was."""
    arguments = {"pipeline": PIPE, "framebuffer": framebuffer(), "vertices": buffer(), "uniforms": SCENE.rules,
                 "textures": SCENE.images, "threads": 1, **changes}  # fmt: skip
    pipe, target, counters = arguments.pop("pipeline"), arguments["framebuffer"], Counters()
    before = {name: plane.copy() for name, plane in planes(target).items()}
    with pytest.raises(InputError, match=sentence) as error:
        draw_module.draw(pipe, counters=counters, taps=taps, **arguments)
    assert "\n" not in str(error.value) and str(error.value).endswith(".")
    for name, plane in planes(target).items():
        np.testing.assert_array_equal(plane, before[name], err_msg=name)
    assert not dict(counters)
    assert taps is None or (not taps.vertex and not taps.fragment)


@pytest.mark.parametrize(("changes", "sentence"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_refused_row(changes, sentence):
    refused(sentence, taps=Taps(), **changes)


CONTROLS = [
    ("as it is", {}),
    ("two threads", {"threads": 2}),
    ("numpy numbers", {"threads": np.int64(1), "instances": np.int32(1), "vertex_count": np.int64(3)}),
    ("last index", {"indices": [2, 2, 2]}),
    ("no indices", {"indices": []}),
    ("as many instances as rows", {**STEPS, "instances": 2}),
    ("a tuple of one buffer", {"vertices": (buffer(),)}),
    ("viewport beyond the target", viewport(-5, -5, 500, 500, 0, 0)),
    ("scissor of the target", dynamic(scissor=ScissorRect(0, 0, WIDTH, HEIGHT))),
    ("an empty scissor", dynamic(scissor=ScissorRect(WIDTH, HEIGHT, 0, 0))),
    ("full masks", dynamic(stencil_reference=255, stencil_read_mask=255, stencil_write_mask=255)),
    ("an input with planes to spare", {"textures": Images(texture((4, HEIGHT, WIDTH)), FLAGS)}),
]


@pytest.mark.parametrize("changes", [row[1] for row in CONTROLS], ids=[row[0] for row in CONTROLS])
def test_control_row(changes):
    arguments = {"framebuffer": framebuffer(), "vertices": buffer(), "uniforms": SCENE.rules, "loop": "dense",
                 "textures": SCENE.images, "threads": 1, "pipeline": PIPE, **changes}  # fmt: skip
    counters = Counters()
    draw_module.draw(arguments.pop("pipeline"), counters=counters, **arguments)
    counters.check()
    assert counters["draw.calls"] == 1


class Nest(NamedTuple):
    """The inputs, and textures one level down."""

    height: Texture
    flags: Texture
    more: Images


class Arrays(NamedTuple):
    """Uniforms with an array."""

    modulus: int
    slope: float
    table: np.ndarray


def test_feedback_loops_are_refused():
    target = framebuffer()
    color, number = Texture(target.color("weight")), Texture(target.color("id"))
    refused("texture 'height' is also", framebuffer=target, textures=Images(color, FLAGS))
    refused("texture 'flags' is also", framebuffer=target, textures=Images(HEIGHTS, number))
    refused("texture 'height' is also", framebuffer=target, textures=Images(target.texture("color"), FLAGS))
    refused("texture 'height' is also", framebuffer=target, textures=Images(Texture(target.depth[None]), FLAGS))
    nested = Nest(HEIGHTS, FLAGS, Images(HEIGHTS, number))
    refused(r"texture 'more\.flags' is also", framebuffer=target, textures=nested)
    refused("'table' is also", framebuffer=target, uniforms=Arrays(3, 0.0, target.depth))
    refused("'table' is also", framebuffer=target, uniforms=Arrays(3, 0.0, target.stencil[2:]))
    # Control: a copy is no feedback
    copy = Images(Texture(target.color("weight").copy()), Texture(target.color("id").copy()))
    counters = Counters()
    draw_module.draw(PIPE, framebuffer=target, counters=counters, vertices=buffer(), uniforms=SCENE.rules,
                     textures=copy, threads=1, loop="dense")  # fmt: skip
    assert counters["fragment.written"] > 0


def test_taps_refuse_unknown_stages_and_what_would_not_fit(monkeypatch):
    with pytest.raises(InputError, match="no stage 'tessellation'"):
        Taps("tessellation")
    fragments = 3 * WIDTH * HEIGHT
    monkeypatch.setattr(taps_module, "MAX_TAPPED", fragments)
    counters = Counters()
    draw_module.draw(PIPE, framebuffer=framebuffer(), counters=counters, vertices=buffer(), uniforms=SCENE.rules,
                     textures=SCENE.images, taps=Taps())  # fmt: skip
    assert counters["raster.fragments"] == fragments
    monkeypatch.setattr(taps_module, "MAX_TAPPED", fragments - 1)
    refused(f"copy {fragments} records", taps=Taps("fragment"))
    monkeypatch.setattr(rounds_module, "ROUND_PRIMITIVES", 1)
    monkeypatch.setattr(rounds_module, "SMALLEST_SLICE", 1)
    refused(f"copy {fragments} records", taps=Taps("fragment"))
    monkeypatch.setattr(taps_module, "MAX_TAPPED", 2)
    refused("copy 3 records", taps=Taps("vertex"))


@pytest.mark.parametrize(("width", "height"), [(0, 1), (1, 0), (-1, -1), (2**14 + 1, 2**14)])
def test_framebuffers_of_absurd_size_are_refused(width, height):
    assert MAX_TARGET_PIXELS == 2**28
    with pytest.raises(InputError, match=f"{width} × {height} pixels"):
        Framebuffer(width, height, TARGETS)


def test_clears():
    target = framebuffer()
    target.clear_color("color", (1.5, -2))
    target.clear_color("id", 7)
    target.clear_stencil(200)
    target.clear_depth(0.25)
    assert (target.color("color")[0] == 1.5).all() and (target.color("color")[1] == -2).all()
    assert (target.color("id") == 7).all() and (target.color("where") == 0).all()
    assert (target.stencil == 200).all() and (target.depth == 0.25).all()
    with pytest.raises(InputError, match="no target 'colour'; it has color, id, where, weight"):
        target.clear_color("colour", 1)
    with pytest.raises(InputError, match="target 'color' has 2 components"):
        target.clear_color("color", (1, 2, 3))


def test_sentences_begin_with_the_label_of_the_pipeline():
    refused("^the pass of this test: loop", pipeline=replace(PIPE, label="the pass of this test"), loop="x")
