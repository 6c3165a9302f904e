"""What all images share of a camera, and is wrong: parameters that are held, a focal length that is far off.

It is tried before single observations are accused: a few unknowns more, with which the whole block fits.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.adjustment.trials import LOUD, is_rejected, squares, variance

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Attempts, Trials
    from obseq.images.camera import Camera

FOCAL, POINT, DISTORTION = "F", "PP.", "K."
"""Patterns of parameters of cameras."""
CALLED = {FOCAL: "focal length", POINT: "principal point", DISTORTION: "distortion"}
"""What is freed first, and what beside it, and what they are called."""
OFF = 0.03
"""Share of itself by which a focal length is off, at least, that keeps images from being placed."""
FACTORS = (2.0, 0.5, 1.4, 0.7)
"""Times as long as it was given a focal length may be: each covers those about it."""


def held_parameters(trials: Trials, most: int = 3) -> str:
    """Held parameters of cameras with which as unknowns a block is accepted, in words; empty where none are.

    Args:
        trials: of the block.
        most: 1 for the focal length alone, 2 with the principal point, 3 with the distortion.
    """
    said_of = (FOCAL, _focal_length), (POINT, _principal_point), (DISTORTION, _distortion)
    for parameters, said in said_of[:most]:
        found = _freed(trials, parameters)
        if found is not None and not is_rejected(found) and trials.gains(found) > LOUD**2:
            return f"{said(found)}: {trials.becomes(found)}"
    return ""


def interior(trials: Trials) -> str:
    """A focal length, or a principal point, that explains most of what a bad block leaves, in words."""
    found = _freed(trials, FOCAL)
    if found is not None:
        return f"{_focal_length(found)}: {trials.becomes(found)}"
    found = _freed(trials, POINT)
    return "" if found is None else f"{_principal_point(found)}: {trials.becomes(found)}"


def _freed(trials: Trials, parameters: str) -> BundleSolution | None:
    """A block that fits with parameters and those before them as unknowns; None where they were so before."""
    if not _are_held(trials.block, parameters):
        return None

    def fitting() -> BundleSolution | None:
        made, order = trials.copy(), list(CALLED)
        made.free_parameters("|".join(order[: order.index(parameters) + 1]))
        return trials.fitting(made, f"another {CALLED[parameters]}")

    return trials.once(parameters, fitting)


def _are_held(block: AdjustableBlock, parameters: str) -> bool:
    """Whether a parameter that a pattern matches keeps its value in a camera that has images."""
    pattern = re.compile(parameters)
    return any(
        pattern.fullmatch(name) and block.is_frozen(camera, name)
        for camera in set(block.camera_of.values())
        for name in block.cameras[camera].parameter_names
    )


def other_focal(attempts: Attempts, factors: Iterable[float] = FACTORS) -> BundleSolution | None:
    """A block that fits with focal lengths that are far from those given; None where it does not.

    Args:
        attempts: of a block whose images have no place.
        factors: times as long as they were given, from which they are found.
    """
    for factor in factors:
        made = attempts.copy()
        made.cameras = {name: replace(c, focal=factor * c.focal) for name, c in made.cameras.items()}
        made.free_parameters(FOCAL)
        found = attempts.fitting(made, f"focal lengths times {factor:.3g}")
        if found is not None and focal_change(attempts, found) > OFF:
            return found
    return None


def focal_change(attempts: Attempts, found: BundleSolution) -> float:
    """Share of itself by which a focal length has changed from what was given, at most."""
    given = attempts.block.cameras
    return max(_off(camera, given[name]) for name, camera in found.cameras.items())


def as_whole(attempts: Attempts, without: BundleSolution) -> BundleSolution | None:
    """The whole block, from the solution without some of it, where it fits as well; None where not."""
    made = attempts.copy()
    made.poses, made.cameras = without.poses, {**made.cameras, **without.cameras}
    found = attempts.fitting(made, "the whole block from there")
    agrees = found is not None and squares(found) - squares(without) < LOUD**2 * variance(without)
    return found if agrees else None


def focal_in_words(attempts: Attempts, found: BundleSolution) -> str:
    """A focal length that is far off, in words."""
    return f"{_focal_length(found, attempts.block.cameras)}: {attempts.becomes(found)}"


def _focal_length(found: BundleSolution, given: Mapping[str, Camera] | None = None) -> str:
    """The one that is farthest from what was given."""
    given = given or found.block.cameras
    name = max(given.keys() & found.cameras.keys(), key=lambda name: _off(found.cameras[name], given[name]))
    return (
        f"a focal length is wrong, or its unit (camera {name}: {given[name].focal:g} px given, "
        f"{found.cameras[name].focal:.6g} px as an unknown)"
    )


def _off(camera: Camera, given: Camera) -> float:
    return float(abs(np.log(camera.focal / given.focal)))


def _principal_point(found: BundleSolution) -> str:
    """The one that is farthest from what was given."""
    given = found.block.cameras
    off = {
        name: float(np.abs(c.principal_point - given[name].principal_point).max())
        for name, c in found.cameras.items()
    }
    name = max(off, key=lambda name: off[name])
    (x, y), (u, v) = given[name].principal_point, found.cameras[name].principal_point
    return f"a principal point is wrong (camera {name}: {x:g}, {y:g} given, {u:.6g}, {v:.6g} as unknowns)"


def _distortion(found: BundleSolution) -> str:
    """The coefficient that has changed most."""
    given = found.block.cameras
    changes = {
        name: np.abs(c.coefficients - given[name].coefficients)
        for name, c in found.cameras.items()
        if c.coefficient_names
    }
    name = max(changes, key=lambda name: float(changes[name].max()))
    row = int(changes[name].argmax())
    said, old, new = (
        given[name].coefficient_names[row],
        float(given[name].coefficients[row]),
        float(found.cameras[name].coefficients[row]),
    )
    return (
        f"a calibration is wrong, its distortion too (camera {name}: {said} {old:g} given, "
        f"{new:.4g} as an unknown)"
    )
