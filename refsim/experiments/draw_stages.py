"""One small draw call, looked at after each of its stages: every number comes from a tap of the pipeline.

The draw is that of `refsim.experiments.small_draw`, the picture that of `refsim.experiments.stage_panels`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.counters import REGISTRY
from refsim.experiments import stage_panels
from refsim.experiments.registry import Experiment, Row, Rows, Tables
from refsim.experiments.small_draw import HEIGHT, WIDTH, Drawn, Record, cases, drawn
from refsim.pipeline.fragment import DEPTH_FAILED, DISCARDED, EARLY_DEPTH, EARLY_STENCIL, STENCIL_FAILED, WRITTEN
from refsim.pipeline.vertex_buffer import record_type
from refsim.reference import raster

FATES = {
    EARLY_STENCIL: "stencil failed",
    EARLY_DEPTH: "depth failed",
    DISCARDED: "discarded",
    STENCIL_FAILED: "stencil failed",
    DEPTH_FAILED: "depth failed",
    WRITTEN: "written",
}


def short(value: Any) -> float:
    """The shortest decimal number that is this float32."""
    return float(str(np.float32(value)))


def named(names: str, values: Any) -> Row:
    """Columns for the components of a vector."""
    return {name: short(value) for name, value in zip(names.split(), values, strict=True)}


def on_screen(position: np.ndarray) -> Row:
    """Where a clip-space position falls, in pixels."""
    ndc, _ = raster.divide(position)
    return named("screen_x_px screen_y_px", raster.to_screen(ndc, (0, 0, WIDTH, HEIGHT, 0, 1)))


def measure(capacity: int) -> Rows:
    """A row for every vertex, emitted vertex, record, triangle, fragment, pixel and counter, marked with its stage."""
    result = drawn(capacity)
    stages = {
        "vertices": vertex_rows(result),
        "emitted": emitted_rows(result),
        "records": record_rows(result),
        "triangles": triangle_rows(result),
        "fragments": fragment_rows(result),
        "pixels": pixel_rows(result),
        "": [
            {"counter": name, "count": count, "unit": REGISTRY[name].unit} for name, count in result.counters.items()
        ],
    }
    return [{"stage": stage, **row} for stage, rows in stages.items() for row in rows]


CLIP = "clip_x clip_y clip_z clip_w"


def vertex_rows(result: Drawn) -> Rows:
    """What the vertex shader returned."""
    tap = result.taps.vertex[0]
    return [
        {"vertex": i, **named(CLIP, p), **on_screen(p), "pieces": int(tap.varyings["pieces"][i])}
        for i, p in enumerate(tap.position)
    ]


def emitted_rows(result: Drawn) -> Rows:
    """What the geometry shader emitted, and from which vertex."""
    tap = result.taps.geometry[0]
    return [
        {
            "emitted": i, "invocation": int(tap.invocation[i]), "entry": int(tap.entry[i]),
            "vertex": int(tap.vertices[i, 0]), **named(CLIP, p), "heat": short(tap.varyings["heat"][i]), **on_screen(p),
        }
        for i, p in enumerate(tap.position)
    ]  # fmt: skip


def record_rows(result: Drawn) -> Rows:
    """The captured buffer row by row, the free ones too."""
    tap, geometry = result.taps.stream_output[0], result.taps.geometry[0]
    size = record_type(Record).itemsize
    lines: Rows = [{"record": row, "offset_bytes": row * size} for row in range(result.captured.capacity)]
    for i, position in enumerate(tap.records["position"]):
        primitive = int(tap.primitives[i // 3])
        first = int(geometry.primitives[primitive, 0])
        origin = {"primitive": primitive, "invocation": int(geometry.invocation[first])}
        captured = {**origin, **named("x y z w", position), "heat": short(tap.records["heat"][i])}
        lines[tap.first_row + i] |= captured
    return lines


def triangle_rows(result: Drawn) -> Rows:
    """What the rasteriser set up: corners on the sub-pixel grid and the pixels that bound them."""
    tap = result.taps.raster[0]
    lines = []
    for i, corners in enumerate(tap.corners):
        line: Row = {"primitive": int(tap.primitive[i]), "invocation": int(tap.invocation[i])}
        line |= {f"emitted_{k}": int(vertex) for k, vertex in enumerate(tap.vertices[i])}
        for k, (x, y) in enumerate(corners):
            line |= {f"corner_{k}_x_256ths_px": int(x), f"corner_{k}_y_256ths_px": int(y)}
        line |= {f"box_{name}_px": int(edge) for name, edge in zip(("x0", "y0", "x1", "y1"), tap.rect[i], strict=True)}
        lines.append({**line, "front": bool(tap.front[i])})
    return lines


def fragment_rows(result: Drawn) -> Rows:
    """What the fragment shader returned, what became of it, and what the target held then."""
    tap = result.taps.fragment[0]
    return [
        {
            "primitive": int(tap.primitive[i]), "invocation": int(tap.invocation[i]), "x_px": int(tap.x[i]),
            "y_px": int(tap.y[i]), "heat": short(tap.outputs["heat"][i]), "depth": short(tap.depth[i]),
            **named("red green blue alpha", tap.outputs["color"][i]), "fate": FATES[int(tap.fate[i])],
            **named("stored_red stored_green stored_blue stored_alpha", tap.stored["color"][i]),
        }
        for i in range(len(tap.x))
    ]  # fmt: skip


def pixel_rows(result: Drawn) -> Rows:
    """The framebuffer before and after; colours as bytes."""
    lines = []
    states = {"before": result.before, "after": result.target}
    for y in range(HEIGHT):
        for x in range(WIDTH):
            line: Row = {"x_px": x, "y_px": y}
            for name, target in states.items():
                colors = zip(("red", "green", "blue", "alpha"), target.bytes("color")[:, y, x], strict=True)
                line |= {f"{name}_{part}": int(value) for part, value in colors}
                line |= {f"{name}_depth": short(target.depth[y, x]), f"{name}_stencil": int(target.stencil[y, x])}
            lines.append(line)
    return lines


def of_stage(rows: Rows, stage: str) -> Rows:
    """The rows of one stage without their mark."""
    return [{name: value for name, value in row.items() if name != "stage"} for row in rows if row["stage"] == stage]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """A table a stage; the counters under the experiment's own name."""
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    return {f"draw-stages-{stage}" if stage else "draw-stages": of_stage(rows, stage) for stage in stages}


EXPERIMENT = Experiment(
    "draw-stages",
    "One small draw call after each of its stages",
    "24 × 16 pixels, four points; the geometry shader makes strips of 2, 0, 1 and 2 triangles of them. All that "
    "is drawn stands in the tables: a row for each vertex, record, triangle and fragment, copied by taps, and the "
    "framebuffer before and after. A pixel on which fragments of several triangles fall is divided into columns, in "
    "the order in which they were drawn. Tests run after the shader here "
    "(`EarlyTests.NONE`), so that a colour can be shown for fragments that fail them.",
    cases,
    measure,
    stage_panels.plot,
    tables,
    alt="Eight pictures of one small draw: vertices; what the geometry shader emits; the records that stream output "
    "captured, with one triangle too many; triangles on the pixel grid; fragments coloured by an interpolated "
    "value; what became of each; the framebuffer before and after.",
)
