"""How coherent rays stay: tiles with a tight cone, what lies under the wide ones, and what empty tiles save.

The Hierarchical Ray Engine, sections 1, 5 and 7.1: after several refractions rays are "in most cases" enclosed by tight
cones; larger openings "only appear near contours"; later on, the main yield is that ended areas are discarded; and
iterations beyond the eighth are possible. Both normals that bend rays, and two iterations more than the stencil has
bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE, run
from refsim.experiments.verdicts import claim
from refsim.results import Generation, TileState

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
SHADINGS = ("geometric", "smooth")
FILL = 0.55
ITERATIONS = 10
STENCIL_BITS = 8
# Degrees: such a cone holds 3 percent of all directions (`hre_claims.ACCURATE`)
TIGHT = 20.0
# Of the range of the distances of a generation: a jump between neighbours beyond it is a contour
JUMP = 0.1
SEVERAL = (3, 4, 8)  # iterations "after several refractions": the second is the first refracted one
FIRST_REFRACTED = (2, 3)
LATER = 4
HALF = 50.0  # percent: most


def cases(quick: bool) -> list[Case]:
    """A case a scene and normal; 16 × 16 tiles, as in the paper."""
    size, tile = (64, 4) if quick else (256, 16)
    return [
        {"scene": scene, "shading": shading, "size_px": size, "tile_px": tile, "fill": FILL, "iterations": ITERATIONS}
        for scene in SCENES for shading in SHADINGS
    ]  # fmt: skip


def measure(
    scene: str, shading: str, size_px: int, tile_px: int, fill: float, iterations: int, backend: str = "numba"
) -> Rows:
    """A row an iteration."""
    options: dict[str, Any] = {"generations": iterations, "shading": shading, "backend": backend}
    found = run(HIERARCHICAL, scene, size_px, fill, tile_size=tile_px, **options)
    other = run(RAY_ENGINE, scene, size_px, fill, stencil=True, **options)
    triangles = len(found.scene.triangles)
    head = {"scene": scene, "triangles": triangles, "shading": shading, "size_px": size_px, "tile_px": tile_px}
    rows: Rows = []
    for k, (passed, judge) in enumerate(zip(found.generations, other.generations, strict=True)):
        before = found.generations[k - 1] if k else None
        rows.append({**head, "iteration": k + 1, **_tiles(passed, before, tile_px), **_saved(passed, triangles),
                     **_against(passed, judge)})  # fmt: skip
    return rows


def by_tile(mask: NDArray[np.bool_], size: int, tile: int) -> NDArray[np.bool_]:
    """Tiles, row by row, that have a pixel of the mask; the picture is a whole number of tiles wide and high."""
    side = size // tile
    return np.asarray(mask.reshape(side, tile, side, tile).any(axis=(1, 3)).ravel())


def contours(passed: Generation, size: int) -> NDArray[np.bool_]:
    """Pixels [size, size] across whose left or upper edge rays of the generation begin or cease to hit, or hit at
    distances that jump."""
    hit = (passed.hits.triangle >= 0).reshape(size, size)
    t = np.where(hit, passed.hits.t.reshape(size, size).astype(np.float64), np.nan)
    least = JUMP * float(np.nanmax(t) - np.nanmin(t)) if hit.any() else np.inf
    edge = np.zeros((size, size), np.bool_)
    for rows, others in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        with np.errstate(invalid="ignore"):
            edge[rows] |= (hit[rows] != hit[others]) | (np.abs(t[rows] - t[others]) > least)
    return edge


def _tiles(passed: Generation, before: Generation | None, tile_px: int) -> Row:
    """Tiles with rays by the width of their cone, and those with a contour in the generation that made the rays."""
    cones, size = passed.cones, passed.rays.width
    assert cones is not None and size is not None
    live = by_tile(passed.alive, size, tile_px)
    bounded = cones.state == TileState.BOUNDED
    tight = live & bounded & (np.degrees(cones.half_angle.astype(np.float64)) <= TIGHT)
    wide = live & ~tight
    edge = np.zeros_like(live) if before is None else by_tile(contours(before, size), size, tile_px)
    return {
        "tiles": len(live),
        "live_tiles": int(live.sum()),
        "unbounded_tiles": int((live & ~bounded).sum()),
        "tight_tiles": int(tight.sum()),
        "tight_percent_of_live": _percent(int(tight.sum()), int(live.sum())),
        "wide_tiles": int(wide.sum()),
        "wide_tiles_with_contour": int((wide & edge).sum()),
        "live_tiles_with_contour": int((live & edge).sum()),
    }


def _percent(part: int, whole: int) -> float | str:
    return round(100.0 * part / whole, 2) if whole else ""


def _saved(passed: Generation, triangles: int) -> Row:
    """Pairs of tile and triangle left out: because the tile has no ray, and because its cone misses the sphere."""
    c = passed.counters
    empty = c["cone.tiles_empty"] * triangles
    return {
        "pairs": c["cone.sphere_tests"],
        "pairs_saved_by_empty_tiles": empty,
        "pairs_saved_by_cones": c["cone.sphere_tests"] - c["cone.pairs_kept"] - empty,
    }


def _against(passed: Generation, judge: Generation) -> Row:
    """Rays, those whose hit is not the Ray Engine's, and shader runs on pixels without a ray."""
    a, b = passed.hits, judge.hits
    other = (a.triangle != b.triangle) | (a.t.view(np.uint32) != b.t.view(np.uint32))
    return {
        "rays": int(passed.alive.sum()),
        "rays_with_other_hits": int(other.sum()),
        "shader_runs": int(passed.per_ray["triangle_tests"].sum()),
        "shader_runs_without_ray": int(passed.per_ray["triangle_tests"][~passed.alive].sum()),
    }


def runs_of(rows: Rows) -> dict[str, Rows]:
    """The rows of each scene and normal, by a name of both."""
    found: dict[str, Rows] = {}
    for row in rows:
        found.setdefault(f"{style.body_name(row['scene'])}, {row['shading']}", []).append(row)
    return found


def verdicts(rows: Rows) -> Rows:
    """What the sections say, on the rows."""
    found: Rows = _most_cases(rows)
    for body, own in runs_of(rows).items():
        by = {row["iteration"]: row for row in own}
        found += [_tight(body, by[k]) for k in SEVERAL if k in by and by[k]["live_tiles"]]
        found += [_near_contours(body, by[k]) for k in FIRST_REFRACTED if k in by and by[k]["wide_tiles"]]
        found += [_yield(body, [row for row in own if LATER <= row["iteration"] <= STENCIL_BITS])]
        found += [_beyond(body, [row for row in own if row["iteration"] > STENCIL_BITS])]
    return found


def _most_cases(rows: Rows) -> Rows:
    found: Rows = []
    for k in SEVERAL:
        own = [row for row in rows if row["iteration"] == k]
        live, tight = (sum(row[name] for row in own) for name in ("live_tiles", "tight_tiles"))
        if live:
            found.append(
                claim("7.1", "in most cases rays can still be enclosed by tight cones", f"iteration {k}, all bodies",
                      f"more than {HALF:g} percent of tiles with a ray have a bounded cone of at most {TIGHT:g} deg",
                      f"{_percent(tight, live)} percent of {live} tiles", 100.0 * tight > HALF * live)
            )  # fmt: skip
    return found


def _tight(body: str, row: Row) -> Row:
    share = row["tight_percent_of_live"]
    return claim(
        "1", "rays are coherent even after several refractions", f"{body}, iteration {row['iteration']}",
        f"more than {HALF:g} percent of the tiles with a ray have a bounded cone of at most {TIGHT:g} deg",
        f"{share:g} percent of {row['live_tiles']} tiles", share > HALF,
    )  # fmt: skip


def _near_contours(body: str, row: Row) -> Row:
    near, wide = row["wide_tiles_with_contour"], row["wide_tiles"]
    return claim(
        "7.1", "larger openings only appear near contours", f"{body}, iteration {row['iteration']}",
        f"every tile whose cone is wider than {TIGHT:g} deg, or unbounded, has an outline or a jump in distance in the "
        f"generation before; depends where more than {HALF:g} percent have",
        f"{near} of {wide} such tiles; {row['live_tiles_with_contour']} of all {row['live_tiles']} with a ray",
        True if near == wide else None if 100.0 * near > HALF * wide else False,
    )  # fmt: skip


def _yield(body: str, own: Rows) -> Row:
    empty, cones = (sum(row[f"pairs_saved_by_{name}"] for row in own) for name in ("empty_tiles", "cones"))
    pairs = sum(row["pairs"] for row in own)
    return claim(
        "7.1", "later on, the main yield is that areas without a ray are discarded", body,
        f"in iterations {LATER} to {STENCIL_BITS}, tiles without a ray spare more pairs of tile and triangle than "
        "cones do",
        f"{_percent(empty, pairs)} percent of the pairs by empty tiles, {_percent(cones, pairs)} by cones",
        empty > cones,
    )  # fmt: skip


def _beyond(body: str, own: Rows) -> Row:
    other, rays = sum(row["rays_with_other_hits"] for row in own), sum(row["rays"] for row in own)
    idle = sum(row["shader_runs_without_ray"] for row in own)
    return claim(
        "5", "iterations beyond the eighth are possible without excluding further paths", body,
        f"iterations {STENCIL_BITS + 1} to {ITERATIONS} have rays, all with the Ray Engine's hits, and shader runs on "
        "pixels without a ray",
        f"{other} of {rays} rays with another hit; {idle} shader runs without a ray",
        other == 0 and rays > 0 and idle > 0,
    )  # fmt: skip


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Iterations, and verdicts."""
    return {"coherence": rows, "coherence-verdicts": verdicts(rows)}


EXPERIMENT = Experiment(
    "coherence",
    "How coherent rays stay",
    "256² eye rays in 16 × 16 tiles (64² in 4 × 4 with `--quick`), 10 iterations, flat and smooth normals. Tight: "
    f"a bounded cone of at most {TIGHT:g} degrees. A tile has a contour where, in the iteration before, neighbouring "
    "rays part at an outline, or at a jump of a tenth of the range of distances. Saved pairs: of tile and triangle.",
    cases,
    measure,
    None,
    tables,
)
