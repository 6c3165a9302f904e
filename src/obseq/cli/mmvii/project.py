"""Commands of MMVII that compute on a project tree: `create-calib`, `resection`, `block-init` and others."""

import argparse
import sys
from typing import TYPE_CHECKING

from obseq.cli.mmvii.tree_command import IMAGES, Files, add_tree_command, ending_of
from obseq.cli.parsing import Commands, positive_integer, positive_number

if TYPE_CHECKING:
    from obseq.images import Camera, ControlPoints, ImagePoints, UncalibratedResection
    from obseq.project.layout import ProjectTree
    from obseq.project.metadata import Rules


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "write initial calibrations of images from metadata (MMVII's OriCreateCalib)"
    command = add_tree_command(
        commands, "create-calib", _create_calibrations, purpose, ("images", "any_measures", "out")
    )
    command.add_argument("--degree", nargs=3, type=int, default=[3, 1, 1], metavar=("R", "D", "G"))
    command.add_argument("--projection", default="Stenope", metavar="NAME", help="Stenope, FE_EquiDist, ...")
    command.add_argument(
        "--size", nargs=2, type=positive_integer, metavar=("W", "H"), help="of images (their own)"
    )

    purpose = "tell which images have control points enough, and well spread (OriPoseEstimCheckGCPDist)"
    command = add_tree_command(
        commands, "check-gcp-distribution", _distribution, purpose, ("images", "points", "measures")
    )
    command.add_argument("--lists", metavar="PREFIX", help="write the lists of images that pass (SetOfName)")

    purpose = "find the poses of calibrated images from control points (OriPoseEstimSpaceResection)"
    needed = ("images", "points", "measures", "calibrations", "out")
    command = add_tree_command(commands, "resection", _resection, purpose, needed)
    command.add_argument(
        "--triplets", type=positive_integer, default=500, metavar="N", help="tried at most (500)"
    )
    command.add_argument("--max-error", type=positive_number, default=20.0, metavar="PX", help="median (20)")

    purpose = "find poses and calibrations from control points alone (OriPoseEstim11P)"
    command = add_tree_command(
        commands, "resection-11p", _uncalibrated, purpose, ("images", "points", "measures", "out")
    )
    command.add_argument(
        "--size", nargs=2, type=positive_integer, required=True, metavar=("W", "H"), help="of the images"
    )
    command.add_argument(
        "--degree", nargs=3, type=int, metavar=("R", "D", "G"), help="of the distortion (none: linear)"
    )
    command.add_argument(
        "--freeze", metavar="PATTERN", help="parameters that stay as the linear map has them"
    )
    command.add_argument(
        "--principal-point", nargs=2, type=float, metavar=("X", "Y"), help="held at these shares of the size"
    )
    command.add_argument("--no-median", action="store_true", help="no shared calibrations")

    purpose = "find the relative poses of rigidly mounted cameras (BlockCamInit)"
    command = add_tree_command(commands, "block-init", _block, purpose, ("orientation", "pattern", "out"))
    command.add_argument("--images", help=f"those that take part (all): {IMAGES}")
    command.add_argument("--groups", nargs=2, type=positive_integer, default=[1, 2], metavar=("CAM", "EXP"))
    command.add_argument("--master", metavar="CAMERA", help="whose frame is that of the block")
    command.add_argument("--name", default="TheBloc", help="of the block (TheBloc)")

    purpose = "compare measures with the projections of control points (ReportGCP)"
    add_tree_command(
        commands, "report-gcp", _report, purpose, ("images", "points", "measures", "orientation")
    )

    purpose = "list the files of a project, and name what is not understood"
    add_tree_command(commands, "project-contents", _contents, purpose, ())

    purpose = "convert the 3D points of a project to another coordinate system (GCPChSysCo)"
    add_tree_command(commands, "change-sysco", _change_system, purpose, ("system", "points", "out"))


def _create_calibrations(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.cameras import calibration_text
    from obseq.project.metadata import initial_camera
    from obseq.targets.pictures import picture_size

    rules = tree.rules(arguments.metadata)
    given = tuple(arguments.size) if arguments.size else None
    cameras: dict[str, Camera] = {}
    measures = None if arguments.any_measures == "*" else tree.measures(arguments.any_measures)
    for image in tree.images(arguments.images, measures):
        size = given or picture_size(tree.root / image)
        camera = initial_camera(
            rules, image, size=size, degree=tuple(arguments.degree), projection=arguments.projection
        )
        cameras.setdefault(camera.name, camera)
    folder, ending = tree.folder("Ori", arguments.out), ending_of(arguments)
    files: Files = {
        folder / f"{name}{ending}": calibration_text(camera, as_json=arguments.json_files)
        for name, camera in cameras.items()
    }
    lines = [
        f"{name}: F {camera.focal:.3f} px, {camera.width} x {camera.height}"
        for name, camera in cameras.items()
    ]
    return "\n".join(lines) + "\n", files, True


def _distribution(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.images import check_distribution
    from obseq.project.metadata import names_text
    from obseq.spreadsheets import cell_of

    measures, control = _measured(arguments, tree)
    found = check_distribution(measures, control)
    lines = ["image,n,linearity,planarity,resection,eleven_parameters\n"]
    for k, image in enumerate(found.images):
        indices = f"{found.linearity[k]:.6f},{found.planarity[k]:.6f}"
        answers = f"{int(found.allows_resection[k])},{int(found.allows_eleven_parameters[k])}"
        lines.append(f"{cell_of(image)},{found.counts[k]},{indices},{answers}\n")
    files: Files = {}
    if arguments.lists:
        for word, passed in (("Resec", found.allows_resection), ("11Param", found.allows_eleven_parameters)):
            names = [name for name, good in zip(found.images, passed, strict=True) if good]
            path = tree.root / f"{arguments.lists}_OK_{word}{ending_of(arguments)}"
            files[path] = names_text(names, as_json=arguments.json_files)
    return "".join(lines), files, bool(found.allows_resection.all())


def _resection(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    import numpy as np

    from obseq.images import Poses, ResectionOptions, resect
    from obseq.project.cameras import orientation_files, read_first_calibration
    from obseq.project.points import read_system, system_text

    measures, control = _measured(arguments, tree)
    rules, folder = tree.rules(arguments.metadata), tree.orientation(arguments.calibrations)
    cameras = {
        image: read_first_calibration(folder, rules.calibration_names(image), image)
        for image in measures.image_names
    }
    options = ResectionOptions(arguments.triplets, arguments.max_error)
    found = resect(measures, control, cameras, options)
    poses: Poses = found.poses
    out = tree.folder("Ori", arguments.out)
    by_name = {camera.name: camera for camera in cameras.values()}
    files: Files = dict(orientation_files(out, poses, by_name, as_json=arguments.json_files))
    definition = read_system(tree.points(arguments.points))
    files[out / f"CurSysCo{ending_of(arguments)}"] = system_text(definition, as_json=arguments.json_files)
    norms = np.sqrt((found.residuals**2).sum(axis=1))
    lines = []
    for k, image in enumerate(poses.images):
        mine = found.measures.image == found.measures.image_names.index(image)
        used = mine & found.is_used
        rms = np.sqrt((norms[used] ** 2).mean())
        counts = f"{int(used.sum())} of {int(mine.sum())} points"
        lines.append(f"{image}: {counts}, rms {rms:.3f} px, sigma0 {found.sigma0[k]:.3f}")
    gross = np.flatnonzero(~found.is_used)
    lines += [f"gross: {found.measures.label(int(row))}: {norms[row]:.1f} px" for row in gross]
    return "\n".join(lines) + "\n", files, not gross.size


def _uncalibrated(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from dataclasses import replace

    from obseq.images import Poses
    from obseq.project.cameras import IMAGE_CALIBRATION, orientation_files
    from obseq.project.points import read_system, system_text

    parts, lost = _resected(arguments, tree)
    own = {image: f"{IMAGE_CALIBRATION}{image}" for image in parts}
    cameras = {own[image]: replace(part.cameras[image], name=own[image]) for image, part in parts.items()}
    motions = [part.poses[image] for image, part in parts.items()]
    poses = Poses.of(
        list(parts), [m.centre for m in motions], [m.rotation for m in motions], cameras=list(own.values())
    )
    lines = [
        f"{image}: rms {part.rms[0]:.3f} px, F {part.cameras[image].focal:.3f} px"
        for image, part in parts.items()
    ]
    lines += [
        f"{image}: control points nearly in a plane (planarity {part.planarity[image]:.2g}): its focal "
        "length and pose are weak"
        for part in parts.values()
        for image in part.nearly_flat
    ]
    lines += [f"left out: {reason}" for reason in lost]
    if not arguments.no_median:
        medians, spreads = _medians(tree.rules(arguments.metadata), parts)
        cameras |= medians
        lines += spreads
    out, as_json = tree.folder("Ori", arguments.out), arguments.json_files
    files: Files = dict(orientation_files(out, poses, cameras, as_json=as_json))
    definition = read_system(tree.points(arguments.points))
    files[out / f"CurSysCo{ending_of(arguments)}"] = system_text(definition, as_json=as_json)
    return "\n".join(lines) + "\n", files, not lost


def _resected(
    arguments: argparse.Namespace, tree: "ProjectTree"
) -> "tuple[dict[str, UncalibratedResection], list[str]]":
    """The resection of each image, and why there is none of the others."""
    from obseq.errors import InputError
    from obseq.images import resect_uncalibrated

    measures, control = _measured(arguments, tree)
    degree = tuple(arguments.degree) if arguments.degree else None
    middle = tuple(arguments.principal_point) if arguments.principal_point else None
    parts: dict[str, UncalibratedResection] = {}
    lost: list[str] = []
    for image in measures.image_names:
        try:
            parts[image] = resect_uncalibrated(
                measures.of_image(image), control, tuple(arguments.size), degree, arguments.freeze, middle
            )
        except InputError as error:
            lost.append(str(error))
    if not parts:
        raise InputError(f"none of the {len(lost)} images has control points enough; {lost[0]}")
    return parts, lost


def _medians(
    rules: "Rules", parts: "dict[str, UncalibratedResection]"
) -> "tuple[dict[str, Camera], list[str]]":
    """Median calibrations of the images that metadata give one name, and how their parameters scatter."""
    import numpy as np

    from obseq.images import median_camera

    groups: dict[str, list[Camera]] = {}
    for image, part in parts.items():
        groups.setdefault(rules.calibration_name(image), []).append(part.cameras[image])
    medians = {name: median_camera(cameras, name) for name, cameras in groups.items()}
    lines = []
    for name, cameras in groups.items():
        values = np.array([camera.parameters for camera in cameras])
        spread = np.subtract(*np.percentile(values, (80, 20), axis=0))
        rows = zip(medians[name].parameter_names, medians[name].parameters, spread, strict=True)
        lines.append(f"{name}: median of {len(cameras)} images; percentile 80 minus 20 in brackets")
        lines += [f"  {parameter} {value:.8g} ({width:.3g})" for parameter, value, width in rows]
    return medians, lines


def _block(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.images import Exposures, initial_block
    from obseq.project.cameras import read_orientation
    from obseq.project.instruments.rigid_blocks import BlockFile, block_text
    from obseq.project.metadata import chosen

    poses, _ = read_orientation(tree.orientation(arguments.orientation))
    if arguments.images is not None:
        poses = poses.select(tree.listed(arguments.images) or chosen(poses.images, arguments.images))
    exposures = Exposures.of(poses.images, arguments.pattern, *arguments.groups)
    block, pairs = initial_block(poses, exposures, arguments.master, arguments.name)
    lines, passed = [], True
    for pair in pairs:
        shift = " ".join(f"{value:.6f}" for value in pair.mean.centre)
        scatter = f"SigmaTr {pair.sigma_translation:.6g}, SigmaRot {pair.sigma_rotation:.6g}"
        which = f"{pair.first} -> {pair.second}: {len(pair.exposures)} exposures"
        lines.append(f"{which}, translation {shift}, {scatter}")
        off = [name for name, fits in zip(pair.exposures, pair.fits, strict=True) if not fits]
        lines += [f"exposure {name} does not fit the block" for name in off]
        lines += [f"exposure {name} has no image of camera {camera}" for name, camera in pair.missing]
        passed = passed and not off
    lines += [f"not in the block: {image} is not as {arguments.pattern}" for image in exposures.others]
    places = {name: block.places[name] for name in block.places}
    camera, exposure = arguments.groups
    written = BlockFile(block.name, block.master, arguments.pattern, camera, exposure, places)
    path = tree.folder("RigBlock", arguments.out) / f"RigidBloc_{block.name}{ending_of(arguments)}"
    return "\n".join(lines) + "\n", {path: block_text(written, as_json=arguments.json_files)}, passed


def _report(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq.project.cameras import read_orientation
    from obseq.project.points import brought_to
    from obseq.project.reports import gcp_reports

    measures, control = _measured(arguments, tree)
    orientation = tree.orientation(arguments.orientation)
    control, told = brought_to(control, tree.points(arguments.points), orientation)
    poses, cameras = read_orientation(orientation, measures.image_names)
    name = f"{arguments.orientation}_Mes-{arguments.points}-{arguments.measures}"
    folder = tree.folder("Reports", "ReportGCP") / name
    texts = gcp_reports(measures, control, poses, cameras)
    if told:
        print(told, file=sys.stderr)
    return texts["ByImage.csv"], {folder / file: text for file, text in texts.items()}, True


def _contents(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from collections import Counter

    from obseq.project.contents import contents

    found = list(contents(tree))
    counts = Counter((item.path.parent.relative_to(tree.root), item.kind or "not read") for item in found)
    lines = [f"{folder}: {count} {kind}" for (folder, kind), count in sorted(counts.items())]
    for item in found:
        if item.unknown:
            lines.append(f"not understood in {item.path}: {', '.join(item.unknown)}")
    return "".join(f"{line}\n" for line in lines), {}, not any(item.unknown for item in found)


def _change_system(arguments: argparse.Namespace, tree: "ProjectTree") -> tuple[str, Files, bool]:
    from obseq import crs
    from obseq.project.layout import MEASURES
    from obseq.project.points import (
        measure_copies,
        points_text,
        read_control_points,
        read_entries,
        read_system,
        set_name,
        system_text,
    )
    from obseq.project.reports import converted

    folder = tree.points(arguments.points)
    given, source = read_control_points(folder), read_system(folder)
    system = tree.system(arguments.system)
    is_new = system == "RTL"
    if is_new:
        system = crs.complete_rtl(given.coordinates, crs.parse(source)).definition
    control = converted(given, source, system)
    out, ending = tree.folder("ObjCoordWorld", arguments.out), ending_of(arguments)
    as_json = arguments.json_files
    files: Files = {
        out / f"{set_name(folder, arguments.out)}{ending}": points_text(
            control, arguments.out, read_entries(folder), as_json=as_json
        ),
        out / f"CurSysCo{ending}": system_text(system, as_json=as_json),
        **measure_copies(tree.folder(MEASURES, arguments.points), tree.folder(MEASURES, arguments.out)),
    }
    if is_new:
        files[tree.folder("SysCo", f"RTL{ending}")] = system_text(system, as_json=as_json)
    return f"{len(control)} points in {system}\n", files, True


def _measured(arguments: argparse.Namespace, tree: "ProjectTree") -> "tuple[ImagePoints, ControlPoints]":
    from obseq.project.points import read_control_points, read_image_measures

    folder = tree.measures(arguments.measures)
    images = tree.images(arguments.images, folder)
    return read_image_measures(folder, images), read_control_points(tree.points(arguments.points))
