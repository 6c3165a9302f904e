"""An adjusted block as the files of a project: orientations, points, rigid blocks, survey observations."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.images import BundleSolution, ControlPoints
from obseq.images.adjustment.surveys import JoinedSurvey
from obseq.project.assembly import block_files, instrument_file
from obseq.project.cameras import orientation_files
from obseq.project.instruments.blocks import InstrumentBlock, read_instrument_block
from obseq.project.instruments.boresights import adjusted_boresights, read_boresights
from obseq.project.instruments.joining import ENTRIES
from obseq.project.instruments.rigid_blocks import block_text, pose_tree, read_block
from obseq.project.layout import MEASURES, ProjectTree
from obseq.project.networks import adjusted_sets, control_of
from obseq.project.options.bundle_options import BundleOptions
from obseq.project.points import NO_SYSTEM, measure_copies, read_system, system_text
from obseq.project.topo import OUTPUT, AdjustedTopo, topo_text
from obseq.project.tree import Tree, data_text
from obseq.survey import automatic_fix

Files = dict[Path, str | bytes]


@dataclass(frozen=True)
class Results:
    """Where the results of a block go.

    Attributes:
        tree: the project.
        options: of the adjustment.
        orientation: folder of orientations that it started from.
        out: folder of orientations that is written.
        as_json: True for JSON instead of XML.
    """

    tree: ProjectTree
    options: BundleOptions
    orientation: str
    out: str
    as_json: bool = False

    @property
    def _ending(self) -> str:
        return ".json" if self.as_json else ".xml"

    def files(self, solution: BundleSolution) -> Files:
        """All files of a solution; they belong to one state."""
        folder = self.tree.folder("Ori", self.out)
        files: Files = dict(
            orientation_files(
                folder,
                solution.poses,
                solution.cameras,
                source=self.tree.orientation(self.orientation),
                as_json=self.as_json,
            )
        )
        definition = self._definition()
        files[folder / f"CurSysCo{self._ending}"] = system_text(definition, as_json=self.as_json)
        if any(part.out for part in self.options.points):
            found = adjusted_points(solution)
            files |= adjusted_sets(self.tree, self.options, found, definition, as_json=self.as_json)
        for part in self.options.points:
            if part.out and part.with_measures:
                target = self.tree.folder(MEASURES, part.out)
                files |= measure_copies(self.tree.measures(part.folder), target)
        files |= self._rigid(solution) | self._instrument(solution) | self._boresights(solution)
        return files | self._topo(solution)

    def _definition(self) -> str:
        """The system of the orientation, or that of the points where it has none."""
        own = read_system(self.tree.orientation(self.orientation))
        return own if own != NO_SYSTEM else control_of(self.tree, self.options)[1]

    def _rigid(self, solution: BundleSolution) -> Files:
        """The adjusted places of rigid blocks, where `OutRigBlock` asks for them."""
        files: Files = {}
        if not self.options.rigid_out:
            return files
        folder = self.tree.folder("RigBlock", self.options.rigid_out)
        for path in block_files(self.tree, self.options):
            found = read_block(path)
            places = solution.rigid_places(found.name)
            adjusted = replace(found, poses={name: places[name] for name in places})
            files[folder / f"RigidBloc_{found.name}{self._ending}"] = block_text(
                adjusted, as_json=self.as_json
            )
        return files

    def _boresights(self, solution: BundleSolution) -> Files:
        given = self.options.boresights
        if given is None or given.out is None:
            return {}
        found = read_boresights(self.tree.folder("Clino", given.folder))
        folder = self.tree.folder("Clino", given.out)
        return {
            folder / f"{one.file}{self._ending}": one.text(as_json=self.as_json)
            for one in adjusted_boresights(found, solution)
        }

    def _instrument(self, solution: BundleSolution) -> Files:
        given = self.options.instrument
        if given is None or given.out is None:
            return {}
        found = read_instrument_block(instrument_file(self.tree, given))
        path = self.tree.folder("InstrBlock", given.out) / f"{found.path.stem}{self._ending}"
        tilts = given.clinometers is not None
        return {path: adjusted_text(found, solution, given.save, tilts, as_json=self.as_json)}

    def _topo(self, solution: BundleSolution) -> Files:
        if not self.options.survey_out:
            return {}
        folder = self.tree.folder("Topo", self.options.survey_out)
        return {
            folder / f"{OUTPUT}{self._ending}": topo_text(
                _adjusted_topo(part, solution), as_json=self.as_json
            )
            for part in solution.surveys
        }


def _adjusted_topo(part: JoinedSurvey, solution: BundleSolution) -> AdjustedTopo:
    book = part.network.book
    rotations = part.equations.instrument_rotations(solution.result)
    g0 = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])
    return AdjustedTopo(book, part.residuals(solution.result), automatic_fix(book), g0)


def _unknown(n: int) -> FloatArray:
    """(n, 3, 3) covariances of points of which nothing is known."""
    return np.tile(np.diag([np.inf] * 3), (n, 1, 1))


def adjusted_points(solution: BundleSolution) -> ControlPoints:
    """All points of a block, those of its survey networks too, with their covariances.

    These are infinite where the solution is without: nothing is said then of how well the points are known.
    """
    names, places = list(solution.points), [solution.coordinates]
    has_any = solution.result.has_covariances
    covariances = [solution.point_covariances if has_any else _unknown(len(names))]
    for part in solution.surveys:
        known = {*names, *solution.poses.images}  # a projection centre is no point of a project
        new = [row for row, name in enumerate(part.network.points.names) if name not in known]
        names += [part.network.points.names[row] for row in new]
        places.append(part.coordinates(solution.result)[new])
        ids = part.equations.points[new]
        found = solution.result.covariance(ids, not solution.is_a_posteriori) if has_any else None
        covariances.append(_unknown(len(new)) if found is None else found)
    return ControlPoints(tuple(names), np.concatenate(places), np.concatenate(covariances))


Sums = dict[tuple[str, str], tuple[int, float, float]]
"""By pair of cameras: exposures, and sums of what translations and matrices are off."""


def adjusted_text(
    found: InstrumentBlock,
    solution: BundleSolution,
    save: bool,
    tilts: bool = False,
    *,
    as_json: bool = False,
) -> str:
    """The file of a block after its adjustment; what it holds besides stays as it was.

    Args:
        found: as it was before.
        solution: of the adjustment.
        save: whether the sigmas of pairs and cameras are those that were observed.
        tilts: whether its clinometers took part.
        as_json: True for JSON instead of XML.
    """
    data = copy.deepcopy(found.data)
    places = solution.rigid_places(found.name)
    for row in _rows(_field(data, "Cams"), "Set_Cams"):
        row["Pose"] = pose_tree(places[str(row["NameCalib"])])
    if tilts:
        _set_clinometers(data, solution)
    if save:
        _set_sigmas(data, list(found.pairs), _sums(solution, found.name))
    return data_text(data, as_json=as_json)


def _field(tree: dict[str, Tree], name: str) -> dict[str, Tree]:
    found = tree.get(name)
    return found if isinstance(found, dict) else {}


def _rows(tree: dict[str, Tree], name: str) -> list[dict[str, Tree]]:
    found = tree.get(name)
    return [row for row in found if isinstance(row, dict)] if isinstance(found, list) else []


def _set_clinometers(data: dict[str, Tree], solution: BundleSolution) -> None:
    for row in _rows(_field(data, "Clinos"), "Set_Clinos"):
        adjusted = solution.clinometer(str(row["Name"]))
        row["PtNorm"] = tuple(adjusted.axis.tolist())
        row["PolCorr"] = [(value,) for value in adjusted.correction]


def _set_sigmas(data: dict[str, Tree], pairs: list[tuple[str, str]], sums: Sums) -> None:
    """The sigmas of pairs, in the order of the file, and those of cameras: the means over their pairs."""
    for pair, row in zip(pairs, _rows(data, "SigmasPairs"), strict=True):
        if pair in sums:
            _set_average(_field(row, "V"), [sums[pair]])
    for row in _rows(data, "DescrIndiv"):
        own = [value for pair, value in sums.items() if row["K"] in pair]
        if own:
            _set_average(_field(_field(row, "V"), "Sigma"), own)


def _set_average(sigmas: dict[str, Tree], sums: Iterable[tuple[int, float, float]]) -> None:
    n, *parts = (sum(values) for values in zip(*sums, strict=True))
    for name, total in zip(("Tr", "Rot"), parts, strict=True):
        sigmas[name] = {"SumW": (n,), "SumVW": (total,), "Nb": (n,)}


def _sums(solution: BundleSolution, name: str) -> Sums:
    """By pair, the lengths of what translations and matrices are off, summed up."""
    found = solution.rigid_residuals(name)
    shifts = np.linalg.norm(found.translations, axis=1)
    turns = 2.0 * ENTRIES * np.sin(np.linalg.norm(found.rotations, axis=1) / 2.0)
    rows = {pair: [k for k, other in enumerate(found.cameras) if other == pair] for pair in found.cameras}
    return {p: (len(own), float(shifts[own].sum()), float(turns[own].sum())) for p, own in rows.items()}
