"""Adjusted blocks as MicMac v1 has them: orientations, calibrations, measures, coordinates of points."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

import numpy as np

from obseq.errors import InputError
from obseq.formats.camera_terms import check_camera, check_cameras

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.images import Block, BundleSolution, Camera, RigidMotion
    from obseq.images.adjustment.solution import MeasureResiduals

MEASURES, POINTS = "Measures-S2D.xml", "Points-S3D.xml"
RADIAL = ("K1", "K2", "K3", "K4", "K5")
TERMS = (*RADIAL, "p1", "p2", "b1", "b2")
HEAD = '<?xml version="1.0" ?>\n'
FREE = -1.0
"""An uncertainty of points that nobody knew."""


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block that such files cannot hold.

    Raises:
        InputError: a camera has other terms; two images or cameras would be one file.
    """
    check_cameras(block, "MicMac v1", TERMS)
    wrong = [name for name in (*block.camera_of, *block.cameras) if "/" in name or "\\" in name]
    if wrong:
        raise InputError(f"{wrong[0]!r}: files of MicMac v1 have the names of images and cameras")


def v1_files(solution: BundleSolution, folder: str | Path) -> dict[Path, str]:
    """The files of a folder of orientations, and beside them those of measures and points.

    A folder `Ori-X` gives `Ori-X/Orientation-<image>.xml`, `Ori-X/<camera>.xml`, and in it the measures
    (`Measures-S2D.xml`) and all points (`Points-S3D.xml`), with an uncertainty of -1 where nobody knew them.
    """
    place = Path(folder)
    poses = solution.poses
    found = {place / f"{name}.xml": _calibration(camera) for name, camera in solution.cameras.items()}
    for image, camera in zip(poses.images, poses.cameras, strict=True):
        found[place / f"Orientation-{image}.xml"] = _orientation(
            poses[image], f"{place.name}/{camera}.xml", solution
        )
    found[place / MEASURES] = _measures(solution, solution.residuals)
    found[place / POINTS] = _points(solution)
    return found


def _words(values: object) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(np.asarray(values)).tolist())


def _calibration(camera: Camera) -> str:
    check_camera(camera, "MicMac v1", TERMS)
    given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    radial = [given.get(name, 0.0) / camera.focal ** (2 * k) for k, name in enumerate(RADIAL, 1)]
    while radial and not radial[-1]:
        radial.pop()
    terms = "".join(f"<CoeffDist>{_words(value)}</CoeffDist>" for value in radial)
    middle = _words(camera.principal_point)
    part = f"<CDist>{middle}</CDist>{terms}<PPaEqPPs>true</PPaEqPPs>"
    powers = {"P1": ("p1", 1), "P2": ("p2", 1), "b1": ("b1", 0), "b2": ("b2", 0)}
    others = {tag: given.get(name, 0.0) / camera.focal**power for tag, (name, power) in powers.items()}
    model = f"<ModRad>{part}</ModRad>"
    if any(others.values()):
        more = "".join(f"<{tag}>{_words(value)}</{tag}>" for tag, value in others.items())
        model = f"<ModPhgrStd><RadialePart>{part}</RadialePart>{more}</ModPhgrStd>"
    return (
        f"{HEAD}<ExportAPERO><CalibrationInternConique><KnownConv>eConvApero_DistM2C</KnownConv>\n"
        f"<PP>{middle}</PP><F>{_words(camera.focal)}</F><SzIm>{camera.width} {camera.height}</SzIm>\n"
        f"<CalibDistortion>{model}</CalibDistortion></CalibrationInternConique></ExportAPERO>\n"
    )


def _orientation(pose: RigidMotion, calibration: str, solution: BundleSolution) -> str:
    rows = "".join(f"<L{k}>{_words(row)}</L{k}>" for k, row in enumerate(pose.rotation, 1))
    ground = float(np.median(solution.coordinates[:, 2]))
    depth = float(np.median(np.linalg.norm(solution.coordinates - pose.centre, axis=1)))
    return (
        f"{HEAD}<ExportAPERO><OrientationConique>\n"
        "<OrIntImaM2C><I00>0 0</I00><V10>1 0</V10><V01>0 1</V01></OrIntImaM2C>\n"
        "<TypeProj>eProjStenope</TypeProj><ZoneUtileInPixel>true</ZoneUtileInPixel>\n"
        f"<FileInterne>{escape(calibration)}</FileInterne><RelativeNameFI>true</RelativeNameFI>\n"
        f"<Externe><AltiSol>{_words(ground)}</AltiSol><Profondeur>{_words(depth)}</Profondeur>\n"
        "<Time>-1e30</Time><KnownConv>eConvApero_DistM2C</KnownConv>\n"
        f"<Centre>{_words(pose.centre)}</Centre><IncCentre>1 1 1</IncCentre>\n"
        f"<ParamRotation><CodageMatr>{rows}</CodageMatr></ParamRotation></Externe>\n"
        "</OrientationConique></ExportAPERO>\n"
    )


def _measures(solution: BundleSolution, found: MeasureResiduals) -> str:
    parts = [f"{HEAD}<SetOfMesureAppuisFlottants>\n"]
    names = list(map(escape, solution.points))
    order = np.argsort(found.image, kind="stable")
    ends = np.cumsum(np.bincount(found.image, minlength=len(solution.poses)))
    for image, rows in zip(solution.poses.images, np.split(order, ends[:-1]), strict=True):
        if rows.size:
            parts.append(f"<MesureAppuiFlottant1Im><NameIm>{escape(image)}</NameIm>\n")
            parts += [
                f"<OneMesureAF1I><NamePt>{names[point]}</NamePt>"
                f"<PtIm>{x:.17g} {y:.17g}</PtIm></OneMesureAF1I>\n"
                for point, (x, y) in zip(found.point[rows].tolist(), found.xy[rows].tolist(), strict=True)
            ]
            parts.append("</MesureAppuiFlottant1Im>\n")
    return "".join([*parts, "</SetOfMesureAppuisFlottants>\n"])


def _points(solution: BundleSolution) -> str:
    control: Mapping[str, object] = dict(
        zip(solution.block.control.names, solution.block.control.sigmas, strict=True)
    )
    parts = [f"{HEAD}<DicoAppuisFlottant>\n"]
    for name, xyz in zip(solution.points, solution.coordinates, strict=True):
        given = np.asarray(control.get(name, np.full(3, np.inf)), dtype=np.float64)
        sigmas = np.where(np.isinf(given), FREE, given)
        parts.append(
            f"<OneAppuisDAF><Pt>{_words(xyz)}</Pt><NamePt>{escape(name)}</NamePt>"
            f"<Incertitude>{_words(sigmas)}</Incertitude></OneAppuisDAF>\n"
        )
    return "".join([*parts, "</DicoAppuisFlottant>\n"])
