"""Project trees of MMVII that are made up, after the examples 3 and 4 of its training on surveys with images.

    python tools/make_project.py FOLDER --example 4 [--seed N] [--exposures 12] [--targets 60] [--blunders 4]
    python tools/make_project.py FOLDER --example 3 --training --blunders 0

Example 3: six fixed cameras that are calibrated, known points on the ground, and a car with ten targets whose
places in its own frame were measured. Example 4: two cameras on a bar, twelve exposures, sixty targets of
which some are surveyed, three known pillars with a total station. `truth.json` holds what was hidden. The
commands that adjust them are in docs/survey-and-images.md. With `--training`, files are called and made as
those of the training, whose commands run as they are typed there: coordinates in Lambert 93 in `inputs`,
measures as the extraction of targets leaves them.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq import crs
from obseq.crs.transformer import Transformer
from obseq.errors import ObseqError
from obseq.geometry import RigidMotion, exponential
from obseq.images import Camera, ImagePoints, Poses
from obseq.project import measures_text, read_image_measures, write_orientation
from obseq.writing import write_all

if TYPE_CHECKING:
    from obseq.arrays import FloatArray

SITE = "RTL*657700*6860700*0*IGNF:LAMB93"
TREE = "MMVII-PhgrProj"
GON = 200.0 / np.pi
PIXEL_SIGMA, POINT_SIGMA, CAR_SIGMA = 0.3, 0.001, 0.0003
"""Noise: pixels, and metres."""
ANGLE_SIGMA, LENGTH_SIGMA = 0.0005, 0.001
"""Of the total station: gon, and metres."""
BLUNDER = 40.0
"""Pixels."""


class Noise(NamedTuple):
    """Of known points, metres; of measures of targets, and of the car, pixels; what files say of these."""

    points: float = POINT_SIGMA
    targets: float = PIXEL_SIGMA
    car: float = PIXEL_SIGMA
    told: float = PIXEL_SIGMA


ORDINARY = Noise()
TRAINING = {3: Noise(1e-5, 0.02, 0.1, 0.5), 4: Noise(1e-5, 0.5, told=0.5)}
"""By example: its commands take what one adjustment has found as known in the next, without its errors."""


@dataclass(frozen=True)
class Site:
    """What a project is made of.

    Attributes:
        poses: of the images.
        cameras: by name.
        points: by name, in the frame of the site.
        rng: where noise comes from.
    """

    poses: Poses
    cameras: dict[str, Camera]
    points: dict[str, FloatArray]
    rng: np.random.Generator

    def measured(
        self, names: list[str], sigma: float, blunders: int, told: float | None = None
    ) -> ImagePoints:
        """Points in all images that see them, with noise; some are far off; `told` is the sigma of files."""
        xyz = np.array([self.points[name] for name in names])
        rows = []
        for k, (image, camera) in enumerate(zip(self.poses.images, self.poses.cameras, strict=True)):
            local = self.poses[image].to_local(xyz)
            seen = np.flatnonzero(self.cameras[camera].sees(local, margin=-20.0))
            rows += [(k, int(p), *self.cameras[camera].project(local[p : p + 1])[0]) for p in seen]
        table = np.array(rows)
        xy = table[:, 2:] + self.rng.normal(0.0, sigma, (len(table), 2))
        wrong = self.rng.choice(len(table), blunders, replace=False)
        xy[wrong] += BLUNDER * self.rng.choice([-1.0, 1.0], (blunders, 2))
        return ImagePoints.packed(self.poses.images, names, table[:, 0], table[:, 1], xy, told or sigma)

    def truth(self) -> str:
        """All that was hidden, as JSON."""
        whole = {
            "centres": dict(zip(self.poses.images, self.poses.centres.tolist(), strict=True)),
            "rotations": dict(zip(self.poses.images, self.poses.rotations.tolist(), strict=True)),
            "cameras": {name: camera.parameters.tolist() for name, camera in self.cameras.items()},
            "points": {name: list(map(float, xyz)) for name, xyz in self.points.items()},
        }
        return json.dumps(whole, indent=1) + "\n"


def looking(centres: FloatArray, goals: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) of cameras that look at goals, their lines going down."""
    z = (goals - centres) / np.linalg.norm(goals - centres, axis=1, keepdims=True)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def court(n: int, rng: np.random.Generator) -> FloatArray:
    """Targets (n, 3) on the walls and the ground of a court of 24 by 16 metres."""
    side, along, height = rng.integers(0, 5, n), rng.uniform(-1.0, 1.0, n), rng.uniform(0.3, 6.0, n)
    places = np.column_stack([12.0 * along, 8.0 * along, height])
    places[side == 0, 1], places[side == 1, 1] = 8.0, -8.0
    places[side == 2, 0], places[side == 3, 0] = 12.0, -12.0
    ground = side == 4
    places[ground] = np.column_stack([12.0 * along, rng.uniform(-8.0, 8.0, n), rng.uniform(0.0, 0.3, n)])[
        ground
    ]
    return places


def bar(exposures: int, rng: np.random.Generator) -> Poses:
    """Two cameras 0.6 m from one another, carried around the court and pointed across it."""
    angle = np.linspace(0.0, 2.0 * np.pi, exposures, endpoint=False)
    centres = np.column_stack([5.0 * np.cos(angle), 4.0 * np.sin(angle), rng.uniform(1.2, 2.4, exposures)])
    goals = np.column_stack([-9.0 * np.cos(angle), -7.0 * np.sin(angle), rng.uniform(1.5, 3.5, exposures)])
    masters = RigidMotion(centres, looking(centres, goals))
    place = RigidMotion(np.array([0.6, 0.01, -0.02]), exponential(np.array([0.01, 0.12, -0.02])))
    second = RigidMotion(masters.centre + masters.rotation @ place.centre, masters.rotation @ place.rotation)
    names = [f"{camera}_{k + 1:04d}.JPG" for camera in ("C1", "C2") for k in range(exposures)]
    owners = [f"CalibIntr_CamSONY_A6400_Add{camera}_Foc16000" for camera in ("C1", "C2") for _ in angle]
    both = (
        np.concatenate([masters.centre, second.centre]),
        np.concatenate([masters.rotation, second.rotation]),
    )
    return Poses.of(names, *both, cameras=owners)


def sights(points: dict[str, FloatArray], stations: list[str], rng: np.random.Generator) -> str:
    """OBS lines of plumb set-ups that sight everything: directions, zenith angles, distances."""
    lines = ["#VERT"]
    for number, station in enumerate(stations):
        vertical = crs.parse(SITE).vertical_rotation(points[station][None])[0]
        zero, first = rng.uniform(0.0, 2.0 * np.pi), True
        for name in sorted(set(points) - {station}):
            east, north, up = vertical @ (points[name] - points[station])
            length = float(np.linalg.norm([east, north, up]))
            hz = (np.arctan2(east, north) - zero) % (2.0 * np.pi) * GON + rng.normal(0.0, ANGLE_SIGMA)
            zen = np.arccos(up / length) * GON + rng.normal(0.0, ANGLE_SIGMA)
            code, first = (7 if first and number else 5), False
            lines.append(f"{code} {station} {name} {hz % 400.0:.6f} {ANGLE_SIGMA}")
            lines.append(f"6 {station} {name} {zen:.6f} {ANGLE_SIGMA}")
            lines.append(f"3 {station} {name} {length + rng.normal(0.0, LENGTH_SIGMA):.6f} {LENGTH_SIGMA}")
    return "\n".join(lines) + "\n"


def bar_project(
    folder: Path, exposures: int, targets: int, blunders: int, seed: int, noise: Noise = ORDINARY
) -> Site:
    """Example 4: `coord.cor`, `court.obs`, measures in images; calibrations are to be found."""
    rng = np.random.default_rng(seed)
    names = [f"{k:02d}" for k in range(targets)]
    points = dict(zip(names, court(targets, rng), strict=True))
    pillars = {"S1": [-3.0, -2.0, 1.5], "S2": [3.5, -1.0, 1.6], "S3": [0.0, 3.0, 1.4]}
    points |= {name: np.array(xyz) for name, xyz in pillars.items()}
    poses = bar(exposures, rng)
    first, second = (name for name in dict.fromkeys(poses.cameras))
    focal = 1000.0 * 16.0 / 3.9
    distortion = {"K1": -0.012, "K2": 0.01, "p1": 3e-4, "p2": -2e-4, "b1": 1e-4}
    cameras = {
        first: Camera(first, 6000, 4000, focal + 31.0, [3011.0, 1992.0], distortion=distortion),
        second: Camera(second, 6000, 4000, focal - 18.0, [2988.0, 2009.0], distortion={"K1": -0.01}),
    }
    site = Site(poses, cameras, points, rng)
    measures = site.measured(names, noise.targets, blunders, noise.told)
    known = [*pillars, *names[:6]]
    rows = [
        " ".join(["1", name, *(f"{v:.5f}" for v in points[name] + rng.normal(0.0, noise.points, 3))])
        for name in known
    ]
    rows += [" ".join(["0", name, *(f"{v:.1f}" for v in points[name])]) for name in names[6:]]
    surveyed = {name: points[name] for name in [*pillars, *names[: targets * 3 // 4]]}
    texts = {
        folder / "coord.cor": "\n".join(rows) + "\n",
        folder / "court.obs": sights(surveyed, list(pillars), rng),
        folder / "truth.json": site.truth(),
    }
    write_all({**texts, **_measure_files(folder, "Targets", measures)})
    return site


def car_project(folder: Path, targets: int, blunders: int, seed: int, noise: Noise = ORDINARY) -> Site:
    """Example 3: calibrations, `coord_gnd.cor`, `car_xyz.obs`, rough places of its targets, measures."""
    rng = np.random.default_rng(seed)
    ground = {f"G{k:02d}": p for k, p in enumerate(rng.uniform([-6, -6, -0.3], [6, 6, 2.5], (targets, 3)))}
    own = rng.uniform([-0.8, -1.9, 0.2], [0.8, 1.9, 1.5], (10, 3))
    turn, origin = exponential(np.array([0.02, -0.03, 0.7])), np.array([0.8, -0.5, 0.1])
    car = {f"{k:02d}": turn @ place + origin for k, place in enumerate(own)}
    numbers = ("22340125", "22340130", "22340138", "22340201", "22340202", "22340203")
    angle = np.linspace(0.0, 2.0 * np.pi, len(numbers), endpoint=False)
    centres = np.column_stack([9.0 * np.cos(angle), 9.0 * np.sin(angle), np.full(len(numbers), 4.0)])
    images = [f"IGN2_p-cam-{number}-1.jpg" for number in numbers]
    focals = [8 if number[-2:] in ("25", "30", "38") else 12 for number in numbers]
    owners = [
        f"CalibIntr_CamBFS-PGE-161S7M-C_Add{number[-3:]}_Foc{1000 * focal}"
        for number, focal in zip(numbers, focals, strict=True)
    ]
    cameras = {
        name: Camera(name, 5320, 3032, 1000.0 * focal / 2.74, distortion={"K1": -0.05, "K2": 0.02})
        for name, focal in zip(owners, focals, strict=True)
    }
    poses = Poses.of(images, centres, looking(centres, np.zeros((len(images), 3))), cameras=owners)
    site = Site(poses, cameras, ground | car | {"car": origin}, rng)
    rows = [
        " ".join([name, *(f"{v:.5f}" for v in xyz + rng.normal(0.0, noise.points, 3))])
        for name, xyz in ground.items()
    ]
    local = own + rng.normal(0.0, CAR_SIGMA, own.shape)
    lines = ["#BASC"] + [
        f"{14 + axis} car {name} {local[k, axis]:.5f} {CAR_SIGMA}"
        for k, name in enumerate(car)
        for axis in range(3)
    ]
    near = [" ".join([name, *(f"{v:.1f}" for v in xyz)]) for name, xyz in (car | {"car": origin}).items()]
    write_all(
        {
            folder / "coord_gnd.cor": "\n".join(rows) + "\n",
            folder / "car_xyz.obs": "\n".join(lines) + "\n",
            folder / "coord_approx_car.cor": "\n".join(near) + "\n",
            folder / "truth.json": site.truth(),
            **_measure_files(folder, "Gnd", site.measured(list(ground), noise.targets, blunders, noise.told)),
            **_measure_files(folder, "Car", site.measured(list(car), noise.car, 0)),
        }
    )
    write_orientation(folder / TREE / "Ori/Calib", poses.select([]), cameras)
    return site


def training_project(
    folder: Path, example: int, exposures: int, targets: int, blunders: int, seed: int
) -> Site:
    """Example 3 or 4 as the commands of the training take it: its files, its sigmas; `truth.json` is ours."""
    if example == 4:
        site = bar_project(folder, exposures, targets, blunders, seed, TRAINING[4])
    else:
        site = car_project(folder, targets, blunders, seed, TRAINING[3])
    _rename_as_in_the_training(folder, site, example)
    return site


def _rename_as_in_the_training(folder: Path, site: Site, example: int) -> None:
    inputs, measures = folder / "inputs", folder / TREE / "ObjMesInstr"
    tables = ("coord.cor",) if example == 4 else ("coord_gnd.cor", "coord_approx_car.cor")
    texts = {inputs / name: _in_lambert((folder / name).read_text("utf-8")) for name in tables}
    if example == 4:
        texts[inputs / "polygone.obs"] = (folder / "court.obs").read_text("utf-8")
        targets = read_image_measures(measures / "Targets")
        for k, name in enumerate(("TargetsC", "TargetsI")):  # two kinds: every other target
            kind = targets.of_points(sorted(targets.point_names)[k::2])
            texts |= _measure_files(folder, name, kind)
        shutil.rmtree(measures / "Targets")
    write_all(texts)
    if example == 3:
        (folder / "car_xyz.obs").rename(inputs / "car_xyz.obs")
        (measures / "Gnd").rename(inputs / "gnd_img_V2")
        (measures / "Car").rename(measures / "Targets")
        (folder / TREE / "Ori/Calib").rename(inputs / "calibsV2")
        (inputs / "calibsV2/CurSysCo.xml").unlink(missing_ok=True)
    for name in (*tables, "court.obs"):
        (folder / name).unlink(missing_ok=True)
    for image in site.poses.images:
        (folder / image).touch()


def _in_lambert(table: str) -> str:
    """The lines of a COR file of the site in Lambert 93; a field is put before names that have none."""
    rows = [line.split() for line in table.splitlines()]
    places = np.array([row[-3:] for row in rows], float)
    there = Transformer(crs.parse(SITE), crs.parse("IGNF:LAMB93")).forward(places, [row[-4] for row in rows])
    heads = [" ".join(row[:-3]) if len(row) > 4 else f"1 {row[0]}" for row in rows]
    lines = [
        " ".join([head, *(f"{v:.5f}" for v in xyz)])
        for head, xyz in zip(heads, np.asarray(there), strict=True)
    ]
    return "\n".join(lines) + "\n"


def _measure_files(folder: Path, name: str, measures: ImagePoints) -> dict[Path, str]:
    place = folder / TREE / "ObjMesInstr" / name
    return {place / f"MesIm-{image}.xml": measures_text(image, measures) for image in measures.image_names}


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where the project is written")
    parser.add_argument("--example", type=int, choices=(3, 4), required=True)
    parser.add_argument("--exposures", type=int, default=12, help="of example 4 (%(default)s)")
    parser.add_argument("--targets", type=int, default=60, help="(%(default)s)")
    parser.add_argument("--blunders", type=int, default=4, help="image measures 40 px off (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--training", action="store_true", help="files as those of the training")
    return parser.parse_args()


def main() -> int:
    """Write a project; 2 when it cannot be written."""
    options = arguments()
    common = {"targets": options.targets, "blunders": options.blunders, "seed": options.seed}
    try:
        if options.training:
            training_project(options.folder, options.example, options.exposures, **common)
        elif options.example == 4:
            bar_project(options.folder, options.exposures, **common)
        else:
            car_project(options.folder, **common)
    except ObseqError as error:
        sys.stderr.write(f"make_project: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
