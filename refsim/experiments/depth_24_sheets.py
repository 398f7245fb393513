"""Two sheets, one close behind the other: which one 24 bits of depth show, by the gap and by which is drawn first.

A hit of depth z is stored as round(z · (2²⁴ − 1)). Two hits s steps apart, s < 1, fall into one step for a share 1 − s
of all places of the pair; then the first drawn stays. A speck far behind the eye makes the range 1,024 units and more,
so that float32 still tells hits apart that are 1/64 of a step from each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.experiments import style
from refsim.experiments.depth_24 import FIXED, FLOAT, STEPS, depth_scale
from refsim.experiments.registry import Case, Experiment, Row, Rows
from refsim.experiments.runs import HIERARCHICAL
from refsim.methods import trace
from refsim.scene import Rays, Scene, camera_rays

SHEETS = "two sheets"
ORDERS = ("far sheet first", "near sheet first")
GAPS = (0.0625, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0, 1.25, 1.5, 2.0)
QUICK_GAPS = (0.25, 0.5, 0.75, 1.0, 1.5)
NEAR: NDArray[np.float32] = np.array([[[-12, -12, 0], [12, -12, 0], [0, 12, 0]]], np.float32)
SPECK: NDArray[np.float32] = np.array([[[0, 0, 600], [1, 0, 600], [0, 1, 600]]], np.float32)
TILT = 0.125  # the far sheet of a gap lies at −gap; both lean, so that z of a ray is no round number


def sheets(gap: float, far_first: bool) -> Scene:
    """The two sheets, `gap` apart along z, the speck first of all."""
    lean = NEAR + NEAR[..., :1] * np.array([0, 0, TILT], np.float32)
    far = lean - np.array([0, 0, gap], np.float32)
    order = (SPECK, far, lean) if far_first else (SPECK, lean, far)
    triangles: NDArray[np.float32] = np.concatenate(order).astype(np.float32)
    return Scene(triangles, SHEETS)


def sheet_rays(size: int) -> Rays:
    """Rays that meet both sheets, from four units away."""
    return camera_rays(Scene(NEAR / np.float32(12)), size, size, view=(0.05, 0.02, 1.0), fill=1.0, fov=30.0)


def plane_t(rays: Rays, triangle: np.ndarray) -> np.ndarray:
    """Where rays cross a triangle's plane, float64."""
    v = triangle.astype(np.float64)
    normal = np.cross(v[1] - v[0], v[2] - v[0])
    o, d = rays.origin.astype(np.float64), rays.direction.astype(np.float64)
    return np.asarray(((v[0] - o) @ normal) / (d @ normal))


def cases(quick: bool) -> list[Case]:
    """A case a gap and drawing order. `--quick` runs the plain NumPy reference."""
    size, backend = (32, "numpy") if quick else (256, "numba")
    return [
        {"order": order, "gap_steps": gap, "size_px": size, "backend": backend}
        for order in ORDERS for gap in (QUICK_GAPS if quick else GAPS)
    ]  # fmt: skip


def measure(order: str, gap_steps: float, size_px: int, backend: str) -> Rows:
    """One row. `gap_steps` is along z; the rays are at an angle, so their own gaps are a little wider."""
    rays, far_first = sheet_rays(size_px), order == ORDERS[0]
    step = 1.0 / (float(depth_scale(sheets(1.0, far_first), rays)) * STEPS)
    scene = sheets(gap_steps * step, far_first)
    near, far = (2, 1) if far_first else (1, 2)
    apart = (plane_t(rays, scene.triangles[far]) - plane_t(rays, scene.triangles[near])) / step
    share = np.clip(1.0 - apart, 0.0, None).mean() if far_first else 0.0
    row: Row = {
        "order": order, "gap_steps": gap_steps, "size_px": size_px, "rays": len(rays),
        "mean_gap_of_rays_steps": round(float(apart.mean()), 4),
        "predicted_wrong_percent": round(100.0 * float(share), 3),
    }  # fmt: skip
    for name, depth_format in (("float32", FLOAT), ("unorm24", FIXED)):
        options: dict[str, Any] = {"generations": 1, "tile_size": 8, "backend": backend}
        found = trace(HIERARCHICAL, scene, rays, depth_format=depth_format, **options).hits.triangle
        row[f"{name}_hits"] = int((found >= 0).sum())
        row[f"{name}_wrong_hits"] = int((found == far).sum())
        row[f"{name}_wrong_percent"] = round(100.0 * float(np.mean(found == far)), 3)
    return [row]


def plot(rows: Rows) -> Any:
    """Wrong hits over the gap: predicted lines, measured markers."""
    figure = style.new_figure(3.4, 6.4)
    axes = figure.subplots()
    own = [[row for row in rows if row["order"] == order] for order in ORDERS]
    gaps = [[row["mean_gap_of_rays_steps"] for row in some] for some in own]
    axes.plot([0.0, 1.0, max(gaps[0])], [100.0, 0.0, 0.0], "-", color=style.FAINT, label="predicted: 1 − gap", zorder=1)
    for k, order in enumerate(ORDERS):
        look: dict[str, Any] = {"color": style.CYCLE[k], "linestyle": "none", "markersize": 7}
        share = [row["unorm24_wrong_percent"] for row in own[k]]
        axes.plot(gaps[k], share, style.MARKERS[k], label=f"24 bits, {order}", **look)
    flat = [row["float32_wrong_percent"] for row in own[0]]
    axes.plot(gaps[0], flat, "x", color=style.BLACK, markersize=5, label=f"float32, {ORDERS[0]}")
    axes.set_xlabel("gap between the sheets, in depth steps of range · 2⁻²⁴")
    axes.set_ylabel("rays that see the far sheet, percent")
    axes.set_xlim(left=0.0)
    axes.legend(loc="upper right")
    return figure


EXPERIMENT = Experiment(
    "depth-24-sheets",
    "When 24 bits of depth show the wrong one of two surfaces",
    "Two sheets, one close behind the other, in a world of 1,024 units (256² eye rays; 32² in the NumPy reference with "
    "`--quick`). Drawn after the far one, the near sheet is lost where both depths are rounded to one step: for a "
    "share 1 − gap of the rays. Drawn first, it stays. A float32 depth tells them apart at every gap shown.",
    cases,
    measure,
    plot,
    alt="Markers fall along a straight line from near 100 percent at no gap to 0 at a gap of one step; with the near "
    "sheet drawn first, and with float32, they stay at 0.",
)
