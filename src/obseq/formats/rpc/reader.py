"""A block of satellite images: files of coefficients, and tables of measures, control and check points."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.blocks.ground import control_in_frame
from obseq.formats.blocks.tables import control_table, read_measures
from obseq.formats.rpc.files import image_of, read_rpc
from obseq.images.aerial.rpc import Rpc
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.names import unique_names
from obseq.images.satellite.block import GEOGRAPHIC, SatelliteBlock

NONE = ControlPoints.of([], np.zeros((0, 3)))


@dataclass(frozen=True)
class SatelliteFiles:
    """Where a block of satellite images is.

    Attributes:
        rpcs: files of coefficients, one an image.
        measures: tables `image point x y`: samples and lines from the centre of the first pixel.
        control: tables of control points.
        check_points: tables of check points.
        system: of these.
        image_sigma: pixels, for measures without sigma.
        control_sigma: metres, for control points without sigma.
    """

    rpcs: Sequence[Path]
    measures: Sequence[Path]
    control: Sequence[Path] = ()
    check_points: Sequence[Path] = ()
    system: str = GEOGRAPHIC
    image_sigma: float | None = None
    control_sigma: float | None = None

    def block(self, correction: str, bias_sigma: float, drift_sigma: float) -> SatelliteBlock:
        """The block, in a local frame at the middle of the ground of its images.

        Raises:
            InputError: a file is broken, or an image of a measure has no coefficients.
        """
        images = unique_names([image_of(path) for path in self.rpcs], "rational polynomials: image")
        rpcs = dict(zip(images, map(read_rpc, self.rpcs), strict=True))
        frame = _frame(rpcs)
        parts = [read_measures(path, self.image_sigma) for path in self.measures]
        measures = functools.reduce(ImagePoints.joined, parts)
        known, checks = (self._points(paths, frame) for paths in (self.control, self.check_points))
        twice = set(known.names) & set(checks.names)
        if twice:
            raise InputError(f"point {min(twice)!r} is a control point and a check point: it is one of them")
        return SatelliteBlock(
            rpcs, _renamed(measures, images), known, checks, frame, correction, bias_sigma, drift_sigma
        )

    def _points(self, paths: Sequence[Path], frame: str) -> ControlPoints:
        parts = [control_table(path, self.control_sigma)[0] for path in paths]
        names = [name for part in parts for name in part.names]
        unique_names(names, "control point")
        if not parts:
            return NONE
        coordinates, covariances = (
            np.concatenate([getattr(part, key) for part in parts]) for key in ("coordinates", "covariances")
        )
        return control_in_frame(ControlPoints(tuple(names), coordinates, covariances), self.system, frame)


def _frame(rpcs: dict[str, Rpc]) -> str:
    middles = [[rpc.offsets[key] for key in ("LONG", "LAT", "HEIGHT")] for rpc in rpcs.values()]
    return crs.complete_rtl(middles, crs.parse(GEOGRAPHIC)).definition


def _renamed(measures: ImagePoints, images: Sequence[str]) -> ImagePoints:
    """Measures with the names of images that have coefficients; endings of image files do not count."""
    stems = {name.rpartition(".")[0]: name for name in measures.image_names if "." in name}
    known = {stem: name for stem, name in stems.items() if stem in images}
    if not known:
        return measures
    other = {name: stem for stem, name in known.items()}
    names = [other.get(name, name) for name in measures.image_names]
    return ImagePoints.packed(
        names, measures.point_names, measures.image, measures.point, measures.xy, measures.sigmas
    )
