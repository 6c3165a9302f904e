"""From names to numbers: which images and points are adjusted, from where they start, what is left out."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.adjustment.observed_centres import at_observed_centres
from obseq.images.block import Block
from obseq.images.camera import Camera
from obseq.images.control import GivenComponents
from obseq.images.initial.intersection import elsewhere, intersect
from obseq.images.initial.rough import ROUGH, distant_places, misfit, usual_places
from obseq.images.initial.units import unit_of_control
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among, index_of, numbered
from obseq.images.parts import MeasureSet
from obseq.images.poses import Poses, are_in_front


class ContradictionError(InputError):
    """Poses, cameras and points contradict each other so much that there is no solution."""


LEAST_RAYS = 2


@dataclass(frozen=True)
class LeftOut:
    """Something that takes no part in the adjustment.

    Attributes:
        kind: `image`, `point` or `measure`.
        name: of it.
        reason: why.
    """

    kind: str
    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class NumberedSet:
    """A set of measures in the numbers of the whole block.

    Attributes:
        given: the set.
        image: (n,) image of each measure.
        point: (n,) point of each measure.
        is_used: (n,) False for measures of images or points that are left out.
    """

    given: MeasureSet
    image: IntArray
    point: IntArray
    is_used: BoolArray

    @cached_property
    def rows(self) -> IntArray:
        """Rows of the measures that are used, by image and, in each, by point."""
        keys = self.image * (int(self.point.max(initial=0)) + 1) + self.point
        rows = np.flatnonzero(self.is_used)
        if len(rows) < len(keys):
            keys = keys[rows]
        return rows if (np.diff(keys) > 0).all() else rows[np.argsort(keys, kind="stable")]

    @cached_property
    def is_in_order(self) -> bool:
        """Whether `rows` are all measures, as they stand."""
        return len(self.rows) == len(self.image) and np.array_equal(self.rows, np.arange(len(self.rows)))


@dataclass(frozen=True, eq=False)
class Start(GivenComponents):
    """A block in numbers.

    Attributes:
        poses: of the images that are adjusted.
        cameras: camera of each of them.
        points: names of the points that are adjusted.
        coordinates: (n, 3) where they start.
        covariances: (n, 3, 3) of control points, as in `ControlPoints`; infinite for the others.
        is_control: (n,) whether a point is a control point.
        sets: the measures.
        left_out: what takes no part.
        misfit: by how many pixels the rays miss the points that they placed, in the median.
        unmeasured: control points that are in no image.
        met: numbers of the control points that their rays contradict, and (k, 3) where these meet.
    """

    poses: Poses
    cameras: list[Camera]
    points: tuple[str, ...]
    coordinates: FloatArray
    covariances: FloatArray
    is_control: BoolArray
    sets: list[NumberedSet]
    left_out: tuple[LeftOut, ...]
    misfit: float = 0.0
    unmeasured: tuple[LeftOut, ...] = ()
    met: tuple[IntArray, FloatArray] = (np.zeros(0, np.int64), np.zeros((0, 3)))

    @property
    def places(self) -> FloatArray:
        """(n, 3) where points start: what is known of them, but where rays contradict it."""
        rows, places = self.met
        if not rows.size:
            return self.coordinates
        found = self.coordinates.copy()
        found[rows] = places
        return found


def start_of(block: Block, places: Mapping[str, FloatArray] | None = None) -> Start:
    """The numbers of a block whose images have poses.

    Points that survey observations or lengths join need no ray at all; they may be without coordinates here.

    Args:
        block: whose images have poses.
        places: (3,) where points start whose rays do not meet at these poses.

    Raises:
        InputError: there are no measures; an image has no pose; a control point is behind a camera.
    """
    if not any(len(part.measures) for part in block.sets):
        raise InputError("the block has no image measures: add some (add_measures)")
    images, left_out = _images(block)
    cameras = [block.cameras[block.camera_of[image]] for image in images]
    names, sets = _numbered(block, images)
    control = are_among(names, block.control.names)
    covariances = _covariances(block, names)
    fixed = are_among(names, block.joined_points)
    if control.any():
        fixed |= np.isfinite(np.diagonal(covariances, axis1=1, axis2=2)).any(axis=1)
    counts = _rays(sets, len(names))
    reasons: dict[int, str] = {
        int(k): f"it has {counts[k]} ray; a free point takes {LEAST_RAYS}"
        for k in np.flatnonzero(~fixed & (counts < LEAST_RAYS))
    }
    coordinates = _known_coordinates(block, names)
    wanted = ~_have_places(coordinates)
    wanted[list(reasons)] = False
    given = block.poses.select(images)
    poses = at_observed_centres(block, given)
    places_given = coordinates.copy() if poses is not given else coordinates
    unplaced, off = put_points(coordinates, wanted, poses, cameras, names, sets)
    if poses is not given and (unplaced or off > ROUGH):
        others, off_given = put_points(places_given, wanted, given, cameras, names, sets)
        if (off_given > ROUGH, len(others)) < (off > ROUGH, len(unplaced)):
            poses, coordinates, unplaced, off = given, places_given, others, off_given
    places = places or {}
    for k in [k for k in unplaced if names[k] in places]:
        coordinates[k] = places[names[k]]
        del unplaced[k]
    reasons |= {k: reason for k, reason in unplaced.items() if not fixed[k]}
    start = Start(
        poses,
        cameras,
        names,
        coordinates,
        covariances,
        control,
        sets,
        tuple(left_out),
        off,
        _unmeasured(block, names),
    )
    start = replace(start, met=contradicted(start))
    _require_in_front(block, start)
    return _without(start, reasons) if reasons else start


def _without(start: Start, reasons: dict[int, str]) -> Start:
    """A block without some of its points, each for a reason."""
    kept = np.ones(len(start.points), dtype=bool)
    kept[list(reasons)] = False
    number = np.cumsum(kept) - 1
    left_out = [LeftOut("point", start.points[k], reason) for k, reason in sorted(reasons.items())]
    used = [
        NumberedSet(part.given, part.image, number[part.point], part.is_used & kept[part.point])
        for part in start.sets
    ]
    return replace(
        start,
        points=tuple(itertools.compress(start.points, kept)),
        coordinates=start.coordinates[kept],
        met=(number[start.met[0]], start.met[1]),
        covariances=start.covariances[kept],
        is_control=start.is_control[kept],
        sets=used,
        left_out=(*start.left_out, *left_out),
    )


def _unmeasured(block: Block, names: Sequence[str]) -> tuple[LeftOut, ...]:
    """Control points that no observation joins to the block."""
    if not block.control.names:
        return ()
    met = are_among(block.control.names, {*names, *block.joined_points})
    idle = itertools.compress(block.control.names, ~met)
    return tuple(LeftOut("control point", name, "it is in no image") for name in idle)


def _images(block: Block) -> tuple[list[str], list[LeftOut]]:
    """Images that something was measured in, and the others."""
    measured = {name for part in block.sets for name in part.measures.image_names}
    needed = measured | {name for part in block.pose_observations for name in part.poses.images}
    without = [image for image in block.camera_of if image in needed and image not in set(block.poses.images)]
    if without:
        raise InputError(
            f"image {without[0]}: it has no pose ({len(without)} images have none); give one, or let "
            "`initialise` find it"
        )
    images = [image for image in block.camera_of if image in needed]
    others = [image for image in block.camera_of if image not in needed]
    return images, [LeftOut("image", image, "nothing is measured in it") for image in others]


def _numbered(block: Block, images: list[str]) -> tuple[tuple[str, ...], list[NumberedSet]]:
    """The points of the measures and of the lengths, and the measures in their numbers."""
    lengths = block.lengths
    lists = [part.measures.point_names for part in block.sets]
    names, points = _joined([*lists, lengths.first + lengths.second] if lengths.values else lists)
    sets = []
    for part, point in zip(block.sets, points, strict=False):
        measures = part.measures
        image = index_of(images, measures.image_names, "image points: image")
        everything = np.ones(len(measures), dtype=bool)
        sets.append(
            NumberedSet(
                part, _looked_up(image, measures.image), _looked_up(point, measures.point), everything
            )
        )
    return names, sets


def _joined(lists: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], list[IntArray]]:
    """The different names of lists, and the number of each name of each list."""
    if len(lists) == 1 and len(set(lists[0])) == len(lists[0]):
        return lists[0], [np.arange(len(lists[0]))]
    names, numbers = numbered([name for part in lists for name in part])
    return names, np.split(numbers, np.cumsum([len(part) for part in lists])[:-1])


def _looked_up(numbers: IntArray, column: IntArray) -> IntArray:
    """(n,) the numbers of what a column says; the column itself where it says these."""
    return column if np.array_equal(numbers, np.arange(len(numbers))) else numbers[column]


def _rays(sets: list[NumberedSet], n: int) -> IntArray:
    counts = np.zeros(n, dtype=np.int64)
    for part in sets:
        counts += np.bincount(part.point, minlength=n)
    return counts


def _known_coordinates(block: Block, names: Sequence[str]) -> FloatArray:
    """(n, 3) of control points, of points of a survey, or approximations; NaN for the others."""
    found = block.approximations.of(names)
    known = dict(zip(block.control.names, block.control.coordinates, strict=True))
    for network in block.surveys:
        known = dict(zip(network.points.names, network.points.coordinates, strict=True)) | known
    if known:
        rows = np.flatnonzero(are_among(names, known))
        found[rows] = np.array([known[names[row]] for row in rows.tolist()]).reshape(-1, 3)
    return found


def _have_places(coordinates: FloatArray) -> BoolArray:
    """(n,) whether points (n, 3) have coordinates."""
    there = np.isfinite(coordinates)
    return np.ones(len(coordinates), dtype=bool) if there.all() else np.asarray(there.all(axis=1))


def _covariances(block: Block, names: Sequence[str]) -> FloatArray:
    """(n, 3, 3) of control points; infinite on the diagonal for the others."""
    found = np.zeros((len(names), 3, 3))
    found.reshape(-1, 9)[:, ::4] = np.inf
    if not block.control.names:
        return found
    place = {name: k for k, name in enumerate(names)}
    own = [k for k, name in enumerate(block.control.names) if name in place]
    found[[place[block.control.names[k]] for k in own]] = block.control.covariances[own]
    return found


def put_points(
    coordinates: FloatArray,
    wanted: BoolArray,
    poses: Poses,
    cameras: list[Camera],
    names: Sequence[str],
    sets: list[NumberedSet],
) -> tuple[dict[int, str], float]:
    """Puts points that are wanted where their rays meet, or about there where poses are rough.

    Returns:
        The reasons of those that cannot be placed, and by how many pixels rays miss their points.
    """
    if not wanted.any():
        return {}, 0.0
    rays = _rays_to(wanted, poses.images, names, sets)
    found = intersect(rays, poses, cameras)
    coordinates[wanted] = found.coordinates[wanted]
    lost = wanted & ~found.is_placed
    off = misfit(found)
    if off <= ROUGH and not lost.any():
        return {}, off
    focals = np.array([camera.focal for camera in cameras])
    is_rough = off > ROUGH
    places, needed = (
        usual_places(rays, poses, found) if is_rough else distant_places(rays, poses, focals, found)
    )
    coordinates[wanted & needed] = places[wanted & needed]
    lost &= ~needed
    return {int(k): found.reasons[k] for k in np.flatnonzero(lost)}, off


def _rays_to(
    wanted: BoolArray, images: Sequence[str], names: Sequence[str], sets: list[NumberedSet]
) -> ImagePoints:
    """The rays to some points (n,), without covariances, which change no first place."""
    parts = [(part, part.is_used & wanted[part.point]) for part in sets]
    return ImagePoints.packed(
        images,
        names,
        np.concatenate([part.image[rows] for part, rows in parts]),
        np.concatenate([part.point[rows] for part, rows in parts]),
        np.concatenate([part.given.measures.xy[rows] for part, rows in parts]),
        np.concatenate([part.given.measures.sigmas[rows] for part, rows in parts]),
    )


def contradicted(start: Start) -> tuple[IntArray, FloatArray]:
    """Control points whose rays meet far from where they are given, if they are few, and where these meet.

    From where it is given, one that is far off would carry the others away. Held coordinates stay.
    """
    control = start.is_control & ~start.is_held.any(axis=1) & _have_places(start.coordinates)
    rays = _rays_to(control, start.poses.images, start.points, start.sets)
    known = start.coordinates[index_of(start.points, rays.point_names, "point")]
    met, places = elsewhere(rays, start.poses, start.cameras, known, ROUGH)
    if not 0 < 2 * met.size <= len(known):
        return met[:0], places[:0]
    return index_of(start.points, [rays.point_names[row] for row in met.tolist()], "point"), places


def _require_in_front(block: Block, start: Start) -> None:
    """Refuses points with given coordinates that are measured from behind."""
    is_known = _have_places(start.coordinates)
    for part in start.sets:
        rows = slice(None) if is_known.all() else np.flatnonzero(is_known[part.point])
        image, point = part.image[rows], part.point[rows]
        seen = are_in_front(start.cameras, start.poses, image, start.places, point)
        if not seen.all():
            row = int(np.arange(len(part.point))[rows][seen.argmin()])
            origin = part.given.origin or block.origin
            raise ContradictionError(
                f"{f'{origin.place(row)}: ' if origin else ''}{part.given.measures.label(row)}: the point is "
                f"behind the camera ({np.count_nonzero(~seen)} measures are); check the coordinates, the "
                "name, and the convention of the pose: here x = centre + R x_camera, the camera looking "
                f"along +z{_unit_hint(block)}"
            )


def _unit_hint(block: Block) -> str:
    """In which unit control points seem to be, where poses are in another."""
    unit = unit_of_control(block, block.poses)
    return "" if unit is None else f"; the control points are {unit[0]:.6g} times too large: {unit[1]}?"
