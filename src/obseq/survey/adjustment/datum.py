"""What a network rests on: known coordinates as given, held exactly, or inner constraints instead."""

from __future__ import annotations

import enum
from dataclasses import replace

import numpy as np

from obseq.arguments import WORDS, require
from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import composed
from obseq.survey.kinds.registry import among, codes_where
from obseq.survey.model import FieldBook, Points


class DatumKind(enum.StrEnum):
    """What known coordinates do."""

    GIVEN = "given"
    FIXED = "fixed"
    INNER = "inner"


@dataclass(frozen=True)
class Datum:
    """What a network rests on.

    With inner constraints nothing but the observations forms the network: what they leave free (position,
    rotation, scale) is fixed by the least sum of squared movements of some points, from where the known
    coordinates put them if there are any. Precisions are then free of the datum. With just as many points as
    are needed (two in a plane network, three in space) the constraints are minimal ones on these.

    Attributes:
        kind: "given": known coordinates with their sigmas; "fixed": known coordinates exactly; "inner".
        points: The points that carry inner constraints; all points when empty.
        remote: Points that do not carry them.
        kept: Points whose known coordinates stay so with inner constraints.
    """

    kind: DatumKind = DatumKind.GIVEN
    points: tuple[str, ...] = ()
    remote: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "kind", DatumKind(self.kind))
        except ValueError as error:
            listed = ", ".join(kind.value for kind in DatumKind)
            raise InputError(f"Datum: {self.kind!r} is unknown; there are {listed}") from error
        for chosen in ("points", "remote", "kept"):
            names = getattr(self, chosen)
            require("Datum", chosen, names, WORDS)
            object.__setattr__(self, chosen, tuple(map(composed, names)))
        if self.points and self.kind is not DatumKind.INNER:
            raise InputError("Datum: points are chosen for inner constraints only")


def held(points: Points) -> Points:
    """The points, those with a sigma held at their coordinates."""
    return replace(points, sigmas=np.where(np.isnan(points.sigmas), np.nan, 0.0), covariance=None)


def is_free_standing(points: Points) -> bool:
    """Whether no known coordinate, nor a datum, says where the points are; what is held of all does not."""
    sought = ~points.is_held.all(axis=0)
    return bool(points.is_free[:, sought].all()) and not points.in_datum.any()


def freed(points: Points, coordinates: FloatArray, datum: Datum) -> Points:
    """The points at other coordinates, resting on inner constraints.

    Constraints with a sigma are dropped; components that are held (the plan of points of a levelling) stay.

    Args:
        points: The points.
        coordinates: (n, 3) from which they move least.
        datum: The points that carry the constraints.

    Raises:
        InputError: a name is unknown, or a point that was known is held exactly.
    """
    unknown = [name for name in datum.points if name not in points.index]
    if unknown:
        raise InputError(f"datum: there is no point {unknown[0]} in the network; correct the name")
    whole = np.flatnonzero(points.is_held.all(axis=1))
    if whole.size:
        raise InputError(
            f"datum: {points.names[whole[0]]} ({points.place(int(whole[0]))}) is held exactly (sigma 0): "
            "inner constraints contradict that; give it a sigma"
        )
    names = np.array(points.names)
    carrying = np.isin(names, datum.points) if datum.points else ~np.isin(names, datum.remote)
    kept = np.isin(names, datum.kept)
    sigmas = np.where(points.is_held | kept[:, None], points.sigmas, np.nan)
    chosen = carrying[:, None] & np.isnan(sigmas)
    return replace(points, coordinates=coordinates, sigmas=sigmas, covariance=None, datum=chosen)


def without_azimuths(book: FieldBook) -> tuple[FieldBook, tuple[str, ...]]:
    """The observations without azimuths, which orient a network from outside; and a sentence about them."""
    from_north = codes_where(lambda kind: kind.is_from_north)
    azimuths = among(book.observations.types, from_north) & book.observations.active
    count = int(np.count_nonzero(azimuths))
    if not count:
        return book, ()
    return book.without(azimuths), (
        f"inner constraints: {count} azimuths have no part, they would orient it",
    )
