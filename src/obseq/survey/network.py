"""A survey network, from its files to its adjustment."""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from obseq import crs
from obseq.arguments import (
    FUNCTION,
    NOTHING,
    NUMBER,
    PATH,
    PATHS,
    TEXT,
    TRUTH,
    WHOLE,
    WORDS,
    Expected,
    expecting,
    instance,
)
from obseq.dataclass import dataclass
from obseq.errors import InputError, noting
from obseq.stopwatch import Stopwatch
from obseq.survey import files
from obseq.survey.adjustment.computation import Computation
from obseq.survey.adjustment.datum import Datum, DatumKind
from obseq.survey.adjustment.quality import Quality
from obseq.survey.assembling import deflected, in_frame
from obseq.survey.by_name import robust
from obseq.survey.checks.both_faces import MEAN, reduced_faces
from obseq.survey.checks.implausible_sigmas import implausible_sigmas
from obseq.survey.checks.repetitions import repetitions
from obseq.survey.edited import Edited
from obseq.survey.equations.frame import Frame
from obseq.survey.fieldwork import Fieldwork
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.own_frame import placed_in_own_frame
from obseq.survey.initial.plan_only import with_plans_only
from obseq.survey.model import join
from obseq.survey.point_file_options import PointFileOptions

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from pathlib import Path

    from obseq.leastsquares import Blocks
    from obseq.records.diagnosis import AccusedRecord
    from obseq.records.shown_units import ShownUnits
    from obseq.stopwatch import Progress
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.equations.point_system import PointSystem
    from obseq.survey.model import FieldBook, Points

MAX_ITERATIONS = 25
QUALITY = Quality()
GIVEN = Datum()


@dataclass(frozen=True, eq=False)
class Network(Edited):
    """Points and observations to adjust.

    Attributes:
        points: All points that a file gives or an active observation names; coordinates in the frame.
        book: The observations, numbered like the points.
        frame: The computation frame.
        points_crs: The coordinate system of the point files, and of the results.
        phases: Seconds spent reading.
        unit_sigma: By what another program multiplies sigma0 where it reports it (Gama's sigma-apr); None for
            no such program.
        datum: What it rests on, unless the adjustment is told otherwise.
        shown: Units in which results are reported, those of its files; None for metres and gon.
        written: Units of its files; None for metres and gon.

    Example:
        >>> from obseq.survey import Network
        >>> network = Network.read("survey.obs", "points.cor", frame="RTL*2.4*48.8*0*EPSG:4326")
        >>> adjustment = network.adjust()
        >>> adjustment.sigma0, adjustment.points.coordinates
    """

    frame: Frame
    points_crs: crs.CoordinateSystem
    phases: dict[str, float] = field(default_factory=dict)
    unit_sigma: float | None = None
    datum: Datum = GIVEN
    shown: ShownUnits | None = None
    written: ShownUnits | None = None

    @classmethod
    @expecting(
        observation_files=PATHS,
        point_files=PATHS,
        frame=TEXT | NOTHING,
        points_crs=TEXT | NOTHING,
        point_sigma=NUMBER | NOTHING,
        encoding=TEXT,
        point_format=TEXT | NOTHING,
        point_options=instance(PointFileOptions) | NOTHING,
        ignore=WORDS,
        refraction=NUMBER,
        geoid=PATH | NOTHING,
        stochastic=PATH | NOTHING,
        instrument=TEXT | NOTHING,
        faces=TEXT,
    )
    def read(
        cls,
        observation_files: str | Path | Sequence[str | Path],
        point_files: str | Path | Sequence[str | Path] = (),
        frame: str | None = None,
        points_crs: str | None = None,
        point_sigma: float | None = None,
        encoding: str = "utf-8",
        point_format: str | None = None,
        point_options: PointFileOptions | None = None,
        ignore: Collection[str] = (),
        refraction: float = crs.REFRACTION_COEFFICIENT,
        geoid: str | Path | None = None,
        stochastic: str | Path | None = None,
        instrument: str | None = None,
        faces: str = MEAN,
    ) -> Network:
        """Reads OBS files and point files.

        Args:
            observation_files: OBS files; each starts afresh, their observations are put together.
            point_files: COR files, tables of points (.csv), or files of another format (`point_format`);
                without any the network is placed in a frame of its own.
            frame: Definition of the computation frame; without it a plane with heights, or a local tangent
                frame at the mean of the known points when their system is given. A bare `RTL` takes its
                origin from the mean of the points.
            points_crs: Definition of the system of the points; without it the frame.
            point_sigma: Sigma (m) of known points whose line gives none.
            encoding: Encoding of names in the files.
            point_format: Fields of a line of the point files, as MMVII's ImportGCP names them (`ANXYZ`).
            point_options: Everything else about such files; `point_sigma` and `encoding` go before it.
            ignore: What is to be left out of the files, with a warning: "heights", "relative-sigmas",
                "deflections", "after-sigma" (everything after the sigma of an observation).
            refraction: Coefficient k of zenith angles: rays are arcs of radius (radius of the Earth) / k.
            geoid: Deflections of the vertical of points whose line gives none (see `with_deflections`).
            stochastic: File that says what observations are worth, in place of their own sigmas (see
                `obseq.formats.read_stochastic`).
            instrument: Name of an instrument of that file, or of the library, that all are alike (see
                `obseq.formats.stochastic_model`).
            faces: Of sights in both faces of the telescope, "mean" to adjust the means, "all" all readings.

        Raises:
            InputError: A file or a definition is wrong; the message says where and what to do.
        """
        points = (points_crs, point_sigma, point_format, point_options)
        worth = (stochastic, instrument, faces)
        network = files.read_network(
            observation_files, point_files, frame, points, encoding, ignore, refraction, worth
        )
        return network if geoid is None else network.with_deflections(geoid)

    @classmethod
    @expecting(
        paths=PATHS,
        frame=TEXT | NOTHING,
        refraction=NUMBER | NOTHING,
        encoding=TEXT,
        outside=TRUTH,
        geoid=PATH | NOTHING,
        ignore=WORDS,
        sigmas=WORDS,
        points_crs=TEXT | NOTHING,
        stochastic=PATH | NOTHING,
        instrument=TEXT | NOTHING,
        faces=TEXT,
        point_files=PATHS,
        point_sigma=NUMBER | NOTHING,
    )
    def read_project(
        cls,
        paths: str | Path | Sequence[str | Path],
        frame: str | None = None,
        refraction: float | None = None,
        encoding: str = "utf-8",
        *,
        points_crs: str | None = None,
        outside: bool = False,
        geoid: str | Path | None = None,
        ignore: Collection[str] = (),
        sigmas: Collection[str] = (),
        stochastic: str | Path | None = None,
        instrument: str | None = None,
        faces: str = MEAN,
        point_files: str | Path | Sequence[str | Path] = (),
        point_sigma: float | None = None,
    ) -> Network:
        """Reads what files of another program describe, such as a Comp3D project (`.comp`).

        Args:
            paths: The file, or the files that belong together.
            frame: Definition of the computation frame, in place of the one of the project.
            refraction: Coefficient of zenith angles, in place of the one of the project.
            encoding: Encoding of names in the files.
            points_crs: Definition of the system of the points, of files that do not say it (tables).
            outside: Whether files outside the folder of the project may be read.
            geoid: Geoid heights and deflections (see `with_deflections`); heights are for DynAdjust files.
            ignore: What is to be passed over, as for `read`; "frames": reference frames and epochs of single
                observations that are not those of the network.
            sigmas: Standard deviations of observations whose file has none, such as "distance=2mm" (STAR*NET,
                LandXML).
            stochastic: File that says what observations of each instrument are worth, centring included (see
                `obseq.formats.read_stochastic`): in place of the sigmas of the files, where they have some.
            instrument: As for `read`; standard deviations that `sigmas` names go before its own.
            faces: "mean" or "all", as for `read`.
            point_files: More points, as for `read`: those of which the files themselves say nothing.
            point_sigma: Sigma (m) of known ones among these whose line gives none.

        Raises:
            InputError: Something in the files cannot be read; the message says where and what to do.
        """
        return files.read_project_network(
            paths,
            (point_files, point_sigma),
            (frame, points_crs),
            (encoding, outside, ignore),
            (sigmas, stochastic, instrument, faces),
            refraction,
            geoid,
        )

    @expecting(geoid=PATH)
    def with_deflections(self, geoid: str | Path) -> Network:
        """The network with deflections of the vertical of a geoid, for points that have none of their own.

        Points are looked up where files or first values put them, the others in the middle of these.

        Args:
            geoid: A grid (.gsb) or a list of stations (.geo); its heights have no part: a warning says so
                where all that it gives are heights.

        Raises:
            InputError: The network has no place on the Earth, or the geoid says nothing of its points.
        """
        if not self.frame.has_place:
            raise InputError(f"{geoid}: deflections need a place on the Earth: say the system of the points")
        xyz = self.fieldwork.initial_values().coordinates
        points, warning = deflected(self.points, xyz, self.frame, geoid)
        return replace(self, points=points, book=self.book.warned(*warning))

    def __repr__(self) -> str:
        from obseq.survey.adjustment.plotting import network_text

        return f"Network: {network_text(self.points, self.book, self.frame)}"

    def _repr_html_(self) -> str:
        from obseq.survey.adjustment.plotting import network_html

        return network_html(self.points, self.book, self.frame)

    @classmethod
    def assembled(
        cls,
        points: Points,
        book: FieldBook,
        frame: str | None,
        points_crs: str | None,
        refraction: float,
        watch: Stopwatch,
        faces: str = MEAN,
    ) -> Network:
        """The network of points in their system and of observations."""
        with watch.phase("read"):
            points, book = join(points, reduced_faces(book, faces))
        with watch.phase("coordinate systems"):
            points, computation, given, warning = in_frame(points, book, frame, points_crs)
            told = [] if warning is None else [warning]
            book = book.warned(*told, *repetitions(book), *implausible_sigmas(points, book))
            frame_of_network = Frame(computation, refraction)
            own = None if frame_of_network.has_place else placed_in_own_frame(points, book)
        if own is None:
            return cls(points, book, frame_of_network, given, watch.seconds)
        points, words = own
        free = Datum(DatumKind.INNER)
        return cls(points, book.warned(words), frame_of_network, given, watch.seconds, datum=free)

    @property
    def point_system(self) -> PointSystem:
        """The coordinates of points in the system of their files."""
        return self.fieldwork.point_system

    @property
    def fieldwork(self) -> Fieldwork:
        """What an adjustment works on."""
        work = Fieldwork(self.points, self.book, self.frame, self.points_crs, self.shown, self.written)
        return replace(work, points=with_plans_only(self.points, self.book)) if work.has_heights else work

    def given_points(self) -> Points:
        """The points with coordinates in the system of their files; those that it adds have none."""
        placed = self.points.has_coordinates
        coordinates = np.full_like(self.points.coordinates, np.nan)
        coordinates[placed] = self.point_system.coordinates(self.points.coordinates[placed])
        return replace(self.points, coordinates=coordinates)

    def initial_values(self) -> InitialValues:
        """Coordinates of all points and orientations of all stations, from the known points and observations.

        Raises:
            InputError: Some points or stations cannot be placed; the message lists them with the reasons.
        """
        if (rows := np.flatnonzero(self.book.of_cameras)).size:
            raise InputError(
                f"{self.book.label(int(rows[0]))}: its station is a camera (#CAM), which an adjustment of "
                "images turns: bundle-adjust with TopoDirIn, or BundleAdjustment.add_survey"
            )
        initial = self.fieldwork.initial_values()
        initial.require_complete()
        return initial

    @expecting(
        max_iterations=WHOLE,
        tolerance=NUMBER,
        strict=TRUTH,
        progress=FUNCTION | NOTHING,
        quality=instance(Quality),
        start=instance(InitialValues) | NOTHING,
        datum=instance(Datum) | TEXT | NOTHING,
        strategy=TEXT,
        loss=TEXT | NOTHING,
        blocks=Expected("Blocks", lambda value: type(value).__name__ == "Blocks") | NOTHING,
    )
    def adjust(
        self,
        max_iterations: int = MAX_ITERATIONS,
        tolerance: float = 1e-6,
        progress: Progress | None = None,
        *,
        strict: bool = False,
        quality: Quality = QUALITY,
        start: InitialValues | None = None,
        datum: Datum | str | None = None,
        strategy: str = "controlled",
        loss: str | None = None,
        blocks: Blocks | None = None,
    ) -> Adjustment:
        """Adjusts the network by least squares.

        Points and stations that the observations do not determine are left out, with their observations;
        `Adjustment.left_out` names them. Gross errors are looked for, and named with likely slips
        (`Adjustment.diagnosis`); the observations are adjusted all the same.

        Args:
            max_iterations: The iterations end at this number when they have not converged before.
            tolerance: Convergence: no unknown moves any more by this share of its standard deviation.
            progress: Receives what is being done.
            strict: Refuse a network of which something would have to be left out, or with gross errors.
            quality: What is wanted beside residuals and precisions.
            start: Where the iterations start; by default initial values from the known points and the
                observations.
            datum: What the network rests on, or "given", "fixed", "inner"; None for what the files say, or
                the known coordinates.
            strategy: How the iterations move; see `obseq.LeastSquares.solve`.
            loss: "huber", "l1", "cauchy" or "tukey" for robust weights.
            blocks: How it is solved in blocks, with little memory or by many workers; None for at once.

        Raises:
            InputError: Something in the input makes the adjustment impossible.
            SingularSystemError: The observations do not determine some unknowns, which the message names.
        """
        wanted = Datum(cast("DatumKind", datum)) if isinstance(datum, str) else datum
        datum_chosen = wanted or self.datum
        watch = Stopwatch(progress)
        computation = Computation(
            self.frame,
            self.points_crs,
            self.unit_sigma,
            max_iterations,
            tolerance,
            watch,
            quality,
            strategy=strategy,
            blocks=blocks,
        )

        def adjusted(book: FieldBook) -> Adjustment:
            work = replace(self, book=book).fieldwork
            return work.adjusted(datum_chosen, computation, strict=strict, start=start)

        with noting(self.book.warnings):
            adjustment = robust(self.book, loss, adjusted) if loss else adjusted(self.book)
        return replace(adjustment, phases=self.phases | watch.seconds, shown=self.shown)

    def gross_errors(self) -> tuple[AccusedRecord, ...]:
        """What is wrong with it: where, by how much, and by which slip; the clearest first."""
        return self.adjust().gross_errors
