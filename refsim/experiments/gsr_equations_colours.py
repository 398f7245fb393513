"""Checks of Eq. 1, its two tables and Listing 5's colours, on the pixels of one small picture.

Recursive Ray Tracing in Geometry Shader, section 4.4 and appendix A; runs are those of `gsr_equations_checks`.
"""

from __future__ import annotations

import numpy as np

from refsim.experiments.equations import Found, number
from refsim.experiments.gsr_equations_checks import (
    BLACK,
    ROUNDING,
    VIEW,
    both,
    image,
    of_kind,
    pixels_differ,
    pixels_of,
    run,
)
from refsim.experiments.gsr_runs import scene_of
from refsim.reference.blend import Operands, blend
from refsim.results import RayKind

STEP = 0.5 / 255.0  # half a step of 8 bits


def one_shadow_darkens(size: int, name: str) -> Found:
    """A shadow takes light away and adds none."""
    def fails(errata: str) -> int:
        shaded, bare = image(size, errata, passes=2), image(size, errata, passes=2, shadows=False)
        # Listing 5's −1 may not make a pixel darker than no light at all
        return number((shaded > bare + ROUNDING).any(axis=1) | (shaded < -ROUNDING).any(axis=1))

    return Found(size * size, pixels_differ(size), *both(fails, name))


def white_shadows(size: int) -> Found:
    """RGB_src of Eq. 1."""
    return one_shadow_darkens(size, "E1")


def negative_shadows(size: int) -> Found:
    """Listing 5's colour of a shadow."""
    return one_shadow_darkens(size, "E1b")


def opaque(size: int) -> Found:
    """α_src of eye rays: where an eye ray hits, the background does not shine through."""
    def fails(errata: str) -> int:
        changes = image(size, errata, passes=1) != image(size, errata, passes=1, background=BLACK)
        hit = run(size, errata, passes=1).generations[0].hits.triangle >= 0
        return number(changes.any(axis=1) & hit)

    return Found(size * size, pixels_differ(size), *both(fails, "E9"))


def ambient_light(size: int) -> Found:
    """α_src of shadow rays: in shadow ambient light is left."""
    def fails(errata: str) -> int:
        found = run(size, errata, passes=2)
        eye, after = found.generations[0], found.generations[1]
        dark = pixels_of(after, of_kind(after, RayKind.SHADOW) & (after.hits.triangle >= 0), size * size)
        color = np.array([material.color for material in scene_of(VIEW).materials])
        diffuse = np.array([material.kind == "diffuse" for material in scene_of(VIEW).materials])
        material = scene_of(VIEW).material_ids[eye.hits.triangle]
        lit = dark & diffuse[material] & (color[material].max(axis=1) > 0.0)
        return number(lit & (image(size, errata, passes=2).max(axis=1) <= ROUNDING))

    return Found(size * size, pixels_differ(size), *both(fails, "E10"))


def blending(size: int) -> Found:
    """Eq. 1 with the corrected tables: the sum of what each ray brings, whatever else the pixel holds."""
    def fails(errata: str) -> int:
        return number((np.abs(image(size, errata) - image(size)) > STEP).any(axis=1))

    return Found(size * size, pixels_differ(size), *both(fails, "E8"))


def equation_1(size: int) -> Found:
    """1.0 × RGB_src + α_src × RGB_dst, as the blend stage states it: exact in float64, within roundings in float32."""
    rng = np.random.default_rng(52)
    count = size * size
    source, destination, alpha = (rng.uniform(0.0, 1.0, count) for _ in range(3))
    zero = np.zeros(count)
    made = blend("add", "one", "src-alpha", Operands(source, destination, zero, zero, alpha, zero, zero))
    wrong = np.abs(made - (source + alpha * destination)) > 1e-15
    return Found(count, pixels_differ(size), number(wrong), number(wrong))
