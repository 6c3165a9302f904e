"""What a block has, in six lines, before it is adjusted."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.block import Block

FIRST = 3
"""Names of a list before it is cut."""


def overview(block: Block) -> str:
    """Six lines: cameras, images, points, control, references, rigid blocks."""
    lines = {
        "cameras": "; ".join(_cameras(block)),
        "images": _images(block),
        "points": _points(block),
        "control": _control(block),
        "references": "; ".join(_references(block)) or "none",
        "rigs": "; ".join(_rigs(block)) or "none",
    }
    return "Read\n" + "".join(f"  {name:<11}{said}\n" for name, said in lines.items())


def _cameras(block: Block) -> Iterable[str]:
    """Cameras of which the same is unknown, together."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in dict.fromkeys(block.camera_of.values()):
        terms = block.cameras[name].parameter_names
        free = tuple(term for term in terms if not block.is_frozen(name, term))
        groups.setdefault(free, []).append(name)
    for free, names in groups.items():
        yield f"{_named(names)}: {'unknown ' + ' '.join(free) if free else 'held'}"
    sigmas = [sigma for *_, sigma in block.parameter_priors]
    if sigmas:
        yield f"{len(sigmas)} parameters observed"


def _named(names: Collection[str]) -> str:
    more = len(names) - FIRST
    return ", ".join(list(names)[:FIRST]) + (f" and {more} more" if more > 0 else "")


def _images(block: Block) -> str:
    placed = set(block.poses.images)
    waiting = sum(image not in placed for image in block.camera_of)
    return f"{len(placed)} with a pose" + (f", {waiting} without" if waiting else "")


def _points(block: Block) -> str:
    measured = {name for part in block.sets for name in part.measures.point_names}
    sigmas = [_range(part.measures.sigmas) for part in block.sets if len(part.measures)]
    count = sum(len(part.measures) for part in block.sets)
    rows = np.flatnonzero(~block.control.is_free.all(axis=1))
    known = {block.control.names[row] for row in rows}
    others = measured - known - set(block.check_points.names)
    spread = f", sigma {'; '.join(dict.fromkeys(sigmas))} px" if sigmas else ""
    return f"{len(others)} tie points; {count} image points{spread}"


def _range(sigmas: FloatArray) -> str:
    least, most = (f"{float(value):.3g}" for value in (np.min(sigmas), np.max(sigmas)))
    return least if least == most else f"{least} to {most}"


def _control(block: Block) -> str:
    control = block.control
    known = ~control.is_held & ~control.is_free
    observed, held = known.any(axis=1), control.is_held.any(axis=1) & ~known.any(axis=1)
    parts = []
    if observed.any():
        parts.append(f"{observed.sum()} observed (sigma {_range(control.sigmas[known])})")
    if held.any():
        parts.append(f"{held.sum()} held")
    if len(block.check_points):
        parts.append(f"{len(block.check_points)} check points")
    return (", ".join(parts) or "none") + (f"; frame {block.frame}" if block.frame else "")


def _references(block: Block) -> Iterable[str]:
    for part in block.pose_observations:
        turned = "" if part.rotation_sigma is None else f", angles {np.degrees(part.rotation_sigma):.3g} deg"
        yield f"centres of {len(part.poses)} images (sigma {_finite_range(part.centre_sigmas)}{turned})"
    for antenna in block.antennas:
        lever = "" if antenna.is_central else f", lever arm {_lever(antenna.lever_arm, antenna.lever_sigmas)}"
        spread = _finite_range(antenna.sigmas)
        yield f"{antenna.name} of {len(antenna.images)} images (sigma {spread}{lever})"
    for shutter in block.shutters:
        state = "held" if shutter.sigma == 0.0 else "unknown" if np.isinf(shutter.sigma) else "observed"
        yield f"readout of {shutter.name} {state}, from {1000 * shutter.readout:.3g} ms"


def _finite_range(sigmas: FloatArray) -> str:
    known = sigmas[np.isfinite(sigmas)]
    return _range(known) if known.size else "none"


def _lever(lever: FloatArray, sigmas: FloatArray) -> str:
    held = (sigmas == 0.0).all()
    return f"{'held' if held else 'unknown'}, from {' '.join(f'{value:.4g}' for value in lever)}"


def _rigs(block: Block) -> Iterable[str]:
    for rig in block.rigid_blocks:
        exposures = rig.exposures
        state = "held" if rig.is_fixed else "observed" if rig.place_sigmas else "unknown"
        yield (
            f"{rig.name}: {len(exposures.cameras)} cameras, {len(exposures.names)} exposures, places {state}"
        )
