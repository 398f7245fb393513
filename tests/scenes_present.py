"""Which real meshes are at hand: tests ask here instead of skipping, and their rows read `missing` where one is not.

The meshes lie in the folder that REFSIM_SCENES names. Nothing stands in for a mesh that is absent.
"""

from __future__ import annotations

from functools import cache

from refsim.scene import Scene, load_scene, missing_meshes
from refsim.scene.known import KNOWN_MESHES, find_mesh, is_known_file

__all__ = ["absent", "present", "real_scene"]


@cache
def real_scene(name: str) -> Scene | None:
    """The real mesh of that name, byte for byte the one that is known; None where it is missing or another file."""
    if name not in KNOWN_MESHES:
        raise KeyError(f"{name} is none of the real meshes: {', '.join(KNOWN_MESHES)}")
    path = find_mesh(name)
    return load_scene(name) if path is not None and is_known_file(path) else None


def present() -> list[str]:
    """Names of the real meshes that are at hand."""
    return [name for name in KNOWN_MESHES if name not in missing_meshes()]


def absent() -> list[str]:
    """Names of the real meshes that are not, for a summary."""
    return missing_meshes()
