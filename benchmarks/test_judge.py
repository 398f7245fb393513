"""Plan: how long the judge takes for 262,144 rays on the bunny's 69,451 triangles (or a knot of about as many)."""

from __future__ import annotations

import refsim
from refsim.oracle import admissible
from tests.scenes_present import real_scene


def test_judge(benchmark, report) -> None:
    """Target: 60 s, preparation included."""
    bunny = real_scene("bunny")
    scene = bunny if bunny is not None else refsim.load_scene("torus_knot_69696")
    rays = refsim.camera_rays(scene, 512, 512)
    answers = benchmark.pedantic(lambda: admissible(scene, rays, threads=2), rounds=3)
    name = scene.name if bunny is not None else f"bunny missing, {scene.name} instead"
    report(
        f"judge, {len(rays):,} rays on {len(scene):,} triangles ({name}): at most {benchmark.stats.stats.max:.1f} s "
        f"(target 60), {(answers.closest >= 0).mean():.0%} hit"
    )
