"""Glass against mirrors: the same bodies, seen by the same eye rays, once refracting and once reflecting.

The Hierarchical Ray Engine, section 5: "ideally refractive or reflective surfaces". Which is kinder to cones? A
reflected direction turns by twice what the normal turns and keeps the spread of what came in; a refracted one, entering
near a right angle, turns by 1 − 1/n of it and keeps 1/n of the spread. So the first cones behind a mirror are wider.
But rays that a mirror turns away from a convex body are done; those in glass go on to its far side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, fill_of, run
from refsim.reference import cone
from refsim.reference.tiles import Tiles
from refsim.results import Generation, TileState, Trace

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
MATERIALS = ("glass", "mirror")


def cases(quick: bool) -> list[Case]:
    """A case a scene and material."""
    size, tile = (64, 8) if quick else (256, 16)
    return [
        {"scene": scene, "material": material, "size_px": size, "tile_px": tile, "fill": fill_of(scene),
         "generations": 5, "ior": 1.5}
        for scene in SCENES for material in MATERIALS
    ]  # fmt: skip


def measure(
    scene: str, material: str, size_px: int, tile_px: int, fill: float, generations: int, ior: float,
    backend: str = "numba",
) -> Rows:  # fmt: skip
    """A row a generation. Ray Engine tests follow from the rays: all pixels, or with its stencil those that hit."""
    found = run(
        HIERARCHICAL, scene, size_px, fill,
        generations=generations, tile_size=tile_px, material=material, ior=ior, backend=backend,
    )  # fmt: skip
    head = {
        "scene": scene, "triangles": len(found.scene.triangles), "material": material, "ior": ior,
        "size_px": size_px, "tile_px": tile_px, "fill": fill,
    }  # fmt: skip
    before = [None, *found.generations[:-1]]
    return [
        {**head, "generation": k, **_row(found, passed, before[k], tile_px)}
        for k, passed in enumerate(found.generations)
    ]


def _row(found: Trace, passed: Generation, before: Generation | None, tile_px: int) -> Row:
    cones, c = passed.cones, passed.counters
    assert cones is not None and passed.rays.width is not None
    bounded = cones.state == TileState.BOUNDED
    angle = np.degrees(cones.half_angle.astype(np.float64))
    pixels, triangles = len(passed.alive), len(found.scene.triangles)
    tested = pixels if before is None else int((before.hits.triangle >= 0).sum())
    return {
        "rays": int(passed.alive.sum()),
        "hits": int((passed.hits.triangle >= 0).sum()),
        "bounded_tiles": int(bounded.sum()),
        "unbounded_tiles": int((cones.state == TileState.UNBOUNDED).sum()),
        "empty_tiles": int((cones.state == TileState.EMPTY).sum()),
        "median_half_angle_deg": round(float(np.median(angle[bounded])), 4) if bounded.any() else "",
        "mean_half_angle_deg": round(float(np.mean(angle[bounded])), 4) if bounded.any() else "",
        **_predicted(found, before, cones.state != TileState.EMPTY, tile_px),
        "cone_tests": c["cone.sphere_tests"],
        "pairs_kept": c["cone.pairs_kept"],
        "triangle_tests": c["intersection.triangle_tests"],
        "ray_engine_tests": pixels * triangles,
        "ray_engine_tests_with_stencil": tested * triangles,
    }


def _predicted(found: Trace, before: Generation | None, live: Any, tile_px: int) -> Row:
    """For the first bent rays, median over their tiles: the half-angle of the cone of normals, and what follows."""
    if before is None or before is not found.generations[0]:
        return {"median_normals_half_angle_deg": "", "predicted_half_angle_deg": ""}
    assert before.cones is not None
    came = np.degrees(before.cones.half_angle.astype(np.float64))
    normals = normal_cones(found, before, tile_px)
    index = float(found.options["ior"])
    mirror = found.options["material"] == "mirror"
    follows = came + 2.0 * normals if mirror else came / index + (1.0 - 1.0 / index) * normals
    return {
        "median_normals_half_angle_deg": round(float(np.median(normals[live])), 4),
        "predicted_half_angle_deg": round(float(np.median(follows[live])), 4),
    }


def normal_cones(found: Trace, before: Generation, tile_px: int) -> NDArray[Any]:
    """Half-angle in degrees of the cone of the normals, turned towards the eye, at which a tile's rays were bent."""
    assert before.rays.width is not None and before.rays.height is not None
    tiles = Tiles(before.rays.width, before.rays.height, tile_px)
    edges = found.scene.triangles.astype(np.float64)
    normal = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])[before.hits.triangle]
    facing = -np.sign((normal * before.rays.direction).sum(axis=1))
    size = np.linalg.norm(normal, axis=1)
    unit = normal * (facing / np.where(size > 0, size, 1.0))[:, None]
    live = (tiles.pixels >= 0) & (before.hits.triangle >= 0)[tiles.pixels]
    cones = cone.build(np.zeros((*tiles.pixels.shape, 3)), unit[tiles.pixels], live)[0]
    return np.degrees(cone.half_angle(cones))


def compared(rows: Rows) -> Rows:
    """A row a scene: tests in all, savings, and how mirrors stand to glass."""
    found = []
    for glass, mirror in _pairs(rows):
        sums = {name: _sums(own) for name, own in zip(MATERIALS, (glass, mirror), strict=True)}
        line = {name: glass[0][name] for name in ("scene", "triangles", "ior", "size_px", "tile_px", "fill")}
        for name, own in sums.items():
            line |= {f"{name}_{column}": value for column, value in own.items()}
        seconds = [_second(own) for own in (glass, mirror)]
        for name in ("median_half_angle_deg", "predicted_half_angle_deg", "pairs_kept"):
            one, other = (row[name] for row in seconds)
            line[f"first_bent_{name}_mirror_by_glass"] = round(other / one, 3) if one and other != "" else ""
        line["kinder_by_first_bent_half_angle"] = _less(seconds, "median_half_angle_deg")
        line["kinder_by_first_bent_pairs"] = _less(seconds, "pairs_kept")
        for column in ("triangle_tests", "tests_a_ray"):
            line[f"kinder_by_{column}"] = _less([sums[name] for name in MATERIALS], column)
        for column in ("saving_without_stencil", "saving_with_stencil"):
            line[f"kinder_by_{column}"] = _less([{column: -sums[name][column]} for name in MATERIALS], column)
        found.append(line)
    return found


def _less(pair: list[Row], column: str) -> str:
    """The material of the smaller number."""
    one, other = (row[column] for row in pair)
    return "" if "" in (one, other) else "alike" if one == other else MATERIALS[int(other < one)]


def _second(own: Rows) -> Row:
    return own[1] if len(own) > 1 else own[0]


def _pairs(rows: Rows) -> list[tuple[Rows, Rows]]:
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    own = [[[r for r in rows if (r["scene"], r["material"]) == (s, m)] for m in MATERIALS] for s in scenes]
    return [(glass, mirror) for glass, mirror in own if glass and mirror]


def _sums(rows: Rows) -> Row:
    """All generations together."""
    tests = sum(row["triangle_tests"] for row in rows)
    return {
        "rays": sum(row["rays"] for row in rows),
        "triangle_tests": tests,
        "tests_a_ray": round(tests / sum(row["rays"] for row in rows), 3),
        "saving_without_stencil": round(sum(row["ray_engine_tests"] for row in rows) / tests, 3),
        "saving_with_stencil": round(sum(row["ray_engine_tests_with_stencil"] for row in rows) / tests, 3),
        "pairs_kept": sum(row["pairs_kept"] for row in rows),
        "unbounded_tiles": sum(row["unbounded_tiles"] for row in rows),
    }


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Generations, and the comparison."""
    return {"glass-mirrors": rows, "glass-mirrors-compared": compared(rows)}


def plot(rows: Rows) -> Any:
    """A column a scene: cone angles, live and unbounded tiles, tests a generation."""
    pairs = _pairs(rows)
    figure = style.new_figure(5.6)
    grid = figure.subplots(3, len(pairs), sharex=True, sharey="row", squeeze=False)
    for column, pair in enumerate(pairs):
        for name, own, color, marker in zip(MATERIALS, pair, (style.BLUE, style.VERMILION), ("o", "s"), strict=True):
            look = {"color": color, "marker": marker, "label": name}
            _line(grid[0, column], own, [row["median_half_angle_deg"] for row in own], look)
            live = [(row["bounded_tiles"] + row["unbounded_tiles"]) * row["triangles"] for row in own]
            kept = [100.0 * row["pairs_kept"] / all_ if all_ else "" for row, all_ in zip(own, live, strict=True)]
            _line(grid[1, column], own, kept, look)
            _line(grid[2, column], own, [row["triangle_tests"] or "" for row in own], look)
        engine = [row["ray_engine_tests"] for row in pair[0]]
        look = {"color": style.FAINT, "linestyle": "--", "label": "Ray Engine, no stencil"}
        _line(grid[2, column], pair[0], engine, look)
        grid[0, column].set_title(f"{style.body_name(pair[0][0]['scene'])}, {pair[0][0]['triangles']:,} triangles")
        grid[2, column].set_xlabel("generation")
        grid[2, column].set_xticks([row["generation"] for row in pair[0]])
        grid[2, column].set_yscale("log")
    style.count_ticks(grid[2, 0].yaxis)
    grid[0, 0].set_ylabel("half-angle of cones,\nmedian, degrees")
    grid[1, 0].set_ylabel("pairs kept, percent of\nthose of live tiles")
    grid[2, 0].set_ylabel("ray–triangle tests")
    figure.align_ylabels(grid[:, 0])
    figure.legend(*grid[2, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _line(axes: Any, own: Rows, values: list[Any], look: dict[str, Any]) -> None:
    some = [(row["generation"], value) for row, value in zip(own, values, strict=True) if value != ""]
    axes.plot([k for k, _ in some], [value for _, value in some], **look)


EXPERIMENT = Experiment(
    "glass-mirrors",
    "Glass against mirrors",
    "The same bodies and eye rays, glass of index 1.5 and mirrors, 256² rays, tiles of 16 × 16, 5 generations (64² and "
    "8 × 8 with `--quick`). Above: half-angle of the cones of tiles that are bounded. Middle: pairs of tile and "
    "triangle kept, of the tiles that have rays. Below: tests; no marker where no ray is left. The table compares "
    "sums, and how much cones open for what normals do.",
    cases,
    measure,
    plot,
    tables,
    alt="Three rows of curves over the generation: cone angles, pairs kept and tests; mirror cones open wider at once, "
    "but fewer of their rays go on.",
)
