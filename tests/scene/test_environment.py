"""Plan: environments are finite functions of direction alone, and pictures are looked up where they should be.

- Every environment gives finite, non-negative float32[n, 3], the same for a direction whatever its neighbours; a dead
  ray sees black.
- A picture is found by direction: each pixel centre gives its pixel; it wraps; between centres it is bilinear.
- Sky brightens towards the horizon and sun; the checkered floor alternates and meets the sky without a seam.
- .npy and .hdr give the stored numbers (an encoder written here proves it), PNG the linear values of its sRGB bytes.
- 65,536 directions take little time. Bad files and names are refused in one sentence.
"""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from refsim.errors import InputError
from refsim.scene import load_environment
from refsim.scene.environment import CHECKER, SKY, Checker, Environment, Equirectangular, Sky, Uniform

PICTURE = np.random.default_rng(5).random((8, 16, 3), np.float32)
ALL: dict[str, Environment] = {
    "sky": SKY,
    "checker": CHECKER,
    "black": Uniform(),
    "picture": Equirectangular(PICTURE),
    "one pixel": Equirectangular(np.ones((1, 1, 3))),
}


def directions(count: int, seed: int = 3) -> np.ndarray:
    """Unit directions float32, among them the axes."""
    rng = np.random.default_rng(seed)
    d = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(count, 3)) * [1, 0.2, 1]])
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def toward(longitude: float, polar: float) -> np.ndarray:
    """float32[1, 3]: longitude from -z towards +x, polar angle from +y, radians."""
    ring = math.sin(polar)
    return np.float32([[ring * math.sin(longitude), math.cos(polar), -ring * math.cos(longitude)]])


@pytest.mark.parametrize("name", ALL)
@given(hnp.arrays(np.float64, (20, 3), elements=st.floats(-1, 1)))
def test_radiance_is_a_finite_function_of_direction(name: str, raw: np.ndarray) -> None:
    length = np.linalg.norm(raw, axis=1, keepdims=True)
    d = np.where(length > 1e-100, raw / np.where(length > 1e-100, length, 1), 0).astype(np.float32)
    rgb = ALL[name].lookup(d)
    assert rgb.dtype == np.float32 and rgb.shape == (20, 3)
    assert np.isfinite(rgb).all() and (rgb >= 0).all()
    np.testing.assert_array_equal(rgb, np.concatenate([ALL[name].lookup(row[None]) for row in d]))
    assert not rgb[~d.any(axis=1)].any()
    assert ALL[name].lookup(np.zeros((0, 3))).shape == (0, 3)


@given(st.integers(0, 7), st.integers(0, 15))
def test_pixel_centres_give_their_pixels(row: int, column: int) -> None:
    seen = ALL["picture"].lookup(toward((column + 0.5) / 16 * math.tau - math.pi, (row + 0.5) / 8 * math.pi))
    np.testing.assert_allclose(seen[0], PICTURE[row, column], atol=1e-5)


@given(st.integers(0, 6), st.integers(0, 15), st.floats(0, 1), st.floats(0, 1))
def test_between_centres_pixels_mix(row: int, column: int, down: float, across: float) -> None:
    longitude, polar = (column + 0.5 + across) / 16 * math.tau - math.pi, (row + 0.5 + down) / 8 * math.pi
    seen = ALL["picture"].lookup(toward(longitude, polar))
    right = (column + 1) % 16  # the last column's neighbour is the first
    top = PICTURE[row, column] * (1 - across) + PICTURE[row, right] * across
    bottom = PICTURE[row + 1, column] * (1 - across) + PICTURE[row + 1, right] * across
    np.testing.assert_allclose(seen[0], top * (1 - down) + bottom * down, atol=1e-5)


def test_axes_of_a_picture() -> None:
    picture = np.zeros((64, 128, 3), np.float32)
    picture[:, 64 - 4 : 64 + 4, 0] = 1.0  # the middle is -z
    picture[:, 96 - 4 : 96 + 4, 1] = 1.0  # a quarter further right is +x
    picture[:4] = (0.0, 0.0, 1.0)  # the top is +y
    picture[-4:] = (1.0, 1.0, 1.0)
    environment = Equirectangular(picture)
    seen = environment.lookup([(0, 0, -1), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (-1, 0, 0)])
    np.testing.assert_array_equal(seen, [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (0, 0, 0), (0, 0, 0)])


def test_sky_has_a_horizon_and_a_sun() -> None:
    sky = Sky(sun_color=(0, 0, 0))
    column = sky.lookup([toward(0.3, polar)[0] for polar in np.linspace(0, math.pi / 2, 20)])
    assert (np.diff(column, axis=0) > 0).all(), "brighter towards the horizon"
    np.testing.assert_allclose(sky.lookup([(0, 1, 0)])[0], sky.zenith, atol=1e-6)
    np.testing.assert_allclose(sky.lookup([(0, 0, 1)])[0], sky.horizon, atol=1e-6)
    np.testing.assert_allclose(sky.lookup([(0, -1, 0)])[0], sky.ground, atol=1e-6)
    sun = np.float32([SKY.sun]) / np.linalg.norm(SKY.sun)
    np.testing.assert_allclose(SKY.lookup(sun)[0] - sky.lookup(sun)[0], SKY.sun_color, rtol=1e-3)


def test_floor_alternates_and_fades() -> None:
    floor = Checker(tile=1.0, sky=Sky(sun_color=(0, 0, 0)))
    for i, j in ((0, 0), (1, 0), (0, 1), (-1, 0), (-1, -1), (1, 1)):
        down = np.float64([i + 0.5, -1.0, j + 0.5])
        seen = floor.lookup([down / np.linalg.norm(down)])[0]
        np.testing.assert_allclose(seen, floor.dark if (i + j) % 2 else floor.light, atol=1e-6)
    edge = floor.lookup(np.concatenate([toward(a, math.pi / 2 + s * 1e-3) for a in (0.1, 2.0, 4.0) for s in (-1, 1)]))
    np.testing.assert_allclose(edge, np.tile(floor.sky.horizon, (6, 1)), atol=0.03)


def hdr(pixels: np.ndarray, *, packed: bool) -> bytes:
    """A Radiance file of RGBE uint8[h, w, 4], flat or run-length encoded."""
    height, width, _ = pixels.shape
    body = b""
    for row in pixels:
        if not packed:
            body += row.tobytes()
            continue
        body += bytes([2, 2, width >> 8, width & 255])
        for component in row.T.tolist():
            at = 0
            while at < width:
                run = 1
                while at + run < width and run < 127 and component[at + run] == component[at]:
                    run += 1
                if run > 2:
                    body += bytes([128 + run, component[at]])
                else:
                    run = min(2, width - at)
                    body += bytes([run, *component[at : at + run]])
                at += run
    return b"#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + body


RGBE = hnp.arrays(
    np.uint8,
    st.tuples(st.integers(1, 4), st.integers(8, 20), st.just(4)),
    elements=st.one_of(st.sampled_from([0, 128, 130]), st.integers(0, 255)),
    fill=st.just(128),
)


@given(RGBE, st.booleans())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
def test_radiance_files_give_the_stored_numbers(tmp_path: Path, pixels: np.ndarray, packed: bool) -> None:
    pixels[:, :, 3] = np.where(pixels[:, :, 3] < 20, 0, np.minimum(pixels[:, :, 3], 240))
    if not packed:
        pixels[:, 0, 0] |= 4  # else a flat row could pass for an encoded one
    path = tmp_path / "sky.hdr"
    path.write_bytes(hdr(pixels, packed=packed))
    exponent = pixels[:, :, 3:].astype(int)
    wanted = np.where(exponent > 0, pixels[:, :, :3] / 256.0 * 2.0 ** (exponent - 128), 0.0)
    environment = load_environment(path)
    assert isinstance(environment, Equirectangular)
    np.testing.assert_array_equal(environment.image, wanted.astype(np.float32))


def png(array: np.ndarray, mode: str | None = None) -> bytes:
    stream = io.BytesIO()
    picture = Image.fromarray(array)
    (picture if mode is None else picture.convert(mode)).save(stream, "PNG")
    return stream.getvalue()


def test_png_is_srgb_and_npy_is_linear(tmp_path: Path) -> None:
    levels = np.uint8([[[0, 10, 11], [128, 188, 255]]])
    (tmp_path / "a.png").write_bytes(png(levels))
    seen = load_environment(str(tmp_path / "a.png")).image[0]  # type: ignore[attr-defined]
    # Values of the sRGB standard's formula, from the published table.
    np.testing.assert_allclose(seen, [[0, 0.0030352698, 0.0033465358], [0.21586050, 0.50288647, 1.0]], atol=1e-7)
    np.save(tmp_path / "a.npy", PICTURE.astype(np.float64) * 9)
    np.testing.assert_array_equal(load_environment(tmp_path / "a.npy").image, PICTURE * np.float32(9))  # type: ignore[attr-defined]
    for mode in ("L", "P", "RGBA", "1"):
        (tmp_path / "a.png").write_bytes(png(np.full((2, 3, 3), 255, np.uint8), mode))
        np.testing.assert_array_equal(load_environment(tmp_path / "a.png").image, np.ones((2, 3, 3)))  # type: ignore[attr-defined]
    (tmp_path / "a.png").write_bytes(png(np.full((2, 3), 65535, np.uint16)))
    np.testing.assert_array_equal(load_environment(tmp_path / "a.png").image, np.ones((2, 3, 3)))  # type: ignore[attr-defined]


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


SMALL = np.full((2, 8, 4), 130, np.uint8)
FILES = {
    "control PNG": ("a.png", png(np.zeros((2, 4, 3), np.uint8)), None),
    "control npy": ("a.npy", npy(PICTURE), None),
    "control hdr": ("a.hdr", hdr(SMALL, packed=True), None),
    "empty": ("a.png", b"", "is empty"),
    "prose": ("a.png", b"once upon a time", "cannot be read as a picture: unknown format"),
    "PNG cut": ("a.png", png(np.uint8(PICTURE * 255))[:300], "cannot be read as a picture"),
    "npy prose": ("a.npy", b"once upon a time", "cannot be read as .npy"),
    "npy cut": ("a.npy", npy(PICTURE)[:-5], "cannot be read as .npy"),
    "npy objects": ("a.npy", npy(np.array([{}], object)), "cannot be read as .npy"),
    "npy grey": ("a.npy", npy(PICTURE[:, :, 0]), "must hold floats of shape [h, w, 3]"),
    "npy integers": ("a.npy", npy(np.zeros((2, 2, 3), int)), "must hold floats of shape [h, w, 3]"),
    "npy NaN": ("a.npy", npy(np.full((2, 2, 3), np.nan)), "negative or not finite"),
    "npy beyond float32": ("a.npy", npy(np.full((2, 2, 3), 1e39)), "negative or not finite"),
    "npy negative": ("a.npy", npy(-PICTURE), "negative or not finite"),
    "npy of nothing": ("a.npy", npy(PICTURE[:0]), "must have shape [h, w, 3], not [0, 16, 3]"),
    "hdr prose": ("a.hdr", b"once upon a time", "is not a Radiance picture"),
    "hdr cut": ("a.hdr", hdr(SMALL, packed=True)[:-1], "truncated"),
    "flat hdr cut": ("a.hdr", hdr(SMALL, packed=False)[:-1], "truncated"),
    "hdr row cut": ("a.hdr", hdr(SMALL, packed=True)[:-15], "truncated"),
    "hdr row head cut": ("a.hdr", hdr(SMALL, packed=True)[:-10], "truncated"),
    "hdr run too long": ("a.hdr", hdr(SMALL, packed=True).replace(b"\x88", b"\x89"), "damaged row"),
    "hdr absurd": ("a.hdr", hdr(SMALL, packed=True).replace(b"-Y 2 +X 8", b"-Y 99999 +X 99999"), "truncated"),
    "hdr of nothing": ("a.hdr", hdr(SMALL, packed=True).replace(b"-Y 2", b"-Y 0"), "without pixels"),
    "hdr XYZ": ("a.hdr", hdr(SMALL, packed=True).replace(b"rgbe", b"xyze"), "not of RGB"),
}


@pytest.mark.parametrize("row", FILES)
def test_bad_files(row: str, tmp_path: Path) -> None:
    name, content, fragment = FILES[row]
    path = tmp_path / name
    path.write_bytes(content)
    if fragment is None:
        assert load_environment(path).lookup(directions(4)).shape == (10, 3)
        return
    with pytest.raises(InputError) as caught:
        load_environment(path)
    assert fragment in str(caught.value) and str(path) in str(caught.value), caught.value


def test_names(tmp_path: Path) -> None:
    assert load_environment("checker") is CHECKER and load_environment("sky") is SKY
    assert load_environment("white").lookup([(0, 1, 0)]).tolist() == [[1, 1, 1]]
    with pytest.raises(InputError, match="unknown environment 'ski': it is checker, sky, black, white, or the path"):
        load_environment("ski")
    with pytest.raises(InputError, match="does not exist"):
        load_environment(tmp_path / "none.png")
    with pytest.raises(InputError, match="is a folder"):
        load_environment(tmp_path)
    with pytest.raises(InputError, match="a name or a path, not a int"):
        load_environment(7)  # type: ignore[arg-type]


VALUES = {
    "sun": (lambda: Sky(sun=(0, 0, 0)), "sun of the sky must be a direction"),
    "horizon": (lambda: Sky(horizon=(0, 1)), "horizon of the sky must be three finite numbers"),
    "tile": (lambda: Checker(tile=0.0), "tile of the checker must be a finite number above 0"),
    "light": (lambda: Checker(light=(math.nan, 0, 0)), "light of the checker"),
    "color": (lambda: Uniform("red"), "color of the environment"),
    "image": (lambda: Equirectangular(np.zeros((2, 2))), r"must have shape \[h, w, 3\]"),
    "image in words": (lambda: Equirectangular("red"), r"must have shape \[h, w, 3\]"),
    "directions": (lambda: SKY.lookup([1, 2, 3]), r"directions must have shape \[n, 3\]"),
}


@pytest.mark.parametrize("row", VALUES)
def test_values(row: str) -> None:
    make, message = VALUES[row]
    with pytest.raises(InputError, match=message):
        make()
