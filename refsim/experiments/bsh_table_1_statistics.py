"""What the sixteen printed numbers of Table 1 have to do with ours: pairs, rank correlation, permutation tests.

In: rows with the four switches, `nodes_per_ray` and `published_nodes_per_ray`. A p-value is the share of seeded random
permutations of the printed numbers (the given order counted once among them) that do at least as well.

    rank correlation   Spearman's, of printed and counted nodes a ray, row labels as printed
    relabelled         the largest over the 384 ways to rename switches consistently: 4! exchanges of columns times 2⁴
                       of what is on and what is off; each random permutation is given the same choice of 384
    additive share     part of the variance that the four switches explain as independent effects; of sixteen numbers
                       without any order it is 4/15 on average
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from refsim.experiments.registry import Rows

SWITCHES = ("order", "culled", "heads", "frustum")
SEED, DRAWS, DRAWS_RELABELLED = 2010, 20_000, 4_000


def _codes(rows: Rows) -> NDArray[np.int64]:
    """0 and 1 of each row's switches, i64[n, 4]; earliest first is 1."""
    return np.array([[row["order"] == "earliest_first", *(bool(row[name]) for name in SWITCHES[1:])] for row in rows],
                    np.int64)  # fmt: skip


def effects(rows: Rows) -> Rows:
    """Each pair of rows that differ in one switch: 32, eight a switch."""
    codes = _codes(rows)
    index = {tuple(code): k for k, code in enumerate(codes.tolist())}
    found: Rows = []
    for s, name in enumerate(SWITCHES):
        for code, k in index.items():
            if code[s]:
                continue
            on = rows[index[(*code[:s], 1, *code[s + 1 :])]]
            off = rows[k]
            found.append(
                {
                    "switch": name,
                    **{other: off[other] for other in SWITCHES if other != name},
                    **{
                        f"{prefix}change_percent": round(
                            100.0 * (on[f"{prefix}nodes_per_ray"] / off[f"{prefix}nodes_per_ray"] - 1.0), 3
                        )
                        for prefix in ("", "published_")
                    },
                }
            )
    return found


def ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0, equal values the mean of their places."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return ((ends - counts + ends - 1) / 2.0)[inverse]


def _unit(values: NDArray[np.float64]) -> NDArray[np.float64]:
    ranked = ranks(values)
    ranked = ranked - ranked.mean()
    return ranked / np.linalg.norm(ranked)


def relabellings(codes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Row permutations that rename switches consistently, i64[384, 16]."""
    index = {tuple(code): k for k, code in enumerate(codes.tolist())}
    found = []
    for columns, flips in product(permutations(range(4)), product((0, 1), repeat=4)):
        found.append([index[tuple(int(code[c]) ^ f for c, f in zip(columns, flips, strict=True))] for code in codes])
    return np.array(found)


def additive_share(codes: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Part of the variance of values f64[k, 16] that independent effects of the switches explain, f64[k]."""
    signs = (2.0 * codes - 1.0) / 4.0  # orthonormal columns
    centred = values - values.mean(axis=1, keepdims=True)
    return ((centred @ signs) ** 2).sum(axis=1) / (centred**2).sum(axis=1)


def statistics(rows: Rows) -> Rows:
    """A row a statistic: what is observed, how often chance does as well, of how many draws."""
    codes = _codes(rows)
    ours = np.array([row["nodes_per_ray"] for row in rows])
    said = np.array([row["published_nodes_per_ray"] for row in rows])
    draw = np.random.default_rng(SEED)
    shuffled = np.argsort(draw.random((DRAWS, len(rows))), axis=1)
    a, b = _unit(ours), _unit(said)
    found = [_line("rank correlation", float(a @ b), b[shuffled] @ a)]
    renamed = a[relabellings(codes)]
    best = (b[shuffled[:DRAWS_RELABELLED]] @ renamed.T).max(axis=1)
    found.append(_line("rank correlation, best relabelling", float((renamed @ b).max()), best))
    chance = additive_share(codes, said[shuffled])
    found.append(_line("additive share, printed", float(additive_share(codes, said[None])[0]), chance))
    chance = additive_share(codes, ours[shuffled])
    found.append(_line("additive share, ours", float(additive_share(codes, ours[None])[0]), chance))
    return found


def _line(name: str, observed: float, chance: NDArray[np.float64]) -> dict[str, object]:
    reached = int((chance >= observed - 1e-12).sum())
    return {
        "statistic": name,
        "observed": round(observed, 4),
        "chance_mean": round(float(chance.mean()), 4),
        "p_value": round((reached + 1) / (len(chance) + 1), 5),
        "draws": len(chance),
        "seed": SEED,
    }
