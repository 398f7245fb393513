"""Traces of ray trees compared bit for bit: rays, hits, rows, costs, counters, buffers and the image."""

from __future__ import annotations

from refsim.counters import Counters
from refsim.results import Trace
from tests.hre.bits import HIT_COLUMNS, RAY_COLUMNS, same_bits

ROW_COLUMNS = ("alive", "kind", "pixel", "parent", "node", "light", "weight")
SHADER_WORK = (".arithmetic", ".fetches")


def _counts(place: str, a: Counters, b: Counters) -> list[str]:
    """What was never counted counts 0, as in `Counters`; the reference has no shaders whose source it could count."""
    names = [name for name in {**a, **b} if not name.endswith(SHADER_WORK)]
    return [f"{place} {name}: {a[name]}, {b[name]}" for name in names if a[name] != b[name]]


def tree_differences(a: Trace, b: Trace) -> list[str]:
    """Where two traces of trees differ, in any bit or count. Empty if nowhere."""
    if len(a.generations) != len(b.generations):
        return [f"{len(a.generations)} generations, {len(b.generations)}"]
    found = []
    for k, (x, y) in enumerate(zip(a.generations, b.generations, strict=True)):
        pairs = [(name, getattr(x.rays, name), getattr(y.rays, name)) for name in RAY_COLUMNS]
        pairs += [(name, getattr(x.hits, name), getattr(y.hits, name)) for name in HIT_COLUMNS]
        pairs += [(name, getattr(x, name), getattr(y, name)) for name in ROW_COLUMNS]
        pairs += [(name, x.per_ray[name], y.per_ray[name]) for name in {**x.per_ray, **y.per_ray}]
        found += [f"generation {k} {name}" for name, one, two in pairs if not same_bits(one, two)]
        for name in ("occupancy", "parent_generation"):
            one, two = getattr(x, name), getattr(y, name)
            found += [f"generation {k} {name}: {one}, {two}"] if one != two else []
        found += _counts(f"generation {k}", x.counters, y.counters)
    found += _counts("total", a.counters, b.counters)
    names = {**a.per_ray, **b.per_ray}
    found += [f"per_ray {name}" for name in names if not same_bits(a.per_ray[name], b.per_ray[name])]
    assert a.image is not None and b.image is not None
    return found + ([] if same_bits(a.image, b.image) else ["image"])
