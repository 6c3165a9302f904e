"""Pictures: pixels read from files as they are stored, and written. They need the extra `images` (Pillow)."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.packages import require
from obseq.reading.text import check_file

if TYPE_CHECKING:
    from PIL import Image

    from obseq.arrays import Array

LARGEST = 250_000_000
"""Pixels of the largest image: two bytes each are held, and a third as much beside them."""
SMALLEST = 16
"""Sides of the smallest image: less than a target that can be read."""
ORIENTATION = 0x0112
"""Tag of EXIF that says how an image is turned for looking at it."""
DEEP = ("I;16", "I;16B", "I;16L")


@dataclass(frozen=True, eq=False)
class Picture:
    """An image as its file has it.

    Attributes:
        name: of the file, without its folder.
        grey: (height, width) uint8 or uint16; of colours, the mean of the weights that eyes have (luma).
        is_turned: whether the file asks for another orientation when it is looked at. Pixels are as stored.
    """

    name: str
    grey: Array
    is_turned: bool = False


def read_picture(path: str | Path) -> Picture:
    """The pixels of an image, as stored: no orientation is applied, 16 bits stay 16.

    Raises:
        InputError: no image, truncated, too large or too small, or of numbers that are no grey levels.
        MissingPackageError: Pillow is not installed.
    """
    require("reading images", "images", "PIL")
    from PIL import Image, UnidentifiedImageError

    place = Path(path)
    check_file(place)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(place) as image:
                width, height = image.size
                _check_size(place, width, height)
                orientation = image.getexif().get(ORIENTATION, 1)
                grey = _grey(place, image)
    except FileNotFoundError:
        raise InputError(f"{place}: there is no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{place}: is a folder; name its images") from None
    except UnidentifiedImageError:
        raise InputError(f"{place}: is no image that can be read") from None
    except Image.DecompressionBombError:
        raise InputError(_too_large(place)) from None
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, EOFError, OverflowError, IndexError, TypeError) as error:
        raise InputError(f"{place}: the image is damaged: {error}") from None
    return Picture(place.name, grey, orientation not in (0, 1))


def picture_size(path: str | Path) -> tuple[int, int] | None:
    """Width and height of an image as stored; None where there is no image that can be read, or no Pillow."""
    try:
        from PIL import Image
    except ImportError:
        return None
    try:
        with Image.open(path) as image:
            return int(image.size[0]), int(image.size[1])
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def _too_large(path: Path) -> str:
    return f"{path}: has more than {LARGEST // 10**6} million pixels; cut it into parts"


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > LARGEST:
        raise InputError(_too_large(path))
    if min(width, height) < SMALLEST:
        raise InputError(f"{path}: {width} x {height} pixels are too few for a target to be seen")


def _grey(path: Path, image: Image.Image) -> Array:
    if image.mode in DEEP:
        return np.asarray(image).astype(np.uint16)
    if image.mode in ("I", "F"):
        return _levels(path, np.asarray(image))
    return np.array(image if image.mode == "L" else image.convert("L"))


def _levels(path: Path, values: Array) -> Array:
    """Numbers of 32 bits as grey levels, if that is what they are."""
    if not np.isfinite(values).all():
        raise InputError(f"{path}: some pixels are not finite numbers")
    if values.min() < 0 or values.max() > 65535:
        raise InputError(f"{path}: pixels are {values.min():g} to {values.max():g}; 0 to 65535 are read")
    return np.round(values).astype(np.uint16)


def png_bytes(pixels: Array, kind: str = "PNG") -> bytes:
    """Pixels (height, width) or (height, width, 3), uint8, as a PNG file, or one of another kind (TIFF).

    Raises:
        MissingPackageError: Pillow is not installed.
    """
    require("writing images", "images", "PIL")
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind)
    return stream.getvalue()
