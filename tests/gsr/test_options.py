"""Options: what each does to rays and picture, and what is refused, in one sentence.

Plan
- Shadows, reflections, refractions off: no such ray, and the picture of a scene that has no such effect.
- Lights: none, the first, one's own; a scene without any. Light that is out changes nothing but its own target.
- Passes 1 to 6: mirrors that face each other add half of the rest each time, exactly; glass makes a tree. Two names.
- A black background ends misses in the geometry shader; any other is behind all and in mirrors.
- 8-bit targets: the same rays, colours rounded.
- Refusals: a table of option, value and what the sentence names.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import refsim
from refsim import Material
from refsim.errors import InputError
from refsim.papers.geometry_shader_rays.errata import AS_PRINTED, NAMES, Printed, printed_text
from refsim.papers.geometry_shader_rays.record import check_types
from refsim.results import RayKind, Trace
from refsim.scene import PointLight
from tests.gsr.scenes import (
    GLASS,
    SECOND_LIGHT,
    between_mirrors,
    cornell,
    cornell_rays,
    court,
    court_rays,
    facing_mirrors,
    floor_light,
    soup,
    traced,
    wild,
)

GREY = Material("grey", "diffuse", (0.5, 0.25, 0.75), reflectivity=0.5)


def kinds(trace: Trace) -> set[int]:
    return {int(kind) for generation in trace.generations for kind in generation.kind}


def image_of(trace: Trace) -> np.ndarray:
    assert trace.image is not None
    return trace.image


def box(**options: Any) -> Trace:
    return traced(cornell(), cornell_rays(), **{"passes": 4, **options})


def test_without_shadows() -> None:
    """No shadow ray; every surface has all its light, as with lights that nothing hides."""
    trace = box(shadows=False)
    assert kinds(trace) == {RayKind.EYE, RayKind.REFLECTED, RayKind.REFRACTED}
    unshadowed = traced(court(), court_rays(), passes=3, shadows=False)
    # A ray a depth: two of them are all that a buffer holds of a pixel
    assert unshadowed.generations[0].occupancy is not None and unshadowed.generations[0].occupancy.capacity == 8 * 2
    court_image = image_of(unshadowed)
    lit = 0.2 * np.array([0.5, 0.4, 0.3])
    for pixel, weight in ((0, 1), (1, 1), (2, 0.5), (3, 0.5), (4, 0.5), (5, 0.5)):
        assert np.abs(court_image[0, pixel] - weight * (lit + floor_light()[pixel])).max() <= 1e-6
    assert (image_of(trace) >= image_of(box()) - 1e-6).all() and (image_of(trace) > image_of(box()) + 1e-3).any()


def test_without_reflections() -> None:
    trace = box(reflections=False)
    assert kinds(trace) == {RayKind.EYE, RayKind.SHADOW, RayKind.REFRACTED}
    matt = court(Material("wall", "mirror", reflectivity=0.0))
    off, never = traced(court(), court_rays(), passes=3, reflections=False), traced(matt, court_rays(), passes=3)
    assert image_of(off).tobytes() == image_of(never).tobytes()
    # Shadow casting: nothing goes on, so that two rays a pixel are all a buffer holds
    assert off.generations[0].occupancy is not None and off.generations[0].occupancy.capacity == 8 * 2


def test_without_refractions() -> None:
    """Glass keeps its ρ alone, and the tree is a chain: nodes and layers are numbered without a second child."""
    trace = box(refractions=False)
    assert kinds(trace) == {RayKind.EYE, RayKind.SHADOW, RayKind.REFLECTED}
    nodes = [sorted(set(g.node.tolist())) for g in trace.generations if g.node is not None]
    assert nodes == [[0], [0, 1], [1, 2], [2]], "the mirrors' shadow rays, and nothing that a second mirror sends on"
    opaque = cornell().with_materials(
        [Material(m.name, "diffuse", (0, 0, 0), None, m.specular, m.shininess, 0.1) if m.kind == "glass" else m
         for m in cornell().materials]
    )  # fmt: skip
    assert image_of(trace).tobytes() == image_of(traced(opaque, cornell_rays(), passes=4)).tobytes()


def test_no_lights() -> None:
    """Ambient light, mirrors and background remain; no shadow rays."""
    none = box(lights=0)
    assert RayKind.SHADOW not in kinds(none) and RayKind.REFRACTED in kinds(none)
    bare = cornell().replace(lights=())
    assert image_of(none).tobytes() == image_of(traced(bare, cornell_rays(), passes=4, lights=0)).tobytes()
    floor = image_of(traced(court(), court_rays(), passes=3, lights=0))[0]
    ambient = 0.2 * np.array([0.5, 0.4, 0.3])
    assert np.abs(floor[:6] - np.array([[1], [1], [0.5], [0.5], [0.5], [0.5]]) * ambient).max() <= 1e-7
    out = box(lights=(PointLight((0.0, 0.9, 0.0), intensity=0.0),))
    assert np.abs(image_of(out) - image_of(none)).max() <= 2.0**-23


def test_a_scene_without_lights_gets_one() -> None:
    """In front of it, above, on the right: as far as the box is large."""
    bare = cornell().replace(lights=())
    (given,) = bare.lights_or_one
    assert np.allclose((np.array(given.position) - bare.center) / bare.diagonal, [0.5, 0.8, 0.7])
    lit, same = traced(bare, cornell_rays(), passes=2), traced(bare, cornell_rays(), passes=2, lights=given)
    assert image_of(lit).tobytes() == image_of(same).tobytes()
    assert cornell().lights_or_one == cornell().lights


def test_which_lights() -> None:
    """A number takes the first, a light or several are one's own, in the order given."""
    first, second = cornell().lights
    assert second is SECOND_LIGHT
    by_number, by_scene = box(lights=1), traced(cornell().replace(lights=(first,)), cornell_rays(), passes=4)
    by_light, by_list = box(lights=first), box(lights=[first])
    for other in (by_scene, by_light, by_list):
        assert image_of(by_number).tobytes() == image_of(other).tobytes()
    assert (
        image_of(box()).tobytes()
        == image_of(box(lights=2)).tobytes()
        == image_of(box(lights=(first, second))).tobytes()
    )
    swapped = box(lights=(second, first))
    assert np.abs(image_of(swapped) - image_of(box())).max() <= 2.0**-20
    # What two lights give is what each gives, less the rest that both contain
    rest = [image_of(box(lights=chosen)).astype(np.float64) for chosen in (first, second)]
    dark = image_of(box(lights=0)).astype(np.float64)
    assert np.abs(rest[0] + rest[1] - dark - image_of(box())).max() <= 2.0**-20


@pytest.mark.parametrize("passes", range(1, 7))
def test_mirrors_that_face_each_other(passes: int) -> None:
    """The light is out: a wall of colour c shows 0.2 c and half of the other: 0.2 c (1 + 1/2 + 1/4 + …), exactly."""
    scene = facing_mirrors(GREY).replace(lights=(PointLight((0.0, 0.0, 0.5), intensity=0.0),))
    trace = traced(scene, between_mirrors(5, 4), passes=passes)
    ambient = np.array([0.5, 0.25, 0.75], np.float32) * np.float32(0.2)
    expected = sum((ambient * np.float32(0.5**k) for k in range(1, passes)), start=ambient)
    assert (image_of(trace) == expected.astype(np.float32)).all()
    assert len(trace.generations) == passes
    for k, generation in enumerate(trace.generations):
        assert generation.node is not None and generation.weight is not None
        surface = generation.kind != RayKind.SHADOW
        assert surface.sum() == 20 and (generation.node[surface] == k).all()
        assert (generation.weight[surface] == 0.5**k).all()
        assert (~surface).sum() == (20 if k else 0) and (generation.weight[~surface] == 0.5 ** (k - 1)).all()
        assert (generation.hits.triangle[surface] // 2 == (k + 1) % 2).all(), "walls take turns"


@pytest.mark.parametrize("passes", range(1, 7))
def test_glass_makes_a_tree(passes: int) -> None:
    """Nodes of depth k are 2^k − 1 to 2^(k+1) − 2; a deeper tree begins with the rays of a flatter one."""
    scene, rays = soup(4, 14, (GLASS,)), wild(6, 5, 4)
    trace, deepest = (traced(scene, rays, passes=depth) for depth in (passes, 6))
    for k, (generation, same) in enumerate(zip(trace.generations, deepest.generations, strict=False)):
        assert generation.node is not None
        surface = generation.kind != RayKind.SHADOW
        assert surface.any() and (2**k - 1 <= generation.node[surface]).all()
        assert (generation.node[surface] <= 2 ** (k + 1) - 2).all()
        assert generation.rays.direction.tobytes() == same.rays.direction.tobytes()
        assert generation.hits.t.tobytes() == same.hits.t.tobytes()


def test_passes_has_two_names() -> None:
    assert image_of(box(passes=3)).tobytes() == image_of(box(passes=None, generations=3)).tobytes()
    assert len(box(passes=3, generations=3).generations) == 3
    assert len(traced(court(), court_rays()).generations) == 2
    with pytest.raises(InputError, match=r"passes is 3 and generations 2"):
        box(passes=3, generations=2)


@pytest.mark.parametrize("channel", range(3))
def test_a_black_background_ends_misses(channel: int) -> None:
    """Nothing to show: misses end in the geometry shader, and the picture is as if they had added black. Light in one
    channel is something to show."""
    faint = tuple(1e-3 if k == channel else 0.0 for k in range(3))
    black, lit = (traced(court(), court_rays(), passes=3, background=color) for color in ((0, 0, 0), faint))
    assert black.counters["geometry.passed_reflected"] == 4 and lit.counters["geometry.passed_reflected"] == 5
    assert (image_of(black)[0, [6, 7]] == 0).all()
    assert np.abs(image_of(lit)[0, [6, 7]] - np.array([[1.0], [0.5]]) * np.array(faint)).max() <= 1e-9
    assert (image_of(black)[0, :6] == image_of(lit)[0, :6]).all()
    assert black.counters["rays.reflected"] == lit.counters["rays.reflected"] == 5


def test_bytes() -> None:
    """8-bit targets: the same rays and hits; a sum of n values of up to half a step's error is n half steps off."""
    exact, rounded = box(passes=2, lights=1), box(passes=2, lights=1, color_format="rgba8unorm")
    steps = image_of(rounded).astype(np.float64) * 255
    assert np.abs(steps - np.rint(steps)).max() <= 1e-4
    targets = 2 * (2**2 - 1)
    assert np.abs(image_of(rounded) - np.minimum(image_of(exact), 1)).max() <= targets * 0.5 / 255
    assert image_of(rounded).max() <= 1
    for a, b in zip(exact.generations, rounded.generations, strict=True):
        assert a.hits.t.tobytes() == b.hits.t.tobytes() and dict(a.counters) == dict(b.counters)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "passes 0": ({"passes": 0}, "passes is 0"),
    "passes half": ({"passes": 1.5}, "passes is 1.5"),
    "passes true": ({"passes": True}, "passes is True"),
    "acceleration": ({"acceleration": "gird"}, "did you mean 'grid'"),
    "acceleration number": ({"acceleration": 3}, "acceleration is 3"),
    "resolution 0": ({"acceleration": "grid", "resolution": 0}, "resolution is 0"),
    "resolution of two": ({"acceleration": "grid", "resolution": (3, 4)}, "resolution is"),
    "resolution without grid": ({"resolution": 8}, "resolution is the grid's; acceleration 'naive'"),
    "more lights than there are": ({"lights": 3}, "lights is 3; scene 'cornell_box' has 2 lights"),
    "fewer than none": ({"lights": -1}, "lights is -1"),
    "lights true": ({"lights": True}, "not True"),
    "lights in words": ({"lights": ["sun"]}, "lights holds 'sun'"),
    "too many lights": ({"lights": [SECOND_LIGHT] * 65}, "65 lights are more than the 64"),
    "blinding": ({"lights": PointLight((0.0, 0.9, 0.0), intensity=1e300)}, "too bright for float32"),
    "acceleration array": ({"acceleration": np.zeros(3)}, "acceleration is"),
    "background beyond float32": ({"background": (1e300, 0, 0)}, "what float32 holds"),
    "shadows": ({"shadows": "yes"}, "shadows is 'yes'"),
    "reflections": ({"reflections": 1}, "reflections is 1"),
    "refractions": ({"refractions": None}, "refractions is None"),
    "background of two": ({"background": (0, 0)}, "background must be three"),
    "negative background": ({"background": (0, 0, -1)}, "background is"),
    "background nan": ({"background": (0, 0, float("nan"))}, "background must be three"),
    "format": ({"color_format": "rgb565"}, "color_format is 'rgb565'"),
    "errata": ({"errata": "GSR-E99"}, "errata 'GSR-E99' is not known"),
    "capacity 0": ({"capacity": 0}, "capacity is 0"),
    "order": ({"emission_order": "random"}, "emission_order is 'random'"),
    "stages": ({"stages": "fragment"}, "stages is 'fragment'"),
    "no geometry shader": ({"stages": "vertex_only", "passes": 2}, "stages='vertex_only' needs passes=1"),
    "primary": ({"primary": "guess"}, "primary is 'guess'"),
    "too deep a tree": ({"passes": 40}, "40 passes"),
    "unknown": ({"tile_size": 4}, "has no option 'tile_size'"),
    "ior": ({"ior": 0.0}, "ior is 0.0"),
    "facing": ({"facing": "back"}, "facing is 'back'"),
    "threads": ({"threads": 0}, "threads is 0"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    options, sentence = REFUSED[name]
    with pytest.raises(InputError) as refused:
        traced(cornell(), cornell_rays(), **options)
    message = str(refused.value)
    assert sentence in message and "\n" not in message


def test_more_layers_than_a_point_can_be_placed_in() -> None:
    """Beyond 2²⁰ rows float32 would put points into their neighbours' pixels."""
    rays = refsim.camera_rays(court(), 1, 2**18)
    assert image_of(traced(court(), rays, passes=1)).shape == (2**18, 1, 3)
    with pytest.raises(InputError, match=r"5 layers of 262144 rows are more than the 1048576 rows"):
        traced(court(), rays, passes=5)


def test_types_that_float32_holds() -> None:
    """The largest type is L times the number of nodes."""
    check_types(2**23, 2)
    for nodes, lights in ((2**23 + 1, 2), (2**24 + 2, 0)):
        with pytest.raises(InputError, match="more types of rays than"):
            check_types(nodes, lights)


def test_no_environment() -> None:
    with pytest.raises(InputError, match=r"no environment.*background"):
        refsim.render("geometry_shader", cornell(), 4, 4, environment="sky", acceleration="naive")


def test_names_of_errata() -> None:
    """One, several in a string or a sequence, in any case, with or without the paper's letters."""
    assert printed_text("corrected") == Printed() == Printed(*[0] * len(NAMES))
    assert printed_text("GSR-E1") == Printed(E1=1) == printed_text("e1") == printed_text(["E1"])  # type: ignore[arg-type]
    both = Printed(E4=1, E12=1)  # type: ignore[arg-type]
    assert printed_text("GSR-E4,GSR-E12") == printed_text(" e4 , gsr-e12") == printed_text(("E12", "GSR-E4")) == both
    assert printed_text("as_printed") == AS_PRINTED
    assert [name for name in Printed._fields if not getattr(AS_PRINTED, name)] == ["E1b", "E3"]
    for name in NAMES:
        assert sum(printed_text(name)) == 1
    assert printed_text("GSR-E1b") == printed_text("gsr-e1B") == Printed(E1b=1)  # type: ignore[arg-type]


@pytest.mark.parametrize("errata", ["", "E0", "E13", "HRE-E1", "E1;E2", ["E1", 2], "as printed", "corrected,E1"])
def test_unknown_errata(errata: Any) -> None:
    with pytest.raises(InputError, match=r"is not known; choose from corrected, as_printed, GSR-E1, "):
        printed_text(errata)


def test_two_readings_of_one_thing() -> None:
    with pytest.raises(InputError, match="two readings"):
        printed_text("GSR-E1,GSR-E1b")


@pytest.mark.parametrize("errata", [None, 3, True])
def test_what_is_no_name_of_errata(errata: Any) -> None:
    with pytest.raises(InputError, match=f"errata {errata} is not known"):
        traced(court(), court_rays(), errata=errata)
