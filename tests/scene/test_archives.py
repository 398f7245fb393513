"""Plan: the table of original archives fits the table of known meshes.

- Every known mesh has an archive, or is refused with the reason and its whereabouts; a wrong name is told the nearest.
- Real meshes, where they are, written as text and read back are the known bytes again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from refsim.errors import InputError
from refsim.scene.archives import ORIGINALS, UNSEEN
from refsim.scene.fetch import fetch_meshes, plain_ply
from refsim.scene.known import KNOWN_MESHES, find_mesh, is_known_file
from refsim.scene.trimesh_source import read_ply
from tests.scene.archive_server import text_ply

NAMES = {
    "buny": "did you mean bunny",
    "": "unknown mesh ''",
    "../bunny": "unknown mesh '../bunny'",
    "cornell_box": "refsim makes it itself",
    "teapot": "no original archive of it is known.*alecjacobson/common-3d-test-models",
    "happy_buda": "did you mean happy_buddha",
    "happy_buddha": "no SHA-256 of its content is known.*happy_recon/happy_vrip.ply in https://graphics.stanford.edu",
    "lucy_100k": "others changed it.*pyvista/vtk-data",
}


@pytest.mark.parametrize("name", NAMES)
def test_names_that_cannot_be_fetched(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=NAMES[name]):
        next(fetch_meshes([name], tmp_path))


@pytest.mark.parametrize("name", KNOWN_MESHES)
def test_every_known_mesh_has_an_archive_or_a_reason(name: str, tmp_path: Path) -> None:
    original = ORIGINALS.get(name)
    if original is None:
        with pytest.raises(InputError, match=f"mesh '{name}' cannot be fetched"):
            next(fetch_meshes([name], tmp_path))
    else:
        assert original.url.endswith(".ply.gz" if original.member is None else ".tar.gz")
        assert original.terms and original.credit and original.vertices < KNOWN_MESHES[name].triangles
    assert not set(UNSEEN) & set(KNOWN_MESHES)


@pytest.mark.parametrize("name", ORIGINALS)
def test_real_mesh_as_text_is_the_known_one(name: str) -> None:
    path = find_mesh(name)
    if path is None or not is_known_file(path):
        print(f"{name}: missing")  # the made-up mesh above stands for all
        return
    stored = read_ply(name, path.read_bytes())
    assert (len(stored.faces), len(stored.vertices)) == (KNOWN_MESHES[name].triangles, ORIGINALS[name].vertices)
    # Text of the large ones would take seconds, and goes the same way.
    text = stored if len(stored.faces) > 50_000 else read_ply(name, text_ply(np.float32(stored.vertices), stored.faces))
    assert plain_ply(text.vertices, text.faces) == path.read_bytes()
