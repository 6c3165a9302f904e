"""What a block lacks to be adjusted, and what its observations hardly determine, in its own words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from obseq.errors import InputError, SingularSystemError
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.start import ContradictionError, Start
from obseq.images.block import Block
from obseq.images.initial.distribution import check_spread
from obseq.leastsquares import LeastSquaresResult
from obseq.leastsquares.diagnosis.rejection import is_emptied
from obseq.leastsquares.diagnosis.singular import grouped

DATUMS = ("control", "centres", "points", "none")


def check_datum(block: Block, start: Start, datum: str | Sequence[str]) -> None:
    """Refuses a block that nothing places in the world, unless a free one is asked for.

    Raises:
        InputError: the datum is unknown; too little is known; all that is known is on a line.
    """
    if isinstance(datum, str) and datum not in DATUMS:
        raise InputError(f"datum {datum!r} is none of {', '.join(DATUMS)} or a list of point names")
    if datum != "control" or block.surveys:
        return
    known = start.is_control[:, None] & ~start.is_free
    others = known_beside_points(block, start)
    if int(known.sum()) + others < 7:
        raise InputError(
            f"{block.source}the block has no datum: {int(known.sum()) + others} coordinates of measured "
            "points are known, and position, orientation and scale take 7; add control points, or ask for a "
            "free block, on its centres or on its points (datum='centres', datum='points'; --datum centres, "
            "--datum points)" + _idle(start)
        )
    if others == len(block.lengths.values) and (known.all(axis=1) == known.any(axis=1)).all():
        rows = np.flatnonzero(known.all(axis=1))
        places = block.control_places([start.points[row] for row in rows])
        what = "the block" if any(origin.lines for _, origin in block.control_origins) else ""
        check_spread(start.coordinates[rows], what or f"{block.source}the block", places)


def check_weights(equations: Equations) -> None:
    """Refuses a solution in which no image point has any weight: only what is known besides says the poses.

    Raises:
        SingularSystemError: thresholds have rejected all of them.
    """
    batches = [item.batch for item in equations.measures if item.batch.active.any()]
    if batches and all(is_emptied(batch) for batch in batches):
        raise SingularSystemError(
            f"all {sum(int(batch.active.sum()) for batch in batches)} image points lie beyond the threshold: "
            "none has any weight"
        )


@contextmanager
def cameras_refused() -> Iterator[None]:
    """Cameras that cannot be, which iterations have led to, are said to be those of a mirror image."""
    try:
        yield
    except InputError as error:
        raise ContradictionError(
            f"{error}: the block fits as a mirror image only; check the axes of image points and control "
            "points, the principal point and the poses, or hold the camera (--freeze '.*')"
        ) from None


def _idle(start: Start) -> str:
    """The control points that are given and in no image, if there are some."""
    names = [item.name for item in start.unmeasured]
    if not names:
        return ""
    measured = f"{', '.join(start.points[:3])}, ..." if start.points else "none"
    return (
        f". {len(names)} control points are in no image: {', '.join(names[:3])}; names count with their case "
        f"(points in images: {measured})"
    )


def check_scale(block: Block, datum: str | Sequence[str]) -> None:
    """Refuses rigid blocks of unknown size without a scale: the world would shrink for their sake."""
    has_scale = datum == "control" or block.lengths.values or block.surveys
    for part in block.rigid_blocks:
        if not (has_scale or part.is_exact or part.is_fixed or part.observed_places.keys() - {part.master}):
            raise InputError(
                f"rigid block {part.name}: its sigmas are in the unit of the world, and nothing gives "
                "the block a scale; add a length, or take the places of the cameras as known (is_fixed) "
                "or as observed (place_sigmas)"
            )


LEAST_OF_AN_IMAGE = 3
"""Points that determine a pose."""
HINT = (
    "A block needs a datum: three control points that are not on a line, observed poses, or --datum centres "
    "(datum='centres')."
)
POINT_HINT = "Rays of these points are nearly parallel: measure them from farther apart, or leave them out."
CAMERA_HINT = (
    "Hold parameters of the camera {} (--freeze '.*', or 'K.|p.|b.'; freeze_parameters), or give more images "
    "and control points."
)
THRESHOLD_HINT = (
    "All measures of a point may lie beyond the threshold: adjust with an attenuation and no threshold first "
    "(it weakens large residuals, and leaves none out), then with the threshold from there."
)


def known_beside_points(block: Block, start: Start) -> int:
    """Equations that say something of position, orientation or scale, those of control points left aside."""
    images = start.poses.images
    fixed = [*block.fixed_centres, *block.fixed_rotations]
    held = 3 * sum(bool(pattern.fullmatch(image)) for pattern in fixed for image in images)
    observed = 6 * sum(len(part.poses) for part in block.pose_observations)
    observed += 3 * sum(len(set(part.images) & set(images)) for part in block.antennas)
    instruments = block.instruments
    read = sum(len(part.images) for part in instruments.inclinations)
    read += sum(len(part.images) for part in instruments.needles)
    return held + observed + read + len(block.lengths.values)


def in_words(equations: Equations, error: SingularSystemError) -> SingularSystemError:
    """The error of a block whose measures leave unknowns undetermined: which, and what may be wrong."""
    message = f"{_undetermined(error)}\n{_hint(equations, error)}"
    return SingularSystemError(message, error.unknowns, error.defect, error.kernel, error.movements)


def weakness(equations: Equations, result: LeastSquaresResult) -> str:
    """Why a solution has no precisions, in a sentence; empty where it has, or nothing speaks against them."""
    if result.weak is None:
        return ""
    short = _shortage(result.n_observations + result.n_constraints, result.n_unknowns, _least_free(equations))
    if short:
        return short
    error = result.weak
    if isinstance(error, SingularSystemError) and error.unknowns:
        return f"{_undetermined(error)}. {_hint(equations, error)}"
    return str(error)


def _least_free(equations: Equations) -> int:
    """Parameters that a datum takes where nothing places the block in the world."""
    block, start = equations.block, equations.start
    known = int(start.is_control.sum()) + known_beside_points(block, start) + len(block.surveys)
    return 0 if known else 7


def _shortage(equations: int, unknowns: int, datum: int) -> str:
    """What there is to say of so many equations for so many unknowns, some of which a datum takes."""
    rest = unknowns - datum
    if equations > rest:
        return ""
    taken = f"{rest} unknowns, and {datum} that the datum takes" if datum else f"{rest} unknowns"
    counted = f"the block has {equations} equations for {taken}"
    more = "measure more points in more images, or hold parameters of cameras (--freeze '.*')"
    if equations == rest:
        return f"{counted}: nothing checks the result; {more}"
    return f"{counted}: it is {rest - equations} equations short; {more}"


def _undetermined(error: SingularSystemError) -> str:
    if error.kernel is None:
        return str(error)
    names = grouped(error.unknowns)
    return f"the observations do not determine {names} (rank deficiency {error.defect})"


FINE = 1e-6
"""Pixels: no image point is known to so little. Beside it others are lost in rounding."""


def hiding_sigma(block: Block) -> str:
    """The image point whose sigma is so small that no other counts, in words; empty without any."""
    for part in block.sets:
        sigmas = part.measures.sigmas.min(axis=1, initial=np.inf)
        row = int(np.argmin(sigmas)) if len(sigmas) else -1
        if row >= 0 and sigmas[row] < FINE:
            origin = part.origin or block.origin
            place = f"{origin.place(row)}: " if origin else ""
            return (
                f"{place}{part.measures.label(row)}: a sigma of {sigmas[row]:g} pixels hides what the others "
                f"say ({np.count_nonzero(sigmas < FINE)} measures are below {FINE:g}); correct it."
            )
    return ""


def _hint(equations: Equations, error: SingularSystemError) -> str:
    """What may be wrong with a block whose measures leave unknowns undetermined."""
    block, start, system = equations.block, equations.start, equations.system
    if hidden := hiding_sigma(block):
        return hidden
    owners = {name.rpartition(".")[0] for name in error.unknowns}
    cameras = [name for name in block.cameras if name in owners]
    counts = np.zeros(len(start.poses), dtype=np.int64)
    for part in start.sets:
        counts += np.bincount(part.image[part.rows], minlength=len(counts))
    poor = np.flatnonzero(counts < LEAST_OF_AN_IMAGE)
    if poor.size:
        return (
            f"Image {start.poses.images[poor[0]]}: {counts[poor[0]]} of its points take part, and a pose "
            f"takes {LEAST_OF_AN_IMAGE} ({poor.size} images have fewer); measure more, or leave it out."
        )
    n_equations = system.n_observations + system.n_constraints
    short = _shortage(n_equations, system.problem.n_free, _least_free(equations))
    if short:
        return f"{short[0].upper()}{short[1:]}."
    thresholds = [part.weighting for part in block.sets if part.weighting is not None]
    if any(part.threshold for part in thresholds):
        return THRESHOLD_HINT
    if cameras:
        return CAMERA_HINT.format(", ".join(cameras))
    loose = [name for name in start.points if name in owners]
    return POINT_HINT if loose and len(loose) == len(owners) else HINT
