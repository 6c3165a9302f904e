"""Images that are read as stored, or refused by name."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from obseq.errors import InputError
from obseq.targets import read_picture
from obseq.targets.pictures import png_bytes

GREY = (np.arange(64 * 48).reshape(48, 64) % 251).astype(np.uint8)


def test_pixels_are_as_stored_whatever_exif_says(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(GREY).save(tmp_path / "a.png", exif=exif)
    picture = read_picture(tmp_path / "a.png")
    assert picture.is_turned
    assert np.array_equal(picture.grey, GREY)


def test_sixteen_bits_stay_sixteen(tmp_path: Path) -> None:
    deep = GREY.astype(np.uint16) * 250
    for name in ("a.png", "a.tif"):
        Image.fromarray(deep).save(tmp_path / name)
        assert np.array_equal(read_picture(tmp_path / name).grey, deep)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "CMYK", "1"])
def test_colours_become_grey(tmp_path: Path, mode: str) -> None:
    Image.fromarray(GREY).convert(mode).save(tmp_path / "a.tif")
    grey = read_picture(tmp_path / "a.tif").grey
    assert grey.dtype == np.uint8 and grey.shape == GREY.shape
    if mode in ("RGB", "RGBA"):
        assert np.array_equal(grey, GREY)


def test_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    Image.fromarray(np.tile(GREY, (10, 10))).save(tmp_path / "whole.jpg")
    (tmp_path / "cut.jpg").write_bytes((tmp_path / "whole.jpg").read_bytes()[:3000])
    (tmp_path / "empty.jpg").write_bytes(b"")
    (tmp_path / "text.jpg").write_text("no image", encoding="utf-8")
    Image.fromarray(GREY[:1, :1]).save(tmp_path / "pixel.png")
    Image.fromarray(np.full((20, 20), np.nan, dtype=np.float32)).save(tmp_path / "nan.tif")
    Image.fromarray(np.full((20, 20), -5.0, dtype=np.float32)).save(tmp_path / "minus.tif")
    said = {
        "cut.jpg": "damaged",
        "empty.jpg": "no image",
        "text.jpg": "no image",
        "pixel.png": "too few",
        "nan.tif": "not finite",
        "minus.tif": "0 to 65535",
        "absent.jpg": "no such file",
    }
    for name, words in said.items():
        with pytest.raises(InputError, match=words) as error:
            read_picture(tmp_path / name)
        assert name in str(error.value)


def test_files_changed_at_random_are_read_or_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    for name in ("a.jpg", "a.png", "a.tif"):
        Image.fromarray(GREY).save(tmp_path / name)
        data = np.frombuffer((tmp_path / name).read_bytes(), dtype=np.uint8)
        for _ in range(60):
            broken = data.copy()
            broken[random.integers(0, len(data), 6)] = random.integers(0, 256, 6)
            (tmp_path / f"b{name}").write_bytes(broken[: random.integers(1, len(data) + 1)].tobytes())
            try:
                read_picture(tmp_path / f"b{name}")
            except InputError:
                continue


def test_png_files_hold_the_pixels(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png_bytes(GREY))
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), GREY)
