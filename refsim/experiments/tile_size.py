"""The tile-size trade-off of section 7.1: smaller tiles cull better, and cost more vertex shader runs.

"For our test scenes, we found that further decreasing the tile size [from 16×16] resulted in performance loss, meaning
that the overhead of more processed vertices and larger textures became more significant than the gain from better
coherence." Counted here: cone–sphere tests (vertex shader runs), ray–triangle tests, rays visited while cones are
built. What a frame costs is their sum for a stated price of a cone test, in ray–triangle tests.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, counts, fill_of, run
from refsim.experiments.verdicts import claim

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
TILES = (1, 2, 4, 8, 16, 32, 64)
QUICK_TILES = (4, 8, 16, 32, 64)
PRICES = (1, 4, 16)  # ray–triangle tests that one cone–sphere test, or one ray visited, is said to cost


def cases(quick: bool) -> list[Case]:
    """A case a scene and tile size."""
    size, tiles = (128, QUICK_TILES) if quick else (256, TILES)
    return [
        {"scene": scene, "size_px": size, "tile_px": tile, "fill": fill_of(scene), "generations": 5}
        for scene in SCENES
        for tile in tiles
    ]


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generations: int, backend: str = "numba"
) -> Rows:
    """One row: the counters of one run."""
    found = run(HIERARCHICAL, scene, size_px, fill, generations=generations, tile_size=tile_px, backend=backend)
    c = found.counters
    tiles = c["cone.tiles_empty"] + c["cone.tiles_bounded"] + c["cone.tiles_unbounded"]
    return [
        {
            "scene": scene,
            "triangles": len(found.scene.triangles),
            "size_px": size_px,
            "tile_px": tile_px,
            "fill": fill,
            "cones_built": tiles,
            "unbounded_tiles_percent": round(100.0 * c["cone.tiles_unbounded"] / tiles, 3),
            "rays_visited": sum(int(passed.alive.sum()) for passed in found.generations),
            **counts(found),
        }
    ]


def priced(row: Row, price: float) -> float:
    """Cost of a run, in ray–triangle tests."""
    return float(row["triangle_tests"] + price * (row["cone_tests"] + row["rays_visited"]))


def costs(rows: Rows) -> Rows:
    """Cost at each stated price, and the price above which half the tile would lose (0: it loses at any price)."""
    found = []
    for row in rows:
        half = next((r for r in rows if r["scene"] == row["scene"] and r["tile_px"] * 2 == row["tile_px"]), None)
        line = {name: row[name] for name in ("scene", "triangles", "size_px", "tile_px")}
        line |= {f"cost_at_price_{price}_tests": round(priced(row, price)) for price in PRICES}
        line["price_above_which_half_the_tile_loses_tests"] = "" if half is None else round(break_even(row, half), 3)
        found.append(line)
    return found


def break_even(row: Row, half: Row) -> float:
    """Price of a cone test at which two tile sizes cost the same; the rays visited are the same."""
    return max(0.0, (row["triangle_tests"] - half["triangle_tests"]) / (half["cone_tests"] - row["cone_tests"]))


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Counters, costs, and whether the scenes have one optimum."""
    return {"tile-size": rows, "tile-size-costs": costs(rows), "tile-size-verdicts": verdicts(rows)}


def verdicts(rows: Rows) -> Rows:
    """Whether the cheapest tile is another one for another scene, at each price."""
    found = []
    for price in PRICES:
        best = {}
        for scene in dict.fromkeys(row["scene"] for row in rows):
            own = [row for row in rows if row["scene"] == scene]
            best[style.body_name(scene)] = min(own, key=lambda row: priced(row, price))["tile_px"]
        found.append(
            claim("7.1", "the optimum tile size may depend on the scene", f"price {price:g}",
                  "with a cone test and a ray visited at this price in ray-triangle tests, not all scenes have one "
                  "cheapest tile",
                  ", ".join(f"{name} {tile}" for name, tile in best.items()) + " pixels", len(set(best.values())) > 1)
        )  # fmt: skip
    return found


def plot(rows: Rows) -> Any:
    """A panel a scene: tests of both kinds, and the sums."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure = style.new_figure(3.6)
    for axes, scene in zip(figure.subplots(1, len(scenes), sharey=True, squeeze=False)[0], scenes, strict=True):
        own = [row for row in rows if row["scene"] == scene]
        tiles = [row["tile_px"] for row in own]
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.plot(tiles, [row["cone_tests"] for row in own], "--", color=style.FAINT, label="cone–sphere tests")
        axes.plot(tiles, [row["triangle_tests"] for row in own], "-", color=style.FAINT, label="ray–triangle tests")
        for k, price in enumerate(PRICES):
            cost = [priced(row, price) for row in own]
            color = style.CYCLE[k]
            name = f"cost, cone test = {price} triangle tests"
            axes.plot(tiles, cost, color=color, marker=style.MARKERS[k], label=name)
            best = min(range(len(own)), key=cost.__getitem__)
            axes.plot(tiles[best], cost[best], "o", markersize=12, fillstyle="none", color=color)
        axes.set_xticks(tiles, [str(tile) for tile in tiles])
        axes.minorticks_off()
        style.count_ticks(axes.yaxis)
        axes.set_xlabel("tile size, pixels")
        axes.set_title(f"{style.body_name(scene)}, {own[0]['triangles']:,} triangles")
        if scene == scenes[0]:
            axes.set_ylabel("a frame, in ray–triangle tests")
            handles = axes.get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3)
    return figure


EXPERIMENT = Experiment(
    "tile-size",
    "Tile size: cone tests against ray–triangle tests",
    "256² rays (128² with `--quick`), 5 generations. A circle marks the cheapest tile for a stated price of a "
    "cone–sphere test; the price is an assumption, the counts are not.",
    cases,
    measure,
    plot,
    tables,
    alt="For each of three bodies curves over the tile size: cone tests fall, triangle tests rise, and the cost by "
    "three prices of a cone test has its least, marked with a circle, in between.",
)
