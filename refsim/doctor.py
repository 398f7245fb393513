"""What refsim finds on a machine: versions, processor, kernel cache, meshes, tools.

``examine()`` returns plain values that JSON can hold; ``rows()`` lays them out for reading. Only ``problems`` call for
action: a run-time package that is not there, no directory that can keep compiled kernels, a REFSIM_SCENES that names
no folder. A real mesh, a tool or an OpenGL that is absent is a fact, not a problem.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import platform
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

# What pyproject.toml asks for, and what that brings along and refsim uses too
PACKAGES = (
    "numpy", "numba", "llvmlite", "scipy", "trimesh", "matplotlib", "pillow", "rich", "click", "joblib", "jinja2",
    "markupsafe",
)  # fmt: skip
TOOLS = {"gcc": "builds the C loop that benchmarks compare with"}


def examine() -> dict[str, Any]:
    """Everything there is to say, with ``problems`` as sentences."""
    import refsim

    packages = {name: installed_version(name) for name in PACKAGES}
    cache = kernel_cache()
    problems = [f"the package {name} is not installed" for name, version in packages.items() if version is None]
    if not cache["writable"]:
        problems.append("no directory can keep compiled kernels; set NUMBA_CACHE_DIR to one that can be written")
    found = meshes()
    if found["folder"] is not None and not Path(found["folder"]).is_dir():
        problems.append(f"REFSIM_SCENES names {found['folder']!r}, which is not a folder")
    return {
        "refsim": refsim.__version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "packages": packages,
        "processor": processor(),
        "kernel_cache": cache,
        "scenes": found,
        "tools": {name: shutil.which(name) for name in TOOLS},
        "opengl_witness": opengl_witness(),
        "problems": problems,
    }


def installed_version(package: str) -> str | None:
    """The version of an installed distribution, found without importing it; None if there is none."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def processor() -> dict[str, Any]:
    """Model name, the cores this process may use, and the threads that kernels run on unless told otherwise."""
    model = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text(errors="replace").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"model": model or "unknown", "cores": cores, "threads": kernel_threads()}


def kernel_threads() -> int | None:
    """The number of threads numba starts with, None without numba."""
    try:
        from numba import config
    except ImportError:
        return None
    return int(config.NUMBA_NUM_THREADS)


def kernel_cache() -> dict[str, Any]:
    """Where compiled kernels are kept between processes; numba itself is asked, by the rules it caches by."""
    try:
        from numba.core.caching import FunctionCache
    except ImportError:
        return {"directory": None, "writable": False}
    try:
        # Locating a cache makes its directory and writes a trial file in it.
        return {"directory": FunctionCache(examine).cache_path, "writable": True}
    except (RuntimeError, OSError):
        return {"directory": os.environ.get("NUMBA_CACHE_DIR"), "writable": False}


def meshes() -> dict[str, Any]:
    """The folder of real meshes; which known ones it holds, which it lacks, and which are not the known file."""
    from refsim.scene.known import KNOWN_MESHES, find_mesh, is_known_file, scenes_folder

    folder = scenes_folder()
    found = {name: find_mesh(name) for name in KNOWN_MESHES}
    different = [name for name, path in found.items() if path and not is_known_file(path)]
    return {
        "folder": None if folder is None else str(folder),
        "present": [name for name, path in found.items() if path and name not in different],
        "missing": [name for name, path in found.items() if not path],
        "different": different,
    }


def scenes() -> dict[str, Any]:
    """Everything that has a name: the library, what lies in the folder of real meshes, and what is missing there."""
    from refsim.scene.library import LIBRARY
    from refsim.scene.load import missing_meshes, scene_names

    names = scene_names()
    return {
        "library": [
            {"name": name, "triangles": entry.triangles, "any_size": entry.ideal is not None}
            for name, entry in LIBRARY.items()
        ],
        "meshes": [{"name": name, "triangles": count} for name, count in names.items() if name not in LIBRARY],
        "missing": missing_meshes(),
    }


def opengl_witness() -> dict[str, Any]:
    """The OpenGL that tests/opengl compares with: renderer and version, or the reason why there is none."""
    found: dict[str, Any] = {"present": False, "renderer": None, "version": None, "reason": None}
    try:
        context = importlib.import_module("moderngl").create_standalone_context(backend="egl", require=450)
    except ImportError:
        return {**found, "reason": "the package moderngl is not installed"}
    except Exception as error:  # what a driver says when it cannot start is of many types
        return {**found, "reason": f"no OpenGL 4.5 through EGL: {error}"}
    renderer, version = context.info["GL_RENDERER"], context.info["GL_VERSION"]
    context.release()
    return {**found, "present": True, "renderer": renderer, "version": version}


def witness_row(found: Mapping[str, Any]) -> str:
    """What :func:`opengl_witness` found, in words."""
    return f"{found['renderer']}, {found['version']}" if found["present"] else f"absent ({found['reason']})"


def rows(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What :func:`examine` found, as names and values for reading."""
    cpu, cache, found = report["processor"], report["kernel_cache"], report["scenes"]
    return [
        ("refsim", report["refsim"]),
        ("python", f"{report['python']}, {report['system']}"),
        *((name, version or "missing") for name, version in report["packages"].items()),
        ("processor", f"{cpu['model']}, {cpu['cores']} cores, {cpu['threads']} threads"),
        ("kernel cache", f"{cache['directory']}" if cache["writable"] else "none that can be written"),
        *mesh_rows(found),
        *((name, f"{path or 'missing'} ({TOOLS[name]})") for name, path in report["tools"].items()),
        ("OpenGL witness", witness_row(report["opengl_witness"])),
        *(("problem", sentence) for sentence in report["problems"]),
    ]


def mesh_rows(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What :func:`meshes` found, as names and values for reading."""
    from refsim.scene.known import cache_folder

    return [
        ("REFSIM_SCENES", found["folder"] or f"not set; meshes are looked for in {cache_folder()}"),
        ("meshes present", listed(found["present"])),
        ("meshes missing", listed(found["missing"])),
        ("meshes different", listed(found["different"])),
    ]


def scene_rows(listing: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What :func:`scenes` found, as names and values for reading."""
    return [
        *((entry["name"], described(entry)) for entry in (*listing["library"], *listing["meshes"])),
        *((name, "missing") for name in listing["missing"]),
    ]


def described(entry: Mapping[str, Any]) -> str:
    """How many triangles a scene has, and how to ask for another number if it can have one."""
    told = "a mesh" if entry["triangles"] is None else f"{entry['triangles']:,} triangles"
    return f"{told}; {entry['name']}_N has N" if entry.get("any_size") else told


def listed(names: Sequence[str]) -> str:
    """Names in one line, ``none`` for no names."""
    return ", ".join(names) or "none"
