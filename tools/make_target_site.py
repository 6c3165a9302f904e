"""A small site of coded targets with photographs of it, as example 4 of MMVII's training begins.

    python tools/make_target_site.py FOLDER [--exposures 6] [--picture docs/pictures/target-site.jpg]

Two walls with ring targets and chequered targets, photographed by two cameras on a bar; three pillars, from
which a total station measured to the targets. `inputs` holds what the commands read: specifications of the
targets, coordinates in Lambert 93, survey observations. The commands are in docs/targets-survey.md.
`truth.json` holds what was hidden.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from obseq import crs
from obseq.crs.transformer import Transformer
from obseq.geometry import RigidMotion, exponential
from obseq.images import Camera, Poses
from obseq.targets import (
    Conditions,
    Finder,
    Sheet,
    Specification,
    made,
    overlay,
    photograph,
    read_picture,
    read_specification,
    specification_text,
)
from obseq.writing import write_all

SITE = "RTL*657700*6860700*0*IGNF:LAMB93"
GON = 200.0 / np.pi
ANGLE_SIGMA, LENGTH_SIGMA, POINT_SIGMA = 0.0005, 0.0002, 0.0002
"""Of the total station: gon, metres; of the pillars: metres."""
COLUMNS, LINES = 9, 4
APART = 0.7
"""Metres between targets."""
UNITS = {"CERN": 0.055, "IGNIndoor": 0.1}
"""Metres: radii of the discs."""
SIZE = (1200, 800)
"""Of the photographs: a fifth of those of the training's camera. Its 16 mm are 820 pixels here."""
PILLARS = {"S1": [0.5, -4.5, 0.3], "S2": [3.0, -5.5, 0.5], "S3": [5.2, -4.6, 0.2]}
QUALITY, PICTURE_QUALITY = 93, 60


def sheets() -> list[Sheet]:
    """The targets on the walls: every third is chequered; the right wall stands behind the left one."""
    specs = [made("CERN"), made("CERN"), made("IGNIndoor")]
    used: dict[str, int] = {}
    found = []
    for k in range(COLUMNS * LINES):
        column, line = divmod(k, LINES)
        spec = specs[(column + line) % 3]
        number = used[spec.family] = used.get(spec.family, -3) + 5
        name = list(spec.codes)[number % len(spec.codes)]
        away = 0.0 if column < COLUMNS // 2 else 0.8
        unit = UNITS[spec.family]
        place = np.array([APART * column, away + 0.15 * (line % 2), APART * line])
        found.append(Sheet(spec, name, place, np.array([unit, 0.0, 0.0]), np.array([0.0, 0.0, -unit])))
    return found


def rig(exposures: int) -> tuple[Poses, dict[str, Camera]]:
    """Where the two cameras are."""
    level = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    places = RigidMotion(np.array([0.5, 0.02, -0.01]), exponential(np.array([0.01, -0.05, -0.02])))
    names, centres, rotations = [], [], []
    for k in range(exposures):
        share = k / max(exposures - 1, 1)
        turn = exponential(np.array([0.1 * (-1) ** k, 0.0, 0.5 * (0.5 - share)]))
        roll = exponential(np.array([0.0, 0.0, (k % 3) * np.pi / 2]))
        master = RigidMotion(
            np.array([0.6 + 3.9 * share, -4.2 - 0.6 * (k % 2), 0.7 + 0.6 * (k % 2)]), turn @ level @ roll
        )
        for camera, pose in (("C1", master), ("C2", master @ places)):
            names.append(f"{camera}_{k + 1:04d}.JPG")
            centres.append(pose.centre)
            rotations.append(pose.rotation)
    width, height = SIZE
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    cameras = {
        "C1": Camera("C1", width, height, 826.0, middle + np.array([4.0, -3.0]), distortion={"K1": -0.04}),
        "C2": Camera("C2", width, height, 815.0, middle + np.array([-5.0, 2.0]), distortion={"K1": -0.03}),
    }
    return Poses.of(names, centres, rotations, cameras=[name[:2] for name in names]), cameras


def sights(points: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """OBS lines of the pillars: directions, zenith angles and distances to everything."""
    lines = ["#VERT"]
    for station, place in PILLARS.items():
        zero, code = rng.uniform(0.0, 400.0), 7
        for name in sorted(set(points) - {station}):
            east, north, up = points[name] - np.array(place)
            length = float(np.hypot(np.hypot(east, north), up))
            hz = (np.arctan2(east, north) * GON - zero + rng.normal(0.0, ANGLE_SIGMA)) % 400.0
            zenith = np.arccos(up / length) * GON + rng.normal(0.0, ANGLE_SIGMA)
            lines.append(f"{code if station != 'S1' else 5} {station} {name} {hz:.6f} {ANGLE_SIGMA}")
            lines.append(f"6 {station} {name} {zenith:.6f} {ANGLE_SIGMA}")
            lines.append(f"3 {station} {name} {length + rng.normal(0.0, LENGTH_SIGMA):.6f} {LENGTH_SIGMA}")
            code = 5
    return "\n".join(lines) + "\n"


def coordinates(points: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """COR lines in Lambert 93: pillars are known, targets roughly."""
    rough = [
        xyz + rng.normal(0.0, POINT_SIGMA / 100 if name in PILLARS else 0.05, 3)
        for name, xyz in points.items()
    ]
    there = Transformer(crs.parse(SITE), crs.parse("IGNF:LAMB93")).forward(np.array(rough), list(points))
    return "".join(
        f"{int(name in PILLARS)} {name} {x:.5f} {y:.5f} {z:.5f}\n"
        for name, (x, y, z) in zip(points, np.asarray(there), strict=True)
    )


def make_site(folder: Path, exposures: int = 6, seed: int = 0) -> None:
    """Write the site, with photographs."""
    rng = np.random.default_rng(seed)
    targets = sheets()
    poses, cameras = rig(exposures)
    points = {name: np.array(place) for name, place in PILLARS.items()}
    points |= {one.name: one.centre for one in targets}
    specs: dict[str, Specification] = {one.spec.family: one.spec for one in targets}
    inputs = folder / "inputs"
    write_all(
        {
            **{inputs / f"{s.prefix}_FullSpecif.xml": specification_text(s) for s in specs.values()},
            inputs / "coord.cor": coordinates(points, rng),
            inputs / "polygone.obs": sights(points, rng),
            folder / "truth.json": json.dumps(
                {
                    "points": {name: xyz.tolist() for name, xyz in points.items()},
                    "centres": dict(zip(poses.images, poses.centres.tolist(), strict=True)),
                }
            ),
        }
    )
    for number, (image, owner) in enumerate(zip(poses.images, poses.cameras, strict=True)):
        camera, pose = cameras[owner], poses[image]
        seen = [one for one in targets if camera.sees(pose.to_local(one.centre[None]), -60.0)[0]]
        grey, _ = photograph(camera, seen, Conditions(noise=2.5, seed=seed + number), pose)
        Image.fromarray(grey).save(folder / image, quality=QUALITY)


def draw_picture(folder: Path, out: Path) -> None:
    """A photograph of the site with what is found there."""
    specs = [read_specification(path) for path in sorted((folder / "inputs").glob("*_FullSpecif.xml"))]
    grey = read_picture(folder / "C1_0003.JPG").grey
    Image.fromarray(overlay(grey, Finder(specs).find(grey))).save(out, quality=PICTURE_QUALITY)


def main() -> int:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where the site is written")
    parser.add_argument("--exposures", type=int, default=6, help="of both cameras (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path, help="a photograph with its targets, for the page")
    options = parser.parse_args()
    make_site(options.folder, options.exposures, options.seed)
    if options.picture:
        draw_picture(options.folder, options.picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
