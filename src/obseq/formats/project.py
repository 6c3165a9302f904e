"""What a reader of the files of another program makes of them: a network, and how it is to be computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.stochastic import StochasticModel
from obseq.records.shown_units import ShownUnits
from obseq.survey.model import FieldBook, Points

NOTHING = StochasticModel()


@dataclass(frozen=True, eq=False)
class Project:
    """What the files of another program describe.

    Attributes:
        points: The points, in their own system.
        book: The observations.
        frame: Definition of the computation frame; None for the one that the points ask for.
        points_crs: Definition of the system of the points; None for the frame.
        refraction: Coefficient of zenith angles.
        max_iterations: The iterations end at this number; None for the usual one.
        unit_sigma: Standard deviation of unit weight (mm, cc) by which the program multiplies sigma0 where it
            reports; None when it does not.
        inner: With inner constraints, names of points that do not carry them, and of those whose coordinates
            stay known then; None without.
        has_geoid: Whether the geoid that is given has been used.
        shown: Units of the files, in which results are reported; None for metres and gon.
        is_from_grid_north: Whether azimuths are bearings on the map, where the points have one.
        units: (n,) metres in the unit of length in which the files give the coordinates of each point: they
            are in metres here. NaN for coordinates in the units of their system; None where all are.
        stochastic: What observations of its instruments are worth.
        centred: Rows of observations in whose standard deviations centring is still to be.
        vertical_factors: Of GNSS vectors, by their first row (`vertical_factors`).
    """

    points: Points
    book: FieldBook
    frame: str | None = None
    points_crs: str | None = None
    refraction: float = crs.REFRACTION_COEFFICIENT
    max_iterations: int | None = None
    unit_sigma: float | None = None
    inner: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    has_geoid: bool = False
    shown: ShownUnits | None = None
    is_from_grid_north: bool = False
    units: FloatArray | None = None
    stochastic: StochasticModel = NOTHING
    centred: tuple[int, ...] = ()
    vertical_factors: Mapping[int, float] = field(default_factory=dict)

    def points_in(self, definition: str | None) -> Points:
        """The points with coordinates in the units of their system.

        Args:
            definition: Of that system; None for a plane in metres.
        """
        return self.points if self.units is None else in_own_units(self.points, self.units, definition)

    def systems(self, frame: str | None, points_crs: str | None) -> tuple[str | None, str | None]:
        """Definitions of the computation frame, and of the system of the points: those given, else its own.

        Raises:
            InputError: A system of the points is given, and it has one.
        """
        if points_crs is not None and self.points_crs is not None:
            raise InputError(
                f"--points-crs {points_crs}: the points of these files are in {self.points_crs}, as they "
                "say; leave it out"
            )
        return frame or self.frame, points_crs or self.points_crs


def in_own_units(points: Points, units: FloatArray, definition: str | None) -> Points:
    """Points with coordinates in the units of their system: longitudes and latitudes are angles in any case.

    Args:
        points: In metres.
        units: (n,) as in `Project`.
        definition: Of the system; None for a plane in metres.
    """
    if definition is None:
        return points
    system = crs.parse(definition)
    plan = units if system.plan_unit.is_angle else np.full(len(units), system.plan_unit.factor)
    own = np.column_stack([plan, plan, np.full(len(units), system.height_unit.factor)])
    own[np.isnan(units)] = 1.0
    return replace(points, coordinates=points.coordinates / own)


@dataclass(frozen=True)
class Reading:
    """How files are to be read.

    Attributes:
        encoding: Encoding of names in the files.
        outside: Whether files outside the folder of the project may be read.
        geoid: File of geoid heights and deflections, for heights above the geoid; None without.
        ignore: What is to be left out or passed over, by name (`obseq.formats.obs.after_sigma.IGNORABLE`).
        sigmas: Standard deviations of observations whose file has none, by name (`default_sigmas.NAMES`).
        instruments: The same of named instruments.
        has_points: Whether other files give points, so that these need not.
    """

    encoding: str = "utf-8"
    outside: bool = False
    geoid: Path | None = None
    ignore: frozenset[str] = frozenset()
    sigmas: Mapping[str, float] = field(default_factory=dict)
    instruments: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    has_points: bool = False


Reader = Callable[[tuple[Path, ...], Reading], Project]
"""Reads the files that a user named together."""


def only_one(paths: tuple[Path, ...]) -> Path:
    """The path of a project that is one file.

    Raises:
        InputError: There are more.
    """
    if len(paths) > 1:
        raise InputError(f"{paths[1]}: {paths[0]} is a project by itself; adjust one at a time")
    return paths[0]
