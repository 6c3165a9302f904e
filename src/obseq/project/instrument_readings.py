"""Readings of clinometers of a project (`MeasureClino/<Folder>/ClinoMeasures`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.names import unique_names
from obseq.project.tree import Reader, read_tree

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.arrays import FloatArray

FILE = "ClinoMeasures"


@dataclass(frozen=True, eq=False)
class ClinometerReadings:
    """What clinometers read, exposure by exposure.

    Attributes:
        path: of the file.
        names: (k,) of the clinometers.
        exposures: (n,) identifiers.
        angles: (n, k) radians.
        sigmas: (n, k) radians; NaN where the file gives none.
    """

    path: Path
    names: tuple[str, ...]
    exposures: tuple[str, ...]
    angles: FloatArray
    sigmas: FloatArray


def read_clinometer_readings(folder: Path) -> ClinometerReadings:
    """The readings of a folder of `MeasureClino`.

    Raises:
        InputError: with file and field.
    """
    paths = [path for path in (folder / f"{FILE}.xml", folder / f"{FILE}.json") if path.is_file()]
    if not paths:
        raise InputError(f"{folder}: holds no readings of clinometers ({FILE}.xml)")
    path = paths[0]
    whole = Reader(read_tree(path), str(path))
    names = tuple(name for name in whole.list("NamesClino") if isinstance(name, str))
    rows = [Reader(one, f"{path}: SetMeasures") for one in whole.list("SetMeasures")]
    exposures = tuple(row.text("Ident") for row in rows)
    unique_names(names, f"{path}: clinometer")
    unique_names(exposures, f"{path}: exposure")
    if not rows or not names:
        raise InputError(f"{path}: holds no readings")
    angles = np.array([_numbers(row, "Angles", len(names)) for row in rows])
    missing = (float("nan"),) * len(names)
    sigmas = [_numbers(row, "Sigmas", len(names)) if row.has("Sigmas") else missing for row in rows]
    return ClinometerReadings(path, names, exposures, angles, np.array(sigmas))


def _numbers(row: Reader, name: str, count: int) -> tuple[float, ...]:
    found = row.series(name)
    if len(found) != count:
        exposure = row.text("Ident")
        raise InputError(f"{row.where}: {exposure}: {name} has {len(found)} numbers for {count} clinometers")
    return tuple(map(float, found))
