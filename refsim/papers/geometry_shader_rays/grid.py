"""The uniform grid as section 4.3 stores it: cells in a 3-D texture, packed lists of references in a 2-D texture.

"Each grid cell is encoded in one texel. The list of referenced objects is stored tightly packed and each texel
corresponds to a pointer to actual triangle data." In: a scene; out: an `Accelerator` for `acceleration`'s interface.
Texels are int32: float32 texels, which the paper's hardware would have had, count exactly only to 2²⁴.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.jit import specialise
from refsim.papers.geometry_shader_rays.acceleration import Accelerator
from refsim.papers.geometry_shader_rays.grid_build import count_references, lay_out, write_references
from refsim.papers.geometry_shader_rays.grid_margins import GROWTH, Margins, margins, rounded_down, rounded_up
from refsim.papers.geometry_shader_rays.grid_traversal import search_grid
from refsim.pipeline.threads import checked_threads, run_all
from refsim.scene.mesh import Scene

# Cells for a triangle by the default rule: see `grid`
DENSITY = 6.0
ROW_BITS = 12
ROW = 1 << ROW_BITS
# 400 MB of cells, and as much of counts on the way; 512 MB of references
MOST_CELLS = 2**25
MOST_REFERENCES = 2**27
SMALLEST_CHUNK = 1 << 14
Triple = tuple[Any, Any, Any]


class Grid(NamedTuple):
    """What the traversal reads.

    cells         i32[gz, gy, gx, 3], one RGB texel a cell: x and y where its list starts in `references`, its length
    references    i32[rows, 4096], the lists one after the other without gaps, on from row to row; a texel is the number
                  i of a triangle, which is where its data lies: x = i mod 1024, y = i div 1024
    texels, lists   the same memory as [cells, 3] and [references]: the next cell and reference are a step away
    row_bits      12
    lower, size, inverse_size, shape   corner, edges of a cell, one over them, and cells along x, y, z, all float32
    loose         i32[k] triangles in no cell, which every ray tests; far: see `grid_margins`; total: all triangles
    """

    cells: NDArray[np.int32]
    references: NDArray[np.int32]
    texels: NDArray[np.int32]
    lists: NDArray[np.int32]
    row_bits: np.uintp
    lower: Triple
    size: Triple
    inverse_size: Triple
    shape: Triple
    loose: NDArray[np.int32]
    far: np.float32
    total: np.int32


def grid(scene: Scene, resolution: Any = None, reach: float | None = None, threads: int | None = None) -> Accelerator:
    """The scene's grid.

    Args:
        resolution: cells along the longest axis, or along x, y and z. None: cubes, `DENSITY` = 6 for every triangle.
        reach: the largest distance of a ray's origin from the scene's box; None: 8 of its diagonals. A ray from
            further away is right and slow, as it tests every triangle.
        threads: that build; the grid is the same whatever their number.

    Why 6: milliseconds of one processor for the 262,144 eye rays of a 512² image with a shadow ray and a mirrored ray
    from every hit; in brackets cells and tests of an eye ray.

        cells for a triangle   2                 4                 6                 8                 12
        knot above a ground    71 (10.5, 8.9)    68 (13.2, 7.0)    70 (15.2, 6.0)    70 (16.5, 5.5)    74 (19.2, 4.8)
        bunny                  304 (29.0, 25.0)  270 (36.2, 18.4)  255 (41.5, 15.3)  252 (45.9, 13.7)  246 (52.4, 11.7)
        dragon                 658 (62.7, 32.9)  602 (79.1, 23.7)  604 (90.3, 19.6)  611 (99.6, 17.2)  658 (114, 14.5)

    An axis never gets cells thinner than 4 times the margin by which lists reach beyond them, so an axis along which
    the scene has no thickness gets one cell. Raises `InputError`, also for more than 2²⁵ cells or 2²⁷ references.
    """
    bounds = margins(scene, reach)
    extent = bounds.upper - bounds.lower
    most = np.maximum(np.floor((scene.upper.astype(float) - scene.lower) / (4.0 * GROWTH * bounds.slack)), 1)
    wanted = default_shape(extent, most > 1, len(scene)) if resolution is None else asked_shape(extent, resolution)
    shape = np.clip(wanted, 1, most).astype(np.int64)
    if np.prod(shape) > MOST_CELLS:
        x, y, z = shape
        raise InputError(f"a grid of {x} × {y} × {z} cells is more than the {MOST_CELLS} that fit its memory.")
    lower = rounded_down(bounds.lower)
    size = rounded_up((bounds.upper - lower) / shape * (1 + 2.0**-40))
    cells, references = lists_of(scene, bounds, lower, size, shape, checked_threads(threads))
    structure = Grid(
        cells, references, cells.reshape(-1, 3), references.reshape(-1), np.uintp(ROW_BITS),
        _triple(lower), _triple(size), _triple(np.float32(1) / size), _triple(shape.astype(np.float32)),
        bounds.loose, bounds.far, np.int32(len(scene)),
    )  # fmt: skip
    return Accelerator("grid", structure, search_grid)


def default_shape(extent: NDArray[np.float64], thick: NDArray[np.bool_], count: int) -> NDArray[np.float64]:
    """Cells along x, y, z: cubes, so many that there are `DENSITY` of them for a triangle; see `grid`.

    An axis that is not `thick`, or thinner than a cube, gets one cell; then squares, or segments, share out the rest.
    """
    cells, edge = min(DENSITY * count, MOST_CELLS / 2), np.inf
    while thick.any():
        edge = (np.prod(extent[thick]) / cells) ** (1.0 / thick.sum())
        if (extent[thick] >= edge).all():
            break
        thick = thick & (extent >= edge)
    return np.where(thick, np.rint(extent / edge), 1.0)


def asked_shape(extent: NDArray[np.float64], resolution: Any) -> NDArray[np.float64]:
    """Cells along x, y, z that an integer, or three, ask for. Raises `InputError`."""
    given = (resolution,) if np.ndim(resolution) == 0 else tuple(resolution)
    whole = all(isinstance(n, int | np.integer) and not isinstance(n, bool) and n >= 1 for n in given)
    if not whole or len(given) not in (1, 3):
        raise InputError(f"resolution must be one or three whole numbers from 1, not {resolution!r}.")
    if max(given) > MOST_CELLS:
        raise InputError(f"a grid {max(given)} cells long is more than the {MOST_CELLS} that fit its memory.")
    counts = np.array(given, np.float64)
    return counts if len(given) == 3 else np.rint(extent / extent.max() * counts)


def lists_of(
    scene: Scene,
    bounds: Margins,
    lower: NDArray[np.float32],
    size: NDArray[np.float32],
    shape: NDArray[np.int64],
    threads: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """`cells` and `references`: a counting sort in two passes. Each thread counts its own part of the triangles."""
    chunks = max(min(threads, len(scene) // SMALLEST_CHUNK), 1)
    parts = list(pairwise(np.linspace(0, len(scene), chunks + 1).astype(int).tolist()))
    depth_first = tuple(int(n) for n in shape[::-1])
    counts = np.zeros((chunks, *depth_first), np.int32)
    given = scene.triangles, bounds.dilation, bounds.slack
    box = lower.astype(np.float64), size.astype(np.float64)

    def both(template: Any, *after: Any) -> list[Any]:
        kernel = specialise(template, {})
        tasks = [lambda k=k, ends=ends: kernel(*given, *ends, *box, counts[k], *after) for k, ends in enumerate(parts)]
        return run_all("grid", threads, tasks)

    total = sum(both(count_references))
    if total > MOST_REFERENCES:
        raise InputError(f"a grid of {total} references is more than the {MOST_REFERENCES} that fit its memory.")
    cells = np.empty((*depth_first, 3), np.int32)
    specialise(lay_out, {})(counts, cells, ROW_BITS)
    references = np.zeros((max(-(-total // ROW), 1), ROW), np.int32)
    both(write_references, references.reshape(-1))
    return cells, references


def _triple(values: NDArray[np.float32]) -> Triple:
    x, y, z = values
    return x, y, z
