"""The record of a bundle adjustment: what the result file holds, and every report is made of.

Format "obseq-bundle", version 6 (5 had image points by columns in JSON). Coordinates are in the unit of the
world, those of images in pixels, angles in radians. What is not defined is None, and null in the file.
"""

from __future__ import annotations

from obseq.errors import InputError
from obseq.images.output.instruments import ClinometerRecord, RigidRecord
from obseq.images.output.references import AntennaRecord, CheckPointRecord, ShutterRecord
from obseq.images.output.shares import LARGE, RejectedShare, rejected_shares
from obseq.images.output.testing import BlockReliabilityRecord
from obseq.records.adjustment import IterationRecord, RunRecord
from obseq.records.diagnosis import DiagnosisRecord
from obseq.records.quality import GlobalTestRecord
from obseq.records.record import Record, from_plain
from obseq.records.rows import Rows, hold_as_columns
from obseq.records.table import AnyTable, table_of
from obseq.report.result_file import text_of

FORMAT = "obseq-bundle"
VERSION = 6


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


class MeasureRecord(Record, frozen=True):
    """An image point as it was adjusted: pixels, and the tests of both coordinates.

    Attributes:
        x: column measured; `y` the line.
        dx: computed minus measured; `dy` the same.
        sx: sigma; `sy` the same.
        weight: what robust weights left, 1 for all.
        w_x: residual over its own standard deviation; None where nothing controls it. `w_y` of the line.
        redundancy_x: share of an error that shows in the residual; `redundancy_y` of the line.
        detectable_x: smallest blunder that the test finds, None as `w_x`; `detectable_y` of the line.
    """

    image: str
    point: str
    x: float
    y: float
    dx: float
    dy: float
    sx: float
    sy: float
    weight: float = 1.0
    w_x: float | None = None
    w_y: float | None = None
    redundancy_x: float | None = None
    redundancy_y: float | None = None
    detectable_x: float | None = None
    detectable_y: float | None = None


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
        measures: all image points that were adjusted.
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
    points: Rows[BlockPointRecord]
    left_out: tuple[BlockLeftOutRecord, ...]
    unpaired: tuple[BlockLeftOutRecord, ...]
    notes: tuple[str, ...]
    behind: Rows[MeasureRecord]
    weakened: int
    measures: Rows[MeasureRecord]
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

    def __post_init__(self) -> None:
        hold_as_columns(self)

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
        return () if self.reliability is None else rejected_shares(self.reliability, self.measures)

    def table(self, name: str = "points") -> AnyTable:
        """One of its lists as a table (see `obseq.records.table`)."""
        return table_of(self, name)

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
