"""Recall and accuracy of coded targets over size, tilt, blur, noise, contrast and distortion.

    python tools/benchmarks/bench_targets.py [--targets 16] [--lines base size] [--families CERN14] [--time]

Each entry: targets found of those shown, wrong names, rms of the distance to the true centre (pixels), the
same as the covariances state it, and the mean of the squared error over the stated one. Where OpenCV is
installed (pip install opencv-python-headless), its ArUco markers of the same size stand beside: corners
refined by sub-pixel, the centre where their diagonals meet. What is known of the original: centres by point
symmetry, 0.02 to 0.13 pixels off in scenes like the first line.
"""

import argparse
import importlib.util
import io
import math
import time
from typing import Any

import numpy as np
from PIL import Image

from obseq.images import Camera
from obseq.targets import Conditions, Finder, Scene, Specification, made, photograph, random_sheets
from obseq.targets.statistics import Trial, summary

FAMILIES = {
    "CERN14": ("CERN", 14),
    "IGNIndoor12": ("IGNIndoor", 12),
    "IGNDroneSym12": ("IGNDroneSym", 12),
    "IGNDroneTop10": ("IGNDroneTop", 8),
}
BASE_SCENE = {"sizes": (70.0, 70.0), "tilts": (25.0, 25.0), "contrast": (150.0, 150.0)}
LINES: list[tuple[str, dict[str, Any], dict[str, Any], float, int]] = [
    ("base", {}, {}, 0.0, 92),
    *((f"size {size:g}", {"sizes": (size, size)}, {}, 0.0, 92) for size in (16.0, 20.0, 25.0, 30.0, 45.0)),
    ("size 120", {"sizes": (120.0, 120.0)}, {}, 0.0, 92),
    *((f"tilt {tilt:g}", {"tilts": (tilt, tilt)}, {}, 0.0, 92) for tilt in (0.0, 45.0, 60.0, 70.0)),
    *((f"blur {blur:g}", {}, {"blur": blur}, 0.0, 92) for blur in (0.6, 1.5, 2.2, 3.0)),
    *((f"noise {noise:g}", {}, {"noise": noise}, 0.0, 92) for noise in (0.5, 8.0, 15.0)),
    *((f"contrast {c:g}", {"contrast": (c, c)}, {}, 0.0, 92) for c in (40.0, 25.0, 12.0)),
    ("distortion -0.15", {}, {}, -0.15, 92),
    ("motion 3", {}, {"motion": 3.0}, 0.0, 92),
    ("no JPEG", {}, {}, 0.0, 0),
    ("JPEG 50", {}, {}, 0.0, 50),
]
"""Name, scene, conditions, distortion, quality of JPEG."""


def compressed(image: Any, quality: int) -> Any:
    """The image after JPEG."""
    if not quality:
        return image
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "JPEG", quality=quality)
    return np.array(Image.open(stream))


def camera_for(spec: Specification, size: float, distortion: float) -> Camera:
    """A camera whose image has room for some targets of a size."""
    width = int(max(400, 5.2 * size * (1.6 if spec.geometry.in_rows else 2.0)))
    middle = [width / 2 - 400, width / 2 - 300]
    return Camera("bench", width, width, 1500.0, middle, distortion={"K1": distortion})


def entry(family: str, line: tuple[Any, ...], wanted: int, timed: bool) -> str:
    """The figures of one family in one line."""
    _, scene, seen, distortion, quality = line
    spec = made(*FAMILIES[family])
    finder = Finder([spec])
    camera = camera_for(spec, {**BASE_SCENE, **scene}["sizes"][0], distortion)
    trials: list[Trial] = []
    spent, seed = 0.0, 0
    while sum(len(trial.truths) for trial in trials) < wanted and seed < 5 * wanted:
        seed += 1
        left = wanted - sum(len(trial.truths) for trial in trials)
        sheets = random_sheets(camera, [spec], Scene(min(10, left), **{**BASE_SCENE, **scene}, seed=seed))
        image, truths = photograph(camera, sheets, Conditions(**seen, seed=seed))
        image = compressed(image, quality)
        start = time.process_time()
        trials.append(Trial(truths, finder.find(image)))
        spent += time.process_time() - start
    row = summary(trials)
    text = f"{row.found}/{row.visible} {row.wrong} {row.rms:.4f} ({row.stated:.4f}) {row.ratio:.2f}"
    return text + f" {1e3 * spent / max(row.visible, 1):.0f}ms" * timed


def aruco(line: tuple[Any, ...], wanted: int) -> str:
    """OpenCV's markers of the same size, contrast, blur and noise, turned at random, seen from the front."""
    import cv2

    name, scene, seen, distortion, quality = line
    if name.startswith("tilt") or distortion:
        return ""
    size = {**BASE_SCENE, **scene}["sizes"][0]
    contrast = {**BASE_SCENE, **scene}["contrast"][0]
    light = Conditions(**seen)
    words = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_6X6_250)
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(words, options)
    random, errors = np.random.default_rng(1), []
    for number in range(wanted):
        marker = cv2.aruco.generateImageMarker(words, number, 800).astype(float)
        sheet = np.pad(marker, 200, constant_values=255.0)
        scale, turn = size / 800.0, random.uniform(0.0, 2.0 * math.pi)
        side = int(2.2 * size) + 20
        centre = side / 2 + random.uniform(-1.0, 1.0, 2)
        k = (np.arange(64) + 0.5) / 64 - 0.5
        y, x = np.mgrid[0:side, 0:side]
        places = np.stack((x, y), axis=-1)[:, :, None] + np.column_stack((k, k[(np.arange(64) * 27) % 64]))
        c, s = math.cos(turn) / scale, math.sin(turn) / scale
        u = (places - centre) @ np.array([[c, -s], [s, c]]) + 599.5
        inside = ((u > 0) & (u < 1199)).all(axis=-1)
        i, j = np.clip(np.round(u).astype(int), 0, 1199).transpose(3, 0, 1, 2)
        grey = np.where(inside, 115.0 + (sheet[j, i] / 255.0 - 0.5) * contrast, light.background).mean(axis=2)
        image = cv2.GaussianBlur(grey, (0, 0), light.blur) + random.normal(0.0, light.noise, grey.shape)
        corners, names, _ = detector.detectMarkers(
            compressed(np.clip(np.round(image), 0, 255).astype(np.uint8), quality)
        )
        for corner, found in zip(corners, [] if names is None else names.ravel(), strict=False):
            if found == number:
                errors.append(meet(corner[0].astype(float)) - centre)
    rms = math.sqrt(np.mean(np.sum(np.square(errors), axis=1))) if errors else math.nan
    return f"{len(errors)}/{wanted} {rms:.4f}"


def meet(corner: Any) -> Any:
    """Where the diagonals of four corners meet."""
    a, b, c, d = corner
    share = np.linalg.solve(np.column_stack((c - a, b - d)), b - a)
    return a + share[0] * (c - a)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--targets", type=int, default=16, help="of each entry")
    parser.add_argument("--lines", nargs="+", default=[""], help="those whose names begin so")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=FAMILIES)
    parser.add_argument("--time", action="store_true", help="processor time of a target, too")
    options = parser.parse_args()
    has_opencv = importlib.util.find_spec("cv2") is not None
    for line in LINES:
        if line[0].startswith(tuple(options.lines)):
            entries = []
            for family in options.families:
                entries.append(f"{family} {entry(family, line, options.targets, options.time)}")
            entries += [f"ArUco {aruco(line, options.targets)}"] if has_opencv else []
            print(f"{line[0]:18s}", " | ".join(entries), flush=True)


if __name__ == "__main__":
    main()
