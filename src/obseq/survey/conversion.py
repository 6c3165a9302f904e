"""Networks written as files of other programs, and points as point files."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.arguments import PATH, expecting, instance
from obseq.errors import InputError
from obseq.survey.files.cor import cor_text
from obseq.survey.files.gama_writer import GamaNetwork, gama_text
from obseq.survey.files.obs import obs_text
from obseq.survey.kinds.directions import ZEN
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE
from obseq.survey.maps import geojson, geopackage
from obseq.survey.network import Network
from obseq.survey.point_files import cor_of, csv_of, csv_text
from obseq.writing import write_text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from obseq.arrays import FloatArray
    from obseq.record import AdjustmentRecord
    from obseq.survey.model import Points

UNIT_SIGMA = 10.0
"""Gama's standard deviation of unit weight, for networks that have none."""
NO_CORRECTION = 1.0


NETWORK_WRITERS: dict[str, Callable[[Network], str]] = {
    ".gkf": lambda network: gama_text(as_gama(network)),
    ".obs": lambda network: obs_text(network.book),
    ".cor": lambda network: cor_text(known_points(network)),
    ".csv": lambda network: csv_text(in_own_system(network)),
}
"""What writes networks, by the suffix of the file: its text."""
RESULT_WRITERS: dict[str, Callable[[AdjustmentRecord, float], str | bytes]] = {
    ".cor": lambda record, _: cor_of(record),
    ".csv": lambda record, _: csv_of(record),
    ".geojson": geojson,
    ".gpkg": geopackage,
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
    _refuse_corrections(network)
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


def known_points(network: Network) -> Points:
    """The points for a COR file: those without coordinates are computed from the observations.

    Raises:
        InputError: Some cannot be placed, or the points carry a datum that a COR file cannot say.
    """
    points = network.points
    if points.in_datum.any():
        name = points.names[int(np.flatnonzero(points.in_datum.any(axis=1))[0])]
        raise InputError(
            f"point {name} carries the datum of a free network, which a COR file cannot say; write .gkf"
        )
    if points.covariance is not None:
        raise InputError("known coordinates have a covariance, which a COR file cannot say")
    if not points.has_coordinates.all():
        computed = network.initial_values().coordinates
        given = points.coordinates
        points = replace(points, coordinates=np.where(np.isnan(given), computed, given))
    return in_own_system(replace(network, points=points))


def _refuse_corrections(network: Network) -> None:
    rows = network.book.observations
    zeniths = np.flatnonzero(rows.active & (rows.types == ZEN.code))
    if zeniths.size and network.frame.refraction_coefficient != NO_CORRECTION:
        raise InputError(
            f"{network.book.label(int(zeniths[0]))}: zenith angles are corrected for refraction and "
            f"curvature (coefficient {network.frame.refraction_coefficient:g}), and Gama does neither; with "
            "--refraction 1 they are written as they are"
        )
    if np.isfinite(network.points.deflections).any():
        raise InputError(
            "deflections of the vertical are given, which Gama does not know (--ignore deflections)"
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
