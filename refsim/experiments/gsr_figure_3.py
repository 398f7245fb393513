"""Figure 3: "the contribution of eye rays (a), reflected rays (b) and shadow rays (c)", and the composed image (d).

Recursive Ray Tracing in Geometry Shader, section 4.4. The layers are those of the tracer's render targets after two
passes: layer 0 holds what eye rays saw, the others what reflected (and refracted) rays saw. With the shadow rays left
out a layer is a contribution; what shadow rays take away is the difference. Eq. 1's sum of the layers is the image.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from refsim.counters import Counters
from refsim.experiments import style
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, VIEWS, grid_over, hits_of, rays_of, run, scene_of
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.image import encode_srgb
from refsim.methods import METHODS
from refsim.options import checked
from refsim.results import RayKind

Planes = NDArray[np.float32]
PANELS = (
    ("eye rays", "(a) eye rays"),
    ("secondary rays", "(b) reflected rays"),
    ("shadow rays", "(c) shadow rays"),
    ("composed", "(d) composed"),
)


def cases(quick: bool) -> list[Case]:
    """Two scenes: the torus knot on a mirroring ground, and the Cornell box, whose glass refracts too."""
    size = 96 if quick else 512
    return [{"view": view, "size_px": size} for view in ("knot", "cornell box")]


class Parts(NamedTuple):
    """Images f32[h, w, 3]; `extinguished` bool[h, w], where a shadow ray took light away."""

    eye: Planes
    secondary: Planes
    composed: Planes
    extinguished: NDArray[np.bool_]
    sum: Planes


def layers_of(view: str, size: int, **options: Any) -> Planes:
    """The render targets after all passes: f32[layer, target, 3, h, w]; target 0 is the unshadowed one."""
    from refsim.papers.geometry_shader_rays.setup import options_of, prepared
    from refsim.papers.geometry_shader_rays.tracer import GeometryShaderTracer, Setting

    scene, rays = scene_of(view), rays_of(view, size)
    given = {"acceleration": grid_over(view, size), **options}
    values = checked(GEOMETRY_SHADER, METHODS[GEOMETRY_SHADER].options, given)
    shared = options_of(scene, values)
    tracer = GeometryShaderTracer(prepared(scene, rays, values, shared), size, size, shared, Setting())
    tracer.draw_passes(rays, Counters())
    layers = tracer.layers
    planes = layers.framebuffer.floats.reshape(len(layers.targets), 4, layers.count, size, size)
    return np.ascontiguousarray(np.moveaxis(planes, 2, 0)[:, :, :3])


def added(targets: Planes) -> Planes:
    """Eq. 1's sum over targets f32[n, 3, h, w] in their order, as the blending passes form it: f32[h, w, 3]."""
    image = np.zeros(targets.shape[1:], np.float32)
    for target in targets:
        image = target + image
    return np.moveaxis(image, 0, 2)


@lru_cache(maxsize=2)
def parts(view: str, size: int) -> Parts:
    """The contributions of a picture in two passes."""
    shadowed, plain = layers_of(view, size), layers_of(view, size, shadows=False)
    return Parts(
        eye=added(plain[0]),
        secondary=added(plain[1:].reshape(-1, *plain.shape[2:])),
        composed=run(GEOMETRY_SHADER, view, size).image,  # type: ignore[arg-type]
        extinguished=(shadowed[0] != plain[0]).any(axis=(0, 1)),
        sum=added(shadowed.reshape(-1, *shadowed.shape[2:])),
    )


def measure(view: str, size_px: int) -> Rows:
    """A row a contribution: rays, hits, pixels that it changes, and the light that it brings or takes."""
    found = run(GEOMETRY_SHADER, view, size_px)
    first, second = found.generations
    p = parts(view, size_px)
    surfaces = (RayKind.REFLECTED, RayKind.REFRACTED)
    lit = p.eye + p.secondary
    lines = {
        "eye rays": (len(first.alive), hits_of(first), np.ones(p.extinguished.shape, np.bool_), p.eye),
        "secondary rays": (
            sum(int((second.kind == kind).sum()) for kind in surfaces),
            sum(hits_of(second, kind) for kind in surfaces),
            (p.secondary != 0).any(axis=2), p.secondary,
        ),
        "shadow rays": (
            int((second.kind == RayKind.SHADOW).sum()), hits_of(second, RayKind.SHADOW), p.extinguished,
            p.composed - lit,
        ),
        "composed": (
            len(first.alive) + len(second.alive), hits_of(first) + hits_of(second), (p.composed != 0).any(axis=2),
            p.composed,
        ),
    }  # fmt: skip
    return [
        {
            "view": view,
            "scene": VIEWS[view].scene,
            "triangles": len(found.scene.triangles),
            "size_px": size_px,
            "contribution": name,
            "rays": rays,
            "rays_that_hit": hits,
            "pixels_changed": int(changed.sum()),
            "mean_linear_radiance": round(float(light.mean(dtype=np.float64)), 6),
            "pixels_where_sum_of_layers_differs": int((p.sum != p.composed).any(axis=2).sum()),
        }
        for name, (rays, hits, changed, light) in lines.items()
    ]


def plot(rows: Rows) -> Any:
    """A line of four panels a scene."""
    views = list(dict.fromkeys(row["view"] for row in rows))
    figure = style.new_figure(2.55 * len(views))
    for line, view in zip(figure.subplots(len(views), len(PANELS), squeeze=False), views, strict=True):
        own = {row["contribution"]: row for row in rows if row["view"] == view}
        p = parts(view, own["composed"]["size_px"])
        white = np.where(p.extinguished[..., None], np.float32(0), np.float32(1)) * np.ones(3, np.float32)
        refracts = view.startswith("cornell")
        for axes, (name, title), image in zip(line, PANELS, (p.eye, p.secondary, white, p.composed), strict=True):
            style.no_frame(axes)
            axes.imshow(encode_srgb(image), interpolation="antialiased")
            axes.set_title("(b) reflected, refracted" if refracts and name == "secondary rays" else title)
            row = own[name]
            mean = f"{row['mean_linear_radiance']:+.3f}".replace("-", "−")
            said = f"{row['rays']:,} rays, {row['rays_that_hit']:,} hit\nmean {mean}"
            axes.set_xlabel(said, fontsize=8)
    return figure


EXPERIMENT = Experiment(
    "gsr-figure-3",
    "Figure 3: what eye, reflected and shadow rays contribute",
    "512² (96² with `--quick`), two passes, one light. (a) and (b) are the render targets of eye rays and of reflected "
    "(in the Cornell box also refracted) rays as they are without shadows; black in (c) is where a shadow ray "
    "extinguished the light's part of what the eye ray had drawn (one that hits for a surface turned away from the "
    "light extinguishes nothing); (d) is the composed image. Below each: rays shot, rays that hit, and the mean linear "
    "radiance that they add or take.",
    cases,
    measure,
    plot,
    alt="Two rows of four pictures, a torus knot and a Cornell box: what eye rays draw, what reflected and refracted "
    "rays add, what shadow rays extinguish, and all composed.",
)
