"""What becomes of a fragment of an engine's pass: stencil, shader, depth, in the order of the early-test policy.

State of the pass (sections 2.1 and 5): depth test LESS with depth write; stencil EQUAL under a read mask, REPLACE
where everything passes, KEEP otherwise. The shader writes depth (t, scaled) and discards (no hit), so:

    ideal        stencil, shader, depth      failing by stencil changes nothing, so it may come first
    mesa, none   shader, stencil, depth      a shader that writes depth or discards switches early tests off
    forced       stencil, depth, shader      tests and updates first; the written depth is ignored for the primitive's 0
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refsim.counters import Counters

SHADER, STENCIL, DEPTH = "shader", "stencil", "depth"
ORDER = {
    "ideal": (STENCIL, SHADER, DEPTH),
    "mesa": (SHADER, STENCIL, DEPTH),
    "none": (SHADER, STENCIL, DEPTH),
    "forced": (STENCIL, DEPTH, SHADER),
}
FAILED = {SHADER: "fragment.discarded", STENCIL: "stencil.failed", DEPTH: "depth.failed"}
STENCIL_BITS = 8
UNORM24 = 2.0**24 - 1


@dataclass(frozen=True)
class FragmentTests:
    """Policy ("ideal" …), depth format ("depth32float-stencil8" or "depth24unorm-stencil8"), whether stencil is on."""

    policy: str
    depth_format: str
    stencil: bool

    def stored(self, z: np.ndarray) -> np.ndarray:
        """Depth as the buffer holds it: clamped to [0, 1] (NaN: 1); round(z (2^24 − 1)) in the fixed-point format."""
        clamped = np.where(z < 1, np.where(z > 0, z, np.float32(0)), np.float32(1)).astype(np.float32)
        if self.depth_format == "depth24unorm-stencil8":
            return np.floor(clamped.astype(np.float64) * UNORM24 + 0.5).astype(np.float32)
        return clamped


def stencil_masks(generation: int) -> tuple[int, int]:
    """Read and write mask of a pass: it tests the bit of the pass before and writes its own; none is left past 8."""
    read = 1 << (generation - 1) if 1 <= generation < STENCIL_BITS else 0
    write = 1 << generation if generation < STENCIL_BITS else 0
    return read, write


class Target:
    """Depth (cleared to 1), stencil (of the pass before, changed in place) and counts of one pass, a row a pixel.

    `invocations` int32[n]: shader runs a pixel.
    """

    def __init__(self, tests: FragmentTests, stencil: np.ndarray, generation: int) -> None:
        n = len(stencil)
        self.tests = tests
        self.read, self.write = stencil_masks(generation)
        self.depth = tests.stored(np.ones(n, np.float32))
        self.stencil = stencil
        self.invocations = np.zeros(n, np.int32)
        self.fragments_made = self.written = 0
        self.failed = dict.fromkeys(FAILED, 0)
        self.failed_early = {STENCIL: 0, DEPTH: 0}

    def fragments(self, rows: np.ndarray, keep: np.ndarray, z: np.ndarray) -> np.ndarray:
        """One primitive's fragments, at most one a pixel: pixels `rows`, the shader's keep and depth there.

        Returns the places in `rows` (indices) of the fragments that are written to the colour targets.
        """
        stored = self.tests.stored(np.zeros_like(z) if self.tests.policy == "forced" else z)
        passes = {
            SHADER: keep,
            STENCIL: (self.stencil[rows] & self.read) == self.read,
            DEPTH: stored < self.depth[rows],
        }
        if not self.tests.stencil:
            passes[STENCIL] = np.ones_like(keep)
        left = np.arange(len(rows))
        tested: set[str] = set()
        for stage in ORDER[self.tests.policy]:
            if stage == SHADER:
                self.invocations[rows[left]] += 1
            stays = passes[stage][left]
            lost = int(len(left) - stays.sum())
            self.failed[stage] += lost
            tested.add(stage)
            if SHADER not in tested:
                self.failed_early[stage] += lost
            left = left[stays]
            if stage != SHADER and {STENCIL, DEPTH} <= tested:
                self._update(rows[left], stored[left])
        self.fragments_made += len(rows)
        self.written += len(left)
        return left

    def _update(self, rows: np.ndarray, stored: np.ndarray) -> None:
        """Writes of the fragments that passed stencil and depth."""
        self.depth[rows] = stored
        if self.tests.stencil:
            self.stencil[rows] |= np.uint8(self.write)

    def count(self, counters: Counters) -> None:
        """Adds up what became of the fragments."""
        early = sum(self.failed_early.values())
        counters.add("raster.fragments", self.fragments_made)
        counters.add("stencil.failed_early", self.failed_early[STENCIL])
        counters.add("depth.failed_early", self.failed_early[DEPTH])
        counters.add("fragment.invocations", self.fragments_made - early)
        for stage, name in FAILED.items():
            counters.add(name, self.failed[stage])
        counters.add("fragment.written", self.written)
