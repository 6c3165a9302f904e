"""Networks that are made in memory, without files."""

from __future__ import annotations

from obseq import crs
from obseq.arguments import NOTHING, NUMBER, TEXT, expecting
from obseq.formats.tables.in_memory import Given, observations_of, points_of
from obseq.stopwatch import Stopwatch
from obseq.survey.network import Network


@expecting(frame=TEXT | NOTHING, points_crs=TEXT | NOTHING, angles=TEXT, refraction=NUMBER)
def network_from_tables(
    points: Given,
    observations: Given,
    frame: str | None = None,
    points_crs: str | None = None,
    angles: str = "rad",
    refraction: float = crs.REFRACTION_COEFFICIENT,
) -> Network:
    """A network from tables in memory: data frames, or dictionaries of columns.

    Args:
        points: The points (`obseq.formats.tables.in_memory.points_of` says which columns).
        observations: The observations (`obseq.formats.tables.in_memory.observations_of`).
        frame: Definition of the computation frame, as for `Network.read`.
        points_crs: Definition of the system of the points; without it the frame.
        angles: Unit of angles in the table: "rad", "gon" or "degree".
        refraction: Coefficient of zenith angles.

    Raises:
        InputError: Something in the tables is wrong; the message names the row.
    """
    watch = Stopwatch()
    with watch.phase("read"):
        given, book = points_of(points), observations_of(observations, angles)
    return Network.assembled(given, book, frame, points_crs, refraction, watch)
