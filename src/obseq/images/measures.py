"""What was measured in the images: points, packed in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.images.names import are_among, as_names, index_of, numbered, rows_of, sigmas_of


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """Points measured in images.

    Pixels: x = column to the right, y = line downwards. Any origin will do as long as the principal point
    of the camera has the same; MMVII's default principal point is the middle of [0, width] x [0, height].

    Attributes:
        image_names: names of the images.
        point_names: names of the points.
        image: (n,) image of each measure, a position in `image_names`.
        point: (n,) point of each measure, a position in `point_names`.
        xy: (n, 2) pixels.
        sigmas: (n, 2) standard deviations, pixels.
        covariances: (n,) of x and y, pixels squared.

    Example:
        >>> measures = ImagePoints.of(["a", "a", "b"], ["1", "2", "1"], [[10.0, 20], [30, 40], [50, 60]])
        >>> measures.of_image("a").point_names
        ('1', '2')
    """

    image_names: tuple[str, ...]
    point_names: tuple[str, ...]
    image: IntArray
    point: IntArray
    xy: FloatArray
    sigmas: FloatArray
    covariances: FloatArray

    @classmethod
    def of(
        cls,
        images: Sequence[str],
        points: Sequence[str],
        xy: ArrayLike,
        sigmas: ArrayLike = 1.0,
        covariances: ArrayLike = 0.0,
    ) -> ImagePoints:
        """Measures from names: (n,) images and points, (n, 2) pixels, one sigma, (n,) or (n, 2), covariances.

        Raises:
            InputError: a point is measured twice in an image, a number is not finite, a sigma not positive,
                or an array has another shape.
        """
        image_names, image = numbered(as_names(images, "image points: image"))
        point_names, point = numbered(as_names(points, "image points: point"))
        return cls.packed(image_names, point_names, image, point, xy, sigmas, covariances)

    @classmethod
    def packed(
        cls,
        image_names: Sequence[str],
        point_names: Sequence[str],
        image: ArrayLike,
        point: ArrayLike,
        xy: ArrayLike,
        sigmas: ArrayLike = 1.0,
        covariances: ArrayLike = 0.0,
    ) -> ImagePoints:
        """The same from numbers, for those who have them: nothing is looked up by name."""
        image, point = np.asarray(image, dtype=np.int64), np.asarray(point, dtype=np.int64)
        if len(image) != len(point):
            raise InputError(f"image points: {len(image)} images and {len(point)} points")
        made = cls(
            as_names(image_names, "image points: image"),
            as_names(point_names, "image points: point"),
            image,
            point,
            rows_of(xy, len(image), 2, "image points: pixels"),
            sigmas_of(sigmas, len(image), 2, "image points: sigmas"),
            sigmas_of(covariances, len(image), 1, "image points: covariances")[:, 0],
        )
        made._check()
        return made

    def _check(self) -> None:
        if not len(self):
            return
        row = _first_wrong(np.isfinite(self.xy))
        if row is not None:
            raise RowError(f"{self.label(row)}: the pixel {self.xy[row]} is not finite", row)
        row = _first_wrong((self.sigmas > 0.0) & np.isfinite(self.sigmas))
        if row is not None:
            raise RowError(f"{self.label(row)}: the sigma must be positive and finite", row)
        row = _first_wrong(np.abs(self.covariances) < self.sigmas.prod(axis=1))
        if row is not None:
            raise RowError(f"{self.label(row)}: the covariance of x and y must be below their sigmas", row)
        keys = self.image * len(self.point_names) + self.point
        if (np.diff(keys) > 0).all():
            return  # by image and, in each, by point: nothing comes twice
        order = np.argsort(keys, kind="stable")
        twice = np.flatnonzero(np.diff(keys[order]) == 0)
        if twice.size:
            row = int(order[twice[0] + 1])
            raise RowError(f"{self.label(row)}: measured twice in the image", row)

    def __len__(self) -> int:
        return len(self.image)

    def label(self, row: int) -> str:
        """What to call a measure in a message: its image and its point."""
        return self.labels([row])[0]

    def labels(self, rows: ArrayLike) -> list[str]:
        """What to call measures in messages."""
        index = np.asarray(rows, dtype=np.int64)
        images, points = self.image_names, self.point_names
        pairs = zip(self.image[index].tolist(), self.point[index].tolist(), strict=True)
        return [f"image {images[i]}, point {points[k]}" for i, k in pairs]

    def rows(self, chosen: ArrayLike) -> ImagePoints:
        """The measures of some rows (numbers or a mask), with the names that remain."""
        index = np.arange(len(self))[np.asarray(chosen)]
        images, image = np.unique(self.image[index], return_inverse=True)
        points, point = np.unique(self.point[index], return_inverse=True)
        return replace(
            self,
            image_names=tuple(self.image_names[k] for k in images),
            point_names=tuple(self.point_names[k] for k in points),
            image=image.astype(np.int64),
            point=point.astype(np.int64),
            xy=self.xy[index],
            sigmas=self.sigmas[index],
            covariances=self.covariances[index],
        )

    def of_image(self, name: str) -> ImagePoints:
        """The measures of one image."""
        return self.rows(self.image == index_of(self.image_names, [name], "image points: image")[0])

    def of_points(self, names: Sequence[str]) -> ImagePoints:
        """The measures of points that are among some names."""
        return self.rows(are_among(self.point_names, names)[self.point])

    def joined(self, other: ImagePoints) -> ImagePoints:
        """These measures and others, which name their images and points alike."""
        image_names, image = numbered([*self.image_names, *other.image_names])
        point_names, point = numbered([*self.point_names, *other.point_names])
        n_images, n_points = len(self.image_names), len(self.point_names)
        return ImagePoints.packed(
            image_names,
            point_names,
            np.concatenate([image[:n_images][self.image], image[n_images:][other.image]]),
            np.concatenate([point[:n_points][self.point], point[n_points:][other.point]]),
            np.concatenate([self.xy, other.xy]),
            np.concatenate([self.sigmas, other.sigmas]),
            np.concatenate([self.covariances, other.covariances]),
        )

    @property
    def are_correlated(self) -> bool:
        """Whether x and y of a measure are."""
        return bool(self.covariances.any())

    @property
    def matrices(self) -> FloatArray:
        """(n, 2, 2) covariances of x and y."""
        found = self.covariances[:, None, None] * np.ones((2, 2))
        found[:, [0, 1], [0, 1]] = self.sigmas**2
        return found


def _first_wrong(is_right: BoolArray) -> int | None:
    """The first row, (n,) or (n, 2), that is not right; None when all are."""
    return None if is_right.all() else int(is_right.reshape(len(is_right), -1).all(axis=1).argmin())
