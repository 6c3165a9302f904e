"""Where things are in a project tree: folders by kind and short name, in the spellings of 2023 and 2026."""

from __future__ import annotations

import contextlib
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.project.metadata import MODES, Rules, chosen, read_names, read_rules
from obseq.project.points import MEASURES_PREFIX, read_definition
from obseq.project.tree import ENDINGS, file_in, files_in

TREE = "MMVII-PhgrProj"
SYSTEMS = "SysCo"
MEASURES, POINTS, OLD = "ObjMesInstr", "ObjCoordWorld", "PointsMeasure"


@dataclass(frozen=True)
class ProjectTree:
    """A project.

    Attributes:
        root: the folder that holds ``MMVII-PhgrProj``.
    """

    root: Path

    @classmethod
    def at(cls, root: str | Path, *, is_new: bool = False) -> ProjectTree:
        """The project of a folder, or of its ``MMVII-PhgrProj``.

        Args:
            root: the folder.
            is_new: whether the tree may be missing: it is made when something is written.

        Raises:
            InputError: if there is no such tree, or no such folder.
        """
        place = Path(root)
        place = place.parent if place.name == TREE else place
        if not (place / TREE).is_dir() and not (is_new and place.is_dir()):
            raise InputError(f"{root}: holds no project ({TREE})")
        return cls(place)

    def folder(self, kind: str, name: str) -> Path:
        """The folder of a kind and short name, whether or not it is there; its path says the same.

        Raises:
            InputError: a path leads elsewhere.
        """
        return self.root / TREE / kind / self._short(name, kind)

    def orientation(self, name: str) -> Path:
        """A folder of orientations that is there."""
        return self._existing(name, "Ori")

    def measures(self, name: str) -> Path:
        """A folder of measures in images that is there."""
        return self._existing(name, MEASURES, OLD)

    def points(self, name: str) -> Path:
        """A folder of 3D points that is there."""
        return self._existing(name, POINTS, OLD)

    def topo(self, name: str) -> Path:
        """A folder of survey observations that is there."""
        return self._existing(name, "Topo")

    def rules(self, name: str = "Std") -> Rules:
        """The metadata rules of a folder."""
        path, rules = self.metadata(self._existing(name, "MetaData").name)
        if not path.is_file():
            raise InputError(f"{path.parent}: holds no metadata (CalcMTD.xml)")
        return rules

    def metadata(self, name: str) -> tuple[Path, Rules]:
        """The file of the metadata rules of a folder, and the rules: none where there is no file yet."""
        folder = self.folder("MetaData", name)
        if path := file_in(folder, "CalcMTD"):
            return path, read_rules(path)
        path = folder / f"CalcMTD{ENDINGS[0]}"
        return path, Rules(dict.fromkeys(MODES, ()), str(path))

    def system(self, word: str) -> str:
        """The definition of a coordinate system, which may be the name of a file of ``SysCo``."""
        path = None if "/" in word else file_in(self.root / TREE / SYSTEMS, word)
        return word if path is None else read_definition(path)

    def calibrations(self) -> set[str]:
        """Names of the calibrations that any orientation of the project has."""
        return {path.stem for path in (self.root / TREE / "Ori").glob("*/Calib*")}

    def images(self, selection: str, measures: Path | None = None) -> list[str]:
        """Names of the images that have measures and are in a list, or match a pattern as a whole.

        Args:
            selection: the list, or the pattern.
            measures: folder of the measures; any where it is None, and images in the folder of the project.

        Raises:
            InputError: if there is none, or a listed one has no measures.
        """
        if measures is None:
            return self._images_anywhere(selection)
        measured = _measured(measures)
        names = self.listed(selection)
        if names:
            missing = [name for name in names if name not in measured]
            if missing:
                raise InputError(f"{selection}: {missing[0]} has no measures in {measures}")
            return names
        found = chosen(measured, selection)
        if not found:
            raise InputError(f"{selection!r}: no image with measures in {measures} has such a name")
        return found

    def _images_anywhere(self, selection: str) -> list[str]:
        """The images of a list, or all that match: files of the project's folder, and those with measures."""
        if names := self.listed(selection):
            return names
        files = [path.name for path in self.root.iterdir() if path.is_file()]
        folders = [path for kind in (MEASURES, OLD) for path in (self.root / TREE / kind).glob("*")]
        found = chosen(sorted({*files, *(name for place in folders for name in _measured(place))}), selection)
        if not found:
            raise InputError(f"{selection!r}: no image in {self.root}, or with measures, has such a name")
        return found

    def listed(self, selection: str) -> list[str]:
        """The names of a list in the folder of the project; none where the selection is no such file."""
        path = self.root / selection
        return read_names(path) if selection.endswith(ENDINGS) and path.is_file() else []

    def _short(self, name: str, *kinds: str) -> str:
        given, folders = Path(name), [self.root / TREE / kind for kind in kinds]
        meant = {path.resolve() for path in (self.root / given, given)}
        here = len(given.parts) == 1 or any((folder / given.name).resolve() in meant for folder in folders)
        if given.name in ("", "..") or not here:
            raise InputError(f"{name}: not in {folders[0]}; give its name there, without folders.")
        return given.name

    def _existing(self, name: str, *kinds: str) -> Path:
        short = self._short(name, *kinds)
        for kind in kinds:
            if (path := self.folder(kind, short)).is_dir():
                return path
        folders = [path for kind in kinds for path in (self.root / TREE / kind).glob("*/")]
        present = sorted({path.name for path in folders})
        known = ", ".join(present) or "none"
        raise InputError(f"{self.folder(kinds[0], short)}: there is no such folder; there are {known}")


def give_old_names(root: Path) -> None:
    """Gives folders of points and of measures their name of 2024 too, where the tree has none of that name.

    `PointsMeasure/NAME` is a link to `ObjCoordWorld/NAME` or `ObjMesInstr/NAME`: what is copied there, as the
    training does, is found. A file system without links keeps the names of today alone.
    """
    tree = root / TREE
    for kind in (POINTS, MEASURES):
        for folder in sorted((tree / kind).glob("*/")):
            old = tree / OLD / folder.name
            if not old.exists():
                with contextlib.suppress(OSError):
                    old.parent.mkdir(exist_ok=True)
                    old.symlink_to(Path("..", kind, folder.name), target_is_directory=True)


def _measured(folder: Path) -> list[str]:
    """Names of the images that have measures in a folder."""
    return sorted(path.stem[len(MEASURES_PREFIX) :] for path in files_in(folder, MEASURES_PREFIX))
