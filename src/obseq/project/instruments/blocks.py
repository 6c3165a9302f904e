"""Instrument blocks of a project (`FileRB_<name>`): cameras and clinometers on one body, and their sigmas.

Cameras are named by their calibrations. What a file holds besides stays in it when it is written again.
"""

from __future__ import annotations

from dataclasses import field, replace
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion
from obseq.images.names import unique_names
from obseq.project.instruments.rigid_blocks import read_pose_fields
from obseq.project.metadata import read_names, whole_match
from obseq.project.tree import Reader, Tree, file_in, pairs, read_tree

FILE = "FileRB_"
CAMERA, CLINOMETER = "Camera", "Clino"
"""What instruments are called in files."""
Average = tuple[float | None, float | None]
"""Sigmas of a translation and of the entries of a rotation matrix; None where none is known yet."""
Names = tuple[str, str]


@dataclass(frozen=True)
class InstrumentCamera:
    """A camera of an instrument block.

    Attributes:
        calibration: its name, which is that of the camera here.
        stamp: pattern of image names, whose first group is the exposure.
        selection: pattern of the images of the block, where `listed` is None.
        pose: camera to block; None where the file says that it is not known yet.
        listed: names of the images of the block, where a list says them.
    """

    calibration: str
    stamp: str
    selection: str
    pose: RigidMotion | None
    listed: frozenset[str] | None = None


@dataclass(frozen=True, eq=False)
class InstrumentClinometer:
    """A clinometer of an instrument block.

    Attributes:
        axis: (3,) in the frame of the block; None where the file says that it is not known yet.
        correction: coefficients of degrees 0 to 3.
    """

    name: str
    axis: FloatArray | None
    correction: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class InstrumentBlock:
    """An instrument block as a file describes it.

    Attributes:
        path: of the file.
        data: all that it holds.
        master: calibration of the camera whose frame is that of the block.
        carriers: calibrations of the cameras whose pose is that of the block.
        cameras: of the block.
        pairs: sigmas by pair of calibrations.
        instruments: sigmas by name of instrument.
        clinometers: of the block.
        right_angles: sigmas of the right angles between clinometers, radians.
    """

    path: Path
    data: dict[str, Tree]
    master: str
    carriers: tuple[str, ...]
    cameras: tuple[InstrumentCamera, ...]
    pairs: dict[Names, Average]
    instruments: dict[str, Average]
    clinometers: tuple[InstrumentClinometer, ...] = ()
    right_angles: dict[Names, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name of the block, from its file."""
        return self.path.stem.removeprefix(FILE)

    @property
    def turns(self) -> bool:
        """Whether it has known relative rotations, which no adjustment uses (the original's neither)."""
        fields = Reader(self.data, str(self.path))
        return fields.has("CstrRelRot") and bool(fields.list("CstrRelRot"))


def read_instrument_block(path: Path) -> InstrumentBlock:
    """The block of a file ``InstrBlock/<Folder>/FileRB_<name>.xml``.

    Raises:
        InputError: with file and field.
    """
    data = read_tree(path)
    whole = Reader(data, str(path))
    cams = whole.fields("Cams")
    rows = [Reader(one, f"{path}: Set_Cams") for one in cams.list("Set_Cams")]
    cameras = tuple(_camera(row, path) for row in rows)
    names = [camera.calibration for camera in cameras]
    numbers = {row.integer("Num", place): names[place] for place, row in enumerate(rows)}
    if len(set(names)) < len(names) or len(numbers) < len(names):
        raise InputError(f"{path}: a camera comes twice, by its name or by its number")
    found = InstrumentBlock(
        path,
        data,
        _numbered(numbers, cams.integer("NumMaster", 0), f"{path}: NumMaster"),
        _carriers(cams, numbers),
        cameras,
        {key: _average(value) for key, value in _by_pair(whole, "SigmasPairs")},
        _descriptions(whole),
        tuple(_clinometers(whole)),
        {key: float(value.number("Sigma")) for key, value in _by_pair(whole, "CstrOrthog")},
    )
    _require_known(found)
    return found


def _numbered(numbers: dict[int, str], number: int, where: str) -> str:
    if number not in numbers:
        raise InputError(f"{where} is {number}; the cameras have {sorted(numbers)}")
    return numbers[number]


def _carriers(cams: Reader, numbers: dict[int, str]) -> tuple[str, ...]:
    """The cameras of `NumPoseInstr`: all of them where it is empty, the master for -1."""
    if not cams.has("NumPoseInstr") or not cams.value("NumPoseInstr"):
        return tuple(numbers.values())
    master = cams.integer("NumMaster", 0)
    given = [int(number) if number >= 0 else master for number in cams.series("NumPoseInstr")]
    return tuple(_numbered(numbers, number, f"{cams.where}: NumPoseInstr") for number in given)


def _camera(row: Reader, path: Path) -> InstrumentCamera:
    name, selection = row.text("NameCalib"), row.text("ImSelect", "")
    listed = None
    if row.has("SelIsPat") and not row.integer("SelIsPat"):
        listed = frozenset(read_names(_list_file(path, selection, f"{row.where}: {name}")))
    known = row.integer("IsInit", 1)
    pose = read_pose_fields(row.fields("Pose")) if known else None
    return InstrumentCamera(name, row.text("PatTimeStamp"), selection, pose, listed)


def _list_file(path: Path, name: str, where: str) -> Path:
    """The list of names that a block refers to: in the folder of the project, or beside the block."""
    places = [folder / name for folder in (*path.parents[3:4], path.parent)]
    found = next((place for place in places if name and place.is_file()), None)
    if found is None:
        tried = " and ".join(map(str, places))
        raise InputError(f"{where}: its images are those of a list (SelIsPat 0), which is not at {tried}")
    return found


def _by_pair(whole: Reader, name: str) -> list[tuple[Names, Reader]]:
    """The entries of a map whose keys are pairs of names."""
    found: list[tuple[Names, Reader]] = []
    for key, value in pairs(whole.list(name) if whole.has(name) else [], f"{whole.where}: {name}"):
        names = [part for part in key if isinstance(part, str)] if isinstance(key, tuple | list) else []
        if len(names) != 2 or len(key) != 2:
            raise InputError(f"{whole.where}: {name}: a key should be two names in quotes")
        pair = names[0], names[1]
        if pair in (other for other, _ in found):
            raise InputError(f"{whole.where}: {name}: {', '.join(pair)} come twice")
        found.append((pair, Reader(value, f"{whole.where}: {name}: {', '.join(pair)}")))
    return found


def _average(sigmas: Reader) -> Average:
    return _mean(sigmas, "Tr"), _mean(sigmas, "Rot")


def _mean(sigmas: Reader, name: str) -> float | None:
    """A sigma, which files keep as a weighted sum and the sum of its weights; None without any."""
    parts = sigmas.fields(name)
    weight = float(parts.number("SumW"))
    return float(parts.number("SumVW")) / weight if weight else None


def _descriptions(whole: Reader) -> dict[str, Average]:
    rows = whole.list("DescrIndiv") if whole.has("DescrIndiv") else []
    found = {}
    for key, value in pairs(rows, f"{whole.where}: DescrIndiv"):
        one = Reader(value, f"{whole.where}: DescrIndiv: {key}")
        found[str(key)] = _average(one.fields("Sigma"))
    return found


def _clinometers(whole: Reader) -> list[InstrumentClinometer]:
    clinos = whole.fields("Clinos") if whole.has("Clinos") and whole.mapping("Clinos") else None
    rows = clinos.list("Set_Clinos") if clinos else []
    found = []
    for row in (Reader(one, f"{whole.where}: Set_Clinos") for one in rows):
        axis = np.array(row.numbers("PtNorm", 3), dtype=np.float64)
        known = bool(row.integer("IsInit", 1)) and bool(axis.any())
        correction = tuple(map(float, row.series("PolCorr")))
        found.append(InstrumentClinometer(row.text("Name"), axis if known else None, correction))
    return found


def _require_known(found: InstrumentBlock) -> None:
    """Refuses pairs and right angles of instruments that the block does not have."""
    cameras = {camera.calibration for camera in found.cameras}
    clinometers = {item.name for item in found.clinometers}
    for where, keys, known in (
        ("SigmasPairs", found.pairs, cameras),
        ("CstrOrthog", found.right_angles, clinometers),
    ):
        lost = {name for pair in keys for name in pair} - known
        if lost:
            what = "camera" if known is cameras else "clinometer"
            raise InputError(f"{found.path}: {where} names {min(lost)}, which is no {what} of the block")


READINGS = "ClinoMeasures"


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

    def chosen(self, pattern: str) -> ClinometerReadings:
        """Those of the exposures whose names match as a whole."""
        rows = [k for k, name in enumerate(self.exposures) if whole_match(pattern, name, str(self.path))]
        names = tuple(self.exposures[row] for row in rows)
        return replace(self, exposures=names, angles=self.angles[rows], sigmas=self.sigmas[rows])


def read_clinometer_readings(folder: Path) -> ClinometerReadings:
    """The readings of a folder of `MeasureClino`.

    Raises:
        InputError: with file and field.
    """
    path = file_in(folder, READINGS)
    if path is None:
        raise InputError(f"{folder}: holds no readings of clinometers ({READINGS}.xml)")
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
