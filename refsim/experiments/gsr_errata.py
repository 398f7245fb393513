"""What each erratum of the listings and of Eq. 1 changes: pictures as printed, one by one, against the corrected one.

A run has one thing as printed (or all) and the rest corrected. Counted: pixels whose bits differ from the corrected
picture's, those that differ by more than half a step of 8 bits, the largest difference of a channel, and triangle
tests. GSR-E1 and E1b (a shadow's own colour) are run on 8-bit targets too, where Listing 5's −1 is clamped to black.
Recursive Ray Tracing in Geometry Shader, appendix A and section 4.4.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.gsr_runs import GEOMETRY_SHADER, head, run
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.image import encode_srgb
from refsim.results import Trace

VIEW, PASSES = "cornell box from afar", 3
FLOAT, BYTES = "rgba32float", "rgba8unorm"
ABOUT = {
    "corrected": "all corrected",
    "GSR-E1": "E1: white shadows",
    "GSR-E1b": "E1b: shadows of −1",
    "GSR-E2": "E2: misses end unseen",
    "GSR-E3": "E3: none gets ready",
    "GSR-E4": "E4: ρ is 0.25",
    "GSR-E5": "E5: only eyes spawn",
    "GSR-E6": "E6: no any-hit",
    "GSR-E7": "E7: S_VB (right)",
    "GSR-E8": "E8: one target for all",
    "GSR-E9": "E9: eye fragments add",
    "GSR-E10": "E10: no ambient light",
    "GSR-E11": "E11: offset along N",
    "GSR-E12": "E12: always 90°",
    "as_printed": "all as printed",
}
ON_BYTES = ("corrected", "GSR-E1", "GSR-E1b", "as_printed")
VISIBLE = 0.5 / 255.0


def cases(quick: bool) -> list[Case]:
    """A case an erratum and format."""
    size = 96 if quick else 256
    wanted = [(name, FLOAT) for name in ABOUT] + [(name, BYTES) for name in ON_BYTES]
    return [
        {"view": VIEW, "size_px": size, "passes": PASSES, "color_format": form, "errata": name} for name, form in wanted
    ]


@lru_cache(maxsize=24)
def traced(view: str, size: int, passes: int, color_format: str, errata: str) -> tuple[NDArray[np.float32], Row]:
    """The picture and what it took."""
    found = run(GEOMETRY_SHADER, view, size, passes=passes, color_format=color_format, errata=errata)
    assert found.image is not None
    return found.image, {**head(view, size, found), **_took(found)}


def _took(found: Trace) -> Row:
    c = found.counters
    return {
        "rays": sum(c[f"rays.{kind}"] for kind in ("eye", "shadow", "reflected", "refracted")),
        "shadow_rays": c["rays.shadow"],
        "cells": c["traversal.cells"],
        "triangle_tests": c["intersection.triangle_tests"],
        "fragments_shaded": c["fragment.written"],
    }


def measure(view: str, size_px: int, passes: int, color_format: str, errata: str) -> Rows:
    """One row."""
    right, usual = traced(view, size_px, passes, color_format, "corrected")
    image, took = traced(view, size_px, passes, color_format, errata)
    own = {"passes": passes, "color_format": color_format, "errata": errata}
    return [{**took, **own, **differing(right, image, usual)}]


def differing(right: NDArray[np.float32], image: NDArray[np.float32], usual: Row) -> Row:
    """How far a picture is from the corrected one, and the tests of that."""
    apart = np.abs(image.astype(np.float64) - right).max(axis=2)
    return {
        "pixels_changed": int((image != right).any(axis=2).sum()),
        "pixels_visibly_changed": int((apart > VISIBLE).sum()),
        "largest_difference": round(float(apart.max()), 6),
        "darkest_channel": round(float(image.min()), 6),
        "brightest_channel": round(float(image.max()), 6),
        "triangle_tests_corrected": usual["triangle_tests"],
    }


def plot(rows: Rows) -> Any:
    """A contact sheet; under each picture the pixels that are visibly others."""
    sheet = [row for row in rows if row["color_format"] == FLOAT]
    sheet += [row for row in rows if row["color_format"] == BYTES and row["errata"] in ("GSR-E1b", "as_printed")]
    columns = 5
    lines = -(-len(sheet) // columns)
    figure = style.new_figure(2.13 * lines)
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes in grid.flat:
        axes.set_visible(False)
    for axes, row in zip(grid.flat, sheet, strict=False):
        axes.set_visible(True)
        style.no_frame(axes)
        image, _ = traced(row["view"], row["size_px"], row["passes"], row["color_format"], row["errata"])
        axes.imshow(encode_srgb(image), interpolation="nearest")
        name = ABOUT[row["errata"]]
        axes.set_title(f"{name.split(':')[0]}, 8 bit" if row["color_format"] == BYTES else name, fontsize=8)
        axes.set_xlabel(_said(row), fontsize=7.5)
    return figure


def _said(row: Row) -> str:
    pixels = row["size_px"] ** 2
    share = 100.0 * row["pixels_visibly_changed"] / pixels
    more = row["triangle_tests"] / row["triangle_tests_corrected"]
    by = f"{row['largest_difference']:.2g}"
    changed = "same bits" if row["pixels_changed"] == 0 else f"{share:.3g} % of pixels, ≤ {by}"
    return f"{changed}\ntests × {more:.3g}"


EXPERIMENT = Experiment(
    "gsr-errata",
    "What each erratum of the listings and of Eq. 1 changes",
    "The Cornell box with a mirror and a block of glass, seen from outside so that the background shows; 256² (96² "
    "with `--quick`), three passes, one light, float targets unless it says 8 bit. Each picture has one thing as "
    "printed and the rest corrected. Below it: pixels that differ by more than half an 8-bit step, the largest "
    "difference of a channel, and ray–triangle tests against the corrected run's. E3 never marks a ray as ready to be "
    "shaded, so only the clear colour remains; E6 costs tests and changes nothing else; E7 lists numbers of the text "
    "that are right.",
    cases,
    measure,
    plot,
    alt="A grid of small pictures of one Cornell box, each with one erratum as printed: white or black shadows, "
    "missing reflections, a pale or a shrunken picture, and some that change nothing; all as printed together at "
    "the end.",
)
