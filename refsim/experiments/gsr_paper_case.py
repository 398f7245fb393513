"""Each listing and table as printed at the paper's own set-up, one picture each, against a recursive ray tracer.

The set-up is what the paper describes: two passes, one light, shadows and one reflection, 8-bit targets cleared to
black, Listing 3's 90° camera, Listing 5's light (N · L: no ambient light, no highlight), no glass. The witness is
Whitted's recursion in NumPy (`refsim.reference.whitted`), which knows no errata, no buffers and no passes. Beyond this
set-up (more passes, glass, float targets, other cameras) the same items are checked by `gsr_equations`.
Recursive Ray Tracing in Geometry Shader, sections 4.3 and 4.4, appendix A.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.gsr_runs import GEOMETRY_SHADER, scene_of
from refsim.experiments.registry import Case, Experiment, Row, Rows, Tables
from refsim.methods import METHODS, trace
from refsim.options import checked
from refsim.reference.blend import Operands, blend, clamped, to_unorm8
from refsim.reference.ray_trees import search_of, traced
from refsim.reference.searches import Found
from refsim.reference.whitted import Bundle, Whitted
from refsim.results import RayKind, Trace
from refsim.scene import Rays, Scene, camera_rays
from refsim.scene.light import PointLight

FULL, QUICK = 32, 16  # pixels a side
MOST_PASSES = 4
BLACK, GREY = (0.0, 0.0, 0.0), (0.5, 0.5, 0.5)
# Ambient light is our own: surfaces so dark under a light so bright have none that 8 bits can hold
DIM = 1e-6
SETTING = {"passes": 2, "refractions": False, "background": BLACK, "color_format": "rgba8unorm"}
QUARTER = 0.25  # Listing 5's weight of a reflection
Image = NDArray[np.float32]


@dataclass(frozen=True)
class Item:
    """What is printed (switches of the option `errata`), where, and what its picture must be like."""

    name: str
    place: str
    printed: str
    property: str


def _every(*without: str) -> str:
    names = ("E1", "E1b", "E2", "E4", "E5", "E6", "E8", "E9", "E10", "E11", "E12")
    return ",".join(f"GSR-{name}" for name in names if name not in without)


PICTURE = "the picture of the recursive ray tracer"
LISTING = "appendix A, Listing "
ITEMS = {
    "listing-3-eye": Item("Listing 3: eye rays", LISTING + "3", "GSR-E12", PICTURE),
    "listing-3-shadow": Item("Listing 3: shadow rays", LISTING + "3", "GSR-E6", PICTURE),
    "listing-4-spawn": Item("Listing 4: type != 0", LISTING + "4", "GSR-E5", PICTURE),
    "listing-4-offset": Item("Listing 4: hitP", LISTING + "4", "GSR-E11", PICTURE),
    "listing-4-miss": Item("Listing 4: hit.idx == −1", LISTING + "4", "GSR-E2",
                           "where an eye ray misses there is backgroundColor, grey before a black clear colour"),
    "listing-5-rho": Item("Listing 5: 0.25", LISTING + "5", "GSR-E4", PICTURE),
    "listing-5-shadow": Item("Listing 5: (−1, −1, −1, 0)", LISTING + "5", "GSR-E1b", PICTURE),
    "single-pass": Item("Eq. 1 in a single pass", "section 4.4", "GSR-E8", PICTURE),
    "alpha-eye": Item("α_src, eye rays", "section 4.4", "GSR-E9", PICTURE),
    "alpha-shadow": Item("α_src, shadow rays", "section 4.4", "GSR-E10", PICTURE),
    "rgb-shadow": Item("RGB_src, shadow rays", "section 4.4", "GSR-E1", PICTURE),
    "rgb-eye": Item("RGB_src, eye rays", "section 4.4", "GSR-E8,GSR-E9", "eye rays alone: " + PICTURE),
    "alpha-reflected": Item("α_src, reflected rays", "section 4.4", "", "eye, shadow and reflected rays, composed by "
                            "Eq. 1 in NumPy in the order of the buffer, are " + PICTURE),
    "as-printed": Item("all listings and Eq. 1", "appendix A", _every("E1b"), PICTURE),
    "as-printed-listings": Item("all, with Listing 5's shadow", "appendix A", _every("E1"), PICTURE),
    "as-printed-quarter": Item("all, with Listing 5's shadow, where every ρ is 0.25", "appendix A", _every("E1"),
                               PICTURE),
}  # fmt: skip


def cases(quick: bool) -> list[Case]:
    """A case an item, and one for the passes."""
    size = QUICK if quick else FULL
    return [{"part": item, "size_px": size} for item in (*ITEMS, "passes")]


@lru_cache(maxsize=2)
def paper_scene(quarter: bool = False) -> Scene:
    """The Cornell box without glass or highlights; its blocks mirror, or every surface does a quarter."""
    scene = scene_of("cornell box")
    light = replace(scene.lights[0], intensity=1.0 / DIM)
    materials = []
    for material in scene.materials:
        rho = QUARTER if quarter else 0.5 if material.kind == "glass" else material.rho
        red, green, blue = (0.8 * DIM * part for part in material.color)
        materials.append(
            replace(material, kind="diffuse", color=(red, green, blue), ior=None, specular=0.0, reflectivity=rho)
        )
    return scene.replace(materials=tuple(materials), lights=(PointLight(light.position, intensity=light.intensity),))


def paper_rays(size: int) -> Rays:
    """Listing 3's camera, 90° across, far enough off to see past the box."""
    return camera_rays(paper_scene(), size, size, view=(0.3, 0.25, 1.0), fov=90.0, fill=0.95)


@lru_cache(maxsize=32)
def run(size: int, errata: str = "corrected", quarter: bool = False, **changes: Any) -> Trace:
    """The pipeline's run in the paper's set-up."""
    return trace(GEOMETRY_SHADER, paper_scene(quarter), paper_rays(size), errata=errata, **{**SETTING, **changes})


@lru_cache(maxsize=16)
def recursive(size: int, quarter: bool = False, **changes: Any) -> Whitted:
    """The same by recursion in NumPy."""
    options = checked(GEOMETRY_SHADER, METHODS[GEOMETRY_SHADER].options, {**SETTING, **changes})
    return traced(paper_scene(quarter), paper_rays(size), options).whitted


def image(found: Trace) -> Image:
    """f32[pixels, 3]."""
    assert found.image is not None
    return found.image.reshape(-1, 3)


def differ(a: Image, b: Image) -> int:
    """Pixels whose bits differ."""
    return int((a.view(np.uint32) != b.view(np.uint32)).any(axis=1).sum())


def composed(size: int, alpha_reflected: float = 1.0) -> Image:
    """Eq. 1 in one 8-bit target, ray by ray in the order of the buffer: eye rays, and shadow and reflected ones."""
    bare, shadowed = recursive(size, shadows=False), recursive(size)
    held = np.zeros((size * size, 3), np.float32)

    def onto(pixels: Any, source: Any, alpha: float) -> None:
        alphas = np.full_like(source, alpha)
        operands = Operands(source, held[pixels], source, source, alphas, alphas, alphas)
        held[pixels] = to_unorm8(blend("add", "one", "src-alpha", clamped(operands)))

    eye = next(shot for shot in bare.shots if shot.kind == RayKind.EYE)
    onto(eye.rays.pixel, bare.light_by_node[0][1][eye.rays.pixel], 1.0)
    for shot in shadowed.shots:
        if shot.kind == RayKind.SHADOW:
            dark = shot.rays.pixel[shot.found.triangle >= 0]
            onto(dark, np.zeros((len(dark), 3), np.float32), 0.0)
    for shot in bare.shots:
        if shot.kind == RayKind.REFLECTED:
            hit = shot.rays.pixel[shot.found.triangle >= 0]
            onto(hit, bare.light_by_node[shot.rays.node][1][hit], alpha_reflected)
    return held


def measure(part: str, size_px: int) -> Rows:
    """One row: pixels that are not the witness's, as printed and corrected. Of `passes` a row a picture."""
    if part == "passes":
        return passes_of(size_px)
    own, changes = ITEMS[part], {"passes": 1} if part == "rgb-eye" else {}
    quarter = part == "as-printed-quarter"
    if part == "listing-4-miss":
        printed, corrected, pixels = _misses(size_px)
    else:
        right = recursive(size_px, quarter, **changes).picture()
        drawn = composed(size_px) if not own.printed else image(run(size_px, own.printed, quarter, **changes))
        printed, corrected = differ(drawn, right), differ(image(run(size_px, "corrected", quarter, **changes)), right)
        pixels = size_px * size_px
    line = {"part": "items", "id": part, "item": own.name, "place": own.place, "size_px": size_px}
    return [
        {
            **line,
            "printed": own.printed or "as composed in NumPy",
            "cases": pixels,
            "twin_differs": corrected,
            "printed_fails": printed,
            "corrected_fails": corrected,
            "property": own.property,
        }
    ]


def _misses(size: int) -> tuple[int, int, int]:
    """Pixels of eye rays that miss and are not grey. As printed these rays end before they are shaded, whatever
    backgroundColor is, and leave the clear colour; corrected, that is backgroundColor."""
    missed = run(size).generations[0].hits.triangle < 0
    grey = to_unorm8(np.array(GREY, np.float32))
    printed, corrected = image(run(size, "GSR-E2")), image(run(size, background=GREY))
    wrong, left = (int((found[missed] != grey).any(axis=1).sum()) for found in (printed, corrected))
    return wrong, left, int(missed.sum())


class OneBounce(Whitted):
    """Whitted's recursion that stops after one reflection, and shadows what it shows."""

    def sent_on(self, rays: Bundle, found: Found, normal: np.ndarray) -> tuple[Bundle, Bundle]:
        """Only eye rays are reflected."""
        reflected, refracted = super().sent_on(rays, found, normal)
        none = np.zeros(0, np.int64)
        return (reflected if rays.node == 0 else reflected.where(none)), refracted.where(none)


def _one_bounce(size: int) -> Image:
    plain = recursive(size, passes=3)
    again = OneBounce(
        plain.surfaces, plain.shading, search_of(paper_scene(), paper_rays(size), plain.surfaces, _options(3)),
        plain.pixels, 3, plain.lights, True, True, False, plain.branching, plain.background, plain.fixed_point,
    )  # fmt: skip
    eye = next(shot for shot in plain.shots if shot.kind == RayKind.EYE)
    again.trace(eye.rays)
    return again.picture()


def _options(passes: int) -> dict[str, Any]:
    return dict(checked(GEOMETRY_SHADER, METHODS[GEOMETRY_SHADER].options, {**SETTING, "passes": passes}))


def passes_of(size: int) -> Rows:
    """P passes against recursions of depth P and P − 1, every surface mirroring a quarter; rays of a depth are one
    generation. And the picture of two passes against one bounce whose reflected hits have shadows too."""
    rows = []
    for passes in range(1, MOST_PASSES + 1):
        drawn = image(run(size, quarter=True, passes=passes))
        for depth in (passes - 1, passes):
            right = recursive(size, True, passes=depth).picture() if depth else np.zeros_like(drawn)
            rows.append(_passes_row(size, passes, depth, differ(drawn, right)))
    rows.append(_passes_row(size, 2, 2, differ(image(run(size)), _one_bounce(size)), shadowed=True))
    return rows


def _passes_row(size: int, passes: int, depth: int, changed: int, shadowed: bool = False) -> Row:
    shown = {"passes": passes, "depth_of_recursion": depth, "deepest_hits_shadowed": int(shadowed)}
    as_deep = int(depth == passes and not shadowed)
    return {"part": "passes", "size_px": size, **shown, "as_deep": as_deep, "pixels": size * size,
            "pixels_changed": changed}  # fmt: skip


def of_part(rows: Rows, part: str) -> Rows:
    """`items` or `passes`."""
    return [row for row in rows if row["part"] == part]


def tables(rows: Rows, others: Mapping[str, Rows]) -> Tables:
    """Items, and depths."""
    return {"gsr-paper-case": of_part(rows, "items"), "gsr-paper-case-passes": of_part(rows, "passes")}


EXPERIMENT = Experiment(
    "gsr-paper-case",
    "Listings and Eq. 1 at the paper's own set-up, one picture each",
    "32² pixels (16² with `--quick`) of the Cornell box without glass: two passes, one light, 8-bit targets cleared to "
    "black, a 90° camera, light N · L. `printed_fails`: pixels whose bits are not those of a recursive ray tracer in "
    "NumPy while that item stands as printed and the rest corrected; `corrected_fails`: all corrected. The other "
    "table: P passes against recursions of depth P and P − 1.",
    cases,
    measure,
    None,
    tables,
)
