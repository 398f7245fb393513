"""What each erratum of section 4 loses: equations as printed, alone and together, against the corrected run.

Each generation is judged twice. *On its own*: the rays of the corrected run's generation are shot again with the
printed equations, so that what is lost is lost there. *Along the path*: the printed equations run from the eye on, and
what an earlier generation lost is missing later too.

With a formula of the construction as printed the second pass, which widens a cone to hold what the first left outside,
does not run (`refsim.geometry.cone.repairs`): those rows change two things at once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from refsim.experiments import style
from refsim.experiments.registry import Case, Experiment, Rows
from refsim.experiments.runs import HIERARCHICAL, fill_of, run, scene_named
from refsim.methods import trace
from refsim.results import Trace
from refsim.scene import Hits

SCENES = ("blob_1000", "torus_knot_1024")
QUICK_SCENES = ("blob_200", "torus_knot_256")
VARIANTS = ("corrected", "HRE-E1", "HRE-E2", "HRE-E3", "HRE-E4", "HRE-E5", "HRE-E6", "HRE-E7", "as_printed")
ABOUT = {
    "corrected": "all corrected",
    "HRE-E1": "E1: apex moves the wrong way",
    "HRE-E2": "E2: origin in the mirrored cone",
    "HRE-E3": "E3: q by a product of norms",
    "HRE-E4": "E4: arccos of a vector not unit",
    "HRE-E5": "E5: zero-angle cone translated",
    "HRE-E6": "E6: mean direction flips past 180°",
    "HRE-E7": "E7: cones past 90° kept",
    "as_printed": "all as printed",
}


def cases(quick: bool) -> list[Case]:
    """A case a scene and variant. `--quick` runs the plain NumPy reference at 64²: same numbers, nothing to compile."""
    scenes, size, tile, backend = (QUICK_SCENES, 64, 8, "numpy") if quick else (SCENES, 256, 16, "numba")
    return [
        {"scene": scene, "size_px": size, "tile_px": tile, "fill": fill_of(scene), "generations": 5,
         "errata": errata, "backend": backend}
        for scene in scenes for errata in VARIANTS
    ]  # fmt: skip


@lru_cache(maxsize=1)
def _corrected(scene: str, size: int, tile: int, fill: float, generations: int, backend: str) -> Trace:
    return run(HIERARCHICAL, scene, size, fill, generations=generations, tile_size=tile, backend=backend)


def measure(
    scene: str, size_px: int, tile_px: int, fill: float, generations: int, errata: str, backend: str
) -> Rows:
    """A row a generation."""
    right = _corrected(scene, size_px, tile_px, fill, generations, backend)
    options: dict[str, Any] = {"tile_size": tile_px, "errata": errata, "backend": backend}
    along = run(HIERARCHICAL, scene, size_px, fill, generations=generations, **options)
    rows = []
    for k, passed in enumerate(right.generations):
        alone = trace(HIERARCHICAL, scene_named(scene), passed.rays, generations=1, **options)
        own = compared(passed.hits, alone.hits)
        path = compared(passed.hits, along.generations[k].hits)
        rows.append(
            {
                "scene": scene,
                "triangles": len(right.scene.triangles),
                "size_px": size_px,
                "tile_px": tile_px,
                "errata": errata,
                "generation": k,
                "rays": int(passed.alive.sum()),
                "hits": int((passed.hits.triangle >= 0).sum()),
                **{f"{name}_on_its_own_hits": count for name, count in own.items()},
                **{f"{name}_along_the_path_hits": count for name, count in path.items()},
                "pairs_kept_corrected": passed.counters["cone.pairs_kept"],
                "pairs_kept_on_its_own": alone.counters["cone.pairs_kept"],
                "unbounded_tiles_corrected": passed.counters["cone.tiles_unbounded"],
                "unbounded_tiles_on_its_own": alone.counters["cone.tiles_unbounded"],
            }
        )
    return rows


def compared(right: Hits, found: Hits) -> dict[str, int]:
    """Hits that are gone, that are of another triangle or place, and that should not be."""
    hit, now = right.triangle >= 0, found.triangle >= 0
    other = (right.triangle != found.triangle) | (right.t != found.t) | (right.u != found.u) | (right.v != found.v)
    return {
        "lost": int((hit & ~now).sum()),
        "wrong": int((hit & now & other).sum()),
        "added": int((~hit & now).sum()),
    }


def plot(rows: Rows) -> Any:
    """A table picture a scene: share of hits lost or wrong on the same rays, and pairs kept."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure = style.new_figure(3.9)
    for number, (axes, scene) in enumerate(zip(figure.subplots(1, len(scenes), squeeze=False)[0], scenes, strict=True)):
        _table(axes, [row for row in rows if row["scene"] == scene], number == 0)
    sentence = "hits lost or wrong in each generation, percent of the corrected run's, same rays for both"
    figure.supxlabel(sentence, fontsize=9)
    return figure


def _table(axes: Any, rows: Rows, named: bool) -> None:
    variants = [name for name in VARIANTS if any(row["errata"] == name for row in rows)]
    generations = sorted({row["generation"] for row in rows})
    share = np.zeros((len(variants), len(generations)))
    kept = []
    for i, name in enumerate(variants):
        own = [row for row in rows if row["errata"] == name]
        for row in own:
            bad = row["lost_on_its_own_hits"] + row["wrong_on_its_own_hits"]
            share[i, row["generation"]] = 100.0 * bad / row["hits"] if row["hits"] else 0.0
        kept.append(100.0 * sum(r["pairs_kept_on_its_own"] for r in own) / sum(r["pairs_kept_corrected"] for r in own))
    # A separate column, in white, for the pairs
    axes.imshow(share, cmap="Blues", vmin=0, vmax=115, aspect="auto")
    for (i, k), value in np.ndenumerate(share):
        text = "0" if value == 0 else "<0.01" if value < 0.01 else f"{value:.3g}"
        axes.text(k, i, text, ha="center", va="center", fontsize=8, color="white" if value > 60 else style.INK)
    for i, value in enumerate(kept):
        axes.text(len(generations), i, f"{value:.0f} %", ha="center", va="center", fontsize=8)
    axes.set_xlim(-0.5, len(generations) + 0.5)
    axes.set_xticks([*generations, len(generations)], [*map(str, generations), "pairs\nkept"])
    axes.set_yticks(range(len(variants)), [ABOUT[name] for name in variants] if named else [""] * len(variants))
    axes.tick_params(length=0, labelsize=8)
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.xaxis.tick_top()
    axes.set_title(f"{style.body_name(rows[0]['scene'])}, {rows[0]['triangles']:,} triangles")


EXPERIMENT = Experiment(
    "errata",
    "What each erratum of section 4 loses",
    "Each printed equation alone, the others corrected, and all as printed; 256² rays, tiles of 16 × 16 (64² and "
    "8 × 8 in the NumPy reference with `--quick`). Pairs kept: in percent of the corrected run's. Where a formula of "
    "the construction is as printed (all but E4) the construction's second pass, which would mend its faults, does not "
    "run either: those rows change two things at once.",
    cases,
    measure,
    plot,
    alt="A table for each of two bodies, a row an erratum and a column a generation: the share of hits that are lost "
    "or wrong, darker for more; the wrong apex, the vector that is not unit and all as printed lose most.",
)
