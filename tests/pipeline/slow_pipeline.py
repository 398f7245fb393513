"""The whole draw path restated: fragment by fragment in submission order, plain Python; nothing of refsim's loops.

`slow_draw` works on what a draw is given (vertices as rows, the fragment shader's twin in Python) and changes a
framebuffer's planes. Coverage asks every pixel's centre in float64; `one_fragment` decides on stencil and depth. Early
tests are restated as semantics: which fragments never reach the shader. Returns the counters and a log of fragments.
"""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from refsim.pipeline.resources import Framebuffer
from refsim.pipeline.state import EarlyTests, Pipeline, PrimitiveTopology, StencilOperation
from tests.pipeline.one_blend import blends, write_colors
from tests.pipeline.one_fragment import DEPTH_FAILS, PASSES, STENCIL_FAILS, one_fragment, stored_depth


class Fragment(NamedTuple):
    """One covered pixel of one primitive and how it ended: early stencil, early depth, discarded, stencil, depth,
    written."""

    primitive: int
    y: int
    x: int
    fate: str
    depth: float
    outputs: dict[str, Any]
    stored: dict[str, tuple]  # what the colour targets hold after it


def slow_draw(
    pipe: Pipeline, framebuffer: Framebuffer, vertices: list, uniforms: Any, images: Any, dynamic: Any, twin: Any
) -> tuple[Counter, list[Fragment]]:
    """Draws `vertices` = [(clip position, size, varyings), …] into `framebuffer`; `twin` is the fragment shader."""
    counts: Counter = Counter({"draw.calls": 1, "vertex.invocations": len(vertices)})
    log: list[Fragment] = []
    corners = 4 if pipe.topology == PrimitiveTopology.QUAD_LIST else 1
    for number in range(len(vertices) // corners):
        vertex = vertices[number * corners : (number + 1) * corners]
        counts["assembly.primitives"] += 1
        counts["raster.primitives"] += 1
        pixels = covered(vertex, framebuffer, dynamic)
        if pixels is None:
            counts["raster.clipped"] += 1
            continue
        counts["raster.drawn" if len(pixels) else "raster.empty"] += 1
        position, _, varyings = vertex[0]
        for y, x in pixels:
            texels = type(images)(*(texture.data[0, y, x] for texture in images))
            keep, z, outputs = twin(uniforms, varyings, texels, (int(x), int(y)))
            forced = pipe.early_tests == EarlyTests.FORCED
            if forced or not pipe.fragment.writes_depth:
                z = np.float32(position[2]) * (np.float32(1) / np.float32(position[3]))
            z = stored_depth(pipe.depth_stencil.format.name, float(z))
            keep = keep or not pipe.fragment.discards
            fate = finish(pipe, framebuffer, dynamic, y, x, z, keep, outputs)
            counts["raster.fragments"] += 1
            if fate == "written" and blends(pipe, framebuffer):
                counts["blend.fragments"] += 1
            count_fate(counts, framebuffer, fate, y, x)
            stored = {name: tuple(framebuffer.color(name)[:, y, x]) for name in framebuffer.targets}
            log.append(Fragment(number, int(y), int(x), fate, z, outputs, stored))
    return counts, log


def covered(vertex: list, framebuffer: Framebuffer, dynamic: Any) -> np.ndarray | None:
    """Rows (y, x) of the pixels whose centres a point or quad covers, in rows; None when it is clipped."""
    position = np.array([v[0] for v in vertex], np.float64)
    w = position[:, 3]
    bounded = (np.abs(position[:, :2]) <= w[:, None]).all() and (position[:, 2] >= 0).all()
    if not (bounded and (position[:, 2] <= w).all() and (w > 0).all()):
        return None
    px = (position[:, 0] / w + 1) / 2 * framebuffer.width
    py = (1 - position[:, 1] / w) / 2 * framebuffer.height
    half = float(vertex[0][1]) / 2 if len(vertex) == 1 else 0.0
    xs, ys = np.arange(framebuffer.width) + 0.5, np.arange(framebuffer.height) + 0.5
    in_x = (xs >= px.min() - half) & (xs < px.max() + half)
    in_y = (ys >= py.min() - half) & (ys < py.max() + half)
    if dynamic.scissor is not None:
        x, y, width, height = dynamic.scissor
        in_x &= (xs > x) & (xs < x + width)
        in_y &= (ys > y) & (ys < y + height)
    return np.argwhere(in_y[:, None] & in_x)


def finish(pipe: Pipeline, framebuffer: Framebuffer, dynamic: Any, y, x, z, keep, outputs) -> str:
    """Tests, updates and writes of one fragment; returns its fate."""
    state, face = pipe.depth_stencil, pipe.depth_stencil.stencil_front
    outcome, depth, stencil = one_fragment(
        state, dynamic.stencil_reference, dynamic.stencil_read_mask, dynamic.stencil_write_mask,
        z, float(framebuffer.depth[y, x]), int(framebuffer.stencil[y, x]),
    )  # fmt: skip
    early_stencil, early_depth = early(pipe)
    forced = pipe.early_tests == EarlyTests.FORCED
    tested_early = (outcome == STENCIL_FAILS and early_stencil) or (outcome == DEPTH_FAILS and early_depth)
    if keep or forced or tested_early:
        assert keep or forced or fails_quietly(face, outcome)
        framebuffer.depth[y, x], framebuffer.stencil[y, x] = depth, stencil
    if tested_early:
        return "early stencil" if outcome == STENCIL_FAILS else "early depth"
    if not keep:
        return "discarded"
    if outcome != PASSES:
        return "stencil" if outcome == STENCIL_FAILS else "depth"
    write_colors(pipe, framebuffer, dynamic.blend_constant, y, x, outputs)
    return "written"


def fails_quietly(face: Any, outcome: str) -> bool:
    """Whether failing so leaves the stencil as it was."""
    return (face.fail_op if outcome == STENCIL_FAILS else face.depth_fail_op) == StencilOperation.KEEP


def early(pipe: Pipeline) -> tuple[bool, bool]:
    """Whether stencil and depth failures are found before the shader runs, by the policy's own words."""
    fragment, state = pipe.fragment, pipe.depth_stencil
    if pipe.early_tests == EarlyTests.FORCED:
        return True, True
    plain = not (fragment.discards or fragment.writes_depth)
    if pipe.early_tests == EarlyTests.NONE or (pipe.early_tests == EarlyTests.MESA and not plain):
        return False, False
    # Ideal: not where a fragment that the shader would have discarded had changed the stencil by failing
    early_stencil = not fragment.discards or fails_quietly(state.stencil_front, STENCIL_FAILS)
    can_fail = state.stencil_front.compare.name != "ALWAYS"
    early_depth = not fragment.writes_depth and (early_stencil or not can_fail)
    return early_stencil, early_depth and (not fragment.discards or fails_quietly(state.stencil_front, DEPTH_FAILS))


def count_fate(counts: Counter, framebuffer: Framebuffer, fate: str, y, x) -> None:
    """Adds one fragment's fate to the counters and, if the shader ran, to the invocations plane."""
    names = {
        "early stencil": ("stencil.failed", "stencil.failed_early"),
        "early depth": ("depth.failed", "depth.failed_early"),
        "discarded": ("fragment.discarded",),
        "stencil": ("stencil.failed",),
        "depth": ("depth.failed",),
        "written": ("fragment.written",),
    }[fate]
    for name in names:
        counts[name] += 1
    if not fate.startswith("early"):
        counts["fragment.invocations"] += 1
        framebuffer.invocations[y, x] += 1
