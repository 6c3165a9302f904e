"""What is in a project tree: what is understood here, and the names of what is not, which stays as it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.project.layout import TREE, ProjectTree
from obseq.project.tree import Tree, bare, read_tree

FIELDS = {
    "InternalCalibration": "Name PixelFrame NbPix Projection Auxiliary SzBuffer Degree DegreeApproxInv "
    "IsFraserMode PerfectProj F PP Distorsion Radial Decentric Polynomial Informations",
    "CameraPose": "NameImage NameInternalCalib Center RotMatrix AxeI AxeJ AxeK EQ WPK YPR",
    "SetMesIm": "NameIm Measures Name Pt Sigma2",
    "SetGCP": "NameSet Measures Name Pt AdditionalInfo Sigma2",
    "SysCoData": "Def",
    "MetaData": "Mode Tries Pat Val",
    "SetOfName": "",
    "CalibBlocCam": "Name Master Pattern KBloc KSync PatternInv ReplaceInv SeparatorInv PoseRel K V Center "
    "RotMatrix AxeI AxeJ AxeK",
    "TopoData": "AllObsSetStations TopoObsSetData Type AllObs TopoObsData Pts Measures Sigmas LastResiduals "
    "StationOriStatus Out_G0 ObsSetSimple",
}
"""What is read of each kind of file: the names of its fields, at any level."""
WHOLE = {
    "instrument block": "Cams NumMaster NumPoseInstr Set_Cams Num NameCalib PatTimeStamp SelIsPat ImSelect "
    "IsInit Pose Center RotMatrix AxeI AxeJ AxeK Clinos Set_Clinos Name PolCorr PtNorm SigmasPairs K V Tr "
    "Rot SumW SumVW Nb DescrIndiv Type NameInstr Sigma CstrRelRot Ori CstrOrthog",
    "clinometer readings": "NamesClino SetMeasures Ident Angles Sigmas",
    "clinometer": "Type NameClino Rotation AxeI AxeJ AxeK NameCamera RelCalib ClinoRef",
}
"""The same of files whose content has no name of its own; the first field is always there."""
OTHERS = {".obs": "survey observations", ".cor": "points of a survey", ".csv": "table"}
FREE = frozenset({"Radial", "Decentric", "Polynomial"})
"""Fields whose own fields are coefficients."""


@dataclass(frozen=True)
class Content:
    """A file of a project.

    Attributes:
        path: of it.
        kind: what it is; empty when it is not understood.
        unknown: fields that are not understood, or why the file is not.
    """

    path: Path
    kind: str
    unknown: tuple[str, ...] = ()


def contents(tree: ProjectTree) -> Iterator[Content]:
    """Every file of a project, by name."""
    for path in sorted((tree.root / TREE).rglob("*")):
        if path.is_file():
            yield _content(path)


def _content(path: Path) -> Content:
    ending = path.suffix.lower()
    if ending in OTHERS:
        return Content(path, OTHERS[ending])
    if ending not in (".xml", ".json"):
        return Content(path, "", (f"files that end in {ending or 'nothing'} are not read",))
    try:
        data = read_tree(path)
    except InputError as error:
        return Content(path, "", (str(error),))
    for kind, fields in WHOLE.items():
        known = fields.split()
        if known[0] in data:
            return Content(path, kind, tuple(dict.fromkeys(_unknown(data, frozenset(known)))))
    kinds = [name for name in data if name in FIELDS]
    if len(kinds) != 1:
        return Content(path, "", tuple(data))
    others = tuple(name for name in data if name != kinds[0])
    return Content(
        path,
        kinds[0],
        (*others, *dict.fromkeys(_unknown(data[kinds[0]], frozenset(FIELDS[kinds[0]].split())))),
    )


def _unknown(value: Tree, known: frozenset[str]) -> Iterator[str]:
    """Names of fields, at any level, that are not known."""
    if isinstance(value, list):
        for part in value:
            yield from _unknown(part, known)
    elif isinstance(value, dict):
        for name, part in value.items():
            if bare(name) not in known:
                yield name
            elif bare(name) not in FREE:
                yield from _unknown(part, known)
