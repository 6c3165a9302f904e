"""Geodetic reference frames by name, and positions from one frame and epoch to another."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import CrsError

if TYPE_CHECKING:
    import pyproj
    from pyproj.database import CRSInfo

    from obseq.arrays import FloatArray

GEOGRAPHIC, GEOCENTRIC = "GEOGRAPHIC_3D_CRS", "GEOCENTRIC_CRS"
"""Kinds of systems as PROJ calls them: longitude, latitude and ellipsoidal height; X, Y and Z."""
_YEAR_OF_ITRF = re.compile(r"itrf19(?=\d\d$)")
A_DAY = 1.5 / 365.25
"""Epochs (years) so close together are one: no plate moves by 0.5 mm in a day."""


PUBLISHED = {
    ("itrf2008", "gda2020"): (
        "+proj=helmert +convention=coordinate_frame +t_epoch=2020 +x=0.01379 +y=0.00455 +z=0.01522 +s=0.0025 "
        "+rx=0.0002808 +ry=0.0002677 +rz=-0.0004638 +dx=0.00142 +dy=0.00134 +dz=0.0009 +ds=0.000109 "
        "+drx=0.0015461 +dry=0.001182 +drz=0.0011551"
    ),
}
"""Transformations that an authority publishes and EPSG, which goes through ITRF2014 (0.2 mm off in vectors of
50 km), does not have: GDA2020 Technical Manual of ICSM."""


class FrameAtEpoch(NamedTuple):
    """A reference frame, and the epoch of coordinates in it.

    Attributes:
        name: As it is usually called: GDA2020, ITRF2014, ETRS89, ...
        epoch: Decimal year; NaN where none is given.
    """

    name: str
    epoch: float = float("nan")


def geographic_crs(name: str) -> str:
    """Definition of the system of longitude, latitude and ellipsoidal height of a frame, such as EPSG:7843.

    Raises:
        CrsError: PROJ knows no frame of that name.
    """
    return _found(name, GEOGRAPHIC)


def moved(points: FloatArray, source: FrameAtEpoch, target: FrameAtEpoch) -> FloatArray:
    """Geocentric points (n, 3) of one frame and epoch in another.

    Between frames that move with a plate the epoch does not count. Into a frame that does not, points are
    brought at their own epoch only: how they move on is not known here.

    Raises:
        CrsError: a frame is unknown, or there is no way from one to the other.
    """
    if _plain(source.name) == _plain(target.name) and (_is_static(target.name) or _is_near(source, target)):
        return points
    if not _is_static(target.name) and not _is_near(source, target):
        raise CrsError(
            f"{source.name} at {source.epoch:.3f} to {target.name} at {target.epoch:.3f}: how points move "
            "between the two epochs is not known"
        )
    x, y, z = np.ascontiguousarray(points.T)
    epoch = source.epoch if np.isfinite(source.epoch) else target.epoch
    converted = _transformer(source.name, target.name).transform(x, y, z, np.full(len(points), epoch))
    return np.stack(converted[:3], axis=-1)


def _is_near(source: FrameAtEpoch, target: FrameAtEpoch) -> bool:
    return not abs(source.epoch - target.epoch) > A_DAY


def _plain(name: str) -> str:
    """A name without the differences of writing: ITRF1997, as DynAdjust has it, is ITRF97."""
    plain = "".join(letter for letter in name.casefold() if letter.isalnum())
    return _YEAR_OF_ITRF.sub("itrf", plain)


@lru_cache(maxsize=2)
def _frames(authority: str | None) -> dict[tuple[str, str], CRSInfo]:
    """The systems that PROJ has of an authority, or of all, by kind and plain name; EPSG's before others."""
    from pyproj.database import query_crs_info
    from pyproj.enums import PJType

    infos = query_crs_info(auth_name=authority, pj_types=[PJType[kind] for kind in (GEOGRAPHIC, GEOCENTRIC)])
    ordered = sorted(infos, key=lambda info: (info.auth_name != "EPSG", info.deprecated))
    return {(info.type.name, _plain(info.name)): info for info in reversed(ordered)}


def _found(name: str, kind: str) -> str:
    """Definition of the system of one kind of a frame; those of EPSG are listed in half the time of all."""
    wanted = kind, _plain(name)
    info = _frames("EPSG").get(wanted) or _frames(None).get(wanted)
    if info is None:
        raise CrsError(
            f"reference frame {name!r} is not known; names such as GDA2020, ITRF2014, ETRS89, NAD83(2011) are"
        )
    return f"{info.auth_name}:{info.code}"


@lru_cache(maxsize=64)
def _is_static(name: str) -> bool:
    """Whether points at rest on their plate keep their coordinates in a frame."""
    import pyproj

    datum = pyproj.CRS.from_user_input(_found(name, GEOCENTRIC)).to_json_dict().get("datum", {})
    return "Dynamic" not in datum.get("type", "") and "frame_reference_epoch" not in datum


@lru_cache(maxsize=64)
def _transformer(source: str, target: str) -> pyproj.Transformer:
    import pyproj
    from pyproj.transformer import TransformerGroup

    published = PUBLISHED.get((_plain(source), _plain(target)))
    if published is not None:
        return pyproj.Transformer.from_pipeline(published)
    first, last = (_found(name, GEOCENTRIC) for name in (source, target))
    group = TransformerGroup(first, last, always_xy=True, allow_ballpark=False)
    if not group.transformers:
        raise CrsError(f"PROJ knows no way from {source} to {target}")
    return pyproj.Transformer.from_pipeline(group.transformers[0].definition)
