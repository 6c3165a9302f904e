"""Networks written as files of other programs, and points as point files."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arguments import NOTHING, PATH, TEXT, expecting, instance
from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.dynadjust.dynaml_writer import DynamlNetwork, dynaml_text
from obseq.formats.dynadjust.stations import ELLIPSOID
from obseq.formats.gama.sets import GamaNetwork
from obseq.formats.gama.writer import gama_text
from obseq.formats.obs.cor import cor_text
from obseq.formats.obs.obs import obs_text
from obseq.formats.point_files import cor_of, csv_of, csv_text, observations_csv
from obseq.formats.sinex.normals import normals_of
from obseq.formats.sinex.reader import MOST_OF_NORMALS
from obseq.formats.sinex.writer import held_exactly, sinex_text
from obseq.formats.tables.writer import table_text
from obseq.records.adjustment import AdjustmentRecord
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.datum import Datum, DatumKind, freed, held
from obseq.survey.drawings import dxf
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE, codes_where
from obseq.survey.maps import geojson, geopackage, kml
from obseq.survey.model import Points
from obseq.survey.network import Network
from obseq.writing import write_text

UNIT_SIGMA = 10.0
"""Gama's standard deviation of unit weight, for networks that have none."""
NO_CORRECTION = 1.0
MOST_STATIONS = 3000
"""Stations of a SINEX file: their covariance is dense."""


NETWORK_WRITERS: dict[str, Callable[[Network], str]] = {
    ".gkf": lambda network: gama_text(as_gama(network)),
    ".obs": lambda network: obs_text(network.book),
    ".cor": lambda network: cor_text(known_points(network)),
    ".xml": lambda network: dynaml_text(as_dynaml(network)),
    ".csv": lambda network: csv_text(tabled_points(network)),
    ".obs.csv": lambda network: table_text(network.book),
}
"""What writes networks, by the suffix of the file: its text."""
RESULT_WRITERS: dict[str, Callable[[AdjustmentRecord, float], str | bytes]] = {
    ".cor": lambda record, _: cor_of(record),
    ".csv": lambda record, _: csv_of(record),
    ".obs.csv": lambda record, _: observations_csv(record),
    ".geojson": geojson,
    ".gpkg": geopackage,
    ".kml": kml,
    ".dxf": dxf,
}
"""What writes results, by the suffix of the file: of the result, and how much larger ellipses are drawn."""


@expecting(path=PATH, network=instance(Network))
def write_gama(path: str | Path, network: Network) -> None:
    """Writes a network for gama-local; `Network.read_project` gives it back.

    Raises:
        InputError: Gama cannot adjust something in it, which the message names; or nothing can be written.
    """
    write_text(path, gama_text(as_gama(network)))


def as_gama(network: Network) -> GamaNetwork:
    """A network as Gama sees it.

    Raises:
        InputError: It is not in a plane, or needs corrections that Gama does not know.
    """
    turn = network.point_system.turn
    if not network.frame.is_plane or turn is None:
        raise InputError(
            f"Gama computes in a plane with heights, and this network in {network.frame.system.definition}: "
            "distances and directions would have to be reduced to the plane first"
        )
    _refuse_inner(network, "Gama")
    _refuse_corrections(network, "Gama", NO_CORRECTION)
    system = network.points_crs
    assert isinstance(system, crs.UnreferencedSystem)
    axes = system.definition.partition("*")[2] or "en"
    return GamaNetwork(
        points=in_own_system(network),
        book=network.book,
        axes=axes,
        turn=turn,
        sigmas=_sigmas(network),
        unit_sigma=network.unit_sigma or UNIT_SIGMA,
        description="written by obseq; x and y as in axes-xy",
    )


@expecting(path=PATH, network=instance(Network), frame=TEXT | NOTHING, epoch=TEXT)
def write_dynaml(path: str | Path, network: Network, frame: str | None = None, epoch: str = "") -> None:
    """Writes a network for DynAdjust, stations and measurements in one file.

    Args:
        path: The file.
        network: The network.
        frame: Name of the reference frame, such as GDA2020; that of the system of the points when None.
        epoch: dd.mm.yyyy.

    Raises:
        InputError: DynaML cannot say something in it, which the message names; or nothing can be written.
    """
    write_text(path, dynaml_text(as_dynaml(network, frame, epoch)))


def as_dynaml(network: Network, frame: str | None = None, epoch: str = "") -> DynamlNetwork:
    """A network as DynAdjust sees it.

    Raises:
        InputError: It has no place on the Earth or no reference frame, or needs corrections.
    """
    if not network.frame.has_place:
        raise InputError(
            f"DynaML is for places on the Earth, and this network is in "
            f"{network.frame.system.definition}: say the system of its points (--points-crs)"
        )
    _refuse_inner(network, "DynAdjust")
    _refuse_other_ground(network)
    _refuse_corrections(network, "DynAdjust", 0.0)
    points, placed = network.points, network.points.has_coordinates
    invented = network.fieldwork.points.is_invented
    lacking = np.flatnonzero(invented[:, :2].any(axis=1) | (invented[:, 2] & ~placed))
    if lacking.size:
        what = "plan" if invented[lacking[0], :2].any() else "height"
        raise InputError(
            f"point {points.names[lacking[0]]} has no {what}, which DynaML cannot say; write .csv"
        )
    if not placed.all():
        points = replace(points, coordinates=network.initial_values().coordinates)
    plain = crs.Transformer(network.frame.system, crs.parse(ELLIPSOID))
    points = replace(points, coordinates=plain.forward(points.coordinates))
    return DynamlNetwork(points, network.book, frame or _frame_name(network), epoch)


def _frame_name(network: Network) -> str:
    from obseq.crs.operations import known_crs

    definition = network.points_crs.definition
    system = known_crs(definition).geodetic_crs if network.points_crs.kind is crs.Kind.PROJ else None
    if system is None or system.name in ("", "unknown"):
        raise InputError(f"the reference frame of the points ({definition}) has no name; say which it is")
    return str(system.name)


@expecting(path=PATH, adjustment=instance(Adjustment))
def write_sinex(path: str | Path, adjustment: Adjustment) -> None:
    """Writes the adjusted points as a SINEX file, with their whole covariance.

    Raises:
        InputError: The network has no place on the Earth, a point is held exactly, or nothing can be written.
    """
    write_text(path, sinex_of(adjustment))


def sinex_of(adjustment: Adjustment) -> str:
    """The text of a SINEX file of adjusted points."""
    solution, points = adjustment.solution, adjustment.points
    rotation, translation = _geocentric_pose(crs.parse(adjustment.frame))
    _check_points(points.points)
    n = len(points.names)
    ids = solution.table.find(list(points.names), "Point3")
    blocks = solution.covariance_between(ids, ids, adjustment.precision == "a priori")
    turn = np.kron(np.eye(n), rotation)
    whole = turn @ blocks @ turn.T
    statistics = {
        "NUMBER OF OBSERVATIONS": float(solution.n_observations + solution.n_constraints),
        "NUMBER OF UNKNOWNS": float(solution.n_unknowns),
        "NUMBER OF DEGREES OF FREEDOM": float(solution.redundancy),
        "VARIANCE FACTOR": float(solution.variance_factor or 1.0),
    }
    normals = normals_of(whole) if points.points.in_datum.any() else None
    places = points.coordinates @ rotation.T + translation
    return sinex_text(points.names, places, whole, statistics, normals=normals)


def check_sinex(network: Network, datum: Datum | None = None) -> None:
    """Refuses, before its adjustment, a network that no SINEX file can hold.

    Args:
        network: as it was read.
        datum: what it is to rest on; None for what its files say.

    Raises:
        InputError: see `write_sinex`.
    """
    points, chosen = network.points, network.datum if datum is None else datum
    _geocentric_pose(network.frame.system)
    if chosen.kind is DatumKind.FIXED:
        points = held(points)
    elif chosen.kind is DatumKind.INNER:
        points = freed(points, points.coordinates, chosen)
    _check_points(points)


def _geocentric_pose(frame: crs.CoordinateSystem) -> tuple[FloatArray, FloatArray]:
    try:
        return frame.geocentric_pose()
    except crs.CrsError as error:
        raise InputError(f"SINEX is for places on the Earth: {error}") from error


def _check_points(points: Points) -> None:
    """Refuses too many points, ones that are held, and a free network of which some carry no datum."""
    if len(points) > MOST_STATIONS:
        raise InputError(
            f"SINEX: {len(points)} points have a dense covariance; choose at most {MOST_STATIONS}"
        )
    exact = np.flatnonzero(points.is_held.any(axis=1))
    if exact.size:
        raise held_exactly(points.names[exact[0]])
    partial = np.flatnonzero(points.is_invented.any(axis=1))
    if partial.size:
        raise InputError(
            f"SINEX: nothing observes the height of point {points.names[partial[0]]}, and SINEX knows no "
            "point without one; observe it, or leave the point out"
        )
    outside = np.flatnonzero(~points.in_datum.all(axis=1))
    if outside.size and points.in_datum.any():
        raise InputError(
            f"SINEX: point {points.names[outside[0]]} does not carry the datum of this free network; let all "
            "points do (--datum inner without --datum-points)"
        )
    if points.in_datum.any() and len(points) > MOST_OF_NORMALS:
        raise InputError(f"SINEX: normal equations of {len(points)} points; at most {MOST_OF_NORMALS}")


def in_own_system(network: Network) -> Points:
    """The points with coordinates in their own system."""
    points = network.points
    placed, turn = points.has_coordinates, network.point_system.turn
    coordinates = np.full_like(points.coordinates, np.nan)
    if turn is not None:
        coordinates = points.coordinates[:, np.abs(turn).argmax(axis=1)] * turn.sum(axis=1)
    else:
        coordinates[placed] = network.point_system.coordinates(points.coordinates[placed])
    return replace(points, coordinates=coordinates)


def _without_inventions(points: Points) -> Points:
    """The points without what nobody gave: places to compute at are no coordinates."""
    invented = points.is_invented
    return replace(
        points,
        coordinates=np.where(invented, np.nan, points.coordinates),
        sigmas=np.where(invented, np.nan, points.sigmas),
        invented=None,
    )


def known_points(network: Network) -> Points:
    """The points for a COR file: those without coordinates are computed from the observations.

    Raises:
        InputError: Some cannot be placed, or the points carry a datum that a COR file cannot say.
    """
    points = network.points
    _refuse_datum(points, "a COR file")
    if not points.has_coordinates.all():
        computed = network.initial_values().coordinates
        computed = np.where(network.fieldwork.points.is_invented, np.nan, computed)
        given = points.coordinates
        points = replace(points, coordinates=np.where(np.isnan(given), computed, given))
    return _without_inventions(in_own_system(replace(network, points=points)))


def tabled_points(network: Network) -> Points:
    """The points for a table.

    Raises:
        InputError: They have deflections, or carry a datum, that a table cannot say.
    """
    points = network.points
    _refuse_datum(points, "a table of points")
    deflected = np.flatnonzero(np.isfinite(points.deflections).any(axis=1))
    if deflected.size:
        raise InputError(
            f"point {points.names[deflected[0]]} has a deflection of the vertical, which a table of points "
            "cannot say; write .cor (or --ignore deflections)"
        )
    return _without_inventions(in_own_system(network))


def _refuse_datum(points: Points, what: str) -> None:
    """Refuses the datum of a free network and covariances of known coordinates."""
    if points.in_datum.any():
        name = points.names[int(np.flatnonzero(points.in_datum.any(axis=1))[0])]
        raise InputError(
            f"point {name} carries the datum of a free network, which {what} cannot say; write .gkf"
        )
    if points.covariance is not None:
        raise InputError(
            f"known coordinates have a covariance, which {what} cannot say: only Comp3D's projects have it "
            "(coord_cov_file), or correlated Px, Py, Pz in a table of observations"
        )


def datum_options(network: Network) -> str:
    """What to say to `obseq adjust` of the inner constraints on which a network rests; nothing without.

    Raises:
        InputError: Known coordinates stay known beside them, which no option says.
    """
    datum, points = network.datum, network.points
    if datum.kind is not DatumKind.INNER:
        return ""
    known = [name for name in datum.kept if not points.is_free[points.index[name]].all()]
    if known:
        raise InputError(
            f"point {known[0]} stays known beside the inner constraints of this project, which OBS, COR and "
            "CSV files cannot say: adjust the project itself"
        )
    carrying = datum.points or tuple(name for name in points.names if name not in datum.remote)
    chosen = "" if len(carrying) == len(points) else " --datum-points " + " ".join(map(shlex.quote, carrying))
    return f" --datum inner{chosen}"


def _refuse_inner(network: Network, program: str) -> None:
    """Refuses inner constraints, which another program would not take over."""
    if network.datum.kind is DatumKind.INNER:
        raise InputError(
            f"this project rests on inner constraints, which a file for {program} would lose: write .obs and "
            ".cor, and adjust them with --datum inner"
        )


def _refuse_other_ground(network: Network) -> None:
    """Refuses what DynAdjust would read along normals that are not those of the network."""
    frame = network.frame.system
    if isinstance(frame, crs.RigidSystem) and not frame.ground.is_plain:
        raise InputError(
            f"heights and verticals of {network.points_crs.definition} are those of its own ellipsoid, and "
            "DynAdjust would take them from that of WGS 84 (GRS 80), which is tilted against it: give the "
            "system of the points with `@h` (heights stay what they are)"
        )


def _refuse_corrections(network: Network, program: str, without: float) -> None:
    """Refuses what a program does not correct; `without` is the coefficient at which nothing is corrected."""
    rows = network.book.observations
    zeniths = np.flatnonzero(rows.active & np.isin(rows.types, codes_where(lambda kind: kind.is_refracted)))
    if zeniths.size and network.frame.refraction_coefficient != without:
        raise InputError(
            f"{network.book.label(int(zeniths[0]))}: zenith angles are corrected (coefficient "
            f"{network.frame.refraction_coefficient:g}), which {program} does not do; with --refraction "
            f"{without:g} they are written as they are"
        )
    if np.isfinite(network.points.deflections).any():
        raise InputError(
            f"deflections of the vertical are given, which {program} does not read (--ignore deflections)"
        )


def _sigmas(network: Network) -> FloatArray:
    """(n,) standard deviations with their relative parts, at the distances that are observed or given."""
    rows, xyz = network.book.observations, network.points.coordinates
    relative = np.flatnonzero(rows.active & (rows.relative_sigmas != 0.0))
    sigmas = rows.sigmas.copy()
    if not relative.size:
        return sigmas
    distances = np.linalg.norm(xyz[rows.to_points[relative]] - xyz[rows.from_points[relative]], axis=1)
    is_angle = IS_ANGLE[rows.types[relative]]
    distances = np.where(is_angle, distances, np.abs(rows.values[relative]))
    lacking = relative[~(distances > 0.0)]
    if lacking.size:
        kind = BY_CODE[int(rows.types[lacking[0]])]
        raise InputError(
            f"{network.book.label(int(lacking[0]))}: the sigma of this {kind.words} depends on the distance, "
            "and its points have no coordinates; give approximate ones"
        )
    share = np.where(is_angle, 1.0 / distances, distances)
    sigmas[relative] += rows.relative_sigmas[relative] * share
    return sigmas
