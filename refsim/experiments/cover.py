"""The README's picture: glass traced by the Hierarchical Ray Engine, and the tests that each of its pixels cost."""

from __future__ import annotations

from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.pictures import averaged, picture
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.experiments.runs import counts
from refsim.image import encode_srgb

WIDTH, HEIGHT = 960, 480


def cases(quick: bool) -> list[Case]:
    """One picture; `samples`² rays a pixel, averaged."""
    own = {"scene": "torus_knot_1024", "samples": 1} if quick else {"scene": "torus_knot_9600", "samples": 2}
    size = HEIGHT // (2 if quick else 1)
    return [{**own, "size_px": size, "tile_px": 16, "fill": 0.78, "generations": 8}]


def measure(
    scene: str, samples: int, size_px: int, tile_px: int, fill: float, generations: int, backend: str = "numba"
) -> Rows:
    """One row: what the pipeline did for the picture."""
    side = size_px * samples
    image = picture(scene, side, side, fill, generations, "smooth", tile_px, backend)
    head = {"scene": scene, "triangles": len(image.trace.scene.triangles), "size_px": size_px, "tile_px": tile_px}
    rest = {"samples": samples, "fill": fill, "generations": generations, "backend": backend}
    return [{**head, **rest, **counts(image.trace)}]


def plot(rows: Rows) -> Any:
    """Left the picture, right a map of ray–triangle tests per pixel, logarithmic: the tiles become visible."""
    from matplotlib.colors import LogNorm

    (row,) = rows
    side = row["size_px"] * row["samples"]
    options = row["generations"], "smooth", row["tile_px"], row["backend"]
    image = picture(row["scene"], side, side, row["fill"], *options)
    left = encode_srgb(averaged(np.clip(image.rgb, 0.0, 1.0), row["samples"]))
    per_ray = image.trace.per_ray["triangle_tests"].reshape(side, side)
    right = averaged(per_ray.astype(np.float64), row["samples"])

    figure = style.new_figure(HEIGHT / 100, WIDTH / 100, layout="none")
    for x, values, look in (
        (0.0, left, {}),
        (0.5, np.maximum(right, 1.0), {"cmap": "magma", "norm": LogNorm(30.0, right.max())}),
    ):
        axes = figure.add_axes((x, 0.0, 0.5, 1.0))
        style.no_frame(axes)
        axes.imshow(values, interpolation="nearest", **look)
        axes.set_xlim(-0.5, values.shape[1] - 0.5)
    bar = figure.add_axes((0.72, 0.055, 0.25, 0.022))
    figure.colorbar(axes.images[0], cax=bar, orientation="horizontal")
    bar.tick_params(colors="white", labelsize=8, length=2, pad=1)
    bar.minorticks_off()
    bar.set_title("ray–triangle tests per ray", color="white", fontsize=9, fontweight="normal", pad=3, loc="center")
    for spine in bar.spines.values():
        spine.set_visible(False)
    return figure


EXPERIMENT = Experiment(
    "cover",
    "The picture of the README",
    "A glass torus knot of 9,600 triangles over a checkered floor, 8 generations; on the right the ray–triangle tests "
    "that each ray of the same picture cost. Tiles that the cones keep whole stand out as squares.",
    cases,
    measure,
    plot,
    dpi=100,
    alt="A glass torus knot over a checkered floor, and beside it the same view as a map of the ray-triangle tests "
    "that each ray cost: few in smooth parts, many in the square tiles along outlines.",
)
