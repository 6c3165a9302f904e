"""Instrument blocks of a project that are made: what is on a body, and where it is, from known poses.

The steps are the original's: `BlockInstrEdit` names cameras and clinometers, `BlockInstrInitCam` places the
cameras, `BlockInstrInitClino` finds the axes of the clinometers.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.images import Poses, initial_block
from obseq.project.instruments.blocks import CAMERA, CLINOMETER, ClinometerReadings, InstrumentBlock
from obseq.project.instruments.joining import carried_images, exposures_of
from obseq.project.instruments.rigid_blocks import pose_tree
from obseq.project.tree import Tree

PERFECT: list[Tree] = [(0.0,), (1.0,), (0.0,), (0.0,)]
"""Coefficients of the correction of a clinometer that needs none."""
LOOSE = 1e-3
"""Radians of tilt between images below which readings do not say how an axis is turned."""


def empty_block() -> dict[str, Tree]:
    """A block of nothing."""
    nothing: list[Tree] = []
    return {
        "Cams": {"NumMaster": (0,), "NumPoseInstr": [(-1,)], "Set_Cams": nothing},
        "Clinos": {"Set_Clinos": []},
        "SigmasPairs": [],
        "DescrIndiv": [],
        "CstrRelRot": [],
        "CstrOrthog": [],
    }


def with_cameras(data: dict[str, Tree], names: Sequence[str], stamp: str, selection: str) -> dict[str, Tree]:
    """A block with cameras, by their calibrations, whose places are not known yet; those it has stay.

    Args:
        data: of the block.
        names: of the calibrations.
        stamp: pattern of image names, whose first group is the exposure.
        selection: pattern of the images of the block.
    """
    made = copy.deepcopy(data)
    rows = _rows(_fields(made, "Cams"), "Set_Cams")
    known = {str(row["NameCalib"]) for row in rows}
    for name in sorted(set(names) - known):
        rows.append(
            {
                "Num": (len(rows),),
                "NameCalib": name,
                "PatTimeStamp": stamp,
                "SelIsPat": (1,),
                "ImSelect": selection,
                "IsInit": (0,),
                "Pose": {"Center": (0.0, 0.0, 0.0), "RotMatrix": _identity()},
            }
        )
        _rows(made, "DescrIndiv").append(_described(name, CAMERA, None))
    return made


def with_clinometers(data: dict[str, Tree], readings: ClinometerReadings) -> dict[str, Tree]:
    """A block with the clinometers that were read, whose axes are not known yet; those it has stay."""
    made = copy.deepcopy(data)
    rows = _rows(_fields(made, "Clinos"), "Set_Clinos")
    known = {str(row["Name"]) for row in rows}
    for column, name in enumerate(readings.names):
        if name not in known:
            rows.append({"Name": name, "IsInit": (0,), "PolCorr": PERFECT, "PtNorm": (0.0, 0.0, 0.0)})
            given = readings.sigmas[np.isfinite(readings.sigmas[:, column]), column]
            sigma = float(given.mean()) if given.size else None
            _rows(made, "DescrIndiv").append(_described(name, CLINOMETER, sigma))
    return made


def with_right_angles(data: dict[str, Tree], angles: Sequence[tuple[str, str, float]]) -> dict[str, Tree]:
    """A block with right angles between clinometers and their sigmas, radians."""
    made = copy.deepcopy(data)
    for first, second, sigma in angles:
        _rows(made, "CstrOrthog").append({"K": (first, second), "V": {"Sigma": (sigma,)}})
    return made


def placed_cameras(
    found: InstrumentBlock, poses: Poses, camera_of: Mapping[str, str]
) -> tuple[dict[str, Tree], list[str]]:
    """The block with the mean places of its cameras, the sigmas of all pairs, and what was found, in lines.

    Args:
        found: the block.
        poses: of images.
        camera_of: calibration of each.

    Raises:
        InputError: a camera has no exposure in common with the master.
    """
    exposures = exposures_of(found, camera_of)
    block, pairs = initial_block(poses, exposures, found.master, found.name, all_pairs=True)
    made = copy.deepcopy(found.data)
    own: dict[str, list[tuple[float, float]]] = {camera: [] for camera in exposures.cameras}
    for row in _rows(_fields(made, "Cams"), "Set_Cams"):
        if (name := str(row["NameCalib"])) in own:
            row["Pose"], row["IsInit"] = pose_tree(block.places[name]), (1,)
    made["SigmasPairs"], lines = [], []
    for pair in pairs:
        n = len(pair.exposures)
        scatter, said = (pair.sigma_translation, pair.sigma_rotation), ""
        sigmas = _sigmas(None, None, 0)
        if n > 1:
            own[pair.first].append(scatter)
            own[pair.second].append(scatter)
            sigmas = _sigmas(*scatter, n)
            said = f", SigmaTr {scatter[0]:.6g}, SigmaRot {scatter[1]:.6g}"
        _rows(made, "SigmasPairs").append({"K": (pair.first, pair.second), "V": sigmas})
        lines.append(f"{pair.first} -> {pair.second}: {n} exposures{said}")
    for row in _rows(made, "DescrIndiv"):
        if own.get(str(row["K"])):
            mean = np.mean(own[str(row["K"])], axis=0)
            _fields(row, "V")["Sigma"] = _sigmas(float(mean[0]), float(mean[1]), len(own[str(row["K"])]))
    return made, lines


def found_axes(
    found: InstrumentBlock, poses: Poses, camera_of: Mapping[str, str], readings: ClinometerReadings
) -> tuple[dict[str, Tree], list[str]]:
    """The block with the axes of its clinometers, the sigmas of their readings, and what was found, in lines.

    Args:
        found: the block; its master carries the clinometers.
        poses: of images.
        camera_of: calibration of each.
        readings: of all clinometers of the block.

    Raises:
        InputError: readings have too few images, or these are all turned alike about the vertical.
    """
    carried = carried_images(found, exposures_of(found, camera_of))
    used = [k for k, name in enumerate(readings.exposures) if name in carried]
    if len(used) < 3:
        raise InputError(
            f"{readings.path}: {len(used)} exposures have an image with a pose; three are needed"
        )
    up = np.array([poses[carried[readings.exposures[k]]].rotation[2] for k in used])
    made, lines = copy.deepcopy(found.data), []
    for row in _rows(_fields(made, "Clinos"), "Set_Clinos"):
        name = str(row["Name"])
        if name not in readings.names:
            raise InputError(f"{readings.path}: has no readings of {name}, a clinometer of {found.path}")
        angles = readings.angles[used, readings.names.index(name)]
        axis = axis_of(up, np.sin(angles), f"{readings.path}: {name}")
        off = np.arcsin(np.clip(up @ axis, -1.0, 1.0)) - angles
        sigma = float(np.sqrt(off @ off / (len(off) - 2)))
        row["PtNorm"], row["IsInit"] = tuple(axis.tolist()), (1,)
        lines.append(
            f"{name}: {len(off)} readings, axis {' '.join(f'{x:.6f}' for x in axis)}, sigma {sigma:.3g} rad"
        )
        for one in _rows(made, "DescrIndiv"):
            if one["K"] == name:
                _fields(one, "V")["Sigma"] = _sigmas(0.0, sigma, len(off))
    return made, lines


def axis_of(up: FloatArray, sines: FloatArray, where: str) -> FloatArray:
    """The unit vector whose products with vectors (n, 3) are nearest to some numbers (n,).

    The least squares with length 1: `x = sum v s c / (s^2 + m)`, with the m that gives this length.

    Raises:
        InputError: the vectors are on one line, all alike: the vector may turn about it.
    """
    from scipy.optimize import brentq

    left, values, ways = np.linalg.svd(up, full_matrices=False)
    if values[1] < LOOSE * values[0]:
        raise InputError(f"{where}: the images are all tilted alike; readings at other tilts are needed")
    products = values * (left.T @ sines)

    def too_long(shift: float) -> float:
        return float(np.sum((products / (values**2 + shift)) ** 2) - 1.0)

    low = -(values[2] ** 2) + 1e-12 * values[0] ** 2
    high = values[0] ** 2 + float(np.linalg.norm(products))
    shift = brentq(too_long, low, high) if too_long(low) > 0.0 > too_long(high) else 0.0
    axis: FloatArray = ways.T @ (products / np.maximum(values**2 + shift, 1e-300))
    return axis / np.linalg.norm(axis)


def _described(name: str, kind: str, sigma: float | None) -> dict[str, Tree]:
    sigmas = _sigmas(None, None, 0) if sigma is None else _sigmas(0.0, sigma, 1)
    return {"K": name, "V": {"Type": kind, "NameInstr": name, "Sigma": sigmas}}


def _sigmas(translation: float | None, rotation: float | None, count: int) -> dict[str, Tree]:
    """Means as files keep them: sums and their weights."""
    return {
        name: {"SumW": (count,), "SumVW": (count * value,), "Nb": (count,)}
        if value is not None
        else {"SumW": (0,), "SumVW": (0,), "Nb": (0,)}
        for name, value in (("Tr", translation), ("Rot", rotation))
    }


def _identity() -> dict[str, Tree]:
    rows = np.eye(3).tolist()
    return {f"Axe{letter}": tuple(rows[k]) for k, letter in enumerate("IJK")}


def _fields(tree: dict[str, Tree], name: str) -> dict[str, Tree]:
    found = tree.setdefault(name, {})
    return found if isinstance(found, dict) else {}


def _rows(tree: dict[str, Tree], name: str) -> list[dict[str, Tree]]:
    found = tree.setdefault(name, [])
    return found if isinstance(found, list) else []  # type: ignore[return-value]  # of dicts, as it was read
