"""The construction of section 4 on the tiles of a run, ray by ray: what Figures 2 and 3 are drawn and counted from.

The rays are those of a traced generation; the steps are taken in float64, so that what is left outside is the
formulas' doing and not rounding's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.registry import Case, Row, Rows, Tables
from refsim.experiments.runs import HIERARCHICAL, fill_of, run
from refsim.reference import cone
from refsim.reference.cone_steps import Step, steps
from refsim.reference.tiles import Tiles
from refsim.reference.vector import angle

SCENES = ("torus_knot_1024", "blob_1000", "sphere_896")
GENERATIONS = (1, 2)
OFTEN = 5  # a tile is drawn whose cone is widened and moved as often
# Of the distance from the apex. The least gap of all runs is 7e-9; float64 leaves 2^-53, times 256 where the way is
# divided by sin 2 phi of the narrowest cone, times some more for sums
ROUNDING = 2.0**-35
Vectors = NDArray[Any]


class Bundles(NamedTuple):
    """Rays of the tiles that have any, float64: numbers of the tiles, columns of tiles, origins, directions, live."""

    tile: NDArray[np.int64]
    columns: int
    p: Vectors
    r: Vectors
    live: NDArray[np.bool_]


def cases(quick: bool) -> list[Case]:
    """A case a scene and generation."""
    scenes, size, tile = (SCENES[:1], 64, 8) if quick else (SCENES, 256, 16)
    return [
        {"scene": scene, "size_px": size, "tile_px": tile, "fill": fill_of(scene), "generation": k}
        for scene in scenes
        for k in GENERATIONS
    ]


@lru_cache(maxsize=2)
def bundles(scene: str, size: int, tile: int, fill: float, generation: int, backend: str) -> Bundles:
    """The tiles of a generation of refracted rays, row by row."""
    found = run(HIERARCHICAL, scene, size, fill, generations=1 + max(GENERATIONS), tile_size=tile, backend=backend)
    passed = found.generations[generation]
    tiles = Tiles(size, size, tile)
    live = (tiles.pixels >= 0) & passed.alive[tiles.pixels]
    some = live.any(axis=1)
    live, pixels = live[some], tiles.pixels[some]
    r = passed.rays.direction.astype(np.float64)[pixels]
    # Rays are unit to float32 only
    r = r / np.where(live, np.linalg.norm(r, axis=2), 1.0)[:, :, None]
    return Bundles(np.flatnonzero(some), tiles.columns, passed.rays.origin.astype(np.float64)[pixels], r, live)


def followed(found: Bundles) -> tuple[list[Step], int]:
    """All steps, and the bundle to draw: of those whose rays all live, whose cone stays bounded and changes often, the
    one that has both an extension and a translation that show well; where there is none, the one with most rays."""
    taken = list(steps(found.p, found.r, found.live))
    good = found.live.all(axis=1) & (taken[-1].after.state == cone.BOUNDED)
    for name in ("extended", "moved"):
        good &= np.sum([getattr(step, name) for step in taken], axis=0) >= OFTEN
    extension = np.max([np.where(step.extended, shows(step.before, step.r), 0.0) for step in taken], axis=0)
    translation = np.max(
        [np.where(step.moved, shows(step.wider, step.p - step.wider.apex), 0.0) for step in taken], axis=0
    )
    worth = np.where(good, np.minimum(extension, translation), 0.0)
    return taken, int(np.argmax(worth if worth.any() else found.live.sum(axis=1)))


def shows(cones: cone.Cones, way: Vectors) -> Vectors:
    """How well cones and a direction that they do not hold can be drawn: the half-angle, what the direction is outside
    by, or what both lack to a right angle, whichever is least; degrees."""
    with np.errstate(invalid="ignore"):
        phi, theta = cone.half_angle(cones), angle(cones.axis, way)
    least = np.minimum(np.minimum(phi, theta - phi), np.pi / 2 - theta)
    return np.degrees(np.where(cones.state == cone.BOUNDED, least, 0.0))


def head(scene: str, size_px: int, tile_px: int, fill: float, generation: int) -> Row:
    """The columns that name a case."""
    return {"scene": scene, "size_px": size_px, "tile_px": tile_px, "fill": fill, "generation": generation}


def place(found: Bundles, bundle: int) -> Row:
    """Where a tile is."""
    row, column = divmod(int(found.tile[bundle]), found.columns)
    return {"tile_row": row, "tile_column": column}


def digits(value: float) -> float:
    """Nine significant digits."""
    return float(f"{value:.9g}")


def degrees(value: float) -> float:
    """Radians, as degrees of six decimals."""
    return round(float(np.degrees(value)), 6)


def columns(**vectors: Vectors) -> Row:
    """A column a component: `q` -> q_x, q_y, q_z."""
    return {
        f"{name}_{axis}": digits(float(value))
        for name, vector in vectors.items()
        for axis, value in zip("xyz", vector, strict=True)
    }


def vector(row: Row, name: str) -> Vectors:
    """The vector of such columns."""
    return np.array([row[f"{name}_{axis}"] for axis in "xyz"], np.float64)


def total(masks: list[NDArray[np.bool_]]) -> int:
    """How many hold in all."""
    return int(sum(mask.sum() for mask in masks))


def split(stem: str) -> Callable[[Rows, Mapping[str, Rows]], Tables]:
    """Tables: the steps of the drawn tiles, and the counts over all tiles."""

    def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
        return {
            stem: [row for row in rows if "step" in row],
            f"{stem}-counts": [row for row in rows if "step" not in row],
        }

    return tables


def drawn_steps(rows: Rows) -> Rows:
    """The steps of the first scene's last generation, whose cones are widest."""
    steps_of = [row for row in rows if "step" in row]
    first = [row for row in steps_of if row["scene"] == steps_of[0]["scene"]]
    return [row for row in first if row["generation"] == first[-1]["generation"]]


def telling(rows: Rows, worth: Callable[[Row], float], number: int) -> Rows:
    """The first row, the last, and those worth most between, in order."""
    most = sorted(range(1, len(rows) - 1), key=lambda k: -worth(rows[k]))[: number - 2]
    return [rows[k] for k in sorted({0, len(rows) - 1, *most})]


def about(row: Row) -> str:
    """The tile, for a title."""
    from refsim.experiments import style

    return (
        f"{style.body_name(row['scene'])}, generation {row['generation']}, "
        f"tile in row {row['tile_row']}, column {row['tile_column']}"
    )
