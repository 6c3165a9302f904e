"""`obseq bundle-adjust`: MMVII's `OriBundleAdj` on a project tree, with its options as it writes them."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command
from obseq.cli.progress import Progress
from obseq.cli.results import INCOMPLETE
from obseq.errors import InputError
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.images import BundleAdjustment, BundleSolution, ImagePoints
    from obseq.project.bundle_options import BundleOptions, Set2D
    from obseq.project.layout import ProjectTree
    from obseq.survey import Network

UNCODED = "NONE"
"""Beginning of the names of targets without a code."""

MORE = """
Options are MMVII's, Name=value, of today or of 2024:
  GCP3D=[[F,SG,Out?],...] GCP2D=[[F,SI,At?,Thr?,Exp?],...]   or GCPDir, GCPW, AddGCPW, GCPDirOut
  PPFzCal=Pat PPFreeCal=[[Cam,Par,Weight?],...] SharedIP=[Cam,Par,...] PatFzCenters PatFzOrient
  PoseVisc=[C,R] RefOri=[Ori,C,R?,Pat?] TPDir=F TiePWeight=[S,At?,Thr?,Exp?] TopoDirIn=F NbIter=N
  BRDirIn=F BRW=[Tr,Rot] BRW_Rat=[Tr,Rot] OutRigBlock=F
The iterations go on until they converge; NbIter only limits them. Poses, calibrations and points that
are written belong to one state."""

EXAMPLE = """\
example:
  obseq bundle-adjust '.*' Resec BA 'GCP3D=[[Fil,1,Adjusted]]' 'GCP2D=[[Fil,0.5]]' \\
      BRDirIn=Rig 'BRW=[1e-2,1e-5]'

exit code: 0 adjusted; 1 not converged, or something was left out; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "adjust a block of a project tree (MMVII's OriBundleAdj)"
    command = add_command(commands, "bundle-adjust", run, purpose, MORE, EXAMPLE)
    command.add_argument("images", help="a regular expression of image names, or a list (SetOfName file)")
    command.add_argument("orientation", help="folder of orientations to start from (Ori)")
    command.add_argument("out", help="folder of orientations that is written")
    command.add_argument("options", nargs="*", metavar="NAME=VALUE", help="MMVII's options")
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR", help="that holds MMVII-PhgrProj (here)"
    )
    command.add_argument("--json-files", action="store_true", help="write JSON instead of XML")
    command.add_argument("--json", type=Path, metavar="FILE", help="every result at full precision")


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    from obseq.project.bundle_options import parse_options
    from obseq.project.layout import ProjectTree

    options = parse_options(arguments.options)
    with Progress("reading") as progress:
        from obseq.images.output.record import record_of
        from obseq.images.output.summary import summary

        tree = ProjectTree.at(arguments.project)
        block = _block(arguments, tree, options)
        progress("adjusting")
        solution = block.solve(max_iterations=options.iterations or 50)
        record = record_of(solution)
        files = _files(arguments, tree, options, solution)
        if arguments.json:
            files[arguments.json] = record.to_json()
        check_writable(files)
        write_all(files)
    print(summary(record, [str(tree.folder("Ori", arguments.out))]), end="")
    return 0 if record.is_complete else INCOMPLETE


def _block(
    arguments: argparse.Namespace, tree: "ProjectTree", options: "BundleOptions"
) -> "BundleAdjustment":
    from obseq.images import BundleAdjustment
    from obseq.project.cameras import read_orientation
    from obseq.project.points import read_control_points

    if not options.measures and not options.ties and not options.survey:
        raise InputError("not any measure: give GCP2D, GCPW, TiePWeight or TopoDirIn")
    images = _images(arguments.images, tree, options)
    poses, cameras = read_orientation(tree.orientation(arguments.orientation), images)
    block = BundleAdjustment()
    block.add_cameras(*cameras.values())
    block.add_poses(poses)
    for points in options.points:
        block.add_control_points(read_control_points(tree.points(points.folder)).scaled(abs(points.factor)))
    for part in options.measures:
        _add_measures(block, part, _targets(block, tree, part, images))
    for part in options.ties:
        _add_measures(block, part, _tracks(tree, part, images))
    _add_rules(block, tree, options)
    if options.rigid is not None:
        _add_rigid(block, tree, options)
    if options.survey:
        block.add_survey(_network(tree, options))
    return block


def _images(selection: str, tree: "ProjectTree", options: "BundleOptions") -> list[str]:
    """Images of the selection that some set has measures of."""
    if not options.measures:
        raise InputError("GCP2D, or GCPDir with GCPW, says which images have measures")
    found: dict[str, None] = {}
    for part in options.measures:
        found |= dict.fromkeys(tree.images(selection, tree.measures(part.folder)))
    return list(found)


def _targets(
    block: "BundleAdjustment", tree: "ProjectTree", part: "Set2D", images: list[str]
) -> "ImagePoints":
    """The measures of a folder, without targets that have no code."""
    import numpy as np

    from obseq.project.points import read_image_measures

    folder = tree.measures(part.folder)
    here = [image for image in tree.images(".*", folder) if image in set(images)]
    measures = read_image_measures(folder, here)
    known = set(block.control.names)
    coded = [name in known or not name.startswith(UNCODED) for name in measures.point_names]
    return measures.rows(np.array(coded, dtype=bool)[measures.point])


def _tracks(tree: "ProjectTree", part: "Set2D", images: list[str]) -> "ImagePoints":
    import numpy as np

    from obseq.project.tie_points import read_tracks

    tracks = read_tracks(tree.folder("MulTieP", part.folder))
    wanted = set(images)
    used = np.array([name in wanted for name in tracks.image_names], dtype=bool)
    return tracks.rows(used[tracks.image])


def _add_measures(block: "BundleAdjustment", part: "Set2D", measures: "ImagePoints") -> None:
    from obseq.images import Weighting

    weighting = Weighting(part.sigma, part.attenuation, part.threshold, part.exponent)
    block.add_measures(measures, weighting, part.folder)


def _add_rules(block: "BundleAdjustment", tree: "ProjectTree", options: "BundleOptions") -> None:
    from obseq.project.cameras import read_orientation

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
        chosen = [
            image for image in poses.images if re.fullmatch(pattern, image) and image in block.camera_of
        ]
        block.observe_poses(poses.select(chosen), shift, turn)


def _add_rigid(block: "BundleAdjustment", tree: "ProjectTree", options: "BundleOptions") -> None:
    """Every block of the folder; MMVII's sigmas are of matrix entries, sqrt(2) times those of angles."""
    from obseq.images import Exposures, Poses, RigidBlock
    from obseq.project.blocks import read_block

    shift, turn = options.rigid or (1.0, 1.0)
    places = options.rigid_places
    folder = tree.folder("RigBlock", options.rigid_folder or "Std")
    paths = sorted(path for path in folder.glob("RigidBloc_*") if path.suffix in (".xml", ".json"))
    if not paths:
        raise InputError(f"{folder}: holds no rigid block (RigidBloc_*.xml)")
    for path in paths:
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
                turn / 2**0.5,
                place_sigmas=(places[0], places[1] / 2**0.5) if places else None,
            )
        )


def _network(tree: "ProjectTree", options: "BundleOptions") -> "Network":
    """The survey observations of a folder; their points are those of the block, and new ones."""
    from obseq.project.points import read_system
    from obseq.survey import Network

    folder = tree.folder("Topo", options.survey or "")
    observations = sorted(folder.glob("*.obs"))
    points = sorted(folder.glob("*.cor"))
    if not observations:
        raise InputError(f"{folder}: holds no survey observations (*.obs)")
    if not points:
        raise InputError(f"{folder}: holds no points of the survey (*.cor); free points need a line each")
    frame = read_system(tree.points(options.points[0].folder)) if options.points else None
    return Network.read(observations, points, frame=None if frame == "LocalNONE" else frame)


def _files(
    arguments: argparse.Namespace, tree: "ProjectTree", options: "BundleOptions", solution: "BundleSolution"
) -> "dict[Path, str | bytes]":
    from obseq.images import ControlPoints
    from obseq.project.cameras import orientation_files
    from obseq.project.points import points_text, read_system, system_text

    as_json = arguments.json_files
    ending = ".json" if as_json else ".xml"
    out = tree.folder("Ori", arguments.out)
    files: dict[Path, str | bytes] = dict(
        orientation_files(out, solution.poses, solution.cameras, as_json=as_json)
    )
    system = read_system(tree.orientation(arguments.orientation))
    files[out / f"CurSysCo{ending}"] = system_text(system, as_json=as_json)
    row = {name: k for k, name in enumerate(solution.points)}
    for part in options.points:
        if part.out:
            given = solution.block.control
            names = [name for name in given.names if name in row]
            chosen = [row[name] for name in names]
            points = ControlPoints(
                tuple(names), solution.coordinates[chosen], solution.point_covariances[chosen]
            )
            folder = tree.folder("ObjCoordWorld", part.out)
            files[folder / f"MesGCP-NewGCP{ending}"] = points_text(points, part.out, as_json=as_json)
            files[folder / f"CurSysCo{ending}"] = system_text(system, as_json=as_json)
    return files | _rigid_files(tree, options, solution, ending)


def _rigid_files(
    tree: "ProjectTree", options: "BundleOptions", solution: "BundleSolution", ending: str
) -> "dict[Path, str | bytes]":
    """The adjusted places of rigid blocks, where `OutRigBlock` asks for them."""
    from dataclasses import replace

    from obseq.project.blocks import block_text, read_block

    if not options.rigid_out:
        return {}
    files: dict[Path, str | bytes] = {}
    source = tree.folder("RigBlock", options.rigid_folder or "Std")
    for path in sorted(path for path in source.glob("RigidBloc_*") if path.suffix in (".xml", ".json")):
        found = read_block(path)
        places = solution.rigid_places(found.name)
        text = block_text(
            replace(found, poses={name: places[name] for name in places}), as_json=ending == ".json"
        )
        files[tree.folder("RigBlock", options.rigid_out) / f"RigidBloc_{found.name}{ending}"] = text
    return files
