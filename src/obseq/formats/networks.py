"""Networks from files: OBS and point files, or what files of another program describe."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.errors import noting
from obseq.formats.default_sigmas import parse_sigmas
from obseq.formats.levelled_points import hold_plans, with_heights
from obseq.formats.obs.after_sigma import checked_ignore
from obseq.formats.obs.exchanged import told_if_exchanged
from obseq.formats.obs.free_points import read_points
from obseq.formats.obs.obs import read_obs
from obseq.formats.obs.point_lists import read_point_lists
from obseq.formats.once import require_distinct
from obseq.formats.project import NOTHING, Reading
from obseq.formats.registry import read_project
from obseq.formats.stochastic import stochastic_model
from obseq.formats.vertical_factors import with_vertical_factors
from obseq.stopwatch import Stopwatch
from obseq.survey.adjustment.datum import Datum, DatumKind
from obseq.survey.grid_bearings import from_grid_north
from obseq.survey.kinds.vectors import VECTOR
from obseq.survey.model import Points, merge_points
from obseq.survey.network import Network
from obseq.survey.point_file_options import PointFileOptions

LEAST_TURN = 1e-4
"""Metres at the end of a vector from which turned axes are told: rounding of the files is less."""


Files = str | Path | Sequence[str | Path]


def read_network(
    observation_files: Files,
    point_files: Files,
    frame: str | None,
    point_options: tuple[str | None, float | None, str | None, PointFileOptions | None],
    encoding: str,
    ignore: Collection[str],
    refraction: float,
    worth: tuple[str | Path | None, str | None, str],
) -> Network:
    """The network of OBS files and point files; see `Network.read`.

    Args:
        observation_files: OBS files.
        point_files: Files of points.
        frame: Definition of the frame.
        point_options: System, sigma and format of the points, and what else is said of them.
        encoding: Of names.
        ignore: What is left out.
        refraction: Coefficient.
        worth: The file of the stochastic model; the instrument that all are alike; what becomes of readings
            in both faces.
    """
    stochastic, instrument, faces = worth
    points_crs, point_sigma, point_format, options = point_options
    watch = Stopwatch()
    with watch.phase("read"), told_if_exchanged(observation_files, point_files, encoding):
        book = read_obs(observation_files, encoding, ignore)
        if point_format is None:
            system = points_crs or frame
            points = read_point_lists(point_files, point_sigma, encoding, ignore, system)
        else:
            options = replace(options or PointFileOptions(), encoding=encoding)
            if point_sigma is not None:
                options = replace(options, sigma=point_sigma)
            points = _read_free_format(point_files, point_format, options)
        points = with_heights(hold_plans(points, book), book)
    model, taken = stochastic_model(stochastic, instrument), np.zeros(0, np.bool_)
    if stochastic is not None or instrument is not None:
        book, taken = model.weighed(book)
    with noting(book.warnings):
        network = Network.assembled(points, book, frame, points_crs, refraction, watch, faces)
    return model.centring(network, taken) if taken.any() else network


def read_project_network(
    paths: Files,
    more_points: tuple[Files, float | None],
    systems: tuple[str | None, str | None],
    reading: tuple[str, bool, Collection[str]],
    worth: tuple[Collection[str], str | Path | None, str | None, str],
    refraction: float | None,
    geoid: str | Path | None,
) -> Network:
    """The network that files of another program describe; see `Network.read_project`.

    Args:
        paths: The files.
        more_points: Files of points beside them, and the sigma of those that have none.
        systems: Definitions of the frame and of the system of the points.
        reading: Encoding; whether files outside are read; what is ignored.
        worth: Standard deviations; the file of the stochastic model; the instrument that all are alike; what
            becomes of both faces.
        refraction: Coefficient of zenith angles.
        geoid: Geoid heights and deflections.
    """
    (encoding, outside, ignore), (sigmas, stochastic, instrument, faces) = reading, worth
    watch = Stopwatch()
    with watch.phase("read"):
        place, left_out = Path(geoid) if geoid else None, checked_ignore(ignore)
        model = stochastic_model(stochastic, instrument)
        given = {**model.default, **parse_sigmas(sigmas)}
        files, sigma = more_points
        has_more = isinstance(files, str | Path) or bool(files)
        how = Reading(encoding, outside, place, left_out, given, model.instruments, has_more)
        project = read_project(paths, how)
        own = project.systems(*systems)
        points = project.points_in(own[1] or own[0])
        if has_more:
            points = completed(points, read_point_lists(files, sigma, encoding, ignore, own[1] or own[0]))
    coefficient = project.refraction if refraction is None else refraction
    book = project.book
    centred = np.isin(np.arange(len(book.observations)), project.centred)
    if (stochastic or instrument) and project.stochastic is NOTHING:
        book, centred = model.weighed(book)
        project = replace(project, stochastic=model)
    with noting(book.warnings):
        network = Network.assembled(points, book, *own, coefficient, watch, faces)
    datum = network.datum if project.inner is None else Datum(DatumKind.INNER, (), *project.inner)
    network = replace(
        network, unit_sigma=project.unit_sigma, datum=datum, shown=project.shown, written=project.shown
    )
    if project.is_from_grid_north:
        network = replace(network, book=from_grid_north(network.fieldwork))
    network = project.stochastic.centring(network, centred)
    network = with_axes_told(with_vertical_factors(network, project.vertical_factors))
    if place is None or project.has_geoid:
        return network
    if "deflections" in left_out:
        return replace(network, book=network.book.warned(f"{place}: left out, as asked for (--ignore)"))
    return network.with_deflections(place)


def completed(points: Points, more: Points) -> Points:
    """Points with those of other files, which count where the first ones have first values at most.

    Raises:
        InputError: A point is known to the first ones too.
    """
    is_flat = (points.coordinates[:, 2] == 0.0) & (points.sigmas[:, 2] == 0.0)  # held, of a plane
    unknown = np.isnan(points.sigmas)
    unknown[:, 2] |= is_flat
    names = set(more.names)
    given = np.array([name in names for name in points.names], np.bool_)
    kept = np.flatnonzero(~(given & unknown.all(axis=1)))
    return merge_points([points.subset(kept), more])


def with_axes_told(network: Network) -> Network:
    """The network, with a warning where its vectors are along other axes than its points.

    Vectors of satellites are along the axes of WGS 84 (ITRF). Where PROJ turns the geodetic system of the
    points against these, another program that takes both as one has other coordinates.
    """
    system, book = network.frame.system, network.book
    rows = np.flatnonzero((book.observations.types == VECTOR.code) & book.observations.active)
    if not rows.size or not isinstance(system, crs.RigidSystem) or system.ground.is_plain:
        return network
    rotation = system.ground.rotation
    angle = float(np.linalg.norm(rotation - rotation.T)) / math.sqrt(8.0)
    vectors = np.stack([book.observations.values[rows + k] for k in range(3)])
    effect = float(np.linalg.norm((rotation - np.eye(3)) @ vectors, axis=0).max())
    if effect < LEAST_TURN:
        return network
    description = network.points_crs.definition
    operation = getattr(network.points_crs, "operation", None)
    by = f" ({operation.description})" if operation is not None else ""
    told = (
        f"{len(rows)} GNSS vectors are along the axes of WGS 84 (ITRF), against which PROJ turns those of "
        f"{description} by {angle * 648000.0 / math.pi:.3f} arc seconds{by}: by up to {effect * 1e3:.1f} mm "
        "at their ends. Programs that take them along the axes of the points differ by so much"
    )
    return replace(network, book=book.warned(told))


def _read_free_format(files: Files, point_format: str, options: PointFileOptions) -> Points:
    paths = [files] if isinstance(files, str | Path) else files
    require_distinct(paths)
    return merge_points([read_points(path, point_format, options) for path in paths])
