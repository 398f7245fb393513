"""Plan: what a person gets wrong in a first script is told in one sentence, by the name that the script uses.

- Shaders that do not compile: the label, the file and line where they are at fault, and what is wrong; where they
  return or take the wrong things, what they should. No name of numba's intermediate code. Beside each a control in
  the tests that draw with these pipelines. A shader that ends without return is told of while it runs.
- Objects of another class in a field of a pipeline, a framebuffer or run-time state: the field is named; rectangles
  given as plain tuples draw what their classes draw.
- Textures and vertex columns of types or shapes that would be misread.
"""

from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest

from refsim import pipeline as pipeline_module
from refsim.errors import InputError
from refsim.jit import func
from refsim.pipeline.resources import Framebuffer, Texture, VertexBuffer
from refsim.pipeline.state import (
    DepthStencilState,
    DynamicState,
    Pipeline,
    ScissorRect,
    TextureFormat,
    VertexBufferLayout,
    Viewport,
)
from refsim.pipeline.taps import Taps
from tests.pipeline.pipelines import POOL, VERTEX, Flat, Images, Outputs, Sprite
from tests.pipeline.scenes import assert_same, full_screen, run

PIPE = replace(POOL["nearest"], label="my pass")
SCENE = full_screen()
F0 = np.float32(0)


@func
def inner(a):
    return a.colour


def undecorated(x):
    return x


@func
def undefined_name(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, nonsense, Flat(F0, (F0, F0), vertex_index)  # noqa: F821


@func
def vec3_for_vec4(u, t, attributes, vertex_index, instance_index):
    return (F0, F0, F0), F0, Flat(F0, (F0, F0), vertex_index)


@func
def no_varyings(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, F0


@func
def varyings_of_another_kind(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, F0, attributes[0].base


@func
def returns_that_differ(u, t, attributes, vertex_index, instance_index):
    if vertex_index > 1:
        return attributes[0].position, F0
    return attributes[0].position, F0, Flat(F0, (F0, F0), vertex_index)


@func
def branches_that_differ(u, t, attributes, vertex_index, instance_index):
    shade = F0
    if vertex_index > 1:
        shade = attributes[0].color
    return attributes[0].position, shade, Flat(F0, (F0, F0), vertex_index)


@func
def choice_without_name(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, F0 if vertex_index > 1 else attributes[0].color, Flat(F0, (F0, F0), vertex_index)


@func
def tuple_plus_number(u, t, attributes, vertex_index, instance_index):
    moved = attributes[0].position + F0
    return moved, F0, Flat(F0, (F0, F0), vertex_index)


@func
def fault_in_a_function_of_its_own(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, inner(attributes[0]), Flat(F0, (F0, F0), vertex_index)


@func
def call_with_too_much(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, inner(F0, F0), Flat(F0, (F0, F0), vertex_index)


@func
def two_arguments(u, t):
    return (F0, F0, F0, F0), F0, Flat(F0, (F0, F0), np.int32(0))


@func
def construct_left_out(u, t, attributes, vertex_index, instance_index):
    with u as _:
        return attributes[0].position, F0, Flat(F0, (F0, F0), vertex_index)


@func
def unknown_to_numpy(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, np.squareroot(F0), Flat(F0, (F0, F0), vertex_index)


@func
def plain_helper(u, t, attributes, vertex_index, instance_index):
    return attributes[0].position, undecorated(F0), Flat(F0, (F0, F0), vertex_index)


@func
def scalar_for_vector(u, t, v, inputs, pixel):
    return True, v.base, Outputs(v.base, v.id, pixel, v.base)


@func
def no_outputs(u, t, v, inputs, pixel):
    return True, v.base


@func
def path_without_return(u, t, v, inputs, pixel):
    if pixel[0] < 3:
        return True, v.base, Outputs(v.color, v.id, pixel, v.base)


def line_of(shader, text):
    """Where `text` stands in this file, in the shader."""
    lines, first = inspect.getsourcelines(shader.py_func)
    return rf"test_mistakes\.py, line {first + next(k for k, line in enumerate(lines) if text in line)}: "


VERTEX_RETURNS = r"the vertex shader must return \(position, point_size, varyings\)"
FRAGMENT_RETURNS = r"the fragment shader must return \(keep, depth, outputs\)"
SHADERS = [
    (undefined_name, "in undefined_name, NameError: name 'nonsense' is not defined"),
    (vec3_for_vec4, VERTEX_RETURNS),
    (no_varyings, f"{VERTEX_RETURNS}.*expected 3, got 2"),
    (varyings_of_another_kind, VERTEX_RETURNS),
    (returns_that_differ, r"test_mistakes\.py, line \d+: Can.t unify .*types: Tuple.*, Tuple.*Flat"),
    (branches_that_differ, line_of(branches_that_differ, "return") + r"Cannot unify .* for 'shade'\."),
    (choice_without_name, line_of(choice_without_name, "return") + r"Cannot unify \w+ and UniTuple\(\w+ x 2\)\."),
    (tuple_plus_number, line_of(tuple_plus_number, "moved =") + r".*add\(UniTuple\(float32 x 4\), float32\)"),
    (fault_in_a_function_of_its_own, line_of(inner, "return") + "Unknown attribute 'colour'"),
    (call_with_too_much, line_of(call_with_too_much, "return") + r".*signature '\(a\)'.*too many positional"),
    (two_arguments, r"the vertex shader two_arguments must take \(uniforms, textures, attributes, vertex_index, "),
    (construct_left_out, "'with"),
    (unknown_to_numpy, "module 'numpy' has no attribute 'squareroot'"),
    (scalar_for_vector, FRAGMENT_RETURNS),
    (no_outputs, f"{FRAGMENT_RETURNS}.*expected 3, got 2"),
]


def with_shader(shader):
    """The pipeline with this shader, in the stage that its parameters tell."""
    stage = "fragment" if "pixel" in shader.py_func.__code__.co_varnames else "vertex"
    return replace(PIPE, **{stage: replace(getattr(PIPE, stage), shader=shader)})


@pytest.mark.parametrize(("shader", "sentence"), SHADERS, ids=[row[0].py_func.__name__ for row in SHADERS])
def test_a_shader_that_does_not_compile(shader, sentence):
    with pytest.raises(InputError, match=f"^my pass: a shader does not compile: .*{sentence}") as refused:
        run(with_shader(shader), SCENE)
    told = str(refused.value)
    assert "\n" not in told and told.endswith(".") and not set("$") & set(told) and "_refsim_" not in told


def test_a_tap_tells_of_the_vertex_shader_as_a_draw_does():
    with pytest.raises(InputError, match=f"^my pass: a shader does not compile: {VERTEX_RETURNS}"):
        run(with_shader(vec3_for_vec4), SCENE, taps=Taps("vertex"))


def test_a_path_without_return_is_told_of():
    with pytest.raises(InputError, match=r"^my pass: a shader returned nothing: a path through it ends without "):
        run(with_shader(path_without_return), SCENE, threads=2)


def test_a_function_without_func_is_named():
    with pytest.raises(InputError, match=r"is the plain Python function undecorated; decorate it @refsim\.func"):
        run(with_shader(plain_helper), SCENE)


LAYOUT = VertexBufferLayout(Sprite)
FIELDS = [
    ("vertex", None, "vertex must be a VertexState, not None"),
    ("vertex", PIPE.fragment, "vertex must be a VertexState, not FragmentState"),
    ("vertex", replace(VERTEX, buffers=LAYOUT), "vertex.buffers must be a tuple of VertexBufferLayout"),
    ("vertex", replace(VERTEX, buffers=[LAYOUT]), "vertex.buffers must be a tuple of VertexBufferLayout"),
    ("vertex", replace(VERTEX, buffers=(Sprite,)), r"vertex.buffers\[0\] must be a VertexBufferLayout"),
    ("vertex", replace(VERTEX, buffers=(VertexBufferLayout(3),)), r"vertex.buffers\[0\].attributes: 3 is not a Named"),
    ("vertex", replace(VERTEX, buffers=(VertexBufferLayout(Sprite, "row"),)), r"vertex.buffers\[0\].step_mode is 'row"),
    ("vertex", replace(VERTEX, varyings=dict), "vertex.varyings: .* is not a NamedTuple class"),
    ("fragment", PIPE.fragment.shader, "fragment must be a FragmentState or None"),
    ("fragment", replace(PIPE.fragment, outputs=[]), "fragment.outputs: .* is not a NamedTuple class"),
    ("fragment", replace(PIPE.fragment, inputs=int), "fragment.inputs: .* is not a NamedTuple class"),
    ("depth_stencil", None, "depth_stencil must be a DepthStencilState, not None"),
    ("depth_stencil", tuple(PIPE.depth_stencil), "depth_stencil must be a DepthStencilState"),
    ("depth_stencil", DepthStencilState(stencil_front=0), "depth_stencil.stencil_front must be a StencilFaceState"),
    ("geometry", VERTEX, "geometry must be a GeometryState or None"),
    ("stream_output", Flat, "stream_output must be a StreamOutputState or None"),
]  # fmt: skip


@pytest.mark.parametrize(("field", "value", "sentence"), FIELDS)
def test_a_field_of_another_class(field, value, sentence):
    with pytest.raises(InputError, match=f"^my pass: {sentence}") as refused:
        replace(PIPE, **{field: value})
    assert "\n" not in str(refused.value) and replace(PIPE) == PIPE


def test_a_label_that_is_no_text():
    with pytest.raises(InputError, match=r"^label must be a str, not 7"):
        Pipeline(VERTEX, PIPE.fragment, label=7)


@pytest.mark.parametrize("targets", [TextureFormat.R32FLOAT, ["c"], {0: TextureFormat.R32FLOAT}])
def test_targets_that_are_no_mapping(targets):
    with pytest.raises(InputError, match="framebuffer: targets must map names to formats"):
        Framebuffer(8, 8, targets)


def test_rectangles_may_be_plain_tuples():
    classes = DynamicState(Viewport(1, 2, 9, 8), ScissorRect(2, 2, 7, 5))
    tuples = DynamicState((1, 2, 9, 8), (2, 2, 7, 5))
    seen = run(PIPE, SCENE._replace(dynamic=classes))
    assert 0 < seen[1]["fragment.written"] < 16 * 12
    assert_same(seen, run(PIPE, SCENE._replace(dynamic=tuples)))


RECTANGLES = [
    ({"viewport": (0, 0, 8)}, r"viewport must be \(x, y, width, height, min_depth, max_depth\), not \(0, 0, 8\)"),
    ({"viewport": ()}, "viewport must be"),
    ({"viewport": [0, 0, 8, 8]}, "viewport must be"),
    ({"viewport": (0, 0, "8", 8)}, "viewport must be made of numbers"),
    ({"scissor": (0, 0, 8)}, r"scissor must be \(x, y, width, height\), not \(0, 0, 8\)"),
    ({"scissor": (0, 0, 8, 8, 0)}, "scissor must be"),
    ({"scissor": 8}, "scissor must be"),
]
IMAGES = SCENE.images
TEXTURES = [
    (Images(Texture(np.zeros((1, 12, 16), np.uint8)), IMAGES.flags), r"'height' is uint8 of shape \(1, 12, 16\)"),
    ((IMAGES.height, Texture(np.zeros((12, 16), np.float32))), r"'1' is float32 of shape \(12, 16\)"),
    (Images(IMAGES.height, (Texture(np.zeros((1, 1, 1))),)), r"'flags\.0' is float64"),
    (Images(IMAGES.height, Texture([[[0]]])), "'flags' is list; a texture is a float32 or int32 array"),
]
REFUSED = [*[({"dynamic": DynamicState(**row)}, told) for row, told in RECTANGLES],
           *[({"images": images}, f"texture {told}") for images, told in TEXTURES]]  # fmt: skip


@pytest.mark.parametrize(("changes", "sentence"), REFUSED)
def test_a_draw_refuses_what_it_would_misread(changes, sentence):
    with pytest.raises(InputError, match=f"^my pass: {sentence}"):
        run(PIPE, SCENE._replace(**changes))


ROWS = {"position": np.zeros((3, 4)), "size": [1] * 3, "base": [0] * 3, "color": np.zeros((3, 2)), "id": [0, 1, 2]}
COLUMNS = [
    ({"id": [0, 1.5, 2]}, "'id' must be whole numbers of int32, not 1.5"),
    ({"id": [0, 1, 2**31]}, "'id' must be whole numbers of int32, not 2147483648"),
    ({"id": np.array([0, 1, np.nan])}, "'id' must be whole numbers of int32, not nan"),
    ({"id": np.array([0, 1, 2**64 - 1], np.uint64)}, "'id' must be whole numbers of int32, not 1844"),
    ({"base": ["a", "b", "c"]}, "'base' must be numbers"),
    ({"color": [[0, 0], [0], [0, 0]]}, "the rows of 'color' differ in length"),
    ({"position": np.zeros((4, 3))}, r"'position' is transposed: \[4, 3\], where rows would be \[3, 4\]"),
    ({"position": np.zeros((3, 3))}, r"'position' needs 4 components a row, not the shape \(3, 3\)"),
    ({"colour": [0] * 3}, "field 'colour' is unknown; there are position, size, base, color, id"),
]


@pytest.mark.parametrize(("changes", "sentence"), COLUMNS)
def test_a_column_that_would_be_misread(changes, sentence):
    with pytest.raises(InputError, match=f"vertex buffer of Sprite: {sentence}"):
        VertexBuffer.of(Sprite, **{**ROWS, **changes})


@pytest.mark.parametrize("ids", [np.array([0.0, -(2.0**31), 2**31 - 1]), np.array([True, False, True]), [0, 1, 2]])
def test_whole_numbers_of_any_type_are_taken(ids):
    columns = VertexBuffer.of(Sprite, **{**ROWS, "id": ids})
    np.testing.assert_array_equal(columns.ints[0], np.asarray(ids, np.int64))


def test_the_names_of_the_package_are_listed():
    assert dir(pipeline_module) == pipeline_module.__all__
    assert all(getattr(pipeline_module, name) is not None for name in dir(pipeline_module))
