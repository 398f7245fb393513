"""One ray and the best hit it has found: what the searches that the traversal lists are compared with have in common.

All in float32, with the operations of the device functions, in plain Python: same bits, same counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from refsim.reference.list_search import Walked
from refsim.reference.triangle import intersect
from refsim.reference.vector import dot

F = np.float32
LEAST = F(2.0**-26)
KAPPA = F(40 * 2.0**-24)
SMALLEST, LARGEST = F(2.0**-60), F(2.0**60)
ZERO = F(0)


@dataclass
class OneRay:
    """o, d f32[3]; `best`, the t of the hit so far or t_max; `nodes`, elements looked at, `tests` of them triangles."""

    o: np.ndarray
    d: np.ndarray
    limit: Any
    records: tuple[np.ndarray, ...]
    any_hit: bool
    front_only: bool
    best: np.float32
    triangle: int = -1
    u: np.float32 = ZERO
    v: np.float32 = ZERO
    nodes: int = 0
    tests: int = 0

    @property
    def done(self) -> bool:
        """Any hit is enough, and there is one."""
        return self.any_hit and self.triangle >= 0

    def test(self, number: int) -> None:
        """Looks at one triangle; of equal t the lower number counts."""
        v0, n, _, m1, m2, _ = (column[number] for column in self.records)
        inside, t, u, v, den = intersect(self.o, self.d, self.limit, v0, n, m1, m2)
        self.nodes, self.tests = self.nodes + 1, self.tests + 1
        nearer = t < self.best or (t == self.best and number < self.triangle)
        if inside and nearer and (den < 0 or not self.front_only):
            self.best, self.triangle, self.u, self.v = F(t), number, F(u), F(v)

    def test_each(self, numbers: Iterable[int]) -> None:
        """Looks at triangles until it is done."""
        for number in numbers:
            if self.done:
                return
            self.test(number)

    def slack(self, root: np.ndarray) -> Any:
        """κ against the root's sphere f32[4]."""
        away = root[:3] - self.o
        reach = np.sqrt(dot(away, away)) + root[3]
        return max(KAPPA * reach, SMALLEST) if reach < LARGEST else F(np.inf)

    def kept_from_zero(self) -> np.ndarray:
        """The direction, no component smaller in size than 2⁻²⁶ of the largest; what is 0 becomes positive."""
        least = LEAST * np.abs(self.d).max()
        return np.where(np.abs(self.d) > least, self.d, np.where(self.d >= 0, least, -least))


def every_ray(
    origin: np.ndarray,
    direction: np.ndarray,
    t_max: np.ndarray,
    records: tuple[np.ndarray, ...],
    any_hit: bool,
    front_only: bool,
    search: Callable[[OneRay], tuple[int, ...]],
) -> tuple[Walked, np.ndarray]:
    """Calls `search` for each live ray; what they found, and the counts it returned, i64[n, …] (dead rays: 0)."""
    found, counts = Walked.nothing(len(t_max)), []
    with np.errstate(all="ignore"):
        for i in range(len(t_max)):
            ray = OneRay(origin[i], direction[i], t_max[i], records, any_hit, front_only, t_max[i])
            counts.append(search(ray) if t_max[i] > 0 else None)
            found.nodes[i], found.tests[i] = ray.nodes, ray.tests
            if ray.triangle >= 0:
                found.triangle[i], found.t[i], found.u[i], found.v[i] = ray.triangle, ray.best, ray.u, ray.v
    width = max((len(row) for row in counts if row is not None), default=0)
    return found, np.array([row or (0,) * width for row in counts], np.int64).reshape(len(t_max), width)


def rounded_out(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners f64 as float32, not above and not below what they were."""
    with np.errstate(over="ignore"):
        near_low, near_high = low.astype(F), high.astype(F)
    return (
        np.where(near_low > low, np.nextafter(near_low, F(-np.inf)), near_low),
        np.where(near_high < high, np.nextafter(near_high, F(np.inf)), near_high),
    )
