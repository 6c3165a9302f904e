"""The record of a bundle adjustment: what the result file holds, and every report is made of.

Format "obseq-bundle", version 5 (4 repeated the worst image points). Coordinates
are in the unit of the world, those of images in pixels, angles in radians. What is not defined is None, and
null in the file.
"""

from __future__ import annotations

import itertools

from obseq.errors import InputError
from obseq.images.output.instruments import ClinometerRecord, RigidRecord
from obseq.images.output.references import AntennaRecord, CheckPointRecord, ShutterRecord
from obseq.images.output.shares import LARGE, Owners, RejectedShare, rejected_shares
from obseq.images.output.testing import BlockReliabilityRecord
from obseq.records.adjustment import IterationRecord, RunRecord
from obseq.records.diagnosis import DiagnosisRecord
from obseq.records.quality import GlobalTestRecord
from obseq.records.record import Record, from_plain
from obseq.records.table import AnyTable, Table, table_of
from obseq.report.result_file import text_of

FORMAT = "obseq-bundle"
VERSION = 5


class ParameterRecord(Record, frozen=True):
    """A camera parameter: value, and standard deviation (0: frozen; None: not asked for)."""

    name: str
    value: float
    sigma: float | None


class CameraRecord(Record, frozen=True):
    """A calibration.

    Attributes:
        backward: True where the distortion corrects the measured points.
        correlations: rows of the matrix, in the order of the parameters.
        undistorted_x: columns where the points of a regular grid of the image, 17 a line, would be without
            distortion, pixels; None where nowhere. `undistorted_y` their lines.
    """

    name: str
    width: int
    height: int
    projection: str
    degree: tuple[int, ...]
    backward: bool
    parameters: tuple[ParameterRecord, ...]
    correlations: tuple[tuple[float, ...], ...] | None
    n_measures: int
    rms: float
    undistorted_x: tuple[float | None, ...]
    undistorted_y: tuple[float | None, ...]


class ImageRecord(Record, frozen=True):
    """A pose and how its measures fit.

    Attributes:
        centre: projection centre.
        centre_sigmas: None when no precision was asked for.
        quaternion: w, x, y, z of the rotation from camera to world.
        opk: photogrammetric omega, phi, kappa.
        opk_sigmas: None when no precision was asked for, or where an angle has none.
    """

    name: str
    camera: str
    centre: tuple[float, ...]
    centre_sigmas: tuple[float, ...] | None
    quaternion: tuple[float, ...]
    opk: tuple[float, ...]
    opk_sigmas: tuple[float | None, ...] | None
    n_measures: int
    rms: float
    largest: float
    mean_dx: float
    mean_dy: float


class BlockPointRecord(Record, frozen=True):
    """A point: kind is `control` or `tie`; `residual` is adjusted minus given, of control points.

    Attributes:
        covariance: xx, xy, xz, yy, yz, zz; None when no precision was asked for.
    """

    name: str
    kind: str
    x: float
    y: float
    z: float
    covariance: tuple[float, ...] | None
    n_rays: int
    rms: float
    residual: tuple[float, ...] | None


class ImagePointRecord(Record, frozen=True):
    """An image point, its residual (computed minus measured, pixels), and what robust weights left of it."""

    image: str
    point: str
    x: float
    y: float
    dx: float
    dy: float
    weight: float


class MeasureRecord(Record, frozen=True):
    """An image point as it was adjusted: pixels, and the tests of both coordinates.

    Attributes:
        dx: computed minus measured; `dy` the same.
        w_x: residual over its own standard deviation; None without redundancy.
        redundancy_x: share of an error that shows in the residual.
    """

    image: str
    point: str
    x: float
    y: float
    dx: float
    dy: float
    sx: float
    sy: float
    weight: float
    w_x: float | None
    w_y: float | None
    redundancy_x: float | None
    redundancy_y: float | None


class ResidualColumns(Record, frozen=True):
    """All image points that were adjusted, by columns.

    Attributes:
        image: number of the image, a position in the images of the record.
        point: number of the point, a position in its points.
        x: column measured, pixels; `y` the line.
        dx: computed minus measured, pixels; `dy` the same.
        sx: sigma, pixels; `sy` the same.
        weight: what robust weights left, 1 for all.
    """

    image: tuple[int, ...]
    point: tuple[int, ...]
    x: tuple[float, ...]
    y: tuple[float, ...]
    dx: tuple[float, ...]
    dy: tuple[float, ...]
    sx: tuple[float, ...]
    sy: tuple[float, ...]
    weight: tuple[float, ...]


class BlockLeftOutRecord(Record, frozen=True):
    """Something that took no part."""

    kind: str
    name: str
    reason: str


class BundleRecord(Record, frozen=True, omit_defaults=False):
    """A whole bundle adjustment.

    Attributes:
        precision: "a posteriori": scaled by sigma0; "a priori": not; "none": not computed.
        squares: weighted sums of squares by kind of observation.
        stopped: why the iterations ended.
        unpaired: exposures of rigid blocks that lack an image; what there is of them took part.
        notes: what a file held and nothing here uses.
        behind: image points whose point is behind the camera in the end, and not far.
        residuals: of all image points.
        reliability: None when no precision was asked for, or without redundancy.
        global_test: of sigma0; None without redundancy, and where robust weights make it meaningless.
        unmeasured: control points that are in no image: they change nothing.
        diagnosis: what is wrong with it; None where nobody has looked.
        weak: what the observations hardly determine, so that there are no precisions; else empty.
        failures: what should explain the result, and failed: nobody has looked.
        far: points whose rays do not tell how far they are; they may be behind their cameras.
        unchecked: check points that are in no image, or could not be placed.
        frame: definition of the frame, where it is on the Earth; else empty.
    """

    n_observations: int
    n_unknowns: int
    redundancy: int
    sigma0: float | None
    converged: bool
    stopped: str
    precision: str
    iterations: tuple[IterationRecord, ...]
    squares: dict[str, float]
    cameras: tuple[CameraRecord, ...]
    images: tuple[ImageRecord, ...]
    points: tuple[BlockPointRecord, ...]
    left_out: tuple[BlockLeftOutRecord, ...]
    unpaired: tuple[BlockLeftOutRecord, ...]
    notes: tuple[str, ...]
    behind: tuple[ImagePointRecord, ...]
    weakened: int
    residuals: ResidualColumns
    reliability: BlockReliabilityRecord | None
    rigid_blocks: tuple[RigidRecord, ...]
    clinometers: tuple[ClinometerRecord, ...]
    run: RunRecord
    global_test: GlobalTestRecord | None = None
    unmeasured: tuple[BlockLeftOutRecord, ...] = ()
    diagnosis: DiagnosisRecord | None = None
    weak: str = ""
    failures: tuple[str, ...] = ()
    far: tuple[str, ...] = ()
    antennas: tuple[AntennaRecord, ...] = ()
    shutters: tuple[ShutterRecord, ...] = ()
    check_points: tuple[CheckPointRecord, ...] = ()
    unchecked: tuple[str, ...] = ()
    frame: str = ""
    format: str = FORMAT
    version: int = VERSION

    @property
    def is_complete(self) -> bool:
        """Converged, with nothing left out, no point behind a camera, and nothing suspected to be wrong.

        A few points that are far are as they should be; where half of all are, the block is not determined.
        """
        is_clean = not (self.left_out or self.behind or self.weak)
        is_clean = is_clean and (self.diagnosis is None or self.diagnosis.is_quiet)
        is_determined = len(self.far) < LARGE * max(len(self.points), 1)
        is_known = is_determined and not (self.failures or self.unchecked)
        is_known = is_known and not any(point.is_off for point in self.check_points)
        return self.converged and is_clean and is_known and not self.rejected_shares

    @property
    def rejected_shares(self) -> tuple[RejectedShare, ...]:
        """The block, or images and points, of which half of the tested coordinates or more are rejected."""
        if self.reliability is None:
            return ()
        images = Owners("image", [item.name for item in self.images], self.residuals.image)
        points = Owners("point", [item.name for item in self.points], self.residuals.point)
        return rejected_shares(self.reliability, self.residuals.weight, images, points)

    def table(self, name: str = "points") -> AnyTable:
        """One of its lists as a table (see `obseq.records.table`); "measures" are all image points."""
        return Table(MeasureRecord, self.measures()) if name == "measures" else table_of(self, name)

    def measures(self) -> tuple[MeasureRecord, ...]:
        """All image points that were adjusted, with their names and tests."""
        found, tests = self.residuals, self.reliability and self.reliability.all
        names = [item.name for item in self.images], [item.name for item in self.points]
        nothing = (None,) * len(found.x)
        columns = zip(
            (names[0][k] for k in found.image),
            (names[1][k] for k in found.point),
            *(found.x, found.y, found.dx, found.dy, found.sx, found.sy, found.weight),
            *((tests.w_x, tests.w_y, tests.redundancy_x, tests.redundancy_y) if tests else (nothing,) * 4),
            strict=True,
        )
        return tuple(itertools.starmap(MeasureRecord, columns))

    def to_json(self) -> str:
        """The text of the result file."""
        return text_of(self)


def is_block(plain: object) -> bool:
    """Whether what a file of results holds is the record of a block."""
    return isinstance(plain, dict) and plain.get("format") == FORMAT


def block_record_of(plain: object, where: str) -> BundleRecord:
    """The record whose plain form is given.

    Args:
        plain: what a file of results holds.
        where: how messages call it.

    Raises:
        InputError: it is not the result of a block, in this version of the format.
    """
    if not isinstance(plain, dict) or not is_block(plain):
        raise InputError(f"{where}: it is not the result of a bundle adjustment")
    if plain.get("version") != VERSION:
        raise InputError(
            f"{where}: format {FORMAT} {plain.get('version')} is not read; this version of obseq reads "
            f"{VERSION}: adjust the block again, or use the version of obseq that wrote it"
        )
    return from_plain(BundleRecord, plain, where)
