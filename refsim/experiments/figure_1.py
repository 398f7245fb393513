"""Figure 1: the block diagram of the hierarchical ray engine, drawn from the draws of a real run.

The Hierarchical Ray Engine, section 3: "Only the initial construction of the vertex buffer is performed on the CPU."
Taps tell what went through each draw; the two orders of submission are run beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, fill_of, run
from refsim.experiments.verdicts import claim
from refsim.pipeline.taps import Taps
from refsim.results import Trace

SCENES = ("torus_knot_500", "blob_500")
PARTS = ("cone construction", "intersection")


def cases(quick: bool) -> list[Case]:
    """A case a scene; taps hold every fragment, so the pictures are small."""
    size = 32 if quick else 64
    return [{"scene": scene, "size_px": size, "tile_px": 8, "generations": 3} for scene in SCENES]


def measure(scene: str, size_px: int, tile_px: int, generations: int) -> Rows:
    """A row a draw, and for each order of submission a row of what both found."""
    options = {"tile_size": tile_px, "generations": generations}
    taps = Taps("vertex", "fragment")
    found = run(HIERARCHICAL, scene, size_px, fill_of(scene), **options, taps=taps)
    other = run(HIERARCHICAL, scene, size_px, fill_of(scene), **options, submission="primitive")
    head: Row = {"scene": scene, "triangles": len(found.scene.triangles), "size_px": size_px, "tile_px": tile_px}
    rows = [{"part": "draws", **head, **row} for row in _draws(found, taps)]
    tiles = (size_px // tile_px) ** 2
    for order, trace in (("tile", found), ("primitive", other)):
        read = tiles * generations if order == "tile" else 0
        rows.append({"part": "orders", **head, "submission": order, "cone_texels_read_back": read,
                     "rays_with_other_hits": _different(found, trace)})  # fmt: skip
    return rows


def _draws(found: Trace, taps: Taps) -> Rows:
    """Draws alternate: the cones of a generation, then its intersections."""
    rows: Rows = []
    buffers = [np.unique(tap.vertex_index) for tap in taps.vertex]
    for number, (vertex, fragment) in enumerate(zip(taps.vertex, taps.fragment, strict=True)):
        generation, part = divmod(number, 2)
        primitives = len(np.unique(fragment.primitive))
        row: Row = {
            "draw": number, "generation": generation, "pass": PARTS[part],
            "live_rays": int(found.generations[generation].alive.sum()),
            "vertices": len(vertex.vertex_index), "sprites_or_quads_drawn": primitives,
            "fragments": len(fragment.x),
            "pixels_drawn_to": len(np.unique(fragment.y.astype(np.int64) << 32 | fragment.x)),
            # The same rows of the vertex buffer in every generation: nothing is made on the CPU in between
            "buffer_rows": len(buffers[number]),
            "same_buffer_as_in_generation_0": bool(np.array_equal(buffers[number], buffers[part])),
            "rays_handed_on": _handed_on(found, generation) if part else 0,
        }  # fmt: skip
        rows.append(row)
    return rows


def _handed_on(found: Trace, generation: int) -> int:
    """Rays that the pass wrote and the next one shot."""
    if generation + 1 >= len(found.generations):
        return 0
    return int(found.generations[generation + 1].alive.sum())


def _different(a: Trace, b: Trace) -> int:
    """Rays of all generations whose hits differ in any bit."""
    return sum(
        int(((p.hits.triangle != q.hits.triangle) | (p.hits.t.view(np.uint32) != q.hits.t.view(np.uint32))).sum())
        for p, q in zip(a.generations, b.generations, strict=True)
    )


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Draws; orders of submission; verdicts on the diagram."""
    draws = [_without(row) for row in rows if row["part"] == "draws"]
    orders = [_without(row) for row in rows if row["part"] == "orders"]
    for row in orders:
        row["verdict"] = "fails" if row["rays_with_other_hits"] else "holds"
    return {"figure-1": draws, "figure-1-orders": orders, "figure-1-verdicts": verdicts(draws)}


def _without(row: Row) -> Row:
    return {name: value for name, value in row.items() if name != "part"}


def verdicts(draws: Rows) -> Rows:
    """What the diagram says, on the draws."""
    found: Rows = []
    for scene in dict.fromkeys(row["scene"] for row in draws):
        own = [row for row in draws if row["scene"] == scene]
        order = [row["pass"] for row in own]
        changed = sum(not row["same_buffer_as_in_generation_0"] for row in own)
        cones = [row["pixels_drawn_to"] for row in own if row["pass"] == PARTS[0]]
        tiles = (own[0]["size_px"] // own[0]["tile_px"]) ** 2
        found += [
            claim("Figure 1", "cones are built for each generation, before its intersections", scene,
                  "draws alternate, cones first", f"{len(own)} draws", order == list(PARTS) * (len(own) // 2)),
            claim("Figure 1", "only the initial vertex buffer is made on the CPU", scene,
                  "every generation draws the same rows of the vertex buffer", f"{changed} of {len(own)} draws differ",
                  changed == 0),
            claim("Figure 1", "a cone a tile is stored in a texture", scene,
                  "each cone pass writes one texel a tile", f"{min(cones)} to {max(cones)} texels for {tiles} tiles",
                  min(cones) == max(cones) == tiles),
        ]  # fmt: skip
    return found


def plot(rows: Rows) -> Any:
    """A lane a generation: textures as rounded boxes, shaders as plain ones, what went through them as numbers."""
    draws = [row for row in rows if row["part"] == "draws" and row["scene"] == rows[0]["scene"]]
    lanes = len(draws) // 2
    figure = style.new_figure(0.4 + 1.35 * lanes)
    axes = figure.subplots()
    style.no_frame(axes)
    axes.set_xlim(0, 100)
    axes.set_ylim(0, lanes)
    for lane in range(lanes):
        _lane(axes, lanes - 1 - lane, lane, draws[2 * lane], draws[2 * lane + 1])
    name = style.body_name(draws[0]["scene"])
    axes.set_title(f"{name}, {draws[0]['triangles']:,} triangles, {draws[0]['size_px']}² rays in tiles of "
                   f"{draws[0]['tile_px']}²: the draws of {lanes} generations")  # fmt: skip
    return figure


def _lane(axes: Any, y: float, generation: int, cones: Row, hits: Row) -> None:
    made = "the CPU, once" if generation == 0 else "the same"
    handed = f"{hits['rays_handed_on']:,} rays handed on" if hits["rays_handed_on"] else "the end of the run"
    boxes = (
        (2, 17, "ray textures", f"generation {generation}:\n{cones['live_rays']:,} live rays", style.SKY, True),
        (22, 17, "cone construction", f"fragment shader,\n{cones['fragments']:,} tiles", style.ORANGE, False),
        (42, 17, "vertex shader", f"{hits['vertices']:,} pairs tested;\nbuffer: {made}", style.GREEN, False),
        (62, 17, "fragment shader", f"{hits['fragments']:,} fragments of\n{hits['sprites_or_quads_drawn']:,} sprites",
         style.VERMILION, False),
        (82, 17, "depth, stencil", f"nearest hits;\n{handed}", style.BLUE, False),
    )  # fmt: skip
    for x, width, title, text, color, rounded in boxes:
        _box(axes, x, y, width, title, text, color, rounded)
    arrow = {"arrowstyle": "-|>", "color": style.INK, "linewidth": 1.2}
    for x in (19, 39, 59, 79):
        axes.annotate("", (x + 3, y + 0.5), (x, y + 0.5), arrowprops=arrow)
    if hits["rays_handed_on"]:
        axes.plot((90.5, 90.5, 10.5), (y + 0.16, y, y), color=style.INK, linewidth=1.2, solid_joinstyle="round")
        axes.annotate("", (10.5, y - 0.16), (10.5, y + 0.004), arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0})


def _box(axes: Any, x: float, y: float, width: float, title: str, text: str, color: str, rounded: bool) -> None:
    from matplotlib.patches import FancyBboxPatch

    shape = "round,pad=0,rounding_size=1.6" if rounded else "square,pad=0"
    edge: Any = {"edgecolor": color, "facecolor": "white", "linewidth": 1.6, "mutation_aspect": 0.06}
    axes.add_patch(FancyBboxPatch((x, y + 0.16), width, 0.68, shape, **edge))
    axes.text(x + width / 2, y + 0.70, title, ha="center", va="center", fontsize=8.5, fontweight="bold")
    axes.text(x + width / 2, y + 0.40, text, ha="center", va="center", fontsize=7.5)


EXPERIMENT = Experiment(
    "figure-1",
    "Figure 1: the block diagram, with what went through it",
    "One row a generation of rays: rounded boxes are textures, square ones shaders and tests. Numbers are those of the "
    "run's draws, taken by taps. The long arrow hands the next rays on; no step but the first vertex buffer is the "
    "CPU's. Run tile by tile and primitive by primitive, the hits are the same.",
    cases,
    measure,
    plot,
    tables,
    alt="A block diagram with a lane for each of three generations of rays. In each lane arrows lead from the ray "
    "textures to the construction of cones, to the vertex shader that tests cones against spheres, to the fragment "
    "shader and to the depth and stencil tests; from there a long arrow leads to the ray textures of the next lane.",
)
