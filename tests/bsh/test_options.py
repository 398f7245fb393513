"""Options of the method: what they mean together, and what is refused in one sentence.

Plan
- Values that no option has: refused by name, with the values there are. Layers that the scene does not have.
- Lists, heads and facing that do not fit each other are refused by both searches. Screen cells need an image.
- generations, ior, material, shading as in every other method (same bits as brute force).
- On the command line: options reach the method; a bad one exits with 2 and one line.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import refsim
from refsim import InputError
from refsim.cli import main
from refsim.papers.sphere_hierarchy.hierarchy import build_hierarchy
from refsim.papers.sphere_hierarchy.lists import build_lists
from refsim.papers.sphere_hierarchy.search import search
from refsim.papers.sphere_hierarchy.shader_search import shader_search
from tests.bsh.traced import bits, eye_rays, mixed, traced, wild_rays


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"lists": 4}, "lists is 4; it must be one of 1, 2, 6, 8"),
        ({"lists": np.array([1, 6])}, "lists is array"),
        ({"lists": [6]}, "lists is \\[6\\]"),
        ({"order": "first"}, "order is 'first'"),
        ({"culling": "sextant"}, "culling is 'sextant'"),
        ({"heads": "clever"}, "heads is 'clever'"),
        ({"head_rule": "root"}, "head_rule is 'root'"),
        ({"screen_cells": 0}, "screen_cells is 0; it must be a whole number from 1 to 1024"),
        ({"screen_cells": 2.5}, "screen_cells is 2.5"),
        ({"packet": 1}, "packet is 1; it must be one of True, False"),
        ({"threshold": 0.0}, "threshold is 0.0; it must be a number above 0 and at most 1"),
        ({"threshold": 1.5}, "threshold is 1.5"),
        ({"layers": (0,)}, "layers is \\(0,\\)"),
        ({"layers": "60"}, "layers is '60'"),
        ({"layers": (40, 40)}, "rows must ascend from 1 to 101"),
        ({"layers": (60, 30)}, "rows must ascend"),
        ({"layers": (102,)}, "rows must ascend"),
        ({"shadows": "yes"}, "shadows is 'yes'"),
        ({"stage": "geometry"}, "stage is 'geometry'"),
        ({"tile_size": 8}, "has no option 'tile_size'"),
        ({"generations": 0}, "generations is 0"),
    ],
    ids=str,
)
def test_refusals(options: dict[str, Any], sentence: str) -> None:
    assert len(mixed()) == 102
    with pytest.raises(InputError, match=sentence):
        traced(mixed(), eye_rays(), **options)


def test_screen_cells_need_an_image() -> None:
    with pytest.raises(InputError, match="screen_cells"):
        traced(mixed(), wild_rays(mixed(), 20, 1), screen_cells=4)


def test_a_scene_that_is_one_point_has_no_heads() -> None:
    point = refsim.Scene([[[1, 2, 3]] * 3] * 2, "point")
    for backend in ("numba", "numpy"):
        trace = traced(point, eye_rays()[:4], heads="regular", backend=backend)
        assert (trace.hits.triangle == -1).all()


@pytest.mark.parametrize("shoot", [search, shader_search], ids=["search", "shader_search"])
def test_shots_that_do_not_fit_are_refused(shoot: Any) -> None:
    tree = build_hierarchy(mixed())
    lists, culled = build_lists(tree), build_lists(tree, 6, culling="sextant_safe")
    rays = eye_rays()[:4]
    for layers, options, sentence in (
        (lists, {}, "layers must be a list of TraversalLists, one a layer, not TraversalLists"),
        ([lists], {"facing": "back"}, "facing is 'back'; it must be one of 'both', 'front'"),
        ([culled], {}, "culling='sextant_safe' needs facing='front'"),
        ([lists], {"starts": []}, "starts are of 0 layers, and there are 1"),
        ([lists], {"starts": [np.zeros(3, np.int32)]}, "must be int32\\[4\\], one element a ray"),
        ([lists], {"starts": [np.zeros(4)]}, "must be int32\\[4\\], one element a ray"),
        ([lists], {"starts": [np.full(4, -1, np.int32)]}, "from 0 on"),
    ):
        with pytest.raises(InputError, match=sentence):
            shoot(layers, rays, **options)


def test_layers_in_any_form() -> None:
    one = traced(mixed(), eye_rays(), layers=60)
    assert bits(one) == bits(traced(mixed(), eye_rays(), layers=[60])) == bits(traced(mixed(), eye_rays()))
    assert one.options["layers"] == (60,)


@pytest.mark.parametrize(
    "options",
    [{"ior": 0.7}, {"shading": "smooth"}, {"material": "mirror"}, {"generations": 2}, {"facing": "front"}],
    ids=str,
)
def test_shared_options_mean_what_they_mean_elsewhere(options: dict[str, Any]) -> None:
    ours = traced(mixed(), eye_rays(), heads="regular", screen_cells=3, **options)
    brute = refsim.trace("brute_force", mixed(), eye_rays(), **{"generations": 4, **options})
    assert bits(ours) == bits(brute)


def run(*arguments: str) -> int:
    return main(["render", "traversal_list", "cubes", "--size", "16", *arguments])


def test_the_command_line_reaches_the_method(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = {
        "lists": "8", "order": "latest_last", "culling": "octant", "facing": "front", "heads": "simple",
        "head-rule": "climb", "screen-cells": "4", "threshold": "0.4", "layers": "100,200", "generations": "2",
    }  # fmt: skip
    words = [word for name, value in given.items() for word in (f"--{name}", value)]
    assert run(*words, "--shadows", "--no-packet", "--json", "--out", str(tmp_path / "cubes.png")) == 0
    options = json.loads(capsys.readouterr().out)["options"]
    assert options["layers"] == [100, 200] and options["packet"] is False and options["screen_cells"] == 4
    assert (tmp_path / "cubes.png").stat().st_size > 0


@pytest.mark.parametrize(
    "words",
    [["--culling", "octant"], ["--lists", "3"], ["--layers", "x"], ["--layers", "900"], ["--heads", "all"]],
    ids=str,
)
def test_a_bad_option_exits_with_2(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "none.png"
    assert run(*words, "--out", str(out)) == 2 and not out.exists()
    said = capsys.readouterr().err
    assert said.startswith("refsim: ") and said.count("\n") == 1
