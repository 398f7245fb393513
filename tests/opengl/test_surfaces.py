"""What a triangle's pixels are given: varyings and depth, within bounds of float32 arithmetic.

Plan
- Perspective-correct, linear and flat varyings and integers over random triangles of any w, corners on the sub-pixel
  grid and off it: refsim and OpenGL each within the bound of `surfaces.exact`; flat ones and integers identical, of
  the first vertex. Triangles are larger than 50 pixels, so that their slopes are known to few roundings.
- Depth, stored as float32 and in 24 bits (where one unit is added for the rounding that OpenGL leaves open); the
  viewport's depth range.
- Depth bias: constant, slope and clamp move the stored depth by what OpenGL 4.6 section 14.6.5 says, within the
  roundings of depth with and without it. What one unit is in 24 bits the implementation may choose; Mesa takes two
  steps of the format, refsim (as WebGPU asks) one. It is measured first, and both are held to their own.
"""

from __future__ import annotations

import numpy as np
import pytest

from refsim.pipeline.enums import DepthStencilFormat
from refsim.pipeline.state import DynamicState, Viewport
from tests.opengl import case as cases
from tests.opengl import surfaces
from tests.opengl.streams import clip
from tests.opengl.verdicts import note, same, within

SEED = 33001
SIZE = (64, 48)
D32, D24 = DepthStencilFormat
PLAIN = {form: surfaces.pipeline(form) for form in DepthStencilFormat}
UNITS = {D32: 1.0, D24: 2.0**24 - 1}


def triangle(rng, on_grid, any_w=True):
    """Corners [3, 4] of a triangle larger than 50 pixels, and its vertices' columns."""
    while True:
        place = rng.uniform(0, 1, (3, 2)) * SIZE
        place = np.rint(place * 256) / 256 if on_grid else place
        (ax, ay), (bx, by) = place[1] - place[0], place[2] - place[0]
        if abs(ax * by - ay * bx) > 100:
            break
    w = np.exp(rng.uniform(-2, 2, 3)) if any_w else 1.0
    position = clip(place, rng.uniform(0.05, 0.95, 3), SIZE, w)
    values = rng.uniform(-1, 1, (3, 5)).astype(np.float32)
    columns = {"smooth": values[:, :2], "linear": values[:, 2:4], "flat": values[:, 4], "id": rng.integers(0, 99, 3)}
    return position, {"position": position, **columns}


def both(witness, pipeline, vertices, **others):
    """Outcomes of refsim and OpenGL onto blank planes; covered pixels bool [h, w], the same for both."""
    given = cases.case(pipeline, surfaces.GLSL, vertices, surfaces.TARGETS, SIZE, **others)
    ours, theirs = cases.ours(given), witness.draw(given)
    covers = [outcome.planes.depth != given.planes.depth for outcome in (ours, theirs)]
    note("surfaces", draws=1, fragments=ours.counts["fragment.written"])
    return ours, theirs, covers[0] & covers[1]


def window_depth(position):
    """Depths of corners [3]."""
    return position[:, 2].astype(np.float64) / position[:, 3]


@pytest.mark.parametrize("on_grid", [True, False], ids=["on the grid", "anywhere"])
def test_varyings_are_within_the_bound(witness, on_grid):
    for k in range(40):
        position, vertices = triangle(np.random.default_rng([SEED, on_grid, k]), on_grid)
        ours, theirs, cover = both(witness, PLAIN[D32], vertices)
        for name, perspective in (("smooth", True), ("linear", False)):
            for part in range(2):
                values = vertices[name][:, part]
                exact = surfaces.exact(position, values, SIZE, perspective=perspective, on_grid=on_grid)
                for side, outcome in (("refsim", ours), ("OpenGL", theirs)):
                    got = outcome.planes.color[name][part]
                    what = f"{name}, triangle {k}, {side}"
                    within("surfaces", what, got[cover], exact.value[cover], exact.bound[cover])
        for name in ("flat", "id"):
            same("surfaces", f"{name}, triangle {k}", ours.planes.color[name], theirs.planes.color[name])
            assert (ours.planes.color[name][0][cover] == vertices[name][0]).all()


@pytest.mark.parametrize("form", DepthStencilFormat, ids=lambda form: form.name)
def test_depth_is_within_the_bound(witness, form):
    for k in range(20):
        rng = np.random.default_rng([SEED, 2, k])
        position, vertices = triangle(rng, on_grid=False)
        low, high = (0.0, 1.0) if k % 2 else np.sort(rng.uniform(0, 1, 2))
        view = Viewport(0, 0, *SIZE, float(low), float(high))
        ours, theirs, cover = both(witness, PLAIN[form], vertices, dynamic=DynamicState(view))
        z = np.float32(low) + window_depth(position) * (np.float64(np.float32(high)) - np.float32(low))
        exact = surfaces.exact(position, z, SIZE, perspective=False, on_grid=False)
        bound = exact.bound * UNITS[form] + (1 if form == D24 else 0)
        for side, outcome in (("refsim", ours), ("OpenGL", theirs)):
            got = outcome.planes.depth
            within("surfaces", f"depth {k}, {side}", got[cover], exact.value[cover] * UNITS[form], bound[cover])


def steps_a_unit(witness):
    """How many steps of 24 bits OpenGL moves a level triangle by, for a constant bias of one unit."""
    position = clip(np.array([[5, 5], [60, 5], [5, 40]]), np.full(3, 0.5), SIZE)
    vertices = {**triangle(np.random.default_rng(SEED), True)[1], "position": position}
    pipeline = surfaces.pipeline(D24, 1024)
    given = [cases.case(p, surfaces.GLSL, vertices, surfaces.TARGETS, SIZE) for p in (PLAIN[D24], pipeline)]
    before, after = (int(witness.draw(each).planes.depth[10, 10]) for each in given)
    assert (after - before) % 1024 in (0, 1, 1023)
    return round((after - before) / 1024)


BIASES = [(200, 0.0, 0.0), (-3000, 0.0, 0.0), (7, -2.0, 0.0), (0, 1.5, 0.0), (100, 3.0, 0.01), (0, -4.0, -0.02)]


@pytest.mark.parametrize(("form", "bias"), [((D32, D24)[k % 2], bias) for k, bias in enumerate(BIASES)])
def test_bias_moves_depth_as_said(witness, form, bias):
    constant, scale, clamp = bias
    pipeline = surfaces.pipeline(form, constant, scale, clamp)
    steps = {"refsim": 1, "OpenGL": steps_a_unit(witness) if form == D24 else 1}
    assert steps["OpenGL"] in (1, 2)
    for k in range(6):
        position, vertices = triangle(np.random.default_rng([SEED, 3, k]), on_grid=True, any_w=False)
        ours, theirs, cover = both(witness, pipeline, vertices)
        z = window_depth(position)
        exact = surfaces.exact(position, z, SIZE, perspective=False, on_grid=True)
        down, across = np.gradient(exact.value)
        step = 2.0 ** (np.floor(np.log2(z.max())) - 23) if form == D32 else 2.0**-24
        slope = max(abs(down[0, 0]), abs(across[0, 0]))
        # A slope is as uncertain as the depth a pixel further; 2^-24 and 1 / (2^24 − 1) are taken for one another
        bound = exact.bound * (1 + abs(scale)) * UNITS[form] + (1 if form == D24 else 0)
        for side, outcome in (("refsim", ours), ("OpenGL", theirs)):
            moved = constant * step * steps[side] + scale * slope
            moved = min(moved, clamp) if clamp > 0 else max(moved, clamp) if clamp < 0 else moved
            expected = np.clip(exact.value + moved, 0, 1) * UNITS[form]
            what = f"bias {bias}, triangle {k}, {side}"
            within("surfaces", what, outcome.planes.depth[cover], expected[cover], bound[cover])
