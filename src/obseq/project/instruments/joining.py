"""Instrument blocks of a project in an adjustment (MMVII's `BOI` and `ClinoBOI`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.images import Clinometer, Exposures, Poses, RigidBlock
from obseq.images.names import numbered
from obseq.project.instruments.blocks import read_clinometer_readings
from obseq.project.metadata import whole_match

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.geometry import RigidMotion
    from obseq.images import BundleAdjustment
    from obseq.images.rigid import Gauge, Sigmas
    from obseq.project.instruments.blocks import ClinometerReadings, InstrumentBlock, InstrumentCamera
    from obseq.project.layout import ProjectTree
    from obseq.project.options.bundle_options import ClinometerOptions, InstrumentOptions

ENTRIES = 2.0**0.5
"""Sigma of the entries of a rotation matrix over that of an angle."""


def add_instruments(
    block: BundleAdjustment, tree: ProjectTree, found: InstrumentBlock, given: InstrumentOptions
) -> None:
    """Adds an instrument block: its rigid cameras, and its clinometers where they are asked for.

    Raises:
        InputError: what the options need is not in the files; it is named.
    """
    rigid = rigid_block_of(found, block.camera_of, given)
    block.add_rigid_block(rigid)
    if given.clinometers is not None:
        readings = read_clinometer_readings(tree.folder("MeasureClino", given.clinometers.folder))
        _add_clinometers(block, found, given.clinometers, readings, rigid.exposures)
    elif found.clinometers:
        block.notes.append(f"{found.path}: Clinos is not used by the adjustment (ClinoBOI joins it)")
    if found.turns:
        block.notes.append(f"{found.path}: CstrRelRot is not used by the adjustment")


def rigid_block_of(
    found: InstrumentBlock, camera_of: Mapping[str, str], given: InstrumentOptions
) -> RigidBlock:
    """The cameras of a block in an adjustment.

    Args:
        found: the file.
        camera_of: calibration of each image.
        given: factors, gauge and attachment.

    Raises:
        InputError: a camera has no pose yet or twice one exposure, there are no pairs, or a sigma is missing.
    """
    places = {camera.calibration: _place(found, camera) for camera in found.cameras}
    if not found.pairs:
        raise InputError(f"{found.path}: SigmasPairs is empty: no pair of cameras is observed")
    every = {pair: _pair_sigmas(found, pair, given) for pair in found.pairs}
    exposures = exposures_of(found, camera_of)
    poses = list(places.values())
    return RigidBlock(
        found.name,
        found.master,
        exposures,
        Poses.of(list(places), [pose.centre for pose in poses], [pose.rotation for pose in poses]),
        *next(iter(every.values())),
        place_sigmas=_attachments(found, given.attachment, exposures) if given.attachment else None,
        master_sigmas=_gauge(found, given),
        pair_sigmas=every,
    )


def _place(found: InstrumentBlock, camera: InstrumentCamera) -> RigidMotion:
    if camera.pose is None:
        raise InputError(f"{found.path}: camera {camera.calibration} has no pose yet (IsInit 0)")
    return camera.pose


def _pair_sigmas(found: InstrumentBlock, pair: tuple[str, str], given: InstrumentOptions) -> Sigmas:
    """Sigmas of a pair: those of the file times the factors, or the factors themselves; of angles."""
    own = found.pairs[pair] if given.relative else (1.0, 1.0)
    translation, entries = _known(found, f"SigmasPairs: {', '.join(pair)}", own)
    return given.factors[0] * translation, given.factors[1] * entries / ENTRIES


def _known(found: InstrumentBlock, what: str, sigmas: tuple[float | None, float | None]) -> Sigmas:
    first, second = sigmas
    if first is None or second is None:
        raise InputError(f"{found.path}: {what}: no sigma is known yet (SumW is 0)")
    return first, second


def _own(found: InstrumentBlock, camera: str) -> Sigmas:
    """The sigmas that `DescrIndiv` gives of a camera."""
    if camera not in found.instruments:
        raise InputError(f"{found.path}: DescrIndiv has no sigmas of {camera}, which the options need")
    return _known(found, f"DescrIndiv: {camera}", found.instruments[camera])


def _attachments(found: InstrumentBlock, factors: Sigmas, exposures: Exposures) -> dict[str, Sigmas]:
    """Sigmas of the places as the file has them, as firm together as the pairs are.

    The original multiplies their weights by the number of pairs over that of cameras.
    """
    known = set(exposures.cameras)
    rank = {camera: k for k, camera in enumerate(exposures.cameras)}
    used = [pair for pair in found.pairs if known >= set(pair)]
    n = sum(len(exposures.pairs(rank[a], rank[b])[2]) for a, b in used)
    if not n:
        raise InputError(f"{found.path}: no exposure has two cameras of a pair of the block")
    spread = (len(found.cameras) / n) ** 0.5
    own = {camera.calibration: _own(found, camera.calibration) for camera in found.cameras}
    return {
        name: (factors[0] * tr * spread, factors[1] * rot * spread / ENTRIES)
        for name, (tr, rot) in own.items()
    }


def _gauge(found: InstrumentBlock, given: InstrumentOptions) -> Gauge | None:
    """The sigmas of the place of the master; None where it is held (the original's rows are of angles)."""
    if max(given.gauge) <= 0.0:
        return None
    own = _own(found, found.master)
    first, second = (
        factor * sigma if factor > 0.0 else None for factor, sigma in zip(given.gauge, own, strict=True)
    )
    return first, second


def exposures_of(found: InstrumentBlock, camera_of: Mapping[str, str]) -> Exposures:
    """Which images, with their calibrations, a block's cameras took together."""
    by_name = {camera.calibration: camera for camera in found.cameras}
    taken: dict[tuple[str, str], str] = {}
    for image, calibration in camera_of.items():
        stamp = _stamp(found, by_name[calibration], image) if calibration in by_name else None
        if stamp is None:
            continue
        other = taken.setdefault((calibration, stamp), image)
        if other != image:
            raise InputError(f"{found.path}: {other} and {image} are both of {calibration}, exposure {stamp}")
    cameras, camera = numbered([pair[0] for pair in taken])
    names, exposure = numbered([pair[1] for pair in taken])
    images = tuple(taken.values())
    others = tuple(image for image in camera_of if image not in set(images))
    return Exposures(cameras, names, images, camera, exposure, others)


def _stamp(found: InstrumentBlock, camera: InstrumentCamera, image: str) -> str | None:
    """The exposure of an image of a camera; None for images that are not of the block."""
    if not _is_chosen(found, camera, image):
        return None
    match = whole_match(camera.stamp, image, f"{found.path}: PatTimeStamp")
    if match is None:
        return None
    if not match.re.groups:
        raise InputError(f"{found.path}: PatTimeStamp {camera.stamp!r} has no group in parentheses")
    return match[1]


def _is_chosen(found: InstrumentBlock, camera: InstrumentCamera, image: str) -> bool:
    if camera.listed is not None:
        return image in camera.listed
    return not camera.selection or bool(whole_match(camera.selection, image, str(found.path)))


def _add_clinometers(
    block: BundleAdjustment,
    found: InstrumentBlock,
    given: ClinometerOptions,
    readings: ClinometerReadings,
    exposures: Exposures,
) -> None:
    carried = carried_images(found, exposures)
    names = [item.name for item in found.clinometers]
    if set(readings.names) != set(names):
        raise InputError(
            f"{readings.path}: has the clinometers {', '.join(readings.names)}; those of {found.path} are "
            f"{', '.join(names) or 'none'}"
        )
    rows = _rows_with_images(block, given, readings, carried)
    images = [carried[readings.exposures[row]] for row in rows]
    for item in found.clinometers:
        if item.axis is None:
            raise InputError(f"{found.path}: clinometer {item.name} has no axis yet (IsInit 0)")
        block.add_clinometer(Clinometer(item.name, item.axis, item.correction, given.free_degrees))
        column = readings.names.index(item.name)
        sigmas = readings.sigmas[rows, column]
        if not np.isfinite(sigmas).all():
            sigmas = np.where(np.isfinite(sigmas), sigmas, _reading_sigma(found, item.name))
        block.add_inclinations(item.name, images, readings.angles[rows, column], given.factors[0] * sigmas)
    for (first, second), sigma in found.right_angles.items():
        block.add_right_angle(first, second, given.factors[1] * sigma)
    block.set_vertical(is_free=given.vertical_is_free)


def _reading_sigma(found: InstrumentBlock, name: str) -> float:
    """The sigma of the readings of a clinometer (radians), which files keep as that of a rotation."""
    sigma = found.instruments.get(name, (None, None))[1]
    if sigma is None:
        raise InputError(f"{found.path}: DescrIndiv has no sigma of the readings of {name}")
    return sigma


def carried_images(found: InstrumentBlock, exposures: Exposures) -> dict[str, str]:
    """The images of the camera that carries the clinometers, by exposure."""
    if found.carriers != (found.master,):
        raise InputError(
            f"{found.path}: NumPoseInstr should name one camera, the master ({found.master}): axes of "
            "clinometers are in the frame of the block"
        )
    if found.master not in exposures.cameras:
        return {}
    own = exposures.camera == exposures.cameras.index(found.master)
    return {
        exposures.names[exposures.exposure[row]]: exposures.images[row]
        for row in np.flatnonzero(own).tolist()
    }


def _rows_with_images(
    block: BundleAdjustment,
    given: ClinometerOptions,
    readings: ClinometerReadings,
    carried: Mapping[str, str],
) -> list[int]:
    """Rows of readings that have an image; the others are left aside, if that is asked for."""
    alone = [name for name in readings.exposures if name not in carried]
    if len(alone) == len(readings.exposures) or (alone and not given.others):
        raise InputError(
            f"{readings.path}: exposure {alone[0]} has no image of the camera that carries the clinometers "
            f"({len(alone)} have none; [VertFree,1] in ClinoBOI leaves such readings aside)"
        )
    if alone:
        block.notes.append(f"{readings.path}: {len(alone)} exposures have no image: {', '.join(alone[:5])}")
    return [row for row, name in enumerate(readings.exposures) if name in carried]
