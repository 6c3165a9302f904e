"""Where the outside values lie: beside the repository, or in it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
EXCERPTS = Path(__file__).parent / "data"


@dataclass(frozen=True)
class OutsideData:
    """Data sets by name: those beside the repository, else the excerpts in `tests/data`.

    Attributes:
        folders: Where they are looked for, in order.
    """

    folders: tuple[Path, ...] = (SHARED_DATA, EXCERPTS)

    def __truediv__(self, path: str) -> Path:
        """A data set, or a file in one; a test that asks for one that is nowhere is skipped.

        An excerpt of a data set may hold some of its files: a test that needs another one is skipped, too.
        """
        data_set = Path(path).parts[0]
        places = [folder / path for folder in self.folders if (folder / data_set).is_dir()]
        if places and (SHARED_DATA / data_set).is_dir():
            return places[0]
        for place in filter(Path.exists, places):
            return place
        pytest.skip(reason=f"the data set {data_set} is not beside the repository: {SHARED_DATA}")

    def find(self, data_set: str) -> Path | None:
        """The folder of a data set; None if it is nowhere."""
        return next((folder / data_set for folder in self.folders if (folder / data_set).is_dir()), None)

    def sets(self, names: Iterable[str]) -> Iterator[Path]:
        """Those of the data sets that are somewhere."""
        return filter(None, map(self.find, names))
