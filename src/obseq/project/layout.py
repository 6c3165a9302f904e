"""Where things are in a project tree: folders by kind and short name, in the spellings of 2023 and 2026."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.project.metadata import chosen, read_names, read_rules
from obseq.project.points import MEASURES_PREFIX

if TYPE_CHECKING:
    from obseq.project.metadata import Rules

TREE = "MMVII-PhgrProj"
MEASURES, POINTS, OLD = "ObjMesInstr", "ObjCoordWorld", "PointsMeasure"
ENDINGS = (".xml", ".json")


@dataclass(frozen=True)
class ProjectTree:
    """A project.

    Attributes:
        root: the folder that holds ``MMVII-PhgrProj``.
    """

    root: Path

    @classmethod
    def at(cls, root: str | Path) -> ProjectTree:
        """The project of a folder, or of its ``MMVII-PhgrProj``.

        Raises:
            InputError: if there is no such tree.
        """
        place = Path(root)
        place = place.parent if place.name == TREE else place
        if not (place / TREE).is_dir():
            raise InputError(f"{root}: holds no project ({TREE})")
        return cls(place)

    def folder(self, kind: str, name: str) -> Path:
        """The folder of a kind and short name, whether or not it is there; a full path is shortened."""
        return self.root / TREE / kind / Path(name).name

    def orientation(self, name: str) -> Path:
        """A folder of orientations that is there."""
        return self._existing(name, "Ori")

    def measures(self, name: str) -> Path:
        """A folder of measures in images that is there."""
        return self._existing(name, MEASURES, OLD)

    def points(self, name: str) -> Path:
        """A folder of 3D points that is there."""
        return self._existing(name, POINTS, OLD)

    def rules(self, name: str = "Std") -> Rules:
        """The metadata rules of a folder."""
        folder = self._existing(name, "MetaData")
        for ending in ENDINGS:
            if (path := folder / f"CalcMTD{ending}").is_file():
                return read_rules(path)
        raise InputError(f"{folder}: holds no metadata (CalcMTD.xml)")

    def images(self, selection: str, measures: Path) -> list[str]:
        """Names of the images that have measures and are in a list, or match a pattern as a whole.

        Raises:
            InputError: if there is none, or a listed one has no measures.
        """
        measured = sorted(
            path.name[len(MEASURES_PREFIX) : -len(path.suffix)]
            for path in measures.glob(f"{MEASURES_PREFIX}*")
            if path.suffix in ENDINGS
        )
        listed = self.root / selection
        if selection.endswith(ENDINGS) and listed.is_file():
            names = read_names(listed)
            missing = [name for name in names if name not in measured]
            if missing:
                raise InputError(f"{listed}: {missing[0]} has no measures in {measures}")
            return names
        found = chosen(measured, selection)
        if not found:
            raise InputError(f"{selection!r}: no image with measures in {measures} has such a name")
        return found

    def _existing(self, name: str, *kinds: str) -> Path:
        for kind in kinds:
            if (path := self.folder(kind, name)).is_dir():
                return path
        present = sorted(
            path.name for kind in kinds for path in (self.root / TREE / kind).glob("*") if path.is_dir()
        )
        known = ", ".join(present) or "none"
        raise InputError(f"{self.folder(kinds[0], name)}: there is no such folder; there are {known}")
