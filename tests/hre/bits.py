"""Two traces compared bit for bit, and sentences on where they differ."""

from __future__ import annotations

import numpy as np

from refsim.results import Cones, Generation, Trace

RAY_COLUMNS = ("origin", "direction", "t_max")
HIT_COLUMNS = ("triangle", "t", "u", "v")
CONE_COLUMNS = ("apex", "axis", "half_angle", "state", "slack")


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal shape, dtype and bits; any NaN equals any NaN."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype != b.dtype or a.shape != b.shape:
        return False
    if a.dtype.kind != "f":
        return bool((a == b).all())
    bits = np.dtype(f"u{a.dtype.itemsize}")
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return bool(((a.view(bits) == b.view(bits)) | (np.isnan(a) & np.isnan(b))).all())


def _columns(place: str, a: object, b: object, names: tuple[str, ...]) -> list[str]:
    found = []
    for name in names:
        x, y = getattr(a, name), getattr(b, name)
        if not same_bits(x, y):
            shapes = f"{x.dtype}{list(x.shape)}, {y.dtype}{list(y.shape)}"
            rows = f"{int((x != y).sum())} values of {x.size}" if x.shape == y.shape else shapes
            found.append(f"{place} {name}: {rows}")
    return found


def _counts(place: str, a: object, b: object) -> list[str]:
    x, y = dict(a), dict(b)  # type: ignore[call-overload]
    return [f"{place} {name}: {x.get(name)}, {y.get(name)}" for name in {**x, **y} if x.get(name) != y.get(name)]


def _generation(k: int, a: Generation, b: Generation, counters: bool) -> list[str]:
    place = f"generation {k}"
    found = _columns(f"{place} rays", a.rays, b.rays, RAY_COLUMNS)
    found += _columns(f"{place} hits", a.hits, b.hits, HIT_COLUMNS)
    found += _columns(f"{place} next rays", a.next_rays, b.next_rays, RAY_COLUMNS)
    found += _columns(place, a, b, ("alive", "kind", "pixel", "parent", "next_kind"))
    if counters:
        found += _counts(f"{place} counter", a.counters, b.counters)
        if a.per_ray.keys() != b.per_ray.keys() or not all(same_bits(a.per_ray[n], b.per_ray[n]) for n in a.per_ray):
            found.append(f"{place} per_ray")
        if isinstance(a.cones, Cones) and isinstance(b.cones, Cones):
            found += _columns(f"{place} cones", a.cones, b.cones, CONE_COLUMNS)
            sizes = [(cones.width, cones.height, cones.tile_size) for cones in (a.cones, b.cones)]
            found += [f"{place} cones: {sizes[0]} and {sizes[1]}"] if sizes[0] != sizes[1] else []
        elif (a.cones is None) != (b.cones is None):
            found.append(f"{place} cones: only one has any")
    return found


def differences(a: Trace, b: Trace, *, counters: bool = True) -> list[str]:
    """Where two traces differ: rays and hits of all generations and the exit rays; with `counters` also every count and
    the cones. Empty if nowhere."""
    if len(a.generations) != len(b.generations):
        return [f"{len(a.generations)} generations, {len(b.generations)}"]
    found = []
    for k, (x, y) in enumerate(zip(a.generations, b.generations, strict=True)):
        found += _generation(k, x, y, counters)
    found += _columns("exit rays", a.exit_rays, b.exit_rays, RAY_COLUMNS)
    if counters:
        found += _counts("total", a.counters, b.counters)
        found += [f"total per_ray {n}" for n in a.per_ray if not same_bits(a.per_ray[n], b.per_ray[n])]
    return found
