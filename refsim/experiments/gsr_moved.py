"""Bytes that a run moves: rays through vertex buffers or render targets, and colours, by arithmetic from its counters.

geometry_shader  a pass reads its vertex buffer and writes the captured one, 64 bytes a ray (Listing 2); every fragment
                 that is written reads and writes the texel of each of its targets; the blending passes read each
                 target's texel and read and write the image's
fragment_grid    a pass of a ray generation reads the origin, direction and hit of its senders and writes its own,
                 three texels of 16 bytes; a pass that lights reads these and the occluders' hit, and reads and writes
                 the image

Both formats are 32-bit floats, four a texel. Textures of the scene, and what only counts, are left out.
"""

from __future__ import annotations

from refsim.experiments.gsr_runs import FRAGMENT_GRID
from refsim.experiments.registry import Row
from refsim.papers.geometry_shader_rays.record import RECORD_BYTES
from refsim.results import Trace

TEXEL = 16
RAY_TEXELS = 3  # origin and t_max, direction, hit
BOTH_WAYS = 2


def moved(found: Trace, pixels: int, lights: int) -> Row:
    """Draw calls, shader invocations and bytes of a run."""
    c = found.counters
    row = {
        "draw_calls": c["draw.calls"],
        "vertex_shader_runs": c["vertex.invocations"],
        "geometry_shader_runs": c["geometry.invocations"],
        "fragment_shader_runs": c["fragment.invocations"],
    }
    own = _of_quads(found, pixels) if found.method == FRAGMENT_GRID else _of_points(found, lights)
    return {**row, **own}


def _of_points(found: Trace, lights: int) -> Row:
    passes = [generation.counters for generation in found.generations]
    read = sum(counters["vertex.invocations"] for counters in passes)
    written = sum(counters["stream_output.primitives"] for counters in passes)
    shaded = sum(counters["fragment.written"] for counters in passes)
    blended = found.counters["fragment.written"] - shaded
    colors = shaded * (lights + 1) * BOTH_WAYS + blended * (1 + BOTH_WAYS)
    return {
        "ray_bytes_read": read * RECORD_BYTES,
        "ray_bytes_written": written * RECORD_BYTES,
        "color_bytes": colors * TEXEL,
    }


def _of_quads(found: Trace, pixels: int) -> Row:
    generations = len(found.generations)
    lighting = found.counters["draw.calls"] - generations
    return {
        "ray_bytes_read": pixels * TEXEL * (generations * RAY_TEXELS + lighting * (RAY_TEXELS + 1)),
        "ray_bytes_written": pixels * TEXEL * generations * RAY_TEXELS,
        "color_bytes": pixels * TEXEL * lighting * BOTH_WAYS,
    }
