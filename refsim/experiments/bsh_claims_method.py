"""Claims on the method, judged on counts: partitions, culling, lists, growth.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA."""

from __future__ import annotations

from itertools import pairwise

from refsim.experiments import bsh_growth, bsh_lists
from refsim.experiments import bsh_published as published
from refsim.experiments.bsh_runs import MESHES, SUBSTITUTES
from refsim.experiments.registry import Rows
from refsim.experiments.runs import MISSING
from refsim.experiments.verdicts import claim

SHARE = 0.05  # percent points that a share of directions may be off


def some(answers: list[bool]) -> bool | None:
    """All, none, or None: some. Nothing to judge is `depends`."""
    return None if not answers or len(set(answers)) > 1 else answers[0]


STAND_INS = tuple(MESHES[scene] for scene in SUBSTITUTES)


def present(rows: Rows) -> Rows:
    """Rows of scenes that are at hand; a stand-in for one of the paper's decides nothing."""
    return [row for row in rows if row.get("triangles") != MISSING and row.get("scene") not in STAND_INS]


def partition_claims(rows: Rows) -> Rows:
    """Section 2.1 on Figure 2's directions; BSH-E1, E2."""
    found = []
    for lists, rule, said, name in (
        (6, "sextant_opposite", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (6, "sextant_same", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (6, "sextant_safe", published.SAID_CULLED_SEXTANT, "BSH-E1"),
        (8, "octant_opposite", published.SAID_CULLED_OCTANT, "BSH-E1"),
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
                "BSH-E1", f"culling loses no hit: {rule}", "Suzanne, bunny",
                "no pixel of any view finds another triangle, or none",
                f"{sum(bad)} pixels of {len(bad)} pictures, in {sum(b > 0 for b in bad)} of them", sum(bad) == 0,
            )
        )  # fmt: skip
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
                "gains grow from each scene to the next with more triangles; depends where at some steps", told,
                some([a < b for a, b in pairwise(values)]),
            ),
        ]  # fmt: skip
    return [*found, *view_claims(rows)]


def view_claims(rows: Rows) -> Rows:
    """Section 2.1: with two lists "the framerate is less dependant on the point of view" than with one."""
    own = [row for row in present(rows) if row["part"] == "plain"]
    found = []
    for scene, order in dict.fromkeys((row["scene"], row["order"]) for row in own):
        for cameras, left_out in (("all cameras", ()), ("cameras of one distance", ("close",))):
            nodes = {
                lists: [row["nodes_per_ray"] for row in own if (row["scene"], row["order"], row["lists"]) ==
                        (scene, order, lists) and row["camera"] not in left_out] for lists in (1, 2)
            }  # fmt: skip
            one, two = (max(nodes[lists]) / min(nodes[lists]) for lists in (1, 2))
            found.append(
                claim(
                    "2.1", "with two lists the cost depends less on the view than with one",
                    f"{scene}, {order.replace('_', ' ')}, {cameras}",
                    "most by least nodes a ray over the cameras is smaller with two lists",
                    f"x {one:.3f} with one, x {two:.3f} with two", two < one,
                )
            )  # fmt: skip
    return found


def optimised_claims(rows: Rows) -> Rows:
    """Section 4's "our optimisations permit to reduce" on Table 2's scenes: all on against six lists alone."""
    own = {
        (row["scene"], row["part"]): row["nodes_per_ray"] for row in present(rows)
        if (row["lists"], row["order"], row["camera"]) == (6, bsh_lists.ORDERS[0], bsh_lists.SEEN[0])
    }  # fmt: skip
    return [
        claim(
            "4", "all optimisations together reduce nodes a ray on Table 2's scenes", f"{scene}, heads by {rule}",
            "fewer nodes a ray than with six lists alone",
            f"{own[scene, 'plain']:.2f} to {own[scene, part]:.2f}", own[scene, part] < own[scene, "plain"],
        )
        for scene in dict.fromkeys(scene for scene, _ in own)
        for rule, part in (("leaf", bsh_lists.PARTS[1]), ("climb", bsh_lists.PARTS[2]))
    ]  # fmt: skip


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
        for law in bsh_growth.laws([row for row in rows if row["scene"] not in STAND_INS])
    ]  # fmt: skip
