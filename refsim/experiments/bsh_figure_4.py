"""Figure 4: the five scenes, "with a single point light", and what a ray costs in each.

Six lists without further optimisation, then with all of them. The Happy Buddha here is a decimated one, the cubes
another scene of as many triangles. Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import bsh_published as published
from refsim.experiments import style
from refsim.experiments.bsh_runs import ENABLED, MESHES, SUBSTITUTES, head, kept, missing_row, ray_counts, vertices_of
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import MISSING, mesh_state
from refsim.image import encode_srgb
from refsim.scene.environment import Uniform
from refsim.scene.known import find_mesh
from refsim.scene.trimesh_source import read_ply
from refsim.shading import shade


def cases(quick: bool) -> list[Case]:
    """A case a scene; `--quick` leaves out the dragon."""
    size = 96 if quick else 512
    names = [name for name in MESHES if not (quick and name == "Dragon")]
    return [{"published_scene": name, "size_px": size, "mesh": mesh_state(MESHES[name])} for name in names]


def measure(published_scene: str, size_px: int, mesh: str) -> Rows:
    """One row."""
    name = MESHES[published_scene]
    triangles, vertices, _ = published.TABLE_2[published_scene]
    line: Row = {
        "published_scene": published_scene,
        "substitute": SUBSTITUTES.get(published_scene, ""),
        "published_triangles": triangles,
        "published_vertices": vertices,
    }
    if mesh == MISSING:
        return [{**line, **missing_row(name, size_px)}]
    plain, all_on = kept(name, size_px), kept(name, size_px, **ENABLED)
    same = (plain.generations[0].hits.triangle == all_on.generations[0].hits.triangle).mean()
    return [
        {
            **line,
            **head(name, size_px, plain),
            "vertices": vertices_of(name),
            "vertices_of_file_and_ground": _in_file(name),
            **ray_counts(plain),
            **{f"all_on_{key}": value for key, value in ray_counts(all_on).items() if key.endswith("per_ray")},
            "same_eye_hits_percent": round(100.0 * float(same), 3),
        }
    ]


def _in_file(name: str) -> int | str:
    """The vertices that the mesh's file lists, some of them at one place, and the ground's four; of none, none."""
    path = find_mesh(name) if mesh_state(name) == "present" else None
    if path is None:
        return ""
    return len(read_ply(path.name, path.read_bytes()).vertices) + 4


def plot(rows: Rows) -> Any:
    """The pictures in a row of three and one of two; in the sixth place what a ray costs."""
    figure = style.new_figure(6.9)
    places = figure.subplots(2, 3).ravel()
    for axes, row in zip(places, rows, strict=False):
        _draw(axes, row)
    for axes in places[len(rows) : -1]:
        axes.set_visible(False)
    _bars(places[-1], [row for row in rows if row["triangles"] != MISSING])
    return figure


def _draw(axes: Any, row: Row) -> None:
    style.no_frame(axes)
    axes.set_title(row["published_scene"])
    if row["triangles"] == MISSING:
        axes.text(0.5, 0.5, f"{row['scene']}:\nmissing", ha="center", va="center", color=style.FAINT)
        return
    size = row["size_px"]
    rgb = shade(kept(row["scene"], size), Uniform((0.93, 0.95, 0.98)))
    axes.imshow(encode_srgb(np.asarray(rgb).reshape(size, size, 3)), interpolation="lanczos")
    told = f"{row['triangles']:,} triangles" + (f"\n({row['substitute']})" if row["substitute"] else "")
    axes.set_xlabel(told, fontsize=8)


def _bars(axes: Any, rows: Rows) -> None:
    places = np.arange(len(rows))
    for k, (key, name, color) in enumerate(
        (("nodes_per_ray", "six lists", style.BLUE), ("all_on_nodes_per_ray", "all optimisations", style.ORANGE))
    ):
        axes.barh(places + 0.38 * k, [row[key] for row in rows], 0.36, color=color, label=name)
    for place, row in zip(places, rows, strict=True):
        axes.text(0.8, place, row["published_scene"], fontsize=7.5, va="center", color="white", fontweight="bold")
    axes.set_yticks([])
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.set_title("Elements visited")
    axes.set_xlabel("nodes a ray, eye and shadow rays")
    axes.legend(loc="upper right")


EXPERIMENT = Experiment(
    "bsh-figure-4",
    "Figure 4: the scenes",
    "512² (96² and no dragon with `--quick`), one point light, Lambert, shadow rays, a ground of two triangles; the "
    "camera and the ground's size are chosen so that rays a pixel come near the paper's. `all optimisations`: safe "
    "sextant culling, regular per-polygon heads, 16 × 16 screen cells, first surviving leaf; only fronts are hit. "
    "Substitutes are named under their pictures; a mesh that is not at hand reads `missing`.",
    cases,
    measure,
    plot,
    alt="The five scenes on a ground with a shadow: cubes, the monkey's head, bunny, Buddha and dragon, or the word "
    "missing; bars of nodes a ray with six lists and with all optimisations.",
)
