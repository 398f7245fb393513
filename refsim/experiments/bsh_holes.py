"""What each culling rule of section 2.1 loses: pixels whose front hit is another one, or none, than without culling
(BSH-E1). Pictures are Lambert with shadows; wrong pixels stand out.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.bsh_runs import CAMERAS, head, lists_of, missing_row, ray_counts, rays_of, run, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import MISSING, mesh_state
from refsim.image import encode_srgb
from refsim.results import Trace
from refsim.scene.environment import Uniform
from refsim.shading import shade

RULES = {"none": 6, "sextant_opposite": 6, "sextant_same": 6, "sextant_safe": 6, "octant": 8}
# What the text says of the opposite sextant, said of octants: counted, no list is made with it
LITERAL_OCTANT = "octant_opposite"
SCENES, SEEN = ("suzanne", "bunny"), ("diagonal", "close", "right")


def cases(quick: bool) -> list[Case]:
    """A case a scene, camera and rule."""
    size, cameras = (64, SEEN[:1]) if quick else (384, SEEN)
    return [
        {"name": name, "camera": camera, "rule": rule, "size_px": size, "mesh": mesh_state(name)}
        for name in SCENES for camera in cameras for rule in (*RULES, LITERAL_OCTANT)
    ]  # fmt: skip


@lru_cache(maxsize=8)
def traced(name: str, camera: str, rule: str, size: int) -> Trace:
    """Eye and shadow rays; only fronts are hit."""
    culling = None if rule == "none" else rule
    return run(name, size, rays=rays_of(name, size, *CAMERAS[camera]), facing="front", culling=culling,
               lists=RULES[rule])  # fmt: skip


def wrong(found: Trace, right: Trace) -> Any:
    """Which pixels' eye rays hit another triangle, or none, bool[n]."""
    return found.generations[0].hits.triangle != right.generations[0].hits.triangle


def measure(name: str, camera: str, rule: str, size_px: int, mesh: str) -> Rows:
    """One row."""
    line: Row = {"camera": camera, "rule": rule, "lists": RULES.get(rule, 8)}
    if mesh == MISSING:
        return [{**missing_row(name, size_px), **line}]
    if rule == LITERAL_OCTANT:
        shown = head(name, size_px, traced(name, camera, "none", size_px))
        return [{**shown, **line, **_counted(name, camera, size_px)}]
    right, found = traced(name, camera, "none", size_px), traced(name, camera, rule, size_px)
    lists = lists_of(name, True, RULES[rule], "earliest_first", None if rule == "none" else rule)
    kept = (lists.triangle_at >= 0).mean()
    bad, hit = wrong(found, right), right.generations[0].hits.triangle >= 0
    return [
        {
            **head(name, size_px, found),
            **line,
            "culled_percent": round(100.0 * (1.0 - float(kept)), 3),
            "list_elements_percent": round(
                100.0 * float(lists.first[-1]) / (RULES[rule] * lists_of(name, True, 1).length(0)), 3
            ),
            "eye_hits": int(hit.sum()),
            "wrong_pixels": int(bad.sum()),
            "wrong_percent_of_hits": round(100.0 * float(bad.sum() / hit.sum()), 4),
            "lost_pixels": int((hit & (found.generations[0].hits.triangle < 0)).sum()),
            **ray_counts(found),
        }
    ]


def _counted(name: str, camera: str, size: int) -> Row:
    """Eye rays whose first hit is on a triangle that their octant's list would leave out by its opposite octant."""
    from refsim.geometry.triangle import pack_triangles
    from refsim.papers.sphere_hierarchy.culling import kept_triangles
    from refsim.papers.sphere_hierarchy.directions import list_directions, list_of_rays

    first = traced(name, camera, "none", size).generations[0]
    packed, seen = pack_triangles(scene_of(name).triangles), first.hits.triangle
    culled = np.stack(
        [~kept_triangles(-packed.n, ~packed.degenerate, along, "octant") for along in list_directions(8)]
    )
    hit = seen >= 0
    bad = hit & culled[list_of_rays(first.rays.direction, 8), np.where(hit, seen, 0)]
    return {
        "culled_percent": round(100.0 * float(culled.mean()), 3),
        "eye_hits": int(hit.sum()),
        "wrong_pixels": int(bad.sum()),
        "wrong_percent_of_hits": round(100.0 * float(bad.sum() / hit.sum()), 4),
    }


def plot(rows: Rows) -> Any:
    """A picture a rule; below each a part of it, where the rule that must be meant makes holes."""
    figure = style.new_figure(4.6)
    shown = rows[-1]["scene"], SEEN[0]
    own = [row for row in rows if (row["scene"], row["camera"]) == shown and row["rule"] in RULES]
    above, below = figure.subplots(2, len(RULES), height_ratios=(1.0, 1.0))
    for axes in (*above, *below):
        style.no_frame(axes)
    for top, bottom, row in zip(above, below, own, strict=False):
        top.set_title(row["rule"].replace("_", " ") if row["rule"] != "none" else "no culling", fontsize=8.5)
        if row["triangles"] == MISSING:
            top.text(0.5, 0.5, f"{row['scene']}:\nmissing", ha="center", va="center", color=style.FAINT)
            continue
        size, place = row["size_px"], (row["scene"], row["camera"])
        image = _marked(*place, row["rule"], size)
        top.imshow(image, interpolation="nearest")
        y, x, side = _hole(*place, size)
        corner = {"fill": False, "edgecolor": style.INK, "linewidth": 0.8}
        top.add_patch(_rectangle(x, y, side, corner))
        told = "the yardstick" if row["rule"] == "none" else f"{row['wrong_pixels']:,} pixels wrong"
        top.set_xlabel(f"{told}\n{row['culled_percent']:.2f} % culled", fontsize=8)
        bottom.imshow(image[y : y + side, x : x + side], interpolation="nearest")
    return figure


def _rectangle(x: int, y: int, side: int, look: dict[str, Any]) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.5, y - 0.5), side, side, **look)


def _marked(name: str, camera: str, rule: str, size: int) -> Any:
    """The picture, wrong pixels vermilion, f64[size, size, 3]."""
    found, right = traced(name, camera, rule, size), traced(name, camera, "none", size)
    image = np.asarray(encode_srgb(shade(found, Uniform((0.93, 0.95, 0.98)))), np.float64).reshape(-1, 3) / 255.0
    bad = wrong(found, right)
    image[bad] = 0.25 * image[bad] + 0.75 * np.array((0.84, 0.37, 0.0))
    return image.reshape(size, size, 3)


def _hole(name: str, camera: str, size: int) -> tuple[int, int, int]:
    """Row, column and side of the part that is shown larger, around the pixels that `sextant_same` gets wrong."""
    bad = np.flatnonzero(wrong(traced(name, camera, "sextant_same", size), traced(name, camera, "none", size)))
    side = size // 6
    middles = [int(np.median(at)) if len(bad) else size // 2 for at in np.divmod(bad, size)]
    y, x = (min(max(at - side // 2, 0), size - side) for at in middles)
    return y, x, side


EXPERIMENT = Experiment(
    "bsh-holes",
    "The holes that each culling rule makes",
    "The bunny seen along a diagonal, 384² (64² with `--quick`), fronts only. Vermilion: pixels whose eye ray finds "
    "another triangle, or none, than without culling. The literal rule (normals of the opposite sextant) removes what "
    "is visible; the rule that must be meant (normals of the same sextant) loses single pixels near outlines; the "
    "safe sextant rule and octants lose none. Below: wrong pixels, and the share of triangles that a list leaves out "
    "on average. The table has Suzanne, further cameras, and what the literal rule, said of octants, would "
    "lose.",
    cases,
    measure,
    plot,
    alt="Five pictures of the bunny and details of its outline, one for each culling rule: large holes by the literal "
    "rule, single wrong pixels along outlines by the one that must be meant, none by the safe rule and octants.",
)
