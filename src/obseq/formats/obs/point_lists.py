"""Points that go with OBS files: COR files, and tables of points (.csv)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.formats.obs.cor import read_cor
from obseq.formats.once import require_distinct
from obseq.formats.project import in_own_units
from obseq.survey.model import merge_points

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from obseq.survey.model import Points

TABLE = ".csv"


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
    tables = [path for path in paths if Path(path).suffix.lower() == TABLE]
    if not tables:
        return read_cor(paths, default_sigma, encoding, ignore)
    from obseq.formats.tables.reader import read_point_table

    require_distinct(paths)
    others = [path for path in paths if path not in tables]
    found = [read_cor(others, default_sigma, encoding, ignore)] if others else []
    for path in tables:
        points, units = read_point_table(path, encoding)
        found.append(in_own_units(points, np.array(units), definition))
    return merge_points(found)
