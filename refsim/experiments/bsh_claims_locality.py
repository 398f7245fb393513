"""Claims on the locality of memory references, judged on the model of the texture cache.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, sections 2.1 and 4."""

from __future__ import annotations

from itertools import pairwise
from math import prod

from refsim.experiments import bsh_locality
from refsim.experiments.bsh_claims_method import present
from refsim.experiments.bsh_runs import MESHES
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

HITS = 90.0  # percent: "almost entirely in the cache", a choice of ours


def locality_claims(rows: Rows) -> Rows:
    """Section 2.1 and Table 2 on the texture cache's model; a line a scene."""
    own = [row for row in present(rows) if row["rays"] == "eye and shadow"]
    alone, found = bsh_locality.lists_alone(own), []
    for cache in dict.fromkeys(row["cache"] for row in own):
        table = {(row["scene"], row["lists"]): row for row in alone if row["cache"] == cache}
        for scene in dict.fromkeys(scene for scene, _ in table):
            for key, text, better in (
                ("hit_percent_all", "a larger share of fetches hits", 1.0),
                ("bytes_per_ray", "fewer bytes from memory a ray", -1.0),
            ):
                one, six = (table[scene, lists][key] for lists in (1, 6))
                found.append(
                    claim(
                        "2.1", "creating multiple traversal lists is expected to increase memory reference locality",
                        f"{scene}, {cache}, {key}", f"with six lists {text} than with one", f"{one:g} to {six:g}",
                        better * (six - one) > 0,
                    )
                )  # fmt: skip
        rates = [row["hit_percent_all"] for row in own if row["ground"] and
                 (row["cache"], row["switches"]) == (cache, bsh_locality.ALL_ON)]  # fmt: skip
        if len(rates) > 1:
            found.append(
                claim(
                    "4", "as polygon count increases, locality is progressively lost", f"{cache}, all optimisations",
                    "the share of fetches that hit falls from scene to scene", "; ".join(f"{rate:g}" for rate in rates),
                    all(a > b for a, b in pairwise(rates)),
                )
            )  # fmt: skip
        bare = [row for row in own if not row["ground"] and row["cache"] == cache]
        found += _cost_claims({row["switches"]: row for row in bare}, cache)
    return found


def _cost_claims(table: dict[str, Row], cache: str) -> Rows:
    """Table 1's caption on the bunny without its ground: what each optimisation costs in locality."""
    if bsh_locality.ALL_ON not in table:
        return []
    plain, full = table[bsh_locality.NONE], table[bsh_locality.ALL_ON]
    single = [row for name, row in table.items() if name not in (bsh_locality.NONE, bsh_locality.ALL_ON)]
    worse = [row["bytes_per_node"] > plain["bytes_per_node"] for row in single]
    nodes, moved = (100.0 * (full[key] / plain[key] - 1.0) for key in ("nodes_per_ray", "bytes_per_ray"))
    return [
        claim(
            "4", "most optimisations happen at the cost of memory access locality", f"bunny without ground, {cache}",
            "with most of the three, more bytes from memory a visited node than without any",
            f"{plain['bytes_per_node']:g} without; "
            + ", ".join(f"{row['switches']} {row['bytes_per_node']:g}" for row in single),
            sum(worse) > len(worse) / 2,
        ),
        claim(
            "4", "gains are offset by lesser memory efficiency", f"bunny without ground, {cache}",
            "all on, bytes from memory a ray fall by less than a tenth of what nodes a ray do; depends where by less",
            f"nodes {nodes:+.1f} percent, bytes {moved:+.1f} percent",
            True if moved >= 0.1 * nodes else None if moved > nodes else False,
        ),
    ]  # fmt: skip


def cache_claims(rows: Rows) -> Rows:
    """Section 4: "small scenes fitting entirely or almost entirely in the cache"; Suzanne is the one that is here."""
    from refsim.papers.sphere_hierarchy import texture_cache

    found = []
    for row in bsh_locality.lists_alone(present(rows)):
        if (row["scene"], row["lists"], row["rays"]) != (MESHES["Suzanne"], 6, "eye and shadow"):
            continue
        size = prod(getattr(texture_cache, row["cache"]))
        found += [
            claim(
                "4", "small scenes fit entirely or almost entirely in the cache",
                f"{row['scene']}, {row['cache']}, {by}", rule, told, holds,
            )
            for by, rule, told, holds in (
                ("bytes", "its lists and vertices take no more bytes than the cache has",
                 f"{row['footprint_bytes']} of {size}", row["footprint_bytes"] <= size),
                ("fetches", f"{HITS:g} percent of the fetches hit", f"{row['hit_percent_all']:g} percent",
                 row["hit_percent_all"] >= HITS),
            )
        ]  # fmt: skip
    return found
