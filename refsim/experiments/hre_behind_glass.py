"""Non-ideal objects behind, before, between and inside glass: what final rays alone get wrong, and the correction.

The Hierarchical Ray Engine, section 5: the rays that hit no ideal surface any more "can […] be traced against the
non-ideal geometry of the scene". Taken by the letter, a path knows nothing of the objects it passed on its way through
glass. `refsim.papers.hierarchical_ray_engine.non_ideal` has both rules. The judge tests every ray against every
triangle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

import refsim
from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import HIERARCHICAL, RAY_ENGINE
from refsim.image import encode_srgb
from refsim.papers.hierarchical_ray_engine.non_ideal import ending_triangles, trace_non_ideal
from refsim.results import Trace
from refsim.scene import Material, PointLight, Rays, Scene, camera_rays, load_scene
from refsim.shading import environment_of, shade

GLASS = Material("glass", "glass", (0.96, 0.98, 1.0))
CLAY = Material("clay", "diffuse", (0.85, 0.26, 0.08))
PALE = Material("pale", "diffuse", (0.75, 0.73, 0.68))
DARK = Material("dark", "diffuse", (0.16, 0.2, 0.26))
LIGHT = PointLight((-4.0, 7.0, 5.0), intensity=0.9)

# Bodies: name of the library (its size is added), scale, place, material
Body = tuple[str, float, tuple[float, float, float], Material]
SCENES: dict[str, tuple[Body, ...]] = {
    "behind glass": (("sphere", 1.0, (0.0, 0.0, 0.6), GLASS), ("torus_knot", 0.62, (0.15, 0.0, -2.1), CLAY)),
    "before glass": (("sphere", 1.2, (0.0, 0.2, -1.0), GLASS), ("torus_knot", 0.4, (0.25, -0.4, 1.2), CLAY)),
    "between glass": (
        ("sphere", 1.0, (0.0, 0.0, 1.2), GLASS), ("torus_knot", 0.4, (0.0, 0.0, -0.5), CLAY),
        ("sphere", 1.2, (0.0, 0.2, -2.3), GLASS),
    ),
    "inside glass": (("sphere", 1.2, (0.0, 0.2, 0.0), GLASS), ("torus_knot", 0.42, (0.0, 0.2, 0.0), CLAY)),
}  # fmt: skip
GENERATIONS = 6
JUDGE = "exhaustive"
SQUARES, SIDE, FLOOR = 10, 1.0, -1.0


def cases(quick: bool) -> list[Case]:
    """A case a scene."""
    size, ball, knot = (48, 224, 128) if quick else (256, 3584, 3200)
    return [
        {"scene": scene, "size_px": size, "tile_px": 8 if quick else 16, "ball_triangles": ball, "knot_triangles": knot}
        for scene in SCENES
    ]


def _floor() -> tuple[np.ndarray, np.ndarray]:
    """A chequered floor: triangles, and which of them are dark."""
    i, j = np.mgrid[:SQUARES, :SQUARES]
    x, z = (part.ravel() * SIDE - 0.5 * SQUARES * SIDE for part in (i, j))
    places = np.array([(0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0)]) * SIDE
    corners = np.stack([x[:, None] + places[:, 0], np.full((len(x), 6), FLOOR), z[:, None] + places[:, 1]], axis=-1)
    return corners.reshape(-1, 3, 3), np.repeat((i + j).ravel() % 2, 2)


@lru_cache(maxsize=4)
def staged(name: str, ball: int, knot: int) -> Scene:
    """The bodies of a scene over the floor; normals of spheres and knots are those of the whole bodies."""
    materials = (GLASS, CLAY, PALE, DARK)
    floor, dark = _floor()
    up = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (len(floor), 3, 1))
    triangles, normals, ids = [floor.astype(np.float32)], [up], [2 + dark]
    for body, scale, place, material in SCENES[name]:
        whole = load_scene(f"{body}_{ball if body == 'sphere' else knot}")
        triangles.append((whole.triangles * scale + np.array(place)).astype(np.float32))
        normals.append(whole.vertex_normals)
        ids.append(np.full(len(whole), materials.index(material)))
    parts = (np.concatenate(part) for part in (triangles, normals, ids))
    corners, vertex_normals, numbers = parts
    return Scene(corners, name, materials, numbers.astype(np.int32), vertex_normals, lights=(LIGHT,))


def _eye(scene: Scene, size: int) -> Rays:
    return camera_rays(scene, size, size, view=(0.0, 0.22, 1.0), fov=24.0, fill=0.3)


@lru_cache(maxsize=8)
def traced(name: str, rule: str, size: int, tile: int, ball: int, knot: int) -> Trace:
    """The picture's paths by a rule; "together" is the engine that draws all triangles at once, `JUDGE`
    the Ray Engine, which leaves out no triangle for any ray."""
    scene = staged(name, ball, knot)
    options: dict[str, Any] = {"generations": GENERATIONS, "shading": "smooth", "tile_size": tile}
    if rule == "together":
        return refsim.trace(HIERARCHICAL, scene, _eye(scene, size), **options)
    if rule == JUDGE:
        options = {"generations": GENERATIONS, "shading": "smooth", "stencil": True}
        return refsim.trace(RAY_ENGINE, scene, _eye(scene, size), **options)
    return trace_non_ideal(scene, _eye(scene, size), rule=rule, **options)  # type: ignore[arg-type]


def wrong_ends(found: Trace, right: Trace) -> np.ndarray:
    """bool[n]: paths that end on another triangle, or elsewhere on it."""
    return (ending_triangles(found) != ending_triangles(right)) | (found_at(found) != found_at(right)).any(axis=1)


def found_at(trace: Trace) -> np.ndarray:
    """f32[n, 3]: where the last ray of each path hits a non-ideal triangle; zero where it does not."""
    place = np.zeros((len(trace.generations[0].rays), 3), np.float32)
    diffuse = trace.scene.optical_indices() < 0
    for generation in trace.generations:
        rows = np.flatnonzero((generation.hits.triangle >= 0) & diffuse[generation.hits.triangle])
        rays = generation.rays
        place[rows] = rays.origin[rows] + generation.hits.t[rows, None] * rays.direction[rows]
    return place


def measure(scene: str, size_px: int, tile_px: int, ball_triangles: int, knot_triangles: int) -> Rows:
    """One row: paths that end in the wrong place by either rule, judged by the Ray Engine, and what each costs."""
    case = size_px, tile_px, ball_triangles, knot_triangles
    right = traced(scene, JUDGE, *case)
    runs = {rule: traced(scene, rule, *case) for rule in ("nearest", "final_rays", "together")}
    ideal = int((right.scene.optical_indices() >= 0).sum())
    head: Row = {"scene": scene, "triangles": len(right.scene), "ideal_triangles": ideal, "size_px": size_px}
    head |= {"tile_px": tile_px, "ball_triangles": ball_triangles, "knot_triangles": knot_triangles}
    ends = ending_triangles(right) >= 0
    row: Row = {**head, "generations": GENERATIONS, "paths": size_px**2}
    row |= {"paths_that_end_on_a_non_ideal_triangle": int(ends.sum())}
    for rule, found in runs.items():
        wrong = wrong_ends(found, right)
        row |= {
            f"{rule}_wrong_paths": int(wrong.sum()),
            f"{rule}_wrong_percent": round(100.0 * float(wrong.mean()), 3),
            f"{rule}_triangle_tests": found.counters["intersection.triangle_tests"],
            f"{rule}_pairs_kept": found.counters["cone.pairs_kept"],
            f"{rule}_tests_by_ended_paths": _by_ended(found),
        }
    return [row]


def _by_ended(found: Trace) -> int:
    """Triangle tests of pixels without a ray: a path that ended kept its stencil bit, or has none to lose."""
    return sum(int(g.per_ray["triangle_tests"][~g.alive].sum()) for g in found.generations)


def plot(rows: Rows) -> Any:
    """A column a scene: the corrected rule, the paper's letter, and where they part."""
    figure = style.new_figure(6.3)
    axes = figure.subplots(3, len(rows), squeeze=False)
    for column, row in enumerate(rows):
        size = row["size_px"]
        case = size, row["tile_px"], row["ball_triangles"], row["knot_triangles"]
        right, literal = (traced(row["scene"], rule, *case) for rule in ("nearest", "final_rays"))
        sky = environment_of(right.scene, "sky")
        pictures = [shade(found, sky).reshape(size, size, 3) for found in (right, literal)]
        wrong = wrong_ends(literal, right).reshape(size, size)
        faint = 0.75 + 0.25 * pictures[0].mean(axis=2, keepdims=True).repeat(3, axis=2).clip(0.0, 1.0)
        shown = [encode_srgb(part) for part in pictures] + [encode_srgb(faint)]
        shown[2][wrong] = [int(style.VERMILION[k : k + 2], 16) for k in (1, 3, 5)]
        for line, picture in enumerate(shown):
            style.no_frame(axes[line, column])
            axes[line, column].imshow(picture, interpolation="nearest" if line == 2 else "lanczos")
        axes[0, column].set_title(f"object {row['scene']}")
        axes[2, column].set_xlabel(f"{row['final_rays_wrong_percent']:.1f} % of paths wrong")
    names = "tested in every pass", "final rays only,\nas section 5 says", "paths that end\nelsewhere"
    for line, text in enumerate(names):
        axes[line, 0].set_ylabel(text, fontsize=9)
    return figure


EXPERIMENT = Experiment(
    "behind-glass",
    "Non-ideal objects and glass: final rays only, and every pass",
    "A clay knot behind, before, between and inside glass balls over a chequered floor; index 1.5, interpolated "
    "normals, 6 generations. Top: non-ideal triangles are tested in every pass, into the depth of the ideal ones; "
    "middle: only the final rays are traced against them, as section 5 says; bottom, in vermilion: paths that then "
    "end elsewhere. Judged by the Ray Engine, which leaves out no triangle; the top row meets it on every path.",
    cases,
    measure,
    plot,
    alt="Four columns of pictures of an orange knot and glass balls on a chequered floor. In the upper row the knot is "
    "seen through, before, between and inside the glass. In the middle row the knot before the glass has lost the part "
    "that overlaps the ball, and those between and inside are gone. The lower row marks these pixels.",
)
