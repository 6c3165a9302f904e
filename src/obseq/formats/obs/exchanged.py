"""Files of observations and of points that were given in each other's place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from obseq.errors import InputError
from obseq.formats.obs.cor import read_cor
from obseq.formats.obs.obs import read_obs

Files = str | Path | Sequence[str | Path]

ANY_SIGMA = 1.0
"""Of known points without one, where it only matters whether a file holds points."""


@contextmanager
def told_if_exchanged(observation_files: Files, point_files: Files, encoding: str) -> Iterator[None]:
    """Errors of reading these files say what they hold, where that is not what they were given for."""
    try:
        yield
    except InputError as error:
        told = _exchanged(observation_files, point_files, encoding)
        if told:
            raise InputError(f"{error}\n{told}") from error
        raise


def _exchanged(observation_files: Files, point_files: Files, encoding: str) -> str:
    """What the files hold; "" where that is what they were given for."""
    told = []
    if _hold_points(observation_files, encoding):
        told.append(f"{_listed(observation_files)} holds points (COR), and was given for observations")
    if _hold_observations(point_files, encoding):
        told.append(f"{_listed(point_files)} holds observations (OBS), and was given for points")
    advice = "exchange them (--obs, --cor)" if len(told) == 2 else "give it as what it is (--obs, --cor)"
    return f"{'; '.join(told)}: {advice}" if told else ""


def _hold_points(files: Files, encoding: str) -> bool:
    """Whether they can be read as points, none of which is given twice: stations of observations are."""
    try:
        read_cor(files, ANY_SIGMA, encoding)
    except InputError:
        return False
    return True


def _hold_observations(files: Files, encoding: str) -> bool:
    """Whether they can be read as observations, of targets that are no coordinates."""
    try:
        book = read_obs(files, encoding)
    except InputError:
        return False
    targets = {book.point_names[row] for row in book.observations.to_points.tolist()}
    return not all(_is_coordinate(name) for name in targets)


def _is_coordinate(name: str) -> bool:
    return name.lstrip("-").replace(".", "", 1).isdecimal()


def _listed(files: Files) -> str:
    given = [files] if not isinstance(files, list | tuple) else files
    return ", ".join(map(str, given))
