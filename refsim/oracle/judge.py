"""Judge hits against the admissible answers: right, or wrong in which way, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refsim.errors import InputError
from refsim.oracle.admissible import Admissible, Facing, admissible
from refsim.scene.rays import Hits, Rays


class Reason(IntEnum):
    """Why an answer is or is not admissible."""

    OK = 0
    WRONG_TRIANGLE = 1  # a hit is right, but not on this triangle
    FALSE_HIT = 2  # nothing may be hit
    FALSE_MISS = 3  # something must be hit
    T_OUTSIDE = 4  # right triangle, t outside its bound or not in 0 < t < t_max
    UV_OUTSIDE = 5  # right triangle and t, u or v outside its bound
    DEAD_HIT = 6  # a dead ray reports a hit


@dataclass(frozen=True)
class Verdicts:
    """Verdicts on n rays.

    reason i8[n]: `Reason`; excess f64[n]: how wrong, 0 for admissible answers: the deviation in bounds for t, u, v
    (capped at 1e9), the margin of the true answer (at most 8) otherwise. answers: what was admissible.
    """

    reason: NDArray[np.int8]
    excess: NDArray[np.float64]
    answers: Admissible
    hits: Hits

    def __len__(self) -> int:
        return len(self.reason)

    @property
    def admissible(self) -> NDArray[np.bool_]:
        """bool[n]: the answer is one that a correct float32 implementation may give."""
        return self.reason == Reason.OK

    @property
    def ok(self) -> bool:
        """Whether every answer is admissible."""
        return bool(self.admissible.all())

    @property
    def counts(self) -> dict[Reason, int]:
        """Number of rays for every reason, zeros included."""
        return {reason: int(np.count_nonzero(self.reason == reason)) for reason in Reason}

    def worst(self) -> str:
        """Tell the most clear-cut offender in one sentence, or that there is none."""
        return self.tell(int(np.argmax(np.where(self.admissible, -1.0, self.excess)))) if len(self) else self.tell(-1)

    def first(self) -> str:
        """Tell the offender of lowest ray index in one sentence, or that there is none."""
        return self.tell(int(np.argmax(~self.admissible))) if len(self) else self.tell(-1)

    def tell(self, ray: int) -> str:
        """Say in one sentence what is wrong with one ray, how many share its fault, and what would be right."""
        if ray < 0:
            return "There are no rays."
        reason = Reason(int(self.reason[ray]))
        if reason == Reason.OK:
            return f"All {len(self)} answers are admissible." if self.ok else f"Ray {ray} is admissible."
        share = self.counts[reason]
        found = (f"triangle {self.hits.triangle[ray]} at t = {self.hits.t[ray]:.9g}, u = {self.hits.u[ray]:.9g}, "
                 f"v = {self.hits.v[ray]:.9g}" if self.hits.triangle[ray] >= 0 else "a miss")
        return (f"Ray {ray} ({reason.name.lower().replace('_', ' ')}, {share} of {len(self)} rays): reported {found}; "
                f"{self._right(ray, reason)}.")

    def _right(self, ray: int, reason: Reason) -> str:
        """Say what would have been admissible."""
        a = self.answers
        if reason == Reason.DEAD_HIT:
            return "the ray is dead and must miss"
        if reason in (Reason.T_OUTSIDE, Reason.UV_OUTSIDE):
            k = int(a.rows(self.hits.triangle)[ray])
            return (f"t must be in [{a.t_low[k]:.9g}, {a.t_high[k]:.9g}] and between 0 and t_max, "
                    f"u within {a.u_bound[k]:.2g} of {a.u[k]:.9g}, v within {a.v_bound[k]:.2g} of {a.v[k]:.9g} "
                    f"(off by {self.excess[ray]:.3g} bounds)")
        listed = [f"triangle {a.triangles[k]} at t = {a.t_float64[k]:.9g} ± {a.t_bound[k]:.2g}"
                  for k in range(a.offsets[ray], min(a.offsets[ray + 1], a.offsets[ray] + 3))]
        more = a.offsets[ray + 1] - a.offsets[ray] - len(listed)
        listed += [f"{more} more"] if more > 0 else []
        listed += ["a miss"] if a.miss[ray] else []
        return f"admissible is {' or '.join(listed)} (margin {a.margin[ray]:.3g} bounds)"


def judge(
    scene: Any, rays: Rays, hits: Hits, *, any_hit: bool = False, facing: Facing = "both", watertight: bool = False,
    threads: int | None = None, answers: Admissible | None = None,
) -> Verdicts:
    """Judge the hits of these very rays.

    any_hit: only hit or miss is judged; a hit needs a triangle that may be accepted, a miss none that must be.
    facing, watertight, threads: as for `admissible`; answers: its result for the same rays and options, if at hand.
    Raises InputError when hits and rays differ in number.
    """
    if len(hits.triangle) != len(rays):
        raise InputError(f"there are {len(hits.triangle)} hits for {len(rays)} rays, one per ray is needed")
    if answers is None:
        answers = admissible(scene, rays, facing=facing, watertight=watertight, threads=threads)
    n = len(rays)
    reason, excess = np.zeros(n, np.int8), np.zeros(n)
    hit = np.asarray(hits.triangle) >= 0
    some = np.diff(answers.offsets) > 0
    reason[~hit & ~answers.miss] = Reason.FALSE_MISS
    reason[hit & ~some] = Reason.FALSE_HIT
    if not any_hit:
        row = answers.rows(np.asarray(hits.triangle))
        reason[hit & some & (row < 0)] = Reason.WRONG_TRIANGLE
        _judge_numbers(answers, rays, hits, row, reason, excess)
    reason[hit & answers.dead] = Reason.DEAD_HIT
    other = (reason != Reason.OK) & (excess == 0.0)
    excess[other] = answers.margin[other]
    return Verdicts(reason, excess, answers, hits)


def _judge_numbers(
    a: Admissible, rays: Rays, hits: Hits, row: NDArray[np.int64], reason: NDArray[np.int8], excess: NDArray[np.float64]
) -> None:
    """Compare t, u and v of the hits on admissible triangles with their bounds; NaN is outside."""
    at = np.flatnonzero(row >= 0)
    k = row[at]
    t, u, v = (np.asarray(x)[at].astype(np.float64) for x in (hits.t, hits.u, hits.v))
    good = (t >= a.t_low[k]) & (t <= a.t_high[k]) & (t > 0.0) & (t < rays.t_max[at])
    near = (np.abs(u - a.u[k]) <= a.u_bound[k]) & (np.abs(v - a.v[k]) <= a.v_bound[k]) & np.isfinite(u) & np.isfinite(v)
    reason[at[~near]] = Reason.UV_OUTSIDE
    reason[at[~good]] = Reason.T_OUTSIDE
    with np.errstate(all="ignore"):
        off_t = np.abs(t - a.t_float64[k]) / a.t_bound[k]
        off_uv = np.maximum(np.abs(u - a.u[k]) / a.u_bound[k], np.abs(v - a.v[k]) / a.v_bound[k])
    off = np.where(good, off_uv, off_t)
    excess[at] = np.where(good & near, 0.0, np.nan_to_num(off, nan=1e9, posinf=1e9))
