"""Scenes and rays: what a method is given. NumPy only; trimesh and Pillow are imported when a file needs them."""

from refsim.scene.camera import camera_frame, camera_rays
from refsim.scene.environment import (
    CHECKER,
    SKY,
    Checker,
    Environment,
    Equirectangular,
    Sky,
    Uniform,
    load_environment,
)
from refsim.scene.lenses import fisheye_rays, thin_lens_rays
from refsim.scene.library import library_scene
from refsim.scene.light import PointLight
from refsim.scene.load import load_scene, missing_meshes, scene_names
from refsim.scene.material import DIFFUSE, GLASS, MIRROR, Material
from refsim.scene.mesh import Scene
from refsim.scene.rays import Hits, Rays

__all__ = [
    "CHECKER",
    "DIFFUSE",
    "GLASS",
    "MIRROR",
    "SKY",
    "Checker",
    "Environment",
    "Equirectangular",
    "Hits",
    "Material",
    "PointLight",
    "Rays",
    "Scene",
    "Sky",
    "Uniform",
    "camera_frame",
    "camera_rays",
    "fisheye_rays",
    "library_scene",
    "load_environment",
    "load_scene",
    "missing_meshes",
    "scene_names",
    "thin_lens_rays",
]
