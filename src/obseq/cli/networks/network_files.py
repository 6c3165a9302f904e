"""The files of a survey network on the command line: options, and what they say to read."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from obseq.cli.own_formulas import use_formulas
from obseq.cli.parsing import finite_number, positive_number
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.catalogue import Role, format_of, listing
from obseq.writing import check_writable

if TYPE_CHECKING:
    from obseq.survey import Network

Options: TypeAlias = dict[str, Any]
"""Arguments of a reader, by name."""


COMMON = (
    *("help", "help_all", "project", "points_crs", "frame", "point_sigma", "instrument"),
    *("out", "units", "quiet", "verbose", "show"),
)
"""Arguments of commands on networks that most users need."""

IGNORABLE = ("heights", "relative-sigmas", "deflections", "after-sigma", "frames", "reductions")


@dataclass(frozen=True)
class Source:
    """The files of a network, and how they are read.

    Attributes:
        observations: OBS files.
        points: COR files.
        reading: Keyword arguments of `Network.read`, or of `Network.read_project`.
        project: Files of another program, to read instead of observations and points.
    """

    observations: Sequence[Path]
    points: Sequence[Path]
    reading: Options
    project: Sequence[Path] = ()

    @property
    def files(self) -> list[Path]:
        """The files that no output may replace."""
        return [*self.observations, *self.points, *self.project]

    def read(self, outputs: Sequence[Path] = ()) -> "Network":
        """The network; outputs that would replace a file it was read from, included ones too, are refused."""
        from obseq.survey import Network

        if self.project:
            network = Network.read_project(self.project, **self.reading)
        else:
            network = Network.read(self.observations, self.points, **self.reading)
        check_writable(outputs, map(Path, (*network.book.files, *network.points.files)))
        return network


def add_network_arguments(command: argparse.ArgumentParser) -> None:
    """Add the files of a network, its systems, and how they are read."""
    _add_files(command)
    _add_systems(command)
    _add_reading(command)


def _add_files(command: argparse.ArgumentParser) -> None:
    files = command.add_argument_group("files")
    files.add_argument(
        "project",
        nargs="*",
        type=Path,
        metavar="PROJECT",
        help=f"files of a network, of any of these formats: {listing()}",
    )
    files.add_argument("--obs", nargs="+", type=Path, metavar="FILE", help="observation files (OBS)")
    files.add_argument(
        "--cor", nargs="+", type=Path, metavar="FILE", help="point files (COR), or tables of points (.csv)"
    )
    files.add_argument(
        "--outside", action="store_true", help="let a project read files outside of its own folder"
    )
    files.add_argument(
        "--geoid",
        type=Path,
        metavar="FILE",
        help="deflections of the vertical; for DynAdjust files geoid heights too",
    )
    files.add_argument(
        "--formulas",
        nargs="+",
        type=Path,
        metavar="FILE.py",
        help="formulas of your own, which tables of observations name; these files are run, so trust them",
    )
    files.add_argument("--encoding", metavar="NAME", help="encoding of point names, such as latin-1 (UTF-8)")
    files.add_argument(
        "--point-format",
        metavar="FIELDS",
        help="the point files are not COR files: the fields of their lines as in MMVII's ImportGCP, for "
        "instance ANXYZ (additional information, name, x, y, z)",
    )
    files.add_argument(
        "--free",
        metavar="PATTERN",
        help="with --point-format: points whose field A matches this expression as a whole are free",
    )
    files.add_argument(
        "--comment", metavar="C", help="with --point-format: what begins a comment (without it: #)"
    )


def _add_systems(command: argparse.ArgumentParser) -> None:
    systems = command.add_argument_group("coordinate systems")
    systems.add_argument(
        "--frame",
        metavar="SYSCO",
        help="system of the computation, for instance RTL*E*N*h*IGNF:LAMB93: axes along east, north and up "
        "at that origin; RTL alone takes the mean of the points as origin (without --frame: that at the mean "
        "of the known points; without --points-crs either: a plane with heights)",
    )
    systems.add_argument(
        "--points-crs",
        metavar="SYSCO",
        help="system of the coordinates in the point files (without it: the frame). In one of the plan, such "
        "as EPSG:2056, heights are levelled, above its own ellipsoid; EPSG:2056@h takes them above that of "
        "WGS 84",
    )


def _add_reading(command: argparse.ArgumentParser) -> None:
    computation = command.add_argument_group("reading")
    computation.add_argument(
        "--point-sigma",
        type=positive_number,
        metavar="S",
        help="sigma in metres of the known points whose line gives none (without it, they are an error)",
    )
    computation.add_argument(
        "--refraction",
        type=finite_number,
        metavar="K",
        help="refraction coefficient of zenith angles, -1 to 1 (without it: 0.12; 0: no refraction; 1: "
        "neither refraction nor curvature)",
    )
    computation.add_argument(
        "--sigmas",
        nargs="+",
        metavar="NAME=VALUE",
        help="standard deviations of observations whose file has none (STAR*NET, LandXML), with their units: "
        "distance=2mm distance-ppm=2ppm direction=3sec angle=3sec azimuth=10sec zenith=5sec height=1mm "
        "height-per-km=1mm height-per-turn=0.2mm instrument-centring=1mm target-centring=1mm "
        "vertical-centring=1mm (sec, arcsec, cc, mgon, gon, deg, rad; mm, cm, m, ft, us-ft)",
    )
    computation.add_argument(
        "--faces",
        choices=("mean", "all"),
        help="of sights in both faces of the telescope: adjust the means (mean), or all readings (all)",
    )
    computation.add_argument(
        "--stochastic",
        type=Path,
        metavar="FILE",
        help="what observations of each instrument are worth (TOML), in place of the sigmas of the files: "
        "distance = '2mm + 2ppm', instrument-centring = '1mm', ...; [instrument.NAME] for one of its own",
    )
    computation.add_argument(
        "--instrument",
        metavar="NAME",
        help="what all observations are worth: an instrument of --stochastic, or of the library: "
        "total-station-1sec (0.5sec to 7sec), digital-level, leica-ts60, ...; a wrong name lists them",
    )
    computation.add_argument(
        "--ignore",
        nargs="+",
        choices=IGNORABLE,
        metavar="WHAT",
        help="leave out of the files, with a warning: " + ", ".join(IGNORABLE),
    )


def source_of(arguments: argparse.Namespace) -> Source:
    """The files that the command line names.

    Raises:
        InputError: no files are named, or a project with what it says itself.
    """
    use_formulas(arguments.formulas or ())
    reading = given(
        {
            "encoding": arguments.encoding,
            "frame": arguments.frame,
            "points_crs": arguments.points_crs,
            "point_sigma": arguments.point_sigma,
            "refraction": arguments.refraction,
            "ignore": arguments.ignore,
            "sigmas": arguments.sigmas,
            "stochastic": arguments.stochastic,
            "instrument": arguments.instrument,
            "faces": arguments.faces,
            **_point_format(arguments),
        }
    )
    obs, cor, project = _by_role(arguments)
    if project:
        return Source([], [], _project_options(arguments, reading, obs, cor), project)
    if not obs:
        raise InputError(
            "What to adjust? Files of observations and of points (obseq adjust site.obs site.cor; --obs and "
            "--cor say which is which), or a project (obseq adjust site.comp)."
        )
    if arguments.geoid is not None:
        reading["geoid"] = arguments.geoid
    if "sigmas" in reading:
        raise InputError("--sigmas goes with a project: the lines of OBS files have their own")
    return Source(obs, cor, reading)


def _by_role(arguments: argparse.Namespace) -> tuple[list[Path], list[Path], list[Path]]:
    """Files of observations, of points, and of networks: as the options say, or the files themselves."""
    obs, cor = list(arguments.obs or ()), list(arguments.cor or ())
    roles = {path: format_of(path).role for path in arguments.project}
    obs += [path for path, role in roles.items() if role is Role.OBSERVATIONS]
    cor += [path for path, role in roles.items() if role is Role.POINTS]
    networks, tables = (
        [path for path, role in roles.items() if role is wanted] for wanted in (Role.NETWORK, Role.TABLE)
    )
    if obs or networks:  # tables beside observations are of points
        return obs, cor + tables, networks
    return obs, cor, tables


def given(options: Options) -> Options:
    """The options that were given: the others keep the defaults of what they are passed to."""
    return {name: value for name, value in options.items() if value is not None}


def _project_options(
    arguments: argparse.Namespace, reading: Options, obs: Sequence[Path], cor: Sequence[Path]
) -> Options:
    """What may be said about a project besides its name."""
    accepted = {"frame", "points_crs", "refraction", "encoding", "ignore", "sigmas", "stochastic"}
    accepted |= {"instrument", "faces"}
    if cor:
        accepted.add("point_sigma")
    surplus = sorted(set(reading) - accepted) + ["obs"] * bool(obs)
    if surplus:
        listed = ", ".join("--" + name.replace("_", "-") for name in surplus)
        raise InputError(
            f"{arguments.project[0]}: a project says itself what {listed} would say; leave it out"
        )
    more = {"outside": arguments.outside, "geoid": arguments.geoid, "point_files": list(cor) or None}
    return reading | given(more)


def _point_format(arguments: argparse.Namespace) -> Options:
    """How points are read when they are not in COR files."""
    options = given({"free_pattern": arguments.free, "comment": arguments.comment})
    if arguments.point_format is None:
        if options:
            raise InputError("--free and --comment go with --point-format, which says what the lines hold")
        return {}
    from obseq.survey import PointFileOptions

    return {"point_format": arguments.point_format, "point_options": PointFileOptions(**options)}
