"""Claims on traversal lists against other structures, judged on the same rays' nodes.

Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA, sections 1, 2.1 and 6."""

from __future__ import annotations

from refsim.experiments.bsh_claims_method import present, some
from refsim.experiments.registry import Row, Rows
from refsim.experiments.verdicts import claim

OURS = ("six lists", "six lists, all on", "six lists, all on, climbing")
STACK = "ordered stack"
OTHERS = ("boxes, one list", STACK, "kd-tree, stack", "kd-tree, restart", "kd-tree, backtrack")
COSTLY = 1.5  # times the nodes with a stack: a choice of ours


def compared_claims(rows: Rows) -> Rows:
    """The same hits; fewer nodes or more."""
    own = present(rows)
    if not own:
        return []
    nodes: dict[str, dict[str, float]] = {}
    for row in own:
        nodes.setdefault(row["scene"], {})[row["structure"]] = row["nodes_per_ray"]
    return [
        claim(
            "2.1", "all structures find the same hits", "same rays",
            "triangles are equal, shadow rays hit or miss alike",
            f"{sum(row['same_hits'] for row in own)} of {len(own)} runs", all(row["same_hits"] for row in own),
        ),
        *(
            _fewer("among the best", ours, other, nodes)
            for ours in (OURS[0], OURS[2]) for other in OTHERS
        ),
        *(_fewer("faster than classical stack-based algorithms", ours, STACK, nodes) for ours in OURS),
        *(
            claim(
                "1", "restarting from the root is costly in redundant computation", f"{scene}, kd-tree",
                f"at least {COSTLY:g} times the nodes a ray that a stack takes",
                f"{table['kd-tree, restart']:g} against {table['kd-tree, stack']:g}",
                table["kd-tree, restart"] >= COSTLY * table["kd-tree, stack"],
            )
            for scene, table in nodes.items()
        ),
    ]  # fmt: skip


def _fewer(text: str, ours: str, other: str, nodes: dict[str, dict[str, float]]) -> Row:
    pairs = {scene: (table[ours], table[other]) for scene, table in nodes.items()}
    return claim(
        "6", text, f"{ours} against: {other}", "fewer nodes a ray, in every scene; depends where in some",
        "; ".join(f"{scene} {a:g} against {b:g}" for scene, (a, b) in pairs.items()),
        some([a < b for a, b in pairs.values()]),
    )  # fmt: skip
