"""The block that a project tree and the options of MMVII's `OriBundleAdj` describe."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ControlPoints, Exposures, ImagePoints, Poses, RigidBlock, Weighting
from obseq.images.names import are_among
from obseq.project.cameras import read_orientation
from obseq.project.instruments.blocks import FILE, read_instrument_block
from obseq.project.instruments.boresights import add_boresights
from obseq.project.instruments.joining import ENTRIES, add_instruments
from obseq.project.instruments.rigid_blocks import read_block
from obseq.project.layout import ProjectTree
from obseq.project.metadata import chosen
from obseq.project.networks import control_of, network_of, survey_points
from obseq.project.options.bundle_options import BundleOptions, InstrumentOptions, Set2D
from obseq.project.points import differ, read_image_measures, read_system, require_one
from obseq.project.tie_points import read_tracks
from obseq.project.topo import read_topo
from obseq.project.tree import files_in
from obseq.reading.origin import Origin
from obseq.survey import FieldBook, Points, make_points, merge_points, read_cor

UNCODED = "NONE"
"""Beginning of the names of targets without a code."""


def assembled(
    tree: ProjectTree, selection: str, orientation: str, options: BundleOptions
) -> BundleAdjustment:
    """The block to adjust.

    Args:
        tree: the project.
        selection: pattern of images, or the file of a list.
        orientation: folder where poses and calibrations start.
        options: what else there is.

    Raises:
        InputError: something is missing or does not fit; it is named.
    """
    if not options.measures and not options.ties:
        raise InputError(
            "not any measure in images: give GCP2D, GCPW or TiePWeight (topo-adjust takes survey alone)"
        )
    parts = [(part, _targets(tree, part, selection), tree.measures(part.folder)) for part in options.measures]
    parts += [
        (part, _tracks(tree, part, selection), tree.folder("MulTieP", part.folder)) for part in options.ties
    ]
    images = list(dict.fromkeys(name for _, measures, _ in parts for name in measures.image_names))
    poses, cameras = read_orientation(tree.orientation(orientation), images)
    control, definition = control_of(tree, options)
    _require_one_system(tree, orientation, definition)
    block = BundleAdjustment()
    block.add_cameras(*cameras.values())
    block.add_poses(poses)
    rays = Counter(measures.point_names[k] for _, measures, _ in parts for k in measures.point)
    _add_points(block, tree, options, control, rays, definition)
    for part, measures, folder in parts:
        weighting = None
        if part.sigma is not None:
            weighting = Weighting(part.sigma, part.attenuation, part.threshold, part.exponent)
        block.add_measures(_coded(measures, control), weighting, part.folder, origin=Origin(str(folder)))
    if options.reference:
        require_one(tree.orientation(orientation), tree.orientation(options.reference[0]))
    _add_rules(block, tree, options)
    if options.rigid is not None:
        _add_rigid(block, tree, options)
    if options.instrument is not None:
        given = options.instrument
        add_instruments(block, tree, read_instrument_block(instrument_file(tree, given)), given)
    if options.boresights is not None:
        add_boresights(block, tree, options.boresights)
    return block


def _require_one_system(tree: ProjectTree, orientation: str, definition: str) -> None:
    """Poses and points must say the same of their system, where both say something."""
    own = read_system(tree.orientation(orientation))
    if differ(own, definition):
        raise InputError(
            f"orientation {orientation} is in {own}, the 3D points are in {definition}: convert one of them "
            "(change-sysco converts points)"
        )


def _targets(tree: ProjectTree, part: Set2D, selection: str) -> ImagePoints:
    folder = tree.measures(part.folder)
    return read_image_measures(folder, tree.images(selection, folder))


def _tracks(tree: ProjectTree, part: Set2D, selection: str) -> ImagePoints:
    folder = tree.folder("MulTieP", part.folder)
    tracks = read_tracks(folder)
    wanted = tree.listed(selection) or chosen(tracks.image_names, selection)
    used = np.array([name in set(wanted) for name in tracks.image_names], dtype=bool)
    if not used.any():
        raise InputError(f"{selection!r}: no image with tie points in {folder} has such a name")
    return tracks.rows(used[tracks.image])


def _coded(measures: ImagePoints, control: ControlPoints) -> ImagePoints:
    """The measures without targets that have no code, unless they are known points."""
    known = are_among(measures.point_names, control.names)
    coded = known | np.array([not name.startswith(UNCODED) for name in measures.point_names], dtype=bool)
    return measures.rows(coded[measures.point])


def _add_points(
    block: BundleAdjustment,
    tree: ProjectTree,
    options: BundleOptions,
    control: ControlPoints,
    rays: Counter[str],
    definition: str,
) -> None:
    """Control points; those that survey observations alone know are points of the survey network.

    A free point of two rays or more starts where they meet, like any tie point, and not at the coordinates of
    the file: rough ones would make all its measures look like blunders.
    """
    origin = Origin(", ".join(str(tree.points(part.folder)) for part in options.points))
    free = np.asarray(control.is_free.all(axis=1))
    tie = {name for name, is_free in zip(control.names, free, strict=True) if is_free and rays[name] > 1}
    if options.survey is None:
        block.add_control_points(control.select([name for name in control.names if name not in tie]), origin)
        return
    folder = tree.topo(options.survey)
    book = read_topo(folder)
    alone = {name for name in control.names if name in book.point_names and not rays[name]}
    block.add_control_points(
        control.select([name for name in control.names if name not in alone | tie]), origin
    )
    points = _survey_points(folder, book, control, alone, tie)
    weight = options.survey_weight
    block.add_survey(network_of(points, book, definition, options.refraction, weight))


def _survey_points(
    folder: Path, book: FieldBook, control: ControlPoints, alone: set[str], tie: set[str]
) -> Points:
    """What is known of the points of the survey alone; those that images have too are free here."""
    names = [name for name in control.names if name in set(book.point_names) - alone]
    coordinates = control.select(names).coordinates.copy()
    coordinates[are_among(names, tie)] = np.nan
    own = control.select([name for name in control.names if name in alone])
    parts: list[Points] = [survey_points(own), make_points(names, coordinates)]
    files = sorted(folder.glob("*.cor"))
    return merge_points([*parts, read_cor(files)] if files else parts)


def _add_rules(block: BundleAdjustment, tree: ProjectTree, options: BundleOptions) -> None:
    if options.frozen:
        block.freeze_parameters(options.frozen)
    for cameras, parameters, sigma in options.freed:
        block.free_parameters(parameters, cameras)
        if sigma is not None:
            block.observe_parameters(parameters, sigma, cameras)
    for cameras, parameters in options.shared:
        block.share_parameters(parameters, cameras)
    if options.fixed_centres:
        block.freeze_centres(options.fixed_centres)
    if options.fixed_rotations:
        block.freeze_rotations(options.fixed_rotations)
    if options.viscosity:
        block.slow_poses(*options.viscosity)
    if options.reference:
        folder, shift, turn, pattern = options.reference
        poses, _ = read_orientation(tree.orientation(folder))
        used = [image for image in poses.images if re.fullmatch(pattern, image) and image in block.camera_of]
        block.observe_poses(poses.select(used), shift, turn)


def block_files(tree: ProjectTree, options: BundleOptions) -> list[Path]:
    """The files of the rigid blocks that the options name."""
    folder = tree.folder("RigBlock", options.rigid_folder or "Std")
    paths = files_in(folder, "RigidBloc_")
    if not paths:
        raise InputError(f"{folder}: holds no rigid block (RigidBloc_*.xml)")
    return paths


def instrument_file(tree: ProjectTree, given: InstrumentOptions) -> Path:
    """The file of the instrument block that `BOI` names, or the only one of its folder."""
    folder = tree.folder("InstrBlock", given.folder)
    paths = files_in(folder, FILE)
    found = [path for path in paths if not given.block or path.stem == FILE + given.block]
    if len(found) != 1:
        listed = ", ".join(path.stem.removeprefix(FILE) for path in paths) or "none"
        raise InputError(f"{folder}: BOI names {given.block or 'no block'}; there are {listed}")
    return found[0]


def _add_rigid(block: BundleAdjustment, tree: ProjectTree, options: BundleOptions) -> None:
    """Every block of the folder; MMVII's sigmas are of matrix entries."""
    shift, turn = options.rigid or (1.0, 1.0)
    places = options.rigid_places
    for path in block_files(tree, options):
        found = read_block(path)
        exposures = Exposures.of(
            list(block.camera_of), found.pattern, found.camera_group, found.exposure_group
        )
        poses = list(found.poses.values())
        block.add_rigid_block(
            RigidBlock(
                found.name,
                found.master,
                exposures,
                Poses.of(list(found.poses), [p.centre for p in poses], [p.rotation for p in poses]),
                shift,
                turn / ENTRIES,
                place_sigmas=(places[0], places[1] / ENTRIES) if places else None,
            )
        )
