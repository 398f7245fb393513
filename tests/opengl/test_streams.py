"""Random streams of fragments through stencil and depth: what is left is the same, bit for bit.

Plan
- Points and triangles of both facings, 60 a stream, over random stencil values and depths, under eight pipelines in
  which every stencil operation and comparison takes every place in both faces; random reference and masks, so that
  streams differ in nothing but run-time values too: colour (float32), numbers (int32), stencil, depth, and the counts:
  samples passed, primitives generated and assembled, vertex invocations (exact in Mesa where nothing is indexed).
  Depths are multiples of 1/16: 24-bit rounding, which OpenGL leaves to the implementation, then decides no test.
- unorm8 without blending: OpenGL 4.6 section 2.3.5.1 asks for the nearest byte but lets halves and precision be; any
  float32 at all is within half a step and 2^-16 of its byte. Bytes and halves of steps among them.
- depth24unorm: any depth is stored within one unit of 1 / (2^24 − 1), and so are refsim's and OpenGL's apart. llvmpipe
  rounds the product to float32 before it rounds it to a unit, which leaves it up to 0.75 units off.
- depth32float: any depth that the shader writes is stored as it is, clamped.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from refsim.pipeline.enums import CompareFunction, DepthStencilFormat, PrimitiveTopology
from refsim.pipeline.state import DepthStencilState, DynamicState
from tests.opengl import case as cases
from tests.opengl import streams
from tests.opengl.streams import D24, SEED, SIZE, STENCIL_DEPTH, TARGETS
from tests.opengl.target import Planes
from tests.opengl.verdicts import note, same, within

STREAMS = 6
# Counters of refsim, and the names of OpenGL's in `tests.opengl.witness` that they equal
COUNTS = {
    "fragment.written": "fragment.written",
    "raster.primitives": "primitives.generated",
    "assembly.primitives": "assembly.primitives",
    "vertex.invocations": "vertex.invocations",
}
UNITS = 2.0**24 - 1
# Everything is kept and stored: stencil and depth tests pass
STORE = {
    form: replace(
        STENCIL_DEPTH["0 point-list ideal"],
        depth_stencil=DepthStencilState(form, True, CompareFunction.ALWAYS),
        fragment=replace(STENCIL_DEPTH["0 point-list ideal"].fragment, writes_depth=True, discards=False),
    )
    for form in DepthStencilFormat
}


def background(rng: np.random.Generator, form: DepthStencilFormat) -> Planes:
    """Random stencil, depths of the streams' own multiples of 1/16, colours that no fragment has."""
    planes = cases.blank(*SIZE, TARGETS, form)
    planes.stencil[:] = rng.integers(0, 256, planes.stencil.shape)
    depth = rng.integers(0, 17, planes.depth.shape) / 16
    planes.depth[:] = np.floor(depth * UNITS + 0.5) if form == D24 else depth
    planes.color["color"][:] = -1
    return planes


@pytest.mark.parametrize("name", STENCIL_DEPTH)
def test_random_streams_end_the_same(witness, name):
    pipeline = STENCIL_DEPTH[name]
    for k in range(STREAMS):
        rng = np.random.default_rng([SEED, k])
        form = pipeline.depth_stencil.format
        values = [int(v) for v in rng.integers(0, 256, 3)]
        if k % 2:
            values[1:] = 0xFF, 0xFF  # full masks let every value of the 8 bits come about
        given = cases.case(
            pipeline, streams.glsl(pipeline), streams.columns(rng, pipeline.topology, 60), TARGETS, SIZE,
            planes=background(rng, form), dynamic=DynamicState(None, None, *values),
        )  # fmt: skip
        ours, theirs = cases.ours(given, loop="dense" if name[0] in "27" else "list"), witness.draw(given)
        said = f"stream {k} of {name}, reference and masks {values}"
        for target in ("color", "id", "where"):
            same("streams", f"{target}, {said}", ours.planes.color[target], theirs.planes.color[target])
        same("streams", f"stencil, {said}", ours.planes.stencil, theirs.planes.stencil)
        within("streams", f"depth, {said}", ours.planes.depth, theirs.planes.depth, 1 if form == D24 else 0)
        for name_here, name_there in COUNTS.items():
            same("streams", f"{name_here}, {said}", ours.counts[name_here], theirs.counts[name_there])
        note("streams", draws=1, fragments=ours.counts["raster.fragments"])


def a_pixel_each(rng: np.random.Generator, **columns: np.ndarray) -> dict[str, np.ndarray]:
    """One point on every pixel, with some columns as given."""
    count = SIZE[0] * SIZE[1]
    given = streams.columns(rng, PrimitiveTopology.POINT_LIST, count)
    y, x = np.divmod(np.arange(count), SIZE[0])
    given["position"] = streams.clip(np.column_stack([x, y]) + 0.5, np.full(count, 0.5))
    given["size"] = np.ones(count, np.float32)
    return {**given, **columns}


def test_unorm8_holds_the_nearest_byte(witness):
    rng = np.random.default_rng(SEED)
    count = SIZE[0] * SIZE[1]
    color = rng.uniform(-0.1, 1.1, (count, 4)).astype(np.float32)
    color[:256] = (np.arange(256) / 255).astype(np.float32)[:, None]
    color[256:512] = ((np.arange(256) + 0.5) / 255).astype(np.float32)[:, None]
    pipeline = STORE[streams.D32]
    given = cases.case(pipeline, streams.glsl(pipeline), a_pixel_each(rng, color=color), TARGETS, SIZE)
    exact = np.clip(color.astype(np.float64), 0, 1).T.reshape(4, *SIZE[::-1]) * 255
    for outcome in (cases.ours(given, loop="list"), witness.draw(given)):
        within("streams", "bytes", outcome.planes.color["bytes"], exact, 0.5 + 2**-16 * 255)
    note("streams", draws=1, fragments=count)


@pytest.mark.parametrize("form", DepthStencilFormat, ids=lambda form: form.name)
def test_depth_is_stored_as_its_format_says(witness, form):
    rng = np.random.default_rng([SEED, 1])
    count = SIZE[0] * SIZE[1]
    near = np.float32(2) ** rng.uniform(-30, 0, count).astype(np.float32)
    base = np.where(np.arange(count) % 2, near, rng.uniform(-0.1, 1.1, count)).astype(np.float32)
    pipeline = STORE[form]
    given = cases.case(pipeline, streams.glsl(pipeline), a_pixel_each(rng, base=base), TARGETS, SIZE)
    ours, theirs = cases.ours(given, loop="list").planes.depth, witness.draw(given).planes.depth
    exact = np.clip(base.astype(np.float64), 0, 1).reshape(SIZE[::-1]) * (UNITS if form == D24 else 1)
    for side, depth in (("refsim", ours), ("OpenGL", theirs)):
        within("streams", f"depth in {form.name}, {side}", depth, exact, 1 if form == D24 else 0)
    within("streams", f"depth in {form.name}", ours, theirs, 1 if form == D24 else 0)
    note("streams", draws=1, fragments=count)
