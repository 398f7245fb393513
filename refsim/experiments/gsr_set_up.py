"""Sentences of sections 4 and 6 on buffers, draws and the scene's textures, each checked on what a run is set up with.

A row says what was counted and of how many; what number makes the sentence true stands in the ledger. What passes
between the stages is `gsr_stages`'. Recursive Ray Tracing in Geometry Shader, sections 3, 4, 4.3 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from refsim.counters import Counters
from refsim.errors import InputError
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, head, rays_of, run, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.methods import METHODS
from refsim.options import checked
from refsim.papers.geometry_shader_rays.setup import options_of, prepared
from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting
from refsim.papers.geometry_shader_rays.triangle_textures import WIDTH
from refsim.pipeline.draw import draw
from refsim.results import Generation, RayKind

FULL, QUICK = 32, 16
BOX, ROOM = "cornell box from afar", "mirroring room"
FULL_VIEWS = (ROOM, "small knot from above", "knot from above")  # every ray hits a mirror
MARGIN = 1e-5  # of a cell's size: centroids nearer than this to its side belong to two cells
Counted = tuple[float, int]  # what was counted, of how many


def _tracer(view: str, size: int) -> GeometryShaderTracer:
    scene, rays = scene_of(view), rays_of(view, size)
    values = checked(GEOMETRY_SHADER, METHODS[GEOMETRY_SHADER].options, {"passes": 2, "refractions": False})
    shared = options_of(scene, values)
    return GeometryShaderTracer(prepared(scene, rays, values, shared), size, size, shared, Setting())


def one_buffer(size: int) -> Counted:
    """Draws that capture into the buffer that they draw, and are not refused."""
    tracer = _tracer(BOX, size)
    source = tracer.fill(rays_of(BOX, size))
    try:
        draw(tracer.pipeline, vertices=source, stream_output=source, framebuffer=tracer.layers.framebuffer,
             uniforms=tracer.frame, counters=Counters())  # fmt: skip
    except InputError as error:
        return int("capture into a vertex buffer that the draw reads" not in str(error)), 1
    return 1, 1


def _ways(size: int) -> tuple[tuple[Generation, ...], ...]:
    """Three passes with eye rays shot, and with eye rays rasterised."""
    return tuple(run(GEOMETRY_SHADER, BOX, size, passes=3, refractions=False, primary=way).generations
                 for way in ("rays", "raster"))  # fmt: skip


def _sent(generation: Generation, pixels: Any) -> dict[tuple[int, ...], tuple[float, ...]]:
    """Rays of these pixels by pixel, kind and node: origin, direction, and where they hit."""
    assert generation.node is not None
    keys = np.stack([generation.pixel, generation.kind, generation.node], 1)
    columns = np.hstack([generation.rays.origin, generation.rays.direction, generation.hits.t[:, None]])
    both = zip(keys.tolist(), columns.tolist(), strict=True)
    return {tuple(key): tuple(row) for key, row in both if key[0] in pixels}


def rasterised(size: int) -> Counted:
    """Rays after the first pass that are not the same where eye rays are rasterised instead, of pixels where both
    found one triangle."""
    shot, drawn = _ways(size)
    same = set(np.flatnonzero(shot[0].hits.triangle == drawn[0].hits.triangle).tolist())
    wrong = total = 0
    for a, b in zip(shot[1:], drawn[1:], strict=True):
        ours, theirs = _sent(a, same), _sent(b, same)
        total += len(ours)
        wrong += sum(ours.get(key) != theirs.get(key) for key in ours.keys() | theirs.keys())
    return wrong, total


def rasterised_hits(size: int) -> Counted:
    """Eye rays for which rasterising finds another triangle than shooting."""
    shot, drawn = _ways(size)
    return int((shot[0].hits.triangle != drawn[0].hits.triangle).sum()), len(shot[0].kind)


def rasterised_steps(size: int) -> Counted:
    """Cells and tests of the first pass with rasterised eye rays, and with shot ones."""
    runs = [run(GEOMETRY_SHADER, BOX, size, passes=1, refractions=False, primary=way) for way in ("raster", "rays")]
    drawn, shot = (int(sum(g.per_ray["cells"].sum() + g.per_ray["triangle_tests"].sum() for g in each.generations))
                   for each in runs)  # fmt: skip
    return drawn, shot


def draws(size: int) -> Counted:
    """Numbers of draw calls of scenes that send on different numbers of rays: a count read back could change them."""
    runs = [run(GEOMETRY_SHADER, view, size, passes=2, refractions=False) for view in (BOX, *FULL_VIEWS)]
    sent = {found.generations[1].counters["vertex.invocations"] for found in runs}
    return len({found.counters["draw.calls"] for found in runs}), len(sent)


def lists(size: int) -> Counted:
    """Texels of the grid whose list does not begin where the one before ends: RGB, x and y of the beginning, length."""
    cells = prepared_of(BOX).accelerator.structure.cells.reshape(-1, 3).astype(np.int64)
    place = cells[:, 0] + (cells[:, 1] << 12)
    return int((place != np.concatenate([[0], np.cumsum(cells[:, 2])[:-1]])).sum()), len(cells)


def indirections(size: int) -> Counted:
    """Triangles that the cell of their centroid does not lead to: cell, list, triangle."""
    structure, scene = prepared_of(BOX).accelerator.structure, scene_of(BOX)
    at = (scene.triangles.mean(axis=1) - np.array(structure.lower)) / np.array(structure.size)
    inside = (np.abs(at - np.rint(at)) > MARGIN).all(axis=1)
    lost = 0
    for k in np.flatnonzero(inside):
        x, y, z = at[k].astype(int)
        first, row, length = structure.cells[z, y, x]
        start = int(first) + (int(row) << int(structure.row_bits))
        lost += int(k not in structure.lists[start : start + int(length)])
    return lost, int(inside.sum())


def world_space(size: int) -> Counted:
    """Triangles whose first corner, plane and edges at one (x, y) of the four slices are not the scene's."""
    texture = np.asarray(prepared_of(BOX).textures.triangles.data)
    triangles = scene_of(BOX).triangles
    i = np.arange(len(triangles))
    slices = texture[i // WIDTH, i % WIDTH]
    corner = (slices[:, 0, :3] != triangles[:, 0]).any(axis=1)
    edges = (triangles[:, 1:] - triangles[:, :1]).astype(np.float64)
    plane = np.abs(np.einsum("nk,nek->ne", slices[:, 1, :3], edges)).max(axis=1) > MARGIN
    return int((corner | plane).sum()), len(triangles)


def slices(size: int) -> Counted:
    """Depth slices of the two textures of triangles, and how many textures."""
    both = prepared_of(BOX).textures
    depths = {np.asarray(texture.data).shape[2] for texture in both}
    return max(depths), len(both)


@lru_cache(maxsize=1)
def prepared_of(view: str) -> Any:
    """The scene's textures and grid."""
    return _tracer(view, QUICK).prepared


STATEMENTS: dict[str, tuple[str, str, Callable[[int], Counted]]] = {
    "draws": ("sections 3, 4.3", "numbers of draws", draws),
    "one-buffer": ("section 4", "draws", one_buffer),
    "rasterised": ("section 6", "rays", rasterised),
    "rasterised-hits": ("section 6", "rays", rasterised_hits),
    "rasterised-steps": ("section 6", "cells and tests", rasterised_steps),
    "lists": ("section 4.3", "texels", lists),
    "indirections": ("section 4.3", "triangles", indirections),
    "world-space": ("section 4.3", "triangles", world_space),
    "slices": ("section 4.3", "slices", slices),
}


def cases(quick: bool) -> list[Case]:
    """A case a statement, and one a scene and size of the buffers' real use."""
    size = QUICK if quick else FULL
    found: list[Case] = [{"part": name, "view": BOX, "size_px": size} for name in STATEMENTS]
    found += [{"part": "room", "view": view, "size_px": size} for view in FULL_VIEWS]
    return found + [{"part": "room", "view": ROOM, "size_px": factor * size} for factor in (2, 4)]


def measure(part: str, view: str, size_px: int) -> Rows:
    """One row."""
    if part == "room":
        return [_room(view, size_px)]
    place, unit, check = STATEMENTS[part]
    measured, of = check(size_px)
    about = " ".join((check.__doc__ or "").split())
    return [{"part": "statements", "id": part, "place": place, "counted": about, "measured": measured, "of": of,
             "unit": unit}]  # fmt: skip


def _room(view: str, size: int) -> Row:
    """What the fullest pass captures where every ray hits and is reflected, against S_VB."""
    found = run(GEOMETRY_SHADER, view, size, passes=2, refractions=False)
    eye = found.generations[0]
    held = [g.occupancy for g in found.generations if g.occupancy is not None]
    reflected = int((found.generations[1].kind == RayKind.REFLECTED).sum())
    return {
        "part": "room", **head(view, size, found),
        "all_hit_and_mirror": int((eye.hits.triangle >= 0).all() and reflected == size * size),
        "records_captured": max(each.vertices for each in held),
        "records_a_pixel": round(max(each.vertices for each in held) / size**2, 4),
        "records_of_s_vb_a_pixel": round(held[0].capacity / size**2, 4),
    }  # fmt: skip


def of_part(rows: Rows, part: str) -> Rows:
    """`statements` or `room`."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Statements, and the buffers' real use."""
    return {"gsr-set-up": of_part(rows, "statements"), "gsr-set-up-room": of_part(rows, "room")}


EXPERIMENT = Experiment(
    "gsr-set-up",
    "What sections 4 and 6 say of buffers, draws and textures",
    "32² pixels (16² with `--quick`) of the Cornell box seen from afar, without glass: buffers, draw calls, the grid's "
    "texels and the triangles' textures, and eye rays that are rasterised. The other table: how full the vertex buffer "
    "gets where every ray hits a mirror, over scenes and sizes.",
    cases,
    measure,
    None,
    tables,
)
