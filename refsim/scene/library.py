"""The library: scenes that the program makes itself, by name, pure NumPy and the same on every machine.

``torus_knot``, ``sphere``, ``blob`` and ``knot_on_ground`` take a size: ``torus_knot_5000`` has exactly 5,000
triangles, and so has ``knot_on_ground_5000``, two of which are the ground. A size is 2 * rows * columns of a grid of
quads, besides the ground. Of all factorisations the one whose rows : columns comes closest to the body's ideal is taken
(8 for the knot, 2 for sphere and blob); a size that has none within a factor of 8 is refused, and the nearest sizes
that have one are named. Of two factorisations equally close the one with more rows is taken.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from refsim.errors import InputError
from refsim.scene import shapes
from refsim.scene.animation import KNIGHT_TRIANGLES, knight_in_box
from refsim.scene.light import PointLight
from refsim.scene.material import GLASS, MIRROR, Material
from refsim.scene.mesh import Scene
from refsim.scene.stages import SILK, on_ground

__all__ = ["LIBRARY", "grid_of", "library_scene"]

LARGEST = 10_000_000
WORST_RATIO = 8

WHITE = Material("white", "diffuse", (0.73, 0.71, 0.68))
RED = Material("red", "diffuse", (0.63, 0.06, 0.05))
GREEN = Material("green", "diffuse", (0.14, 0.45, 0.09))
LAMP = Material("lamp", "diffuse", (1.0, 1.0, 1.0))
GROUND = Material("ground", "diffuse", (0.55, 0.55, 0.5))


@dataclass(frozen=True)
class Entry:
    """A library scene: its maker, its size without a number in the name, and, if it has sizes,
    the ideal rows : columns of its grid, the fewest columns, and the triangles besides the grid."""

    make: Callable[..., Scene]
    triangles: int
    ideal: int | None = None
    least: int = 1
    besides: int = 0


def library_scene(name: str) -> Scene | None:
    """The library's scene of that name, None if it has none; ``InputError`` for a size that it cannot make."""
    entry = LIBRARY.get(name)
    size = None if entry is None else entry.triangles
    if entry is None:
        match = re.fullmatch(r"(.+?)_(-?\d+)", name)
        if not match or match[1] not in LIBRARY:
            return None
        entry, size = LIBRARY[match[1]], int(match[2])
        if entry.ideal is None:
            raise InputError(f"scene {match[1]!r} always has {entry.triangles} triangles, so {name!r} is unknown")
    if entry.ideal is None:
        return entry.make(name)
    assert size is not None
    return entry.make(name, *grid_of(name, size, entry.ideal, entry.least, entry.besides))


def grid_of(name: str, triangles: int, ideal: int, least: int = 1, besides: int = 0) -> tuple[int, int]:
    """Rows and columns of a grid of ``triangles`` but ``besides``: 2 * rows * columns of them.

    rows : columns is closest to ``ideal``, rows >= 3, columns >= ``least``. ``InputError`` when there are none.
    """
    smallest = 6 * least + besides
    if not smallest <= triangles <= LARGEST:
        raise InputError(
            f"scene {name!r} asks for {triangles} triangles; sizes from {smallest} to {LARGEST} are possible"
        )
    grid = _best_grid(triangles - besides, ideal, least)
    if grid is None:
        window = range(max(triangles - 64, smallest), min(triangles + 64, LARGEST) + 1)
        possible = (n for n in window if _best_grid(n - besides, ideal, least))
        near = sorted(possible, key=lambda n: abs(n - triangles))[:2]
        raise InputError(
            f"scene {name!r} cannot have {triangles} triangles, which is not 2 x rows x columns of a "
            f"sound grid{f' and {besides}' if besides else ''}; "
            f"the nearest sizes are {' and '.join(map(str, sorted(near)))}"
        )
    return grid


def _best_grid(triangles: int, ideal: int, least: int) -> tuple[int, int] | None:
    quads, odd = divmod(triangles, 2)
    if odd:
        return None

    def off(columns: int) -> tuple[Fraction, int]:
        # Exact, so that a tie is a tie on every machine; the grid with more rows wins it.
        ratio = Fraction(quads, columns * columns * ideal)
        return max(ratio, 1 / ratio), columns

    possible = [columns for columns in _divisors(quads) if columns >= least and quads // columns >= 3]
    best = min(possible, key=off, default=None)
    return None if best is None or off(best)[0] > WORST_RATIO else (quads // best, best)


def _divisors(number: int) -> list[int]:
    small = [d for d in range(1, math.isqrt(number) + 1) if number % d == 0]
    return sorted({*small, *(number // d for d in small)})


def _assemble(name: str, parts: list[tuple[shapes.Mesh, Material]], lights: tuple[PointLight, ...] = ()) -> Scene:
    materials = tuple(dict.fromkeys(material for _, material in parts))
    triangles = [vertices[faces] for (vertices, faces), _ in parts]
    ids = [np.full(len(faces), materials.index(material), np.int32) for (_, faces), material in parts]
    return Scene(np.concatenate(triangles).astype(np.float32), name, materials, np.concatenate(ids), lights=lights)


def _knot(name: str, segments: int, radial: int) -> Scene:
    return _assemble(name, [(shapes.torus_knot(segments, radial), GLASS)], (PointLight((3.0, 4.0, 5.0)),))


def _knot_on_ground(name: str, segments: int, radial: int) -> Scene:
    body = _assemble(name, [(shapes.torus_knot(segments, radial), SILK)])
    return on_ground(body, gap=0.05)


def _sphere(name: str, segments: int, bands: int) -> Scene:
    return _assemble(name, [(shapes.sphere(segments, bands), GLASS)], (PointLight((3.0, 4.0, 5.0)),))


def _blob(name: str, segments: int, bands: int) -> Scene:
    return _assemble(name, [(shapes.blob(segments, bands), GLASS)], (PointLight((3.0, 4.0, 5.0)),))


def _walls() -> list[tuple[shapes.Mesh, Material]]:
    colors = {"left": RED, "right": GREEN}
    return [(mesh, colors.get(wall, WHITE)) for wall, mesh in shapes.open_cube()]


def _cornell(name: str) -> Scene:
    lamp = shapes.quad((-0.25, 0.98, -0.25), (0.25, 0.98, -0.25), (0.25, 0.98, 0.25), (-0.25, 0.98, 0.25))
    tall = shapes.box((-0.35, -0.385, -0.3), (0.6, 1.2, 0.6), turn=0.3)
    short = shapes.box((0.4, -0.685, 0.35), (0.6, 0.6, 0.6), turn=-0.28)
    return _assemble(name, [*_walls(), (lamp, LAMP), (tall, MIRROR), (short, GLASS)], (PointLight((0.0, 0.9, 0.0)),))


def _room(name: str) -> Scene:
    panel = shapes.quad((-0.7, -0.8, -0.6), (0.2, -0.8, -0.85), (0.2, 0.5, -0.85), (-0.7, 0.5, -0.6))
    return _assemble(name, [*_walls(), (panel, MIRROR)], (PointLight((0.3, 0.8, 0.5)),))


# Five different bodies of five cubes joined side to side in a tree: 22 sides, 24 vertices each.
BODIES: tuple[tuple[tuple[tuple[int, int, int], ...], tuple[float, float, float]], ...] = (
    (((0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)), (-3.5, 1.0, -2.0)),
    (((0, 0, 0), (0, 1, 0), (0, 2, 0), (0, 3, 0), (1, 0, 0)), (1.5, 0.0, -3.0)),
    (((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (2, 0, 0)), (-3.5, 0.0, 2.0)),
    (((0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0), (2, 2, 0)), (0.0, 0.0, 0.5)),
    (((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 1), (0, 2, 1)), (4.0, 0.0, 1.0)),
)


def _cubes(name: str) -> Scene:
    parts: list[tuple[shapes.Mesh, Material]] = []
    for cells, place in BODIES:
        vertices, faces = shapes.joined_cubes(cells)
        parts.append(((vertices + place + (0.0, 0.05, 0.0), faces), WHITE))
    ground = shapes.quad((-6.0, 0.0, 6.0), (6.0, 0.0, 6.0), (6.0, 0.0, -6.0), (-6.0, 0.0, -6.0))
    return _assemble(name, [*parts, (ground, GROUND)], (PointLight((6.0, 10.0, 8.0)),))


def _knight(name: str) -> Scene:
    return knight_in_box(name=name)


LIBRARY: dict[str, Entry] = {
    "cornell_box": Entry(_cornell, 36),
    "torus_knot": Entry(_knot, 1024, ideal=8, least=3),
    "room": Entry(_room, 12),
    "cubes": Entry(_cubes, 222),
    "sphere": Entry(_sphere, 896, ideal=2),
    "blob": Entry(_blob, 1000, ideal=2),
    "knot_on_ground": Entry(_knot_on_ground, 1026, ideal=8, least=3, besides=2),
    "knight_in_box": Entry(_knight, KNIGHT_TRIANGLES),
}
