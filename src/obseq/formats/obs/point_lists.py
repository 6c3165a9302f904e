"""Points that go with OBS files: COR files, and tables of points (.csv)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from obseq.formats.catalogue import FORMATS
from obseq.formats.obs.cor import read_cor
from obseq.formats.once import require_distinct
from obseq.formats.project import in_own_units
from obseq.survey.model import Points, merge_points

PointReader = Callable[[Path, str], tuple[Points, list[float]]]
"""Of a path and an encoding: points in metres, and the unit of each (m; NaN for that of its system)."""


def read_point_lists(
    files: str | Path | Sequence[str | Path],
    default_sigma: float | None,
    encoding: str,
    ignore: Collection[str],
    definition: str | None,
) -> Points:
    """Reads COR files and tables of points.

    Args:
        files: One file, or several.
        default_sigma: Sigma (m) of known points whose line in a COR file gives none.
        encoding: Of the point names.
        ignore: "deflections" to leave them out.
        definition: Of the system of the points, in whose units they become; None for a plane in metres.

    Raises:
        InputError: Naming file and line, what is wrong and what to do; also for a point given twice.
    """
    paths = [files] if isinstance(files, str | Path) else list(files)
    readers = {path: _reader(Path(path)) for path in paths}
    if not any(readers.values()):
        return read_cor(paths, default_sigma, encoding, ignore)
    require_distinct(paths)
    others = [path for path in paths if readers[path] is None]
    found = [read_cor(others, default_sigma, encoding, ignore)] if others else []
    for path, reader in readers.items():
        if reader is not None:
            points, units = reader(Path(path), encoding)
            found.append(in_own_units(points, np.array(units), definition))
    return merge_points(found)


def _reader(path: Path) -> PointReader | None:
    """What reads a file of points that is no COR file; None for these, whatever they are called."""
    suffix = path.suffix.lower()
    for known in FORMATS:
        if suffix in known.suffixes and known.point_reader:
            module, _, name = known.point_reader.partition(":")
            found: PointReader = getattr(import_module(f"obseq.formats.{module}"), name)
            return found
    return None
