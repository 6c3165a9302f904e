"""Coded targets: generated, drawn, found in images, decoded and measured."""

from typing import TYPE_CHECKING

from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.targets.drawings import draw
    from obseq.targets.families import FAMILIES, made
    from obseq.targets.pictures import Picture, read_picture
    from obseq.targets.sheets import pdf_bytes, svg_text
    from obseq.targets.specification import Geometry, Specification
    from obseq.targets.specification_files import (
        encoding_text,
        read_specification,
        read_specifications,
        specification_text,
    )

_HOMES = {
    "drawings": ("draw",),
    "families": ("FAMILIES", "made"),
    "pictures": ("Picture", "read_picture"),
    "sheets": ("pdf_bytes", "svg_text"),
    "specification": ("Geometry", "Specification"),
    "specification_files": (
        "encoding_text",
        "read_specification",
        "read_specifications",
        "specification_text",
    ),
}

__all__ = [
    "FAMILIES",
    "Geometry",
    "Picture",
    "Specification",
    "draw",
    "encoding_text",
    "made",
    "pdf_bytes",
    "read_picture",
    "read_specification",
    "read_specifications",
    "specification_text",
    "svg_text",
]

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__)
