"""Blending: float32 within the rounding of its few operations, 8 bits within one step a blend.

Plan
- One blend of any source with any stored colour, under every factor before source and destination in every format,
  every operation, write masks, targets without alpha, and the second source.
  float32: OpenGL does not say in which order the products are formed (4.6 section 17.3.6). Mesa's llvmpipe takes a
  common or complementary factor out of the sum, f (s + d) or d + f (s − d), and is refsim's bits otherwise; so it is
  asserted. Any order of these operations stays within 4 half units in the last place of |s| |f| + |d| |g|.
  8 bits: llvmpipe blends bytes: source and constant are rounded to 8 bits first, then each product is; refsim rounds
  once, at the end. With sources that are bytes that is 0.5 + 0.5 + 0.5 steps, so the results differ by one step at
  most; a source that is none adds half a step through each of its places, 4 at most, so 3 steps in all.
- Stacks of blends that enlarge nothing, behind stencil and depth: as many steps as the pixel has blends; the numbers
  of blends are the same.
"""

from __future__ import annotations

import numpy as np
import pytest

from refsim.pipeline.enums import BlendOperation, PrimitiveTopology
from refsim.pipeline.state import BlendComponent, DynamicState
from tests.opengl import blending, streams
from tests.opengl import case as cases
from tests.opengl.streams import SIZE
from tests.opengl.verdicts import note, same, within

SEED = blending.SEED
COUNT = SIZE[0] * SIZE[1]
HALF_UNIT = 2.0**-24
PAIRS = {"zero": "one", "src": "one-minus-src", "dst": "one-minus-dst", "constant": "one-minus-constant",
         "src-alpha": "one-minus-src-alpha", "dst-alpha": "one-minus-dst-alpha",
         "src1": "one-minus-src1", "src1-alpha": "one-minus-src1-alpha"}  # fmt: skip


def one_blend_a_pixel(rng, pipeline, glsl, targets, as_bytes):
    """A point of one pixel on every pixel of random colours; float sources within ±2 unless `as_bytes`."""

    def colors(*shape):
        return rng.integers(0, 256, shape) / 255 if as_bytes else rng.uniform(-2, 2, shape)

    y, x = np.divmod(np.arange(COUNT), SIZE[0])
    vertices = {
        "position": streams.clip(np.column_stack([x, y]) + 0.5, np.full(COUNT, 0.5)),
        "size": np.ones(COUNT, np.float32),
        "source": colors(COUNT, 4).astype(np.float32),
        "second": colors(COUNT, 4).astype(np.float32),
    }
    planes = cases.blank(*SIZE, targets, pipeline.depth_stencil.format)
    for name, form in targets.items():
        shape = planes.color[name].shape
        planes.color[name][:] = rng.integers(0, 256, shape) if form.is_unorm8 else rng.uniform(-2, 2, shape)
    constant = tuple(float(np.float32(part)) for part in colors(4))
    return cases.case(
        pipeline, glsl, vertices, targets, SIZE, planes=planes, dynamic=DynamicState(blend_constant=constant)
    )


def may_be_factored(part: BlendComponent) -> bool:
    """Whether Mesa may take a factor out of the sum."""
    src, dst = part.src_factor.value, part.dst_factor.value
    return src == dst or PAIRS.get(src) == dst or PAIRS.get(dst) == src


def float_bound(witness, part: BlendComponent, given, name: str, component: int):
    """What a float32 component may differ by."""
    if part.operation in (BlendOperation.MIN, BlendOperation.MAX):
        return 0
    if "llvmpipe" in witness.renderer and not may_be_factored(part):
        return 0
    s, s1 = (given.vertices[which].T.reshape(4, *SIZE[::-1]).astype(np.float64) for which in ("source", "second"))
    d = given.planes.color[name].astype(np.float64)
    c = given.dynamic.blend_constant
    d_alpha = d[3] if len(d) == 4 else np.ones_like(d[0])
    values = (s[component], d[component], s1[component], c[component], s[3], d_alpha, s1[3], c[3])
    terms = sum(
        np.abs(values[k]) * blending.size_of_factor(factor, *values)
        for k, factor in enumerate((part.src_factor, part.dst_factor))
    )
    return 4 * HALF_UNIT * terms


def judge(witness, what, given, ours, theirs, byte_steps):
    """Every component of every target within its bound."""
    for name, target in zip(given.targets, given.pipeline.fragment.targets, strict=True):
        planes = ours.planes.color[name], theirs.planes.color[name]
        for k in range(len(planes[0])):
            part = target.blend.alpha if k == 3 else target.blend.color
            unorm = given.targets[name].is_unorm8
            bound = byte_steps if unorm else float_bound(witness, part, given, name, k)
            within("blend", f"{what}, {name}[{k}], {target}", planes[0][k], planes[1][k], bound)
    note("blend", draws=1, fragments=ours.counts["fragment.written"])


@pytest.mark.parametrize("number", range(len(blending.SAMPLE)))
def test_one_blend(witness, number):
    pipeline = blending.SAMPLE[number]
    for k in range(4):
        rng = np.random.default_rng([SEED, number, k])
        given = one_blend_a_pixel(rng, pipeline, blending.GLSL, blending.TARGETS, as_bytes=k % 2 == 0)
        what = f"pipeline {number}, seed {SEED}, {k}"
        judge(witness, what, given, cases.ours(given), witness.draw(given), 1 if k % 2 == 0 else 3)


@pytest.mark.parametrize("name", blending.DUAL)
def test_one_blend_with_a_second_source(witness, name):
    pipeline = blending.DUAL[name]
    for k in range(2):
        rng = np.random.default_rng([SEED, 100, k])
        targets = {name: blending.TARGETS[name]}
        given = one_blend_a_pixel(rng, pipeline, blending.DUAL_GLSL, targets, as_bytes=k % 2 == 0)
        judge(witness, f"second source, {k}", given, cases.ours(given), witness.draw(given), 1 if k == 0 else 3)


def test_stacks_of_blends_behind_stencil_and_depth(witness):
    targets = blending.STACK_TARGETS
    for k in range(6):
        rng = np.random.default_rng([SEED, 200, k])
        many = streams.columns(rng, PrimitiveTopology.POINT_LIST, 200)
        color = many["color"]
        vertices = {"position": many["position"], "size": many["size"], "source": color, "second": color}
        planes = cases.blank(*SIZE, targets, blending.STACK.depth_stencil.format)
        planes.stencil[:] = rng.integers(0, 2, planes.stencil.shape)
        constant = tuple(float(np.float32(part / 255)) for part in rng.integers(0, 256, 4))
        given = cases.case(
            blending.STACK, blending.STACK_GLSL, vertices, targets, SIZE, planes=planes,
            dynamic=DynamicState(None, None, 1, blend_constant=constant),
        )  # fmt: skip
        ours, theirs = cases.ours(given), witness.draw(given)
        count = ours.planes.color["count"][0]
        assert count.max() > 5
        same("blend", f"blends a pixel, {k}", ours.planes.color["count"], theirs.planes.color["count"])
        same("blend", f"stencil, {k}", ours.planes.stencil, theirs.planes.stencil)
        same("blend", f"depth, {k}", ours.planes.depth, theirs.planes.depth)
        for name in ("bytes", "two"):
            within("blend", f"{name}, {k}", ours.planes.color[name], theirs.planes.color[name], count)
        # Colours and alphas stay below 2 here, and a blend rounds by 4 half units of the sum of its terms, below 4
        within("blend", f"wide, {k}", ours.planes.color["wide"], theirs.planes.color["wide"], 16 * HALF_UNIT * count)
        same("blend", f"samples passed, {k}", ours.counts["fragment.written"], theirs.counts["fragment.written"])
        note("blend", draws=1, fragments=ours.counts["raster.fragments"])
