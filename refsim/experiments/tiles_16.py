"""“16 × 16 tiles”: tiles of 16 × 16 pixels, or 16 × 16 of them? Both readings, at 128², 256² and 512² rays.

The Hierarchical Ray Engine, section 3: the texture of cones holds "only as many texels as many tiles are used (16×16 is
typical)", a count. Section 7.1: "we divided the 256×256 ray array into 16×16 tiles. The size of the tiles is somewhat
arbitrary, but limited by the maximum size of point primitives", a size or a count. At 256² they are the same;
Figure 6 is of 512².
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, counts, fill_of, run
from refsim.experiments.verdicts import claim

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
SIZES, QUICK_SIZES = (128, 256, 512), (64, 128)
READINGS = ("size", "count")
SIXTEEN = 16
RAY_FLOATS = 7  # of a ray's two texels: origin and t_max, direction
LITTLE = 1.0  # percent
CONE_FLOATS = 9  # of a cone as it is read back: apex, axis, cosine, sine, slack
COMPARED = ("cones_built", "cone_tests", "pairs_kept", "triangle_tests", "read_back_bytes")


def tile_of(reading: str, size_px: int, sixteen: int = SIXTEEN) -> int:
    """Side of a tile in pixels."""
    return sixteen if reading == "size" else size_px // sixteen


def cases(quick: bool) -> list[Case]:
    """A case a scene, picture size and reading. `--quick` takes 8 for 16 and 64² for 256²."""
    sixteen, sizes, scenes = (8, QUICK_SIZES, SCENES[:1]) if quick else (SIXTEEN, SIZES, SCENES)
    return [
        {"scene": scene, "size_px": size, "reading": reading, "sixteen": sixteen, "fill": fill_of(scene),
         "generations": 5}
        for scene in scenes for size in sizes for reading in READINGS
    ]  # fmt: skip


def measure(
    scene: str, size_px: int, reading: str, sixteen: int, fill: float, generations: int, backend: str = "numba"
) -> Rows:
    """One row: the counters of one run."""
    tile = tile_of(reading, size_px, sixteen)
    found = run(HIERARCHICAL, scene, size_px, fill, generations=generations, tile_size=tile, backend=backend)
    c, triangles = found.counters, len(found.scene.triangles)
    tiles = c["cone.tiles_empty"] + c["cone.tiles_bounded"] + c["cone.tiles_unbounded"]
    exhaustive = size_px * size_px * triangles * generations
    return [
        {
            "scene": scene,
            "triangles": triangles,
            "size_px": size_px,
            "reading": reading,
            "sixteen": sixteen,
            "fill": fill,
            "tile_px": tile,
            "tiles": tiles // generations,
            "cones_built": tiles,
            "read_back_bytes": 4 * CONE_FLOATS * tiles,
            "unbounded_tiles_percent": round(100.0 * c["cone.tiles_unbounded"] / tiles, 3),
            **counts(found),
            "pairs_kept_percent": round(100.0 * c["cone.pairs_kept"] / c["cone.sphere_tests"], 3),
            "saving_without_stencil": round(exhaustive / c["intersection.triangle_tests"], 3),
        }
    ]


def readings(rows: Rows) -> Rows:
    """A row a scene and size: both readings side by side, count by size; `alike`: they are the same run."""
    found = []
    counts_of = {(row["scene"], row["size_px"]): row for row in rows if row["reading"] == "count"}
    for row in [row for row in rows if row["reading"] == "size"]:
        other = counts_of[row["scene"], row["size_px"]]
        same = all(row[name] == other[name] for name in row if name != "reading")
        line: Row = {name: row[name] for name in ("scene", "triangles", "size_px")}
        line |= {f"{name}_if_{reading}": r[name] for reading, r in zip(READINGS, (row, other), strict=True)
                 for name in ("tile_px", "tiles", "saving_without_stencil")}  # fmt: skip
        line |= {f"{name}_count_by_size": round(other[name] / row[name], 4) for name in COMPARED}
        line["texels_are_16_by_16_if_size"] = "yes" if row["tiles"] == row["sixteen"] ** 2 else "no"
        line["texels_are_16_by_16_if_count"] = "yes" if other["tiles"] == row["sixteen"] ** 2 else "no"
        found.append({**line, "alike": "yes" if same else "no"})
    return found


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """All runs, the readings side by side, and what is read back."""
    return {"tiles-16": rows, "tiles-16-readings": readings(rows), "tiles-16-verdicts": verdicts(rows)}


def verdicts(rows: Rows) -> Rows:
    """How little is read back where the texture of cones has 16 × 16 texels, beside what the ray textures hold."""
    found = []
    for row in [row for row in rows if row["reading"] == "count"]:
        iterations = row["cones_built"] // row["tiles"]
        share = 100.0 * row["read_back_bytes"] / (4 * RAY_FLOATS * row["size_px"] ** 2 * iterations)
        found.append(
            claim("3", "reading the cones back is not expensive", f"{style.body_name(row['scene'])}, {row['size_px']}²",
                  f"the cones of {row['sixteen']} × {row['sixteen']} tiles are at most {LITTLE:g} percent of the bytes "
                  f"of the rays that they enclose; depends up to {10 * LITTLE:g}",
                  f"{row['read_back_bytes'] // iterations} bytes an iteration, {share:.2f} percent",
                  True if share <= LITTLE else None if share <= 10 * LITTLE else False)
            | {"size_px": row["size_px"]}
        )  # fmt: skip
    return found


def plot(rows: Rows) -> Any:
    """A panel a measure, over the side of the picture; a colour a scene, a line a reading."""
    from matplotlib.ticker import LogLocator

    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure = style.new_figure(3.4)
    panels = (("cone_tests", "cone–sphere tests"), ("triangle_tests", "ray–triangle tests"),
              ("saving_without_stencil", "Ray Engine tests ÷ these"))  # fmt: skip
    grid = figure.subplots(1, len(panels))
    for axes, (column, name) in zip(grid, panels, strict=True):
        for k, scene in enumerate(scenes):
            for reading, line in zip(READINGS, ("-", "--"), strict=True):
                own = [row for row in rows if (row["scene"], row["reading"]) == (scene, reading)]
                look: dict[str, Any] = {"color": style.CYCLE[k], "linestyle": line, "marker": style.MARKERS[k]}
                look["fillstyle"] = "full" if reading == "size" else "none"
                pixels = "tiles of 16 × 16 pixels" if reading == "size" else "16 × 16 tiles"
                pixels = pixels.replace("16", str(own[0]["sixteen"]))
                axes.plot([row["size_px"] for row in own], [row[column] for row in own],
                          label=f"{style.body_name(scene)}, {pixels}", **look)  # fmt: skip
        sizes = sorted({row["size_px"] for row in rows})
        axes.set_xscale("log", base=2)
        axes.set_xticks(sizes, [f"{size}²" for size in sizes])
        axes.set_xlim(0.85 * sizes[0], 1.18 * sizes[-1])
        axes.set_yscale("log")
        axes.set_xlabel("rays")
        axes.set_title(name)
        axes.minorticks_off()
    for axes in grid[:2]:
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        style.count_ticks(axes.yaxis)
    style.plain_ticks(grid[2].yaxis)
    grid[0].set_ylabel("5 generations")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(scenes), handlelength=3)
    return figure


EXPERIMENT = Experiment(
    "tiles-16",
    "“16 × 16 tiles”, as a size and as a count",
    "Filled markers and full lines: tiles of 16 × 16 pixels. Open markers and dashes: 16 × 16 tiles, whatever their "
    "size. 5 generations; 128², 256² and 512² rays (with `--quick` 8 for 16, 64² and 128² rays). At 256² (64²) both "
    "are one run. The table tiles-16-readings sets the readings side by side.",
    cases,
    measure,
    plot,
    tables,
    alt="Three panels over the side of the picture: the lines of both readings cross where the picture is 256 pixels "
    "wide; above that, 16 by 16 tiles need fewer cone tests and more triangle tests, below it the reverse.",
)
