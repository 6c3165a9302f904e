"""The cases of Borea's data: worksites as its tests make them, and comparison with stated tolerances."""

import json
from functools import cache
from pathlib import Path

import numpy as np

from obseq.images.aerial import (
    FrameCamera,
    Geoid,
    HeightType,
    MapSystem,
    Worksite,
    read_camera,
    read_shots,
    read_terrain,
)

FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data" / "borea"
TYPES = {"altitude": HeightType.ALTITUDE, "height": HeightType.HEIGHT, None: None}


def cases(kind):
    """The cases of a kind; none where the data are absent (the first test of the module says so)."""
    if not FOLDER.is_dir():
        return []
    listed = json.loads((FOLDER / "expected.json").read_text())["cases"]
    return [case for case in listed if case["kind"] == kind]


def identify(case):
    return case["id"]


@cache
def lambert93():
    return MapSystem(2154)


@cache
def geoid():
    return Geoid(FOLDER / "fr_ign_RAF20.tif")


@cache
def terrain():
    return read_terrain(FOLDER / "dtm_synth_height.asc", HeightType.HEIGHT)


@cache
def cameras():
    found = [read_camera(FOLDER / name) for name in ("Camera1.txt", "Camera2.txt")]
    return {camera.name: camera for camera in found}


@cache
def worksite(name="23FD1305_alt_test.OPK"):
    """The shots of a file, with the ground under them."""
    shots, _ = read_shots(FOLDER / name, interval=(2, None))
    return Worksite(shots, cameras(), lambert93(), geoid()).with_nadir(terrain())


def camera_of(inputs):
    given = inputs["camera"]
    return FrameCamera(
        "camera", (given["ppax"], given["ppay"]), given["focal"], (given["width"], given["height"])
    )


def check(case, **found):
    """Compare numbers with those of the case, each to its own tolerance."""
    tolerances = case["tol"]
    for key, value in found.items():
        tolerance = tolerances.get(key, tolerances.get("*"))
        assert tolerance is not None, f"{case['id']}: {key} has no tolerance"
        np.testing.assert_allclose(
            value, case["expected"][key], rtol=0.0, atol=max(tolerance, 1e-9), err_msg=f"{case['id']} {key}"
        )
