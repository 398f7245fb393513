"""Plan: linear light becomes 8-bit sRGB.

- Decoding a code with the standard's inverse curve and encoding it again gives the code, for all 256.
- Encoding never falls when light rises, and saturates outside [0, 1].
- A picture is written to a name given as text or as a path: the same bytes.
- Golden: the ends, the joint of the two branches, middle grey. A colour that is not a number is refused.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refsim.image import encode_srgb, write_png

light = st.floats(width=32, allow_nan=False)


@given(light, light)
def test_rises_with_light(a: float, b: float) -> None:
    low, high = encode_srgb(np.array([min(a, b), max(a, b)], np.float32))
    assert low <= high


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_code_survives_the_inverse(dtype: type) -> None:
    code = np.arange(256)
    s = code / 255.0
    # IEC 61966-2-1, the decoding direction, which the encoder does not share.
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    np.testing.assert_array_equal(encode_srgb(linear.astype(dtype)), code)


@pytest.mark.parametrize(
    ("linear", "code"), [(-1.0, 0), (0.0, 0), (0.0031308, 10), (0.18, 118), (0.5, 188), (1.0, 255), (np.inf, 255)]
)
def test_golden(linear: float, code: int) -> None:
    assert encode_srgb(np.array([linear], np.float32)).tolist() == [code]


def test_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not a number"):
        encode_srgb(np.array([0.5, np.nan], np.float32))


def test_text_names_a_file_as_a_path_does(tmp_path: Path) -> None:
    picture = np.linspace(0, 1, 18).reshape(2, 3, 3)
    write_png(tmp_path / "path.png", picture)
    write_png(str(tmp_path / "text.png"), picture)
    assert (tmp_path / "text.png").read_bytes() == (tmp_path / "path.png").read_bytes()
