"""Claims on the method, judged on counts: partitions, culling, heads, lists, growth, locality.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from itertools import pairwise

from refsim.experiments import bsh_growth, bsh_lists
from refsim.experiments import bsh_published as published
from refsim.experiments.registry import Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim

SHARE = 0.05  # percent points that a share of directions may be off


def some(answers: list[bool]) -> bool | None:
    """All, none, or None: some. Nothing to judge is `depends`."""
    return None if not answers or len(set(answers)) > 1 else answers[0]


def present(rows: Rows) -> Rows:
    """Rows of scenes that are at hand."""
    return [row for row in rows if row.get("triangles") != MISSING]


def partition_claims(rows: Rows) -> Rows:
    """Section 2.1 on Figure 2's directions; BSH-E1, E2."""
    found = []
    for lists, rule, said, name in (
        (6, "sextant_opposite", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (6, "sextant_same", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (6, "sextant_safe", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (8, "octant", published.SAID_CULLED_OCTANT, "BSH-E2"),
    ):
        own = [row for row in rows if row["lists"] == lists]
        culled = [row[f"{rule}_culled_percent"] for row in own]
        facing = [row[f"{rule}_pairs_facing_percent"] for row in own]
        unsafe = [row[f"{rule}_unsafe_percent_of_culled"] for row in own]
        found += [
            claim(
                "2.1", f"{said} percent of the geometry is culled", f"{rule}, even normals",
                "the share of each list is within 0.05 percent points",
                f"{min(culled):.3f} to {max(culled):.3f} percent",
                all(abs(value - said) <= SHARE for value in culled),
            ),
            claim(
                name, "it is impossible for a ray to hit a culled triangle", f"{rule}, even normals",
                "no pair of a culled normal and a direction of the list meets front to front",
                f"{max(facing):.3f} percent of pairs do at most; {max(unsafe):.2f} percent of normals are unsafe",
                max(facing) == 0.0,
            ),
        ]  # fmt: skip
    return found


def hole_claims(rows: Rows) -> Rows:
    """BSH-E1 on pictures."""
    own = present(rows)
    found = []
    for rule in dict.fromkeys(row["rule"] for row in own if row["rule"] != "none"):
        bad = [row["wrong_pixels"] for row in own if row["rule"] == rule]
        found.append(
            claim(
                "BSH-E1" if rule != "octant" else "BSH-E2", f"culling loses no hit: {rule}", "Suzanne, bunny",
                "no pixel of any view finds another triangle, or none",
                f"{sum(bad)} pixels of {len(bad)} pictures, in {sum(b > 0 for b in bad)} of them", sum(bad) == 0,
            )
        )  # fmt: skip
    return found


def head_claims(rows: Rows) -> Rows:
    """Section 3 on the histograms' means."""
    own = present([row for row in rows if row["part"] == "summary"])
    if not own:
        return []
    best: dict[tuple[str, int, str], dict[str, float]] = {}
    for row in own:
        if row["heads"] in ("cells", "regular"):
            best.setdefault((row["scene"], row["ground"], row["head_rule"]), {})[row["rays"]] = row["change_percent"]
    found = []
    for rule in ("leaf", "climb"):
        views = {key: value for key, value in best.items() if key[2] == rule}
        found += [
            claim(
                "3.2", "frustum culling works much better than what is done for secondary rays", f"heads by {rule}",
                "eye rays save a larger share of their nodes than shadow and reflected rays, in every scene",
                "; ".join(
                    f"{scene}{', ground' if ground else ''}: " + ", ".join(f"{k} {v:+.1f}" for k, v in value.items())
                    for (scene, ground, _), value in views.items()
                ),
                some([value["eye"] < min(value["shadow"], value["reflected"]) for value in views.values()]),
            ),
            claim(
                "3.1", "per-polygon heads speed up secondary rays", f"heads by {rule}",
                "shadow and reflected rays visit fewer nodes on average, in every scene",
                "; ".join(
                    f"{scene}{', ground' if ground else ''}: {value['shadow']:+.1f}, {value['reflected']:+.1f} percent"
                    for (scene, ground, _), value in views.items()
                ),
                some([max(value["shadow"], value["reflected"]) < 0 for value in views.values()]),
            ),
            claim(
                "BSH-E4", "a head helps every ray", f"heads by {rule}", "no ray visits more nodes than without",
                f"up to {max(row['more_percent'] for row in own if row['head_rule'] == rule):g} percent of the "
                f"rays visit up to {max(row['most_more'] for row in own if row['head_rule'] == rule)} more",
                all(row["more_percent"] == 0 for row in own if row["head_rule"] == rule),
            ),
        ]  # fmt: skip
    return found


def gain_claims(rows: Rows) -> Rows:
    """Section 4: 5 to 15 percent, the more complex the higher."""
    table = bsh_lists.gains(present(rows))
    if not table:
        return []
    low, high = published.SAID_GAIN
    found = []
    for part in dict.fromkeys(row["part"] for row in table):
        own = [row for row in table if (row["part"], row["lists"], row["order"]) == (part, 6, bsh_lists.ORDERS[0])]
        gains = {row["scene"]: row["gain_percent"] for row in own if row["camera"] == bsh_lists.SEEN[0]}
        told = "; ".join(f"{scene} {gain:.1f}" for scene, gain in gains.items())
        values = list(gains.values())
        found += [
            claim(
                "4", f"six lists gain {low:g} to {high:g} percent", f"front camera, {part}",
                "fewer nodes a ray than one list, by that; depends where in some scenes",
                told, some([low <= gain <= high for gain in values]),
            ),
            claim(
                "4", "the more complex a scene the higher the gain", f"front camera, {part}",
                "gains grow from each scene to the next with more triangles", told,
                all(a < b for a, b in pairwise(values)),
            ),
        ]  # fmt: skip
    plain = [row for row in table if (row["part"], row["lists"]) == ("plain", 6)]
    spread: dict[str, list[float]] = {}
    for row in plain:
        spread.setdefault(row["scene"], []).append(row["gain_percent"])
    found.append(
        claim(
            "4", "six lists gain whatever the view", "all cameras, both orders",
            "never more nodes a ray than with one list",
            "; ".join(f"{scene} {min(gain):+.1f} to {max(gain):+.1f}" for scene, gain in spread.items()),
            all(row["gain_percent"] >= 0 for row in plain),
        )
    )  # fmt: skip
    return found


def growth_claims(rows: Rows) -> Rows:
    """Section 4: a logarithmic function of the triangle count."""
    return [
        claim(
            "4", "ray shooting is approximately a logarithmic function of the triangle count", law["family"],
            "a + b log2 n is nearer to nodes a ray than c n^p",
            f"off by {law['log_rms_nodes']:.2f} nodes, the power law (p = {law['power_p']:.3f}) by "
            f"{law['power_rms_nodes']:.2f}; x {law['times_the_nodes']:g} for x {law['times_the_triangles']:g} "
            "triangles",
            law["better"] == "log",
        )
        for law in bsh_growth.laws(rows)
    ]  # fmt: skip


def locality_claims(rows: Rows) -> Rows:
    """Section 2.1 and Table 2 on the texture cache's model."""
    own = [row for row in present(rows) if row["rays"] == "eye and shadow"]
    found = []
    for cache in dict.fromkeys(row["cache"] for row in own):
        table = {(row["scene"], row["lists"]): row for row in own if row["cache"] == cache}
        scenes = list(dict.fromkeys(scene for scene, _ in table))
        for key, text, better in (
            ("hit_percent_all", "a larger share of fetches hits", 1.0),
            ("bytes_per_ray", "fewer bytes from memory a ray", -1.0),
        ):
            pairs = [(table[scene, 1][key], table[scene, 6][key]) for scene in scenes]
            found.append(
                claim(
                    "2.1", "creating multiple traversal lists is expected to increase memory reference locality",
                    f"{cache}, {key}", f"with six lists {text} than with one, in every scene",
                    "; ".join(f"{scene} {a:g} to {b:g}" for scene, (a, b) in zip(scenes, pairs, strict=True)),
                    some([better * (b - a) > 0 for a, b in pairs]),
                )
            )  # fmt: skip
        rates = [table[scene, 6]["hit_percent_all"] for scene in scenes]
        found.append(
            claim(
                "4", "as polygon count increases, locality is progressively lost", f"{cache}, six lists",
                "the share of fetches that hit falls from scene to scene", "; ".join(f"{rate:g}" for rate in rates),
                all(a > b for a, b in pairwise(rates)),
            )
        )  # fmt: skip
    return found
