"""Results as drawings for CAD: points with their names, error ellipses and observations as DXF."""

from __future__ import annotations

import io

import numpy as np

from obseq import crs
from obseq.packages import require
from obseq.records.adjustment import AdjustmentRecord
from obseq.survey.maps import corners_in, layers_of

COLOURS = {"points": 7, "names": 7, "ellipses": 6, "observations": 8}
"""Layers and their colours in the palette of AutoCAD: black or white, magenta, grey."""
UNITS = {"m": 6, "ft": 2, "us-ft": 21}
"""Of lengths, in the numbers of DXF ($INSUNITS)."""
TEXT_SHARE = 0.01
"""Height of names, as a share of the drawing."""


def dxf(record: AdjustmentRecord, ellipse_scale: float) -> str:
    """The text of a DXF file in the plan of the points, or of the computation frame where that is no plan.

    Points whose height nobody knows lie at height 0.

    Raises:
        MissingPackageError: ezdxf is not installed.
    """
    require("a drawing", "dxf", "ezdxf")
    from ezdxf.filemanagement import new

    is_plan = not record.points_crs_is_angular
    frame = crs.parse(record.frame)
    target = crs.parse(record.points_crs) if is_plan else frame
    drawing = new("R2010", units=UNITS.get((is_plan and record.points_crs_unit) or "m", 0))
    for name, colour in COLOURS.items():
        drawing.layers.add(name.upper(), color=colour)
    space = drawing.modelspace()
    for layer in layers_of(record, ellipse_scale):
        if not layer.shapes:
            continue
        corners, style = np.nan_to_num(corners_in(layer, frame, target)), {"layer": layer.name.upper()}
        ends = np.cumsum([len(shape) for shape in layer.shapes])[:-1]
        height = TEXT_SHARE * float(np.ptp(corners[:, :2], axis=0).max(initial=0.0)) or 1.0
        for shape, properties in zip(np.split(corners, ends), layer.properties, strict=True):
            if layer.geometry == "Point" and len(shape):
                space.add_point(shape[0], style)
                text = space.add_text(str(properties["name"]), height=height, dxfattribs={"layer": "NAMES"})
                text.set_placement((shape[0] + 0.5 * height).tolist())
            elif layer.geometry == "Polygon" and len(shape):
                space.add_polyline3d(shape[:-1], close=True, dxfattribs=style)
            elif len(shape):
                space.add_line(shape[0], shape[1], style)
    text_file = io.StringIO()
    drawing.write(text_file)
    return text_file.getvalue()
