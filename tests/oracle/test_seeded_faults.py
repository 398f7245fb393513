"""Plan: every realistic fault is found, on the ray where it happens, under its own reason, and told in one sentence.
Faults: second closest, t_max ignored, triangle id off by one, t scaled by 1 + 1e-4, a triangle missed in its middle,
a hit on a zero-area triangle, t < 0 accepted, facing ignored, u and v swapped, v off, NaN, dead rays that hit.
Control: the same rays unharmed are admissible, so the accusation is the fault's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from refsim.errors import InputError
from refsim.oracle import Reason, admissible, bodies_of, judge
from refsim.scene.rays import Hits, Rays
from tests.oracle import cases, ports

TRI = cases.sphere()
RAYS = cases.camera(TRI, 48, 48)
GOOD = ports.trace("plane", TRI, RAYS)
ANSWERS = admissible(TRI, RAYS)
# Rays whose true answer is beyond doubt: there every fault must be seen.
CLEAR = (ANSWERS.margin >= 4.0) & (ANSWERS.closest >= 0)


def ordered(depth_rank: int) -> Hits:
    """The hit of that rank in depth, a miss where there is none."""
    t, u, v, _ = ports.everything("plane", TRI, RAYS)
    ok = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    k = np.where(ok, t, np.inf).argsort(axis=1)[:, depth_rank]
    r = np.arange(len(RAYS))
    hit = ok[r, k]
    return Hits(np.where(hit, k, -1).astype(np.int32), np.where(hit, t[r, k], np.inf).astype("f4"), u[r, k], v[r, k])


def drop_middle(hits: Hits) -> Hits:
    gone = CLEAR & (np.minimum(hits.u, hits.v) > 0.2)
    return replace(hits, triangle=np.where(gone, -1, hits.triangle).astype(np.int32))


FAULTS = {
    "second closest": (lambda h: ordered(1), Reason.WRONG_TRIANGLE, CLEAR),
    "id off by one": (
        lambda h: replace(h, triangle=np.where(h.triangle >= 0, (h.triangle + 1) % len(TRI), -1)),
        Reason.WRONG_TRIANGLE,
        CLEAR,
    ),
    "id past the end": (
        lambda h: replace(h, triangle=np.where(h.triangle >= 0, h.triangle + len(TRI), -1)),
        Reason.WRONG_TRIANGLE,
        CLEAR,
    ),
    "t scaled": (
        lambda h: replace(h, t=h.t * np.float32(1 + 1e-4)),
        Reason.T_OUTSIDE,
        CLEAR & (ANSWERS.conditioning < 5),
    ),
    "t is NaN": (lambda h: replace(h, t=h.t * np.float32(np.nan)), Reason.T_OUTSIDE, CLEAR),
    "v off by 0.002": (
        lambda h: replace(h, v=h.v + np.float32(2e-3)),
        Reason.UV_OUTSIDE,
        CLEAR & (ANSWERS.conditioning < 5),
    ),
    "u is NaN": (lambda h: replace(h, u=h.u * np.float32(np.nan)), Reason.UV_OUTSIDE, CLEAR),
    "missed in the middle": (drop_middle, Reason.FALSE_MISS, CLEAR & (np.minimum(GOOD.u, GOOD.v) > 0.2)),
    "hit everywhere": (
        lambda h: replace(h, triangle=np.maximum(h.triangle, 0)),
        Reason.FALSE_HIT,
        (ANSWERS.closest < 0) & (ANSWERS.margin >= 4.0),
    ),
}


def test_control_unharmed_hits_are_admissible():
    assert judge(TRI, RAYS, GOOD, answers=ANSWERS).ok


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_found_on_every_clear_ray(name):
    harm, reason, where = FAULTS[name]
    verdicts = judge(TRI, RAYS, harm(GOOD), answers=ANSWERS)
    assert where.sum() > 50
    assert (verdicts.reason[where] == reason).all()
    assert verdicts.counts[reason] >= where.sum()
    told = verdicts.worst()
    assert told.count("\n") == 0 and reason.name.lower().replace("_", " ") in told
    assert f"Ray {np.flatnonzero(~verdicts.admissible)[0]} " in verdicts.first()


def test_t_max_ignored_is_found():
    short = Rays(RAYS.origin, RAYS.direction, np.where(ANSWERS.closest >= 0, GOOD.t * np.float32(0.999), np.inf))
    verdicts = judge(TRI, short, GOOD)
    assert (verdicts.reason[CLEAR] == Reason.FALSE_HIT).all()
    assert judge(TRI, short, ports.trace("plane", TRI, short)).ok


def test_negative_t_accepted_is_found():
    away = Rays(RAYS.origin, -RAYS.direction, RAYS.t_max)
    backward = replace(GOOD, t=-GOOD.t)
    verdicts = judge(TRI, away, backward)
    assert (verdicts.reason[CLEAR] == Reason.FALSE_HIT).all()
    assert judge(TRI, away, Hits.misses(len(away))).ok


def test_facing_ignored_is_found():
    inside = cases.rays(np.random.default_rng(1), TRI, 400, "free")
    inside = Rays(np.zeros_like(inside.origin), inside.direction, inside.t_max)
    hits = ports.trace("plane", TRI, inside)
    assert judge(TRI, inside, hits).ok
    verdicts = judge(TRI, inside, hits, facing="front")
    assert (verdicts.reason[hits.triangle >= 0] == Reason.FALSE_HIT).all()


def test_hit_on_a_zero_area_triangle_is_found():
    line = np.array([[[-1, 0, 0], [0, 0, 0], [1, 0, 0]]], np.float32)
    rays = Rays(np.array([[0.5, 0, 2]]), np.array([[0, 0, -1]]))
    hit = Hits(np.zeros(1, np.int32), np.array([2], "f4"), np.zeros(1, "f4"), np.zeros(1, "f4"))
    assert judge(line, rays, hit).reason[0] == Reason.FALSE_HIT
    below = np.concatenate([line, np.array([[[-3, -3, -1], [3, -3, -1], [0, 3, -1]]], np.float32)])
    assert judge(below, rays, hit).reason[0] == Reason.WRONG_TRIANGLE


def test_dead_ray_must_miss():
    rays = Rays(np.array([[0, 0, 5.0], [0, 0, 5.0]]), np.array([[0, 0, 0.0], [0, 0, -1.0]]), np.array([0.0, 0.0]))
    hit = Hits(np.full(2, 3, np.int32), np.full(2, 4, "f4"), np.full(2, 0.3, "f4"), np.full(2, 0.3, "f4"))
    for any_hit in (False, True):
        assert (judge(TRI, rays, hit, any_hit=any_hit).reason == Reason.DEAD_HIT).all()
    assert judge(TRI, rays, Hits.misses(2)).ok


def test_any_hit_judges_hit_or_miss_only():
    second = ordered(1)
    assert not judge(TRI, RAYS, second, answers=ANSWERS).ok
    found = replace(GOOD, triangle=np.where(GOOD.triangle >= 0, 0, -1).astype(np.int32))
    assert judge(TRI, RAYS, found, any_hit=True, answers=ANSWERS).ok
    verdicts = judge(TRI, RAYS, Hits.misses(len(RAYS)), any_hit=True, answers=ANSWERS)
    assert (verdicts.reason[CLEAR] == Reason.FALSE_MISS).all()
    verdicts = judge(TRI, RAYS, replace(GOOD, triangle=np.zeros(len(RAYS), np.int32)), any_hit=True, answers=ANSWERS)
    assert (verdicts.reason[(ANSWERS.closest < 0) & (ANSWERS.margin > 2)] == Reason.FALSE_HIT).all()


def test_bad_calls_are_named():
    with pytest.raises(InputError, match="hits for"):
        judge(TRI, RAYS, Hits.misses(3))
    with pytest.raises(InputError, match="facing"):
        admissible(TRI, RAYS, facing="back")
    with pytest.raises(InputError, match="float32"):
        bodies_of(TRI.astype(float))
