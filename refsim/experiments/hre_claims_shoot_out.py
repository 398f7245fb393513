"""Claims of section 8 on how the Hierarchical Ray Engine stands to spatial hierarchies, on the rows of the shoot-out.

In steps a ray, where the paper has times. Speeds are compared on an eye's rays and on such rays spread by little; what
coherence has to do with it, on all.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from refsim.experiments.registry import Row, Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim

OURS = "Hierarchical Ray Engine"
SPATIAL = ("geometry shader, grid", "geometry shader, boxes", "one list", "six lists")
COHERENT = 0.1  # the largest spread of rays that are asked
COSTS = {"structures kept": "steps_per_ray", "structures built anew": "rebuilt_steps_per_ray"}


def claims(rows: Rows) -> Rows:
    """A line a scene, spread and whether structures are built anew; and on growth, a line a spread."""
    found: Rows = []
    present = [row for row in rows if row.get("steps_per_ray", "") not in ("", MISSING) and row["spread"] <= COHERENT]
    for name, cost in COSTS.items():
        for spread in dict.fromkeys(row["spread"] for row in present):
            own = [row for row in present if row["spread"] == spread]
            scenes = [scene for scene in dict.fromkeys(row["scene"] for row in own) if _steps(own, scene, OURS, cost)]
            found += [_outperforms(own, scene, spread, name, cost) for scene in scenes]
            found.append(_falls_behind(own, scenes, spread, name, cost))
    return found + _spreads(rows)


def _spreads(rows: Rows) -> Rows:
    """What is left of the savings over brute force, from an eye's rays to random ones; structures kept."""
    found: Rows = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene and row.get("steps_per_ray", "") not in ("", MISSING)]
        ours = {row["spread"]: row["triangles"] / row["steps_per_ray"] for row in own if row["method"] == OURS}
        if ours:
            found.append(
                claim("8", "it assumes strongly coherent rays", scene,
                      "it saves steps over brute force on an eye's rays, and none on random ones",
                      _course(ours), ours[min(ours)] > 1.0 >= ours[max(ours)])
            )  # fmt: skip
        for method in SPATIAL:
            theirs = {row["spread"]: row["triangles"] / row["steps_per_ray"] for row in own if row["method"] == method}
            if theirs:
                found.append(
                    claim("8", "spatial hierarchies impose no constraint on coherence", f"{scene}, {method}",
                          "it saves steps over brute force at every spread of the rays",
                          _course(theirs), min(theirs.values()) > 1.0)
                )  # fmt: skip
    return found


def _course(savings: dict[float, float]) -> str:
    return "; ".join(f"spread {spread:g}: {value:.3g} times" for spread, value in savings.items())


def _steps(rows: Rows, scene: str, method: str, cost: str) -> Any:
    return next((row[cost] for row in rows if (row["scene"], row["method"]) == (scene, method)), None)


def _best(rows: Rows, scene: str, cost: str) -> tuple[float, str]:
    return min((_steps(rows, scene, method, cost), method) for method in SPATIAL)


def _outperforms(rows: Rows, scene: str, spread: float, name: str, cost: str) -> Row:
    triangles = next(row["triangles"] for row in rows if row["scene"] == scene)
    ours, (best, method) = _steps(rows, scene, OURS, cost), _best(rows, scene, cost)
    return claim(
        "8", "it outperforms the spatial hierarchies", f"{scene}, spread {spread:g}, {name}",
        "fewer steps a ray than a grid, a hierarchy of boxes and traversal lists; speed-up: triangles by steps",
        f"speed-up {triangles / ours:.3g}; {method}: {triangles / best:.3g}", ours < best,
    )  # fmt: skip


def _falls_behind(rows: Rows, scenes: list[str], spread: float, name: str, cost: str) -> Row:
    behind = {scene: _steps(rows, scene, OURS, cost) / _best(rows, scene, cost)[0] for scene in scenes}
    return claim(
        "8", "it is less suitable for more than several thousand triangles", f"spread {spread:g}, {name}",
        "its steps, by the fewest of a spatial hierarchy, grow from scene to scene as their triangles do",
        "; ".join(f"{scene}: x {times:.3g}" for scene, times in behind.items()),
        all(b > a for a, b in pairwise(behind.values())) if len(behind) > 1 else None,
    )  # fmt: skip
