"""Which pixels triangles cover: the same as OpenGL's, or within its sub-pixel precision of an edge.

Plan
- Triangles that need no clipping (random, with any w, slivers, below pixel size, meshes of shared edges turned and
  moved, strips, indexed): the same pixels, if OpenGL has refsim's 8 sub-pixel bits. Meshes cover each pixel once.
- Triangles that are clipped (off-screen, huge, through the near and far planes and the eye's plane): refsim clips
  against near, far and a guard band, Mesa against the sides of the view too, which moves edges within the grid. Both
  are judged against the exact triangle: no centre deeper inside than the precision is left out, none further outside
  is covered. Where the sub-pixel bits differ from 8 the first list is judged so too.
- Centres on edges: OpenGL only says that one of two neighbours gets them. Mesa gives a level edge to the triangle
  above it, refsim (and WebGPU) to the one below; nothing else differs. The other tests keep level edges off centres.
- Facing and culling drop the same triangles.
"""

from __future__ import annotations

import numpy as np
import pytest

from refsim.pipeline.enums import CullMode, FrontFace, PrimitiveTopology
from tests.opengl import case as cases
from tests.opengl import shapes
from tests.opengl.margins import triangle_margins
from tests.opengl.streams import clip
from tests.opengl.verdicts import note, same

SEED = 31001
SIZE = (64, 48)
COUNT = shapes.MOST
LIST, STRIP = PrimitiveTopology.TRIANGLE_LIST, PrimitiveTopology.TRIANGLE_STRIP
LIST_PIPELINE = shapes.pipeline(LIST)
# A corner is off by half a step of the grid in x and y, so an edge by 0.71 steps; one step leaves float32 its room
STEP = 1 / 256


def anywhere(rng, low=0.0, high=1.0, w=1.0):
    """Corners anywhere between `low` and `high` of the screen."""
    return clip(rng.uniform(low, high, (3 * COUNT, 2)) * SIZE, rng.uniform(0.1, 0.9, 3 * COUNT), SIZE, w)


def any_w(rng):
    """Corners inside, with w from 0.05 to 20."""
    return anywhere(rng, w=np.exp(rng.uniform(-3, 3, 3 * COUNT)))


def slivers(rng):
    """Triangles up to 40 pixels long and some tenths of a pixel wide."""
    middle = rng.uniform(20, 28, (COUNT, 1, 2))
    along = rng.uniform(-20, 20, (COUNT, 3, 1)) * _unit(rng, COUNT)
    place = middle + along + rng.uniform(-0.2, 0.2, (COUNT, 3, 2))
    return clip(place.reshape(-1, 2), np.full(3 * COUNT, 0.5), SIZE)


def tiny(rng):
    """Triangles about as large as a pixel, and below."""
    place = rng.uniform(5, 40, (COUNT, 1, 2)) + rng.uniform(-1, 1, (COUNT, 3, 2)) * rng.uniform(0.2, 1.5, (COUNT, 1, 1))
    return clip(place.reshape(-1, 2), np.full(3 * COUNT, 0.5), SIZE)


def _unit(rng, count):
    angle = rng.uniform(0, 2 * np.pi, count)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]


def mesh(rng):
    """A grid of 8 × 6 cells of two triangles that share edges, turned, scaled and moved, its inner corners shaken."""
    column, row = np.meshgrid(np.arange(9), np.arange(7))
    place = np.stack([column, row], axis=-1).astype(float)
    place[1:-1, 1:-1] += rng.uniform(-0.35, 0.35, (5, 7, 2))
    turn = _unit(rng, 1)[0, 0]
    scale = rng.uniform(1.5, 4.5)
    middle = np.array(SIZE) / 2 + rng.uniform(-1, 1, 2)
    place = (place - [4, 3]) @ np.array([turn, [-turn[1], turn[0]]]) * scale + middle
    a, b, c, d = place[:-1, :-1], place[:-1, 1:], place[1:, :-1], place[1:, 1:]
    corners = np.stack([a, b, c, b, d, c], axis=2).reshape(-1, 2)
    return clip(corners, np.full(len(corners), 0.5), SIZE)


def through_planes(rng):
    """Triangles through the near or the far plane, corners on both sides of the eye among them."""
    return np.hstack([rng.uniform(-2, 2, (3 * COUNT, 2)), rng.uniform(-1, 2, (3 * COUNT, 2))]).astype(np.float32)


UNCLIPPED = {"inside": anywhere, "any w": any_w, "slivers": slivers, "tiny": tiny, "mesh": mesh}
CLIPPED = {
    "partly off-screen": lambda rng: anywhere(rng, -0.5, 1.5),
    "off-screen": lambda rng: anywhere(rng, -4, 5),
    "huge": lambda rng: anywhere(rng, -60, 60),
    "through planes": through_planes,
}

LARGE = ("inside", "any w", "huge", "through planes")


def both(witness, pipeline, position, loop="list", **others):
    """Coverage bool [n, h, w] of refsim and of OpenGL, each with as many samples passed as it covers."""
    corners = pipeline.topology.corners
    count = len(others.get("indices", position)) // corners if pipeline.topology == LIST else len(position) - 2
    bits = shapes.marks(count, corners) if pipeline.topology == LIST else _strip_marks(len(position))
    bits = others.pop("bits", bits)
    vertices = {"position": position, "size": np.ones(len(position), np.float32), "bits": bits}
    given = cases.case(pipeline, shapes.GLSL, vertices, shapes.TARGETS, SIZE, **others)
    ours, theirs = cases.ours(given, loop=loop), witness.draw(given)
    covered = [shapes.covered(outcome.planes.color["bits"], count) for outcome in (ours, theirs)]
    for outcome, cover in zip((ours, theirs), covered, strict=True):
        assert outcome.counts["fragment.written"] == cover.sum()
    note("coverage", draws=1, fragments=ours.counts["fragment.written"])
    return covered


def _strip_marks(count):
    """Bits of a strip's vertices: a triangle takes its first vertex's, and triangle i starts with vertex i."""
    return shapes.marks(count, 1)


def judged(what, cover, margin):
    """Asserts that nothing deeper inside than `STEP` is missing and nothing further outside is covered."""
    missing, added = ~cover & (margin > STEP), cover & (margin < -STEP)
    worst = np.abs(margin[missing | added]).max(initial=0)
    said = f"{what}: {missing.sum()} missing, {added.sum()} too many, up to {worst * 256:.2f}/256 pixel"
    assert not (missing | added).any(), said


def compare(witness, what, position, ours, theirs):
    """The same pixels at 8 sub-pixel bits; else each side within its precision."""
    if witness.subpixel_bits == 8:
        same("coverage", what, ours, theirs)
    else:
        margin = triangle_margins(position, SIZE)
        judged(f"{what}, refsim", ours, margin)
        judged(f"{what}, OpenGL", theirs, margin)


@pytest.mark.parametrize("kind", UNCLIPPED)
def test_unclipped_triangles_cover_the_same_pixels(witness, kind):
    for k in range(8):
        position = UNCLIPPED[kind](np.random.default_rng([SEED, k]))
        ours, theirs = both(witness, LIST_PIPELINE, position, "dense" if kind in LARGE else "list")
        compare(witness, f"{kind}, seed {SEED}, {k}", position, ours, theirs)
        if kind == "mesh":
            for cover in (ours, theirs):
                assert cover.sum(axis=0).max() == 1 and cover.any(axis=0)[20:28, 28:36].all()


@pytest.mark.parametrize("kind", CLIPPED)
def test_clipped_triangles_are_right_within_the_precision(witness, kind):
    for k in range(8):
        position = CLIPPED[kind](np.random.default_rng([SEED, k]))
        ours, theirs = both(witness, LIST_PIPELINE, position, "dense" if kind in LARGE else "list")
        margin = triangle_margins(position, SIZE)
        assert (margin > STEP).any() and (margin < -STEP).any()
        judged(f"{kind} {k}, refsim", ours, margin)
        judged(f"{kind} {k}, OpenGL", theirs, margin)
        note("coverage", values=ours.size, same=(ours == theirs).sum(), within_bound=(ours != theirs).sum())


def test_indexed_triangles_cover_the_same_pixels(witness):
    rng = np.random.default_rng([SEED, 20])
    place = clip(rng.uniform(0, 1, (40, 2)) * SIZE, np.full(40, 0.5), SIZE)
    indices = rng.integers(0, 40, 72)  # repeated indices make triangles of no area
    first = indices[::3]
    bits = np.zeros((40, 4), np.float32)
    # A vertex that provokes several triangles lends all of them its bit: each index keeps its first triangle's
    keep = np.sort(np.unique(first, return_index=True)[1])
    indices = indices.reshape(-1, 3)[keep].ravel()
    bits[indices[::3]] = shapes.marks(len(keep), 1)
    ours, theirs = both(witness, LIST_PIPELINE, place, indices=indices, bits=bits)
    compare(witness, "indexed", place[indices], ours, theirs)


def test_strips_cover_the_same_pixels(witness):
    pipeline = shapes.pipeline(STRIP)
    for k in range(4):
        rng = np.random.default_rng([SEED, 30 + k])
        position = clip(rng.uniform(0, 1, (50, 2)) * SIZE, np.full(50, 0.5), SIZE)
        ours, theirs = both(witness, pipeline, position)
        triples = np.stack([position[:-2], position[1:-1], position[2:]], axis=1).reshape(-1, 4)
        compare(witness, f"strip {k}", triples, ours, theirs)


@pytest.mark.parametrize(("front", "cull"), [(FrontFace.CW, CullMode.BACK), (FrontFace.CW, CullMode.FRONT)])
def test_culling_drops_the_same_triangles(witness, front, cull):
    position = anywhere(np.random.default_rng([SEED, 40]))
    ours, theirs = both(witness, shapes.pipeline(LIST, front, cull), position)
    compare(witness, f"{front}, {cull}", position, ours, theirs)
    assert 20 < ours.any(axis=(1, 2)).sum() < 76


def test_centres_on_edges_belong_to_one_triangle_and_only_level_edges_are_anothers(witness):
    rng = np.random.default_rng([SEED, 50])
    # Two triangles a cell over corners at pixel centres: every edge goes through centres
    column, row = np.meshgrid(np.arange(4.5, 60, 9), np.arange(4.5, 44, 8))
    place = np.stack([column, row], axis=-1)
    place[1:-1, 1:-1] += rng.integers(-2, 3, place[1:-1, 1:-1].shape)
    a, b, c, d = place[:-1, :-1], place[:-1, 1:], place[1:, :-1], place[1:, 1:]
    corners = np.stack([a, b, c, b, d, c], axis=2).reshape(-1, 2)[: 3 * COUNT]
    ours, theirs = both(witness, LIST_PIPELINE, clip(corners, np.full(len(corners), 0.5), SIZE))
    for cover in (ours, theirs):
        assert cover.sum(axis=0).max() == 1
    differ = np.argwhere(ours != theirs)
    edges = corners.reshape(-1, 3, 2)
    for triangle, y, _ in differ:
        rows = edges[triangle, :, 1]
        level = [rows[k] for k in range(3) if rows[k] == rows[(k + 1) % 3]]
        assert y + 0.5 in level or y + 0.5 in (rows.min(), rows.max()), (triangle, y)
    note("coverage", values=ours.size, same=(ours == theirs).sum(), within_bound=len(differ))
