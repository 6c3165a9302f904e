"""Where the block of `obseq bundle` comes from: tables, the files of other programs, other observations."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.images.bundle_ground import add_ground, carried_by, put_ground
from obseq.cli.parsing import positive_integer
from obseq.errors import InputError, noting
from obseq.formats.blocks.catalogue import BLOCKS, Sigmas
from obseq.printable import listed

SHOWN = 4
"""Parameters that a note lists."""

if TYPE_CHECKING:
    import argparse

    from obseq.formats.blocks.catalogue import BlockFormat
    from obseq.images import BundleAdjustment, Poses, Weighting

OPK_UNITS = ("degree", "gon", "radian")

DATUMS = ("control", "centres", "points")

NEEDS = {
    "lever_arm_sigma": ("lever_arm",),
    "readout": ("positions",),
    "readout_sigma": ("readout",),
    "angle_sigma": ("positions",),
    "positions_crs": ("positions",),
    "frame": ("obs", "control_crs", "positions_crs"),
    **{
        option: (form.option,)
        for form in BLOCKS
        for _, option in form.options
        if option not in ("image_sigma", "control_sigma")
    },
}
"""Options that say nothing without another one: any of these."""


def add_sources(command: argparse.ArgumentParser) -> None:
    """Add the options that say where a block is."""
    files = command.add_argument_group("a block in tables")
    files.add_argument(
        "--cameras", type=Path, metavar="FILE", help="table of cameras, or their calibration (YAML)"
    )
    files.add_argument("--images", type=Path, metavar="FILE", help="table of images, with poses or without")
    files.add_argument("--opk", type=Path, metavar="FILE", help="poses as text, instead of --images")
    files.add_argument("--opk-columns", default="NXYZOPK", metavar="LETTERS", help="of --opk (NXYZOPK)")
    files.add_argument("--opk-unit", choices=OPK_UNITS, default=OPK_UNITS[0], help="of its angles (degree)")
    files.add_argument(
        "--measures",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="tables of image measures; of a block of another program, marks of further points",
    )
    files.add_argument(
        "--control", nargs="+", type=Path, default=[], metavar="FILE", help="tables of control points"
    )
    others = command.add_argument_group("a block of another program")
    for form in BLOCKS:
        others.add_argument(f"--{form.option}", type=Path, metavar=form.takes, help=form.holds)
    others.add_argument("--chunk", metavar="LABEL", help="which one of --metashape")
    others.add_argument(
        "--size", nargs=2, type=positive_integer, metavar=("W", "H"), help="of --photomodeler"
    )
    others.add_argument("--micmac-measures", type=Path, metavar="FILE", help="points measured in images")
    others.add_argument("--micmac-points", type=Path, metavar="FILE", help="their coordinates")
    add_ground(command)
    more = command.add_argument_group("other observations")
    more.add_argument("--lengths", nargs="+", type=Path, default=[], metavar="FILE", help="tables of lengths")
    more.add_argument(
        "--positions", nargs="+", type=Path, default=[], metavar="FILE", help="tables of observed centres"
    )
    more.add_argument("--obs", nargs="+", type=Path, metavar="FILE", help="survey observations (OBS)")
    more.add_argument("--cor", nargs="+", type=Path, metavar="FILE", help="points of the survey (COR)")
    more.add_argument("--frame", metavar="SYSCO", help="frame of the survey, and of the block")


def inputs(arguments: argparse.Namespace) -> list[Path]:
    """The files that no output may replace."""
    single = (
        "cameras",
        "images",
        "opk",
        "micmac_measures",
        "micmac_points",
        *(form.option for form in BLOCKS),
    )
    several = ("measures", "control", "check_points", "lengths", "positions", "obs", "cor")
    found = [path for name in single if (path := getattr(arguments, name))]
    found += [file for folder in found if folder.is_dir() for file in folder.iterdir()]
    return found + [p for name in several for p in getattr(arguments, name) or ()]


def read_block(arguments: argparse.Namespace) -> tuple[BundleAdjustment, str | tuple[str, ...]]:
    """The block that the options name, and its datum: the one asked for, or that of the file."""
    _refuse_idle(arguments)
    given = [(form, path) for form in BLOCKS if (path := getattr(arguments, form.option))]
    tables = any((arguments.cameras, arguments.images, arguments.opk, arguments.measures and not given))
    if len(given) + tables > 1:
        options = [f"--{form.option}" for form, _ in given] + ["tables (--cameras ...)"] * tables
        raise InputError(f"the block is given {len(options)} times: {', '.join(options)}; give one")
    if not given and not tables:
        others = ", ".join(f"--{form.option}" for form in BLOCKS)
        raise InputError(f"say where the block is: --cameras, --images and --measures, or one of {others}")
    datum: str | tuple[str, ...] = arguments.datum or DATUMS[0]
    if given:
        form, path = given[0]
        block = _read_other(arguments, form, path)
        with noting(block.notes):
            _weigh(block, form.sigmas, arguments)
            _add_marks(block, arguments)
        if block.datum_points and not (arguments.datum or arguments.control):
            datum = block.datum_points
    else:
        block = _read_tables(arguments)
    with noting(block.notes):
        put_ground(block, arguments)
        _add_observations(block, arguments)
        if given or arguments.control_crs or arguments.positions_crs:
            _bring(block, arguments)
        if not given and arguments.opk:
            _check_convention(block, arguments)
        _hold_and_free(block, arguments, bool(given))
    return block, datum


def _refuse_idle(arguments: argparse.Namespace) -> None:
    for option, others in NEEDS.items():
        if getattr(arguments, option) is not None and not any(getattr(arguments, name) for name in others):
            names = [f"--{name.replace('_', '-')}" for name in (option, *others)]
            raise InputError(f"{names[0]} goes with {' or '.join(names[1:])}")


def _hold_and_free(block: BundleAdjustment, arguments: argparse.Namespace, is_told: bool) -> None:
    """Holds and frees parameters of cameras; a note tells where files say otherwise."""
    before = _unknown(block)
    if arguments.freeze:
        block.freeze_parameters(arguments.freeze)
    held = _unknown(block)
    if arguments.free:
        block.free_parameters(arguments.free)
    after = _unknown(block)
    if both := (before - held) & after:
        block.notes.append(f"unknown, since --free comes after --freeze: {listed(sorted(both), SHOWN)}")
    for option, names in (("--freeze", before - after), ("--free", after - before)):
        if names and is_told:
            becomes = "held" if option == "--freeze" else "unknown"
            block.notes.append(
                f"{len(names)} parameters are {becomes} by {option}: {listed(sorted(names), SHOWN)}"
            )


def _unknown(block: BundleAdjustment) -> set[str]:
    """The parameters that are unknown, with their cameras."""
    return {
        f"{parameter} of {name}"
        for name, camera in block.cameras.items()
        for parameter in camera.parameter_names
        if not block.is_frozen(name, parameter)
    }


def _bring(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    """Moves a block to what the options say of the world; a block that says it itself stays where it is."""
    from obseq.formats.blocks.placing import bring_to_control

    if arguments.control or arguments.positions or block.antennas:
        bring_to_control(block)


def _add_marks(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    """Adds marks of further points to a block of another program."""
    from obseq.formats.blocks.tables import add_measures

    for path in arguments.measures or ():
        add_measures(block, path, arguments.image_sigma, _weighting(arguments))


def _read_other(arguments: argparse.Namespace, form: BlockFormat, path: Path) -> BundleAdjustment:
    if form.sigmas is Sigmas.ASKED and arguments.image_sigma is None:
        raise InputError(
            f"--{form.option} needs --image-sigma: its files do not say how good the measures are"
        )
    return form.read(path, vars(arguments))


def _read_tables(arguments: argparse.Namespace) -> BundleAdjustment:
    from obseq.formats.blocks.tables import add_cameras, add_images, add_measures
    from obseq.formats.calibrations.reader import SUFFIXES, read_calibrations
    from obseq.images import BundleAdjustment

    needed = ("cameras", "measures") if arguments.opk else ("cameras", "images", "measures")
    missing = [name for name in needed if not getattr(arguments, name)]
    if missing:
        raise InputError(f"--{missing[0]} is missing: a block in tables takes cameras, images and measures")
    block = BundleAdjustment()
    if arguments.cameras.suffix.lower() in SUFFIXES:
        block.add_cameras(*read_calibrations(arguments.cameras))
    else:
        add_cameras(block, arguments.cameras)
    if arguments.opk:
        _add_opk(block, arguments)
    else:
        add_images(block, arguments.images)
    for path in arguments.measures:
        add_measures(block, path, arguments.image_sigma, _weighting(arguments))
    return block


def _add_opk(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    block.add_poses(_opk(arguments, arguments.opk_unit))


def _opk(arguments: argparse.Namespace, unit: str) -> Poses:
    from obseq.formats.opk.reader import read_opk

    return read_opk(arguments.opk, arguments.opk_columns, unit)


def _check_convention(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    """Refuses poses as text that are not in the declared convention, as far as control points can tell."""
    try:
        _try_convention(block, block.poses)
    except InputError as error:
        unit = _unit_that_fits(block, arguments)
        if unit:
            raise InputError(
                f"{arguments.opk}: known points are where they were measured when the angles are in {unit}, "
                f"not in {arguments.opk_unit}: give --opk-unit {unit}"
            ) from None
        raise InputError(f"{arguments.opk}: {error}") from None


def _try_convention(block: BundleAdjustment, poses: Poses) -> None:
    from obseq.formats.opk.reader import check_convention

    cameras = {image: block.cameras[name] for image, name in block.camera_of.items()}
    for part in block.sets:
        if set(part.measures.point_names) & set(block.control.names):
            check_convention(poses, part.measures, block.control, cameras)


def _unit_that_fits(block: BundleAdjustment, arguments: argparse.Namespace) -> str:
    """Another unit of the angles with which known points are where they were measured; empty for none."""
    for unit in OPK_UNITS:
        with suppress(InputError):
            _try_convention(block, _opk(arguments, unit))
            return unit
    return ""


def _weighting(arguments: argparse.Namespace) -> Weighting | None:
    from obseq.images import Weighting

    if arguments.attenuation is None and arguments.threshold is None:
        return None
    if arguments.image_sigma is None:
        raise InputError("--attenuation and --threshold go with --image-sigma: robust weights take one sigma")
    return Weighting(arguments.image_sigma, arguments.attenuation, arguments.threshold)


def _weigh(block: BundleAdjustment, sigmas: Sigmas, arguments: argparse.Namespace) -> None:
    """Gives the measures of another program the weights that the options ask for."""
    from obseq.images import Weighting

    weighting = _weighting(arguments)
    if weighting is None and arguments.image_sigma is not None and sigmas in (Sigmas.NONE, Sigmas.ALL):
        weighting = Weighting(arguments.image_sigma)
        if sigmas is Sigmas.ALL:
            block.notes.append(f"the sigmas of the files are replaced by {arguments.image_sigma:g} px")
    if weighting is not None:
        block.weigh_measures(weighting)


def _add_observations(block: BundleAdjustment, arguments: argparse.Namespace) -> None:
    from obseq.formats.blocks.observations import add_lengths, carry_antennas, observe_positions

    if arguments.lever_arm is not None and not arguments.positions:
        carry_antennas(block, carried_by(arguments))
    for path in arguments.lengths:
        add_lengths(block, path)
    for path in arguments.positions:
        observe_positions(block, path, carried_by(arguments))
    if bool(arguments.obs) != bool(arguments.cor):
        raise InputError("--obs and --cor go together: survey observations and the points they start from")
    if arguments.obs:
        from obseq.survey import Network

        block.add_survey(Network.read(arguments.obs, arguments.cor, frame=arguments.frame))
