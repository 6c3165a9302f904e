"""`obseq epipolar`: whether two orientations agree, from the tie points of two images."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number
from obseq.cli.progress import Progress
from obseq.errors import InputError
from obseq.printable import printable
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.epipolar import Fit, OrientedCamera

CHECK_FAILED = 1
"""Exit code: residuals are larger than expected, or of some points, or points have none."""
HIGHEST, SHOWN = 5, 5

MORE = """
Says whether the orientations agree: residuals against what the measures of the points announce
(--tie-sigma), and whether they show a pattern. Then percentiles of the signed residual of each
point across its epipolar line (pixels of the first image, half the distance to the line), before
and after polynomials are fitted to the field. The orientation is a folder Ori of MMVII or of
MicMac v1; the ties are a folder (TieP of MMVII, Homol of MicMac v1) or a file of lines
'x1 y1 x2 y2'."""

EXAMPLE = """\
example:
  obseq epipolar im1.tif im2.tif --orientation MMVII-PhgrProj/Ori/BA --ties MMVII-PhgrProj/TieP/All --out
  check

exit code: 0 done; 1 done, and residuals are larger than expected, points are far beyond the others
(mismatches, which are named), or points without residual were left out; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "check two orientations with tie points: epipolar residuals and their field"
    command = add_command(commands, "epipolar", run, purpose, MORE, EXAMPLE)
    command.add_argument(
        "first", metavar="IMAGE1", help="name of the first image, where residuals are counted"
    )
    command.add_argument("second", metavar="IMAGE2", help="name of the second image")
    command.add_argument("--orientation", type=Path, required=True, metavar="DIR", help="poses and cameras")
    command.add_argument("--ties", type=Path, required=True, metavar="DIR|FILE", help="tie points")
    command.add_argument(
        "--degree",
        type=positive_integer,
        default=HIGHEST,
        metavar="N",
        help="polynomials of degrees 0 to N in x and y are fitted to the residuals over the image, to show "
        f"whether these follow a pattern; 1 to {HIGHEST} ({HIGHEST}). Percentiles are printed of what "
        "degrees 0 to N - 1 leave; --out has maps of all",
    )
    command.add_argument(
        "--tie-sigma",
        type=positive_number,
        default=0.5,
        metavar="PX",
        help="standard deviation of a measured coordinate of a tie point, pixels (0.5)",
    )
    command.add_argument(
        "--image",
        type=Path,
        metavar="FILE",
        help="the first image itself, shown under the cloud (needs the extra raster)",
    )
    command.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write residuals.csv, percentiles.txt, residuals.html and clouds (PLY) there",
    )


def run(arguments: argparse.Namespace) -> int:
    """Compute, print percentiles, write files; 1 when points were left out."""
    if arguments.degree > HIGHEST:
        raise InputError(f"--degree {arguments.degree}: the highest degree is {HIGHEST}")
    names = ["residuals.csv", "percentiles.txt", "residuals.html", "residuals.ply"]
    names += [f"fit-degree-{degree}.ply" for degree in range(arguments.degree + 1)]
    outputs = [arguments.out / name for name in names] if arguments.out else []
    check_writable(outputs)
    with Progress("computing"):
        report = _Report(arguments)
        write_all(dict(zip(outputs, report.files(), strict=True)) if outputs else {})
    print(printable("\n".join([*report.said, "", report.text])), end="")
    sound = report.verdict.is_good and not report.verdict.gross and not report.lost.size
    return 0 if sound else CHECK_FAILED


class _Report:
    """What is found of one pair of images."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        import numpy as np

        from obseq.images.epipolar import epipolar_residuals, fit_field, judged, percentile_text

        self.title = f"Epipolar residuals of {arguments.first} with {arguments.second}"
        self.camera = _camera(arguments.orientation, arguments.first)
        pairs = _ties(arguments)
        if not len(pairs):
            raise InputError(
                f"{arguments.ties}: holds no tie points of {arguments.first} and {arguments.second}"
            )
        found = epipolar_residuals(
            self.camera, pairs[:, :2], _camera(arguments.orientation, arguments.second), pairs[:, 2:]
        )
        seen = np.isfinite(found.values)
        if not seen.any():
            raise InputError("no point has a residual: do the images and the orientation belong together?")
        self.rows, self.lost, self.given = np.flatnonzero(seen), np.flatnonzero(~seen), pairs
        self.pairs, self.values = pairs[seen], found.values[seen]
        self.directions = found.directions[seen]
        self.grey = _brightness(arguments.image, self.size) if arguments.image else None
        self.fits: list[Fit] = fit_field(self.pixels, self.values, arguments.degree)
        self.text = percentile_text(self.values, self.pixels, self.fits)
        self.verdict = judged(self.values, self.pixels, self.fits, arguments.tie_sigma)

    @property
    def pixels(self) -> "FloatArray":
        return self.pairs[:, :2]

    @property
    def size(self) -> tuple[int, int]:
        camera = self.camera.camera
        if camera.width:
            return camera.width, camera.height
        width, height = self.pixels.max(axis=0)
        return int(width) + 1, int(height) + 1

    @property
    def said(self) -> list[str]:
        """The verdict, the points that are far beyond the others, and those that have no residual."""
        gross = list(self.verdict.gross)
        lines = self.verdict.sentences().splitlines()
        lines += [
            f"  {self._pair(int(self.rows[row]))}: residual {self.values[row]:+.3g} px"
            for row in gross[:SHOWN]
        ]
        if len(gross) > SHOWN:
            lines.append(f"  and {len(gross) - SHOWN} more")
        if self.lost.size:
            why = "at the epipole, behind a camera, or where the distortion has no inverse"
            lines.append(f"{self.lost.size} of {len(self.given)} points have no residual: {why}")
            lines += [f"  {self._pair(int(row))}" for row in self.lost[:SHOWN]]
        if self.lost.size > SHOWN:
            lines.append(f"  and {self.lost.size - SHOWN} more")
        return lines

    def _pair(self, row: int) -> str:
        """A pair of points, by its number in the file and its pixels."""
        x1, y1, x2, y2 = self.given[row].tolist()
        return f"pair {row + 1}, ({x1:.2f}, {y1:.2f}) with ({x2:.2f}, {y2:.2f})"

    def files(self) -> list[str | bytes]:
        """The contents of the files, in the order of their names."""
        from obseq.images.epipolar import fit_cloud, residual_cloud, residual_page

        return [
            self._table(),
            self.text,
            residual_page(self.title, self.pixels, self.values, self.size, self.fits[-1], self.said),
            residual_cloud(self.pixels, self.values, self.size, self.grey),
            *(fit_cloud(self.pixels, fit) for fit in self.fits),
        ]

    def _table(self) -> str:
        rows = ["x1,y1,x2,y2,residual,direction_x,direction_y,weight\n"]
        weights = self.fits[-1].weights
        for pair, value, way, weight in zip(self.pairs, self.values, self.directions, weights, strict=True):
            rows.append(",".join(f"{float(part):.6f}" for part in (*pair, value, *way, weight)) + "\n")
        return "".join(rows)


def _ties(arguments: argparse.Namespace) -> "FloatArray":
    from obseq.project import find_pairs, read_pairs

    if arguments.ties.is_dir():
        return find_pairs(arguments.ties, arguments.first, arguments.second)
    return read_pairs(arguments.ties)


def _camera(folder: Path, image: str) -> "OrientedCamera":
    """The camera of an image, from a folder of MMVII or of MicMac v1."""
    from obseq.images.epipolar import OrientedCamera
    from obseq.project import read_orientation, read_v1_orientation

    old = folder / f"Orientation-{image}.xml"
    if old.is_file():
        pose, camera = read_v1_orientation(old)
        return OrientedCamera(camera, pose)
    poses, cameras = read_orientation(folder, [image])
    name = poses.cameras[0]
    if not name:
        raise InputError(f"{folder}: the pose of {image} names no calibration")
    return OrientedCamera(cameras[name], poses[image])


def _brightness(path: Path, size: tuple[int, int]) -> "FloatArray":
    """The reduced brightness of an image, 0 to 255.

    Raises:
        InputError: rasterio is not installed, the file is no image, or of another size than the camera's.
    """
    try:
        import rasterio
    except ImportError:
        raise InputError(f"{path}: images are read with rasterio: pip install obseq[raster]") from None
    from obseq.images.epipolar import reduced

    try:
        with rasterio.open(path) as raster:
            values = raster.read(1).astype("float64")
    except rasterio.errors.RasterioError as error:
        raise InputError(f"{path}: is no image that can be read: {error}") from None
    if values.shape != size[::-1]:
        width, height = values.shape[::-1]
        raise InputError(f"{path}: is {width} x {height} pixels, its camera says {size[0]} x {size[1]}")
    return reduced(values * (255.0 / max(float(values.max()), 255.0)))
