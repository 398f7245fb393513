"""The recursive ray tracer in the geometry shader made ready on refsim and on OpenGL, so that a call draws and no more.

`Ours` is steps 2 to 6 of the paper's section 3 and the blending passes, with the pipeline's counters and the cells,
tests and box rejections of every ray; sums of these and shares by kind are made by `refsim.trace`, which is timed too.
`Theirs` is the same in GLSL, without counters, until glFinish returns.
"""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np

from refsim import Rays, Scene
from refsim.counters import Counters
from tests.opengl import geometry_shader_rays_glsl as glsl
from tests.opengl.geometry_shader_rays import Port
from tests.opengl.geometry_shader_rays_passes import tracer_of
from tests.opengl.witness import Witness

THREADS = 2
STORAGES = glsl.STORAGES

# Builds the grid of a scene after that of a small one, so that everything is compiled; then traces. Prints seconds of
# the build, and the process's largest memory in GB before the build, after it and after the trace.
DRAGON = """
import sys, time
from refsim import load_scene, trace
from refsim.experiments.gsr_runs import MODES, rays_of, scene_of
from refsim.papers.geometry_shader_rays.grid import grid
from refsim.papers.geometry_shader_rays.setup import reach_of

def most():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1024 / 1e9

name = sys.argv[1]
grid(load_scene("torus_knot_128"), None, 1.0, threads=2)
scene, rays = scene_of(name), rays_of(name, 512)
before, seconds = most(), []
for _ in range(3):
    start = time.perf_counter()
    made = grid(scene, None, reach_of(scene, rays), threads=2)
    seconds.append(time.perf_counter() - start)
after = most()
trace("geometry_shader", scene, rays, acceleration=made, threads=2, **MODES["RT"])
print(min(seconds), before, after, most())
"""


class Ours:
    """A picture on refsim."""

    def __init__(self, scene: Scene, rays: Rays, mode: dict[str, Any]) -> None:
        self.rays = rays
        self.tracer = tracer_of(scene, rays, acceleration="grid", threads=THREADS, **mode)
        self.image = np.empty(0)

    def __call__(self) -> Counters:
        counters = Counters()
        self.image = self.tracer.draw_passes(self.rays, counters)
        return counters

    def picture(self) -> np.ndarray:
        """The image f32[h, w, 3]."""
        return np.moveaxis(self.image[:3], 0, 2)


class Theirs:
    """A picture on OpenGL; `close` when done."""

    def __init__(self, witness: Witness, ours: Ours, storage: str) -> None:
        self.gl, self.port = witness.gl, Port(witness, ours.tracer, ours.rays, storage)
        self.picture, self.close = self.port.picture, self.port.close

    def __call__(self) -> None:
        self.port.draw()
        self.gl.glFinish()


def grid_and_memory(view: str) -> tuple[float, ...]:
    """What `DRAGON` prints, from a process of its own."""
    done = subprocess.run([sys.executable, "-c", DRAGON, view], check=True, stdout=subprocess.PIPE, text=True)
    return tuple(float(word) for word in done.stdout.split())
