"""On which inputs Eq. 1 alone cannot be right, and what the order of emission has to do with it.

One render target (GSR-E8) is held against the layers of section 4.4, "ray generations should be sorted and rendered to
multiple render targets", for 1 to 4 passes, 1 to 3 lights, and rays that go on or not. Ambient light stays in the
light's target in both (GSR-E10), so that what differs is the composition alone. Where the text says that Eq. 1 serves,
Eq. 1 as printed, with its own tables of α_src and RGB_src before a black clear colour, is held against the layers too.
Then the fixed emission order of section 4.3, "first the input ray, later the shadow and finally the specular reflected
ray", is permuted, on one target and on layers. Recursive Ray Tracing in Geometry Shader.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.gsr_errata import VISIBLE
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, head, run, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.image import encode_srgb
from refsim.scene.animation import moving_light
from refsim.scene.light import PointLight

AS_PRINTED = "Eq. 1 as printed"
TARGETS = {"one target": "GSR-E8,GSR-E10", "layers": "GSR-E10", AS_PRINTED: "GSR-E1,GSR-E8,GSR-E9,GSR-E10"}
BLACK = (0.0, 0.0, 0.0)
SECONDARY = {
    "none": {"reflections": False, "refractions": False},
    "reflected": {"refractions": False},
    "reflected and refracted": {},
}
VIEWS = {"none": "knot", "reflected": "knot", "reflected and refracted": "cornell box"}
ORDERS = ("listed", "reflected_first", "reversed")
SHOWN = "knot"  # the view of the permuted orders


def cases(quick: bool) -> list[Case]:
    """A case a combination. `--quick` takes one light and leaves out the order that compiles for nothing new."""
    size, lights, orders = (64, (1,), ORDERS[:2]) if quick else (256, (1, 2, 3), ORDERS)
    limits = [
        {"view": VIEWS[secondary], "size_px": size, "passes": passes, "lights": count, "secondary": secondary}
        for count in lights for passes in (1, 2, 3, 4) for secondary in SECONDARY
    ]  # fmt: skip
    permuted = [
        {"view": SHOWN, "size_px": size, "passes": passes, "lights": 1, "secondary": "reflected", "order": order}
        for passes in (2, 3) for order in orders
    ]  # fmt: skip
    return limits + permuted


def lights_for(view: str, count: int) -> tuple[PointLight, ...]:
    """The view's own light, and others on the way of the moving light, each as bright as 1 / count."""
    scene = scene_of(view)
    others = [light for k, light in enumerate(moving_light(scene, 6)) if k in (1, 4)]
    places = [scene.lights[0].position, *(light.position for light in others)][:count]
    return tuple(PointLight(place, intensity=1.0 / count) for place in places)


@lru_cache(maxsize=16)
def picture(
    view: str, size: int, passes: int, lights: int, secondary: str, targets: str, order: str = "listed",
    black: bool = False,
) -> tuple[NDArray[np.float32], Row]:  # fmt: skip
    """An image and what its rows open with; before the usual background, or a black one."""
    behind = {"background": BLACK} if black else {}
    found = run(
        GEOMETRY_SHADER, view, size, passes=passes, lights=lights_for(view, lights), errata=TARGETS[targets],
        emission_order=order, **SECONDARY[secondary], **behind,
    )  # fmt: skip
    assert found.image is not None
    return found.image, head(view, size, found)


def in_scope(passes: int, lights: int, secondary: str) -> bool:
    """Whether section 4.4 says that Eq. 1 serves: one light, shadows and one bounce of reflections."""
    return lights == 1 and passes <= 2 and secondary in ("none", "reflected")


def measure(view: str, size_px: int, passes: int, lights: int, secondary: str, order: str = "") -> Rows:
    """A row a composition: one target against the layers, and as printed where that is to serve; or both against the
    listed order on layers."""
    if order:
        compositions = ["one target", "layers"]
    else:
        compositions = ["one target", *([AS_PRINTED] if in_scope(passes, lights, secondary) else [])]
    rows = []
    for targets in compositions:
        black = targets == AS_PRINTED
        right, first = picture(view, size_px, passes, lights, secondary, "layers", black=black)
        image, _ = picture(view, size_px, passes, lights, secondary, targets, order or "listed", black)
        apart = np.abs(image.astype(np.float64) - right).max(axis=2)
        rows.append(
            {
                "part": "orders" if order else "limits",
                **first,
                "passes": passes,
                "lights": lights,
                "secondary_rays": secondary,
                "targets": targets,
                "emission_order": order or "listed",
                "pixels_changed": int((image != right).any(axis=2).sum()),
                "pixels_visibly_changed": int((apart > VISIBLE).sum()),
                "largest_difference": round(float(apart.max()), 6),
            }
        )
    return rows


def of_part(rows: Rows, part: str) -> Rows:
    """`limits` or `orders`."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Where one target differs from layers, and what permuted orders do."""
    return {"gsr-order": of_part(rows, "limits"), "gsr-order-emission": of_part(rows, "orders")}


def plot(rows: Rows) -> Any:
    """Left a table of pixels that differ; right the pictures of the orders."""
    figure = style.new_figure(5.3)
    above, below = figure.subfigures(2, 1, height_ratios=(1.0, 1.2))
    _draw_limits(above, of_part(rows, "limits"))
    _draw_orders(below, of_part(rows, "orders"))
    return figure


def _draw_limits(figure: Any, rows: Rows) -> None:
    lights = sorted({row["lights"] for row in rows})
    passes = sorted({row["passes"] for row in rows})
    kinds = list(SECONDARY)
    for axes, count in zip(figure.subplots(1, len(lights), sharey=True, squeeze=False)[0], lights, strict=True):
        share, changed = (np.zeros((len(kinds), len(passes))) for _ in range(2))
        for row in rows:
            if row["lights"] == count and row["targets"] == "one target":
                at = kinds.index(row["secondary_rays"]), passes.index(row["passes"])
                share[at] = 100.0 * row["pixels_visibly_changed"] / row["size_px"] ** 2
                changed[at] = row["pixels_changed"]
        axes.imshow(share, cmap="Oranges", vmin=0, vmax=130, aspect="auto")
        for (i, k), value in np.ndenumerate(share):
            said = f"{value:.2g} %" if changed[i, k] else "equal"
            axes.text(k, i, said, ha="center", va="center", fontsize=8.5)
        axes.set_xticks(range(len(passes)), [f"P = {number}" for number in passes])
        axes.set_yticks(range(len(kinds)), [f"{VIEWS[kind]},\n{kind}".replace("ted and", "ted,") for kind in kinds])
        axes.tick_params(length=0)
        axes.grid(False)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_title(f"{count} light{'s' if count > 1 else ''}")
        if count == lights[0]:
            axes.set_ylabel("view, secondary rays")


def _draw_orders(figure: Any, rows: Rows) -> None:
    first = [row for row in rows if row["passes"] == min(r["passes"] for r in rows)]
    orders = [order for order in ORDERS if any(row["emission_order"] == order for row in first)]
    shown = [(order, "one target") for order in orders] + [(orders[-1], "layers")]
    for axes, (order, targets) in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        (row,) = [r for r in first if (r["emission_order"], r["targets"]) == (order, targets)]
        style.no_frame(axes)
        options = row["view"], row["size_px"], row["passes"], row["lights"], row["secondary_rays"], targets, order
        image, _ = picture(*options)
        axes.imshow(encode_srgb(image), interpolation="antialiased")
        axes.set_title(f"{order.replace('_', ' ')},\n{targets}")
        share = 100.0 * row["pixels_visibly_changed"] / row["size_px"] ** 2
        equal = "the same bits" if row["pixels_changed"] == 0 else f"{share:.3g} % of pixels differ"
        axes.set_xlabel(f"P = {row['passes']}: {equal}", fontsize=8)


EXPERIMENT = Experiment(
    "gsr-order",
    "Where Eq. 1 on one target is not enough, and what emission order it needs",
    "Above: 256² (64² and one light with `--quick`); share of pixels in which one render target, blended by Eq. 1 in "
    "buffer order, differs from a target a light and a layer a surface ray by more than half an 8-bit step; `equal` is "
    "the same bits. Eq. 1 is right without shadows (P = 1), and for one light up to the first shadow in a reflection "
    "(P = 2), if a shadow adds nothing; with the printed (1, 1, 1) it adds white (rows of the table). Below: the torus "
    "knot in two passes, emission order as listed and permuted; `reflected first` lets the "
    "shadow of the eye's hit extinguish what the mirror shows, while layers do not depend on the order.",
    cases,
    measure,
    plot,
    tables,
    alt="Above, tables by lights and passes of the share of pixels in which one target differs from layers, more with "
    "each light and pass; below, four pictures of a torus knot by emission order: reversed and permuted ones have "
    "black where reflections belong, layers do not.",
)
