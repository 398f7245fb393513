"""How far the incremental cone of section 4 is from the tightest one, by the order in which a tile's rays enter it.

"A fast incremental approach is preferred over a tedious one, which could possibly produce more compact results": the
other is `refsim.reference.tightest_cone`. Both in float64, so that order alone makes the difference.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import HIERARCHICAL, fill_of, run
from refsim.reference import cone
from refsim.reference.sphere import enclosing_spheres
from refsim.reference.tightest_cone import TightestCone, tightest_cone
from refsim.reference.tiles import Tiles
from refsim.results import Generation
from refsim.scene import Scene

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
TILES = (8, 16, 32)
ORDERS = ("scanline", "Hilbert", "random")
GENERATIONS = (1, 2)
SEED = 6


def cases(quick: bool) -> list[Case]:
    """A case a scene and tile size, in the NumPy reference."""
    scenes, size, tiles = (SCENES[:2], 32, (8, 16)) if quick else (SCENES, 64, TILES)
    return [
        {"scene": scene, "size_px": size, "tile_px": tile, "fill": fill_of(scene)} for scene in scenes for tile in tiles
    ]


def visits(order: str, size: int) -> np.ndarray:
    """The pixels of a tile, numbered row by row, in the order they are visited; Hilbert's curve needs 2^k."""
    if order == "scanline":
        return np.arange(size * size)
    if order == "random":
        return np.random.default_rng(SEED).permutation(size * size)
    curve = np.zeros((1, 2), np.int64)
    side = 1
    while side < size:
        # Four copies: the first and the last mirrored in their diagonals
        last = np.stack([2 * side - 1 - curve[:, 1], side - 1 - curve[:, 0]], axis=1)
        curve = np.concatenate([curve[:, ::-1], curve + np.array([0, side]), curve + side, last])
        side *= 2
    return curve[:, 1] * size + curve[:, 0]


def measure(scene: str, size_px: int, tile_px: int, fill: float) -> Rows:
    """A row a generation and order; medians are over tiles that both bound."""
    found = run(HIERARCHICAL, scene, size_px, fill, generations=1 + max(GENERATIONS), tile_size=8, backend="numpy")
    head = {"scene": scene, "triangles": len(found.scene.triangles), "size_px": size_px, "tile_px": tile_px}
    head["fill"] = fill
    rows = []
    for k in GENERATIONS:
        if k < len(found.generations):
            rows += [{**head, "generation": k, **row} for row in _compared(found.scene, found.generations[k], tile_px)]
    return rows


def _compared(scene: Scene, passed: Generation, tile_px: int) -> Rows:
    rays = passed.rays
    assert rays.width is not None and rays.height is not None
    tiles = Tiles(rays.width, rays.height, tile_px)
    live = (tiles.pixels >= 0) & passed.alive[tiles.pixels]
    live, pixels = live[live.any(axis=1)], tiles.pixels[live.any(axis=1)]
    p = rays.origin.astype(np.float64)[pixels]
    # Rays are unit to float32 only
    r = rays.direction.astype(np.float64)[pixels]
    r = r / np.where(live, np.linalg.norm(r, axis=2), 1.0)[:, :, None]
    tight = [tightest_cone(p[i, live[i]], r[i, live[i]]) for i in range(len(live))]
    spheres = enclosing_spheres(scene.triangles)
    kept = _kept(*_as_cones(tight), spheres)
    size = float(np.linalg.norm(np.ptp(scene.triangles.reshape(-1, 3), axis=0)))
    return [_row(order, p, r, live, visits(order, tile_px), tight, kept, spheres, size) for order in ORDERS]


def _row(
    order: str,
    p: np.ndarray,
    r: np.ndarray,
    live: np.ndarray,
    visit: np.ndarray,
    tight: list[TightestCone | None],
    kept: np.ndarray,
    spheres: tuple[np.ndarray, np.ndarray],
    size: float,
) -> Row:
    cones, slack = cone.build(p[:, visit], r[:, visit], live[:, visit])
    own = _kept(cones, slack, spheres)
    # A cone wider than cos 1/8 is unbounded for both
    wide = np.array([t is None or bool(np.cos(t.half_angle) <= cone.WIDEST_COS) for t in tight])
    bounded = cones.state == cone.BOUNDED
    both = np.flatnonzero(bounded & ~wide)
    angle = cone.half_angle(cones)
    pairs = [(angle[i], cones.apex[i], t) for i in both if (t := tight[i]) is not None]
    ratio = np.array([a / t.half_angle for a, _, t in pairs])
    shift = np.array([np.linalg.norm(at - t.apex) / size for _, at, t in pairs])
    return {
        "order": order,
        "tiles": len(live),
        "unbounded_incremental_tiles": int((~bounded).sum()),
        "unbounded_tightest_tiles": int(wide.sum()),
        "median_half_angle_ratio": round(float(np.median(ratio)), 4) if pairs else "",
        "p90_half_angle_ratio": round(float(np.quantile(ratio, 0.9)), 4) if pairs else "",
        "largest_half_angle_ratio": round(float(ratio.max()), 4) if pairs else "",
        "median_apex_shift_percent": round(100.0 * float(np.median(shift)), 3) if pairs else "",
        "cone_tests": len(live) * len(spheres[1]),
        "pairs_kept_incremental": int(own.sum()),
        "pairs_kept_tightest": int(kept.sum()),
        "pairs_kept_more_percent": round(100.0 * (int(own.sum()) / int(kept.sum()) - 1.0), 3),
    }


def _as_cones(tight: list[TightestCone | None]) -> tuple[cone.Cones, np.ndarray]:
    """The tightest cones as the sphere test takes them; those too wide meet everything."""
    found = cone.empty(len(tight), np.float64)
    slack = np.full(len(tight), np.inf)
    for i, t in enumerate(tight):
        if t is not None and np.cos(t.half_angle) > cone.WIDEST_COS:
            found.apex[i], found.axis[i] = t.apex, t.axis
            found.cos[i], found.sin[i], slack[i] = np.cos(t.half_angle), np.sin(t.half_angle), 0.0
    return found, slack


def _kept(cones: cone.Cones, slack: np.ndarray, spheres: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Spheres met, one number a tile."""
    centre, radius = spheres[0].astype(np.float64), spheres[1].astype(np.float64)
    columns = zip(centre, radius, strict=True)
    return np.sum([cone.meets_sphere(cones, slack, c, s) for c, s in columns], axis=0)


def plot(rows: Rows) -> Any:
    """A panel a scene: above, how much wider the incremental cone is; below, what it keeps in vain."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure = style.new_figure(4.8)
    grid = figure.subplots(2, len(scenes), sharex=True, sharey="row", squeeze=False)
    for number, scene in enumerate(scenes):
        own = [row for row in rows if row["scene"] == scene]
        for k, order in enumerate(ORDERS):
            for generation, line in zip(GENERATIONS, ("-", "--"), strict=True):
                some = [row for row in own if row["order"] == order and row["generation"] == generation]
                look = {"color": style.CYCLE[k], "marker": style.MARKERS[k], "linestyle": line}
                tile = [row["tile_px"] for row in some]
                wider = [100.0 * (float(row["median_half_angle_ratio"] or "nan") - 1.0) for row in some]
                grid[0, number].plot(tile, wider, label=f"{order}, generation {generation}", **look)
                grid[1, number].plot(tile, [row["pairs_kept_more_percent"] for row in some], **look)
        tiles = sorted({row["tile_px"] for row in own})
        grid[1, number].set_xscale("log", base=2)
        grid[1, number].set_xticks(tiles, [str(tile) for tile in tiles])
        grid[1, number].minorticks_off()
        grid[1, number].set_xlabel("tile size, pixels")
        grid[0, number].set_title(f"{style.body_name(scene)}, {own[0]['triangles']:,} triangles")
    grid[0, 0].set_ylabel("half-angle wider by\n(median tile), percent")
    grid[1, 0].set_ylabel("more cone–sphere\npairs kept, percent")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, handlelength=3.5)
    return figure


EXPERIMENT = Experiment(
    "tightest-cone",
    "The incremental cone against the tightest, by visit order",
    "64² rays (32² with `--quick`) of the first two refracted generations, the tightest cone of the same rays as 0: "
    "smallest half-angle, then the smallest translation from the first origin in scanline order. Hilbert's curve and a "
    "seeded random order visit the same rays. Half-angles: tiles that both cones bound; pairs kept: all tiles with a "
    "ray, an unbounded one keeping everything.",
    cases,
    measure,
    plot,
    alt="Two rows of charts, a column a body: how much wider the incremental cone is than the tightest, and how many "
    "more pairs it keeps, over the tile size for scanline, Hilbert and random order in two generations.",
)
