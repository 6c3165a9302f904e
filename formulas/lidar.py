"""Lidar points seen in images, and in other scans, each expanded to the first order at the current solution.

What is observed at a lidar point, the radiometry of an image or the distance of another scan, was read at the
current projection of the point together with its gradient. The formulas move the point in the frame of the
camera or scan and follow these gradients, the intrinsic calibration being fixed. The pose of a camera or of
a scan takes its frame to the world. Metres and radians; radiometries in grey levels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import (
    WORLD_TO_LOCAL,
    Atom,
    Declaration,
    Length,
    Matrix3,
    Number,
    Point2,
    Point3,
    Pose,
    Radiometry,
    Rotation,
    Unit,
    component_names,
    norm,
)
from obseq.formulas.functions import Scalar, let, normalised_ratio

SOURCE = "MMVII Formulas_Lidar.h"


@dataclass(frozen=True)
class Sighting:
    """A lidar point and what was read in an image at its current projection.

    Attributes:
        point: The point, in the world or in the frame of its scan (m).
        current: The point in the frame of the camera, at the current solution (m).
        gradient_i: Gradient of the first pixel coordinate with respect to the point in the camera (pixel/m).
        gradient_j: Gradient of the second one.
        radiometry: Value of the image there.
        gradient: Gradient of the image there (grey level/pixel).
    """

    point: Point3
    current: Point3
    gradient_i: Point3
    gradient_j: Point3
    radiometry: Scalar
    gradient: Point2

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Fifteen scalars, named by a pattern that gives their suffix (`"{}_0"`)."""
        (pattern,) = labels

        def names(prefix: str, suffixes: str) -> tuple[str, ...]:
            return component_names((pattern.format(prefix + "_{}"),), suffixes)

        atoms = (
            Atom("Point3", names("mPScan", "xyz"), part="point", unit="m"),
            Atom("Point3", names("mPCam0", "xyz"), part="current", unit="m"),
            Atom("Point3", names("mGradPCam_i", "xyz"), part="gradient_i", unit="pixel/m"),
            Atom("Point3", names("mGradPCam_j", "xyz"), part="gradient_j", unit="pixel/m"),
            Atom("Scalar", (pattern.format("Rad0"),), part="radiometry", unit="grey level"),
            Atom("Point2", names("GradRad", "xy"), part="gradient", unit="grey level/pixel"),
        )

        def build(scalars: Sequence[Scalar], context: Sequence[Scalar]) -> Sighting:
            point, current, i, j = (Point3(*scalars[k : k + 3]) for k in (0, 3, 6, 9))
            return cls(point, current, i, j, scalars[12], Point2(*scalars[13:15]))

        return Declaration(atoms, build)

    def radiometry_at(self, place: Point3) -> Scalar:
        """The image where a point of the camera frame projects, to the first order."""
        slope = self.gradient.x * self.gradient_i + self.gradient.y * self.gradient_j
        return self.radiometry + (place - self.current).dot(slope)


Camera = Annotated[Pose, "mCCam", "mOmegaCam", "mRot0CamTr", WORLD_TO_LOCAL]
Scan = Annotated[Pose, "mCScan", "mOmegaScan", "mRot0Scan"]
CensusCamera = Annotated[Pose, "mCCam", "mOmegaCam", "mRot0CamTr_{}_0", WORLD_TO_LOCAL]
CensusScan = Annotated[Pose, "mCScan", "mOmegaScan", "mRot0Scan_{}_0"]
Target = Annotated[Radiometry, "TargetRad"]
Seen = Annotated[Sighting, "{}"]
CentreSeen = Annotated[Sighting, "{}_0"]
NeighbourSeen = Annotated[Sighting, "{}_1"]

TYPICAL = {
    "camera.centre": (0.0, 10.0),
    "seen": (0.0, 5.0),
    "Rad0": (100.0, 50.0),
    "target": (100.0, 50.0),
}
TYPICAL_CENSUS = {
    "camera.centre": (0.0, 0.2),
    "centre": (0.0, 1.0),
    "neighbour": (0.0, 1.0),
    "Rad0_0": (100.0, 20.0),
    "Rad0_1": (100.0, 20.0),
}


class EqLidarImPonct(Formula):
    """Radiometry of a lidar point in an image, the same in all images.

    Residual: `I - TargetRad` (grey levels), with `I = Rad0 + GradRad_x (d . mGradPCam_i) + GradRad_y (d .
    mGradPCam_j)`, `d = (I + [mOmegaCam]x) mRot0CamTr (mPScan - mCCam) - mPCam0`. Defined everywhere.
    """

    source = SOURCE
    typical: ClassVar = TYPICAL

    def residual(self, target: Target, camera: Camera, *, seen: Seen) -> Scalar:
        """The radiometry read in the image, minus that of the point."""
        return seen.radiometry_at(camera.inverse() @ seen.point) - target


class EqLidarImPonctPose(Formula):
    """Radiometry of a point of a scan in an image, the pose of the scan being adjusted.

    Residual: as `EqLidarImPonct` with the point `mCScan + mRot0Scan (I - [mOmegaScan]x) mPScan`. Defined
    everywhere.
    """

    source = SOURCE
    typical: ClassVar = {**TYPICAL, "scan.centre": (0.0, 10.0)}

    def residual(self, target: Target, scan: Scan, camera: Camera, *, seen: Seen) -> Scalar:
        """The radiometry read in the image, minus that of the point."""
        return seen.radiometry_at(camera.inverse() @ (scan @ seen.point)) - target


class EqLidarImCorrel(Formula):
    """Radiometry of a lidar point in an image, up to a line per image: the correlation of patches.

    Residual: `CoefAdd + CoefMul I - TargetRad` (grey levels), I as in `EqLidarImPonct`. Defined everywhere.
    """

    source = SOURCE
    typical: ClassVar = {**TYPICAL, "gain": (1.0, 0.3), "offset": (0.0, 20.0)}

    def residual(
        self,
        target: Target,
        gain: Annotated[Number, "CoefMul"],
        offset: Annotated[Radiometry, "CoefAdd"],
        camera: Camera,
        *,
        seen: Seen,
    ) -> Scalar:
        """The radiometry read in the image, brought to the patch by a line, minus that of the point."""
        return offset + gain * seen.radiometry_at(camera.inverse() @ seen.point) - target


class EqLidarImCorrelPose(Formula):
    """Radiometry of a point of a scan in an image, up to a line per image; the pose of the scan is adjusted.

    Residual: as `EqLidarImCorrel` with the point `mCScan + mRot0Scan (I - [mOmegaScan]x) mPScan`. Defined
    everywhere.
    """

    source = SOURCE
    typical: ClassVar = {**TYPICAL, "scan.centre": (0.0, 10.0), "gain": (1.0, 0.3), "offset": (0.0, 20.0)}

    def residual(
        self,
        target: Target,
        gain: Annotated[Number, "CoefMul"],
        offset: Annotated[Radiometry, "CoefAdd"],
        scan: Scan,
        camera: Camera,
        *,
        seen: Seen,
    ) -> Scalar:
        """The radiometry read in the image, brought to the patch by a line, minus that of the point."""
        return offset + gain * seen.radiometry_at(camera.inverse() @ (scan @ seen.point)) - target


class EqLidarImCensus(Formula):
    """Contrast of a lidar point with a neighbour in an image, the same in all images.

    Residual: `c(I_0, I_1) - TargetRatio`, dimensionless, I as in `EqLidarImPonct` for the centre (suffix
    `_0`) and the neighbour (suffix `_1`), seen by the same camera. The contrast is `c(a, b) = (a - b) /
    max(a, b)` of radiometries of which negative ones are taken as 0; it has continuous derivatives where `a =
    b > 0`, and is 0 with derivatives 0 at (0, 0). MMVII derives through a negative radiometry as if it moved
    the contrast; here its derivative is 0. Defined everywhere.

    The matrix of the camera is given twice, as MMVII does: `mRot0CamTr` with suffix `_0` is the context of
    its pose, that with suffix `_1` an observation, which the caller keeps equal.
    """

    source = SOURCE
    observation_order = ("camera", "centre", "matrix_1", "neighbour")
    typical: ClassVar = TYPICAL_CENSUS

    def residual(
        self,
        ratio: Annotated[Number, "TargetRatio"],
        camera: CensusCamera,
        *,
        centre: CentreSeen,
        matrix_1: Annotated[Matrix3, "mRot0CamTr_{}_1"],
        neighbour: NeighbourSeen,
    ) -> Scalar:
        """The contrast read in the image, minus that of the points."""
        again = same_pose(camera, matrix_1.T)
        return (
            normalised_ratio(
                let("radiometry_0", centre.radiometry_at(camera.inverse() @ centre.point)),
                let("radiometry_1", neighbour.radiometry_at(again.inverse() @ neighbour.point)),
            )
            - ratio
        )


class EqLidarImCensusPose(Formula):
    """Contrast of a point of a scan with a neighbour in an image, the pose of the scan being adjusted.

    Residual: as `EqLidarImCensus` with the points `mCScan + mRot0Scan (I - [mOmegaScan]x) mPScan`. Both
    matrices are given twice, with the suffixes `_0` (context) and `_1` (observation, which the caller keeps
    equal).
    """

    source = SOURCE
    observation_order = ("scan", "camera", "centre", "scan_matrix_1", "matrix_1", "neighbour")
    typical: ClassVar = {**TYPICAL_CENSUS, "scan.centre": (0.0, 0.2)}

    def residual(
        self,
        ratio: Annotated[Number, "TargetRatio"],
        scan: CensusScan,
        camera: CensusCamera,
        *,
        centre: CentreSeen,
        scan_matrix_1: Annotated[Matrix3, "mRot0Scan_{}_1"],
        matrix_1: Annotated[Matrix3, "mRot0CamTr_{}_1"],
        neighbour: NeighbourSeen,
    ) -> Scalar:
        """The contrast read in the image, minus that of the points."""
        scan_again, again = same_pose(scan, scan_matrix_1), same_pose(camera, matrix_1.T)
        return (
            normalised_ratio(
                let("radiometry_0", centre.radiometry_at(camera.inverse() @ (scan @ centre.point))),
                let(
                    "radiometry_1", neighbour.radiometry_at(again.inverse() @ (scan_again @ neighbour.point))
                ),
            )
            - ratio
        )


class EqLidarLidar(Formula):
    """Distance of a point of scan A in scan B.

    Residual: `|V| - (DistB0 + GradDistB_x (d . GradProjBI) + GradDistB_y (d . GradProjBJ))` (m), with the
    vector from scan B to the point `V = mCScanA + RotScanA (I - [OmegaScanA]x) PScanA - mCScanB` and `d = (I
    + [OmegaScanB]x) RotScanBTr V - PScanB0`. `DistB0` is the distance raster of B at the current projection
    of the point, `GradDistB` its gradient, and `GradProjB` the gradients of the two raster coordinates.
    Undefined where the point is the centre of B.
    """

    source = SOURCE
    typical: ClassVar = {
        "scan_a.centre": (0.0, 10.0),
        "scan_b.centre": (0.0, 10.0),
        "point": (0.0, 10.0),
        "current": (0.0, 10.0),
        "distance": (10.0, 5.0),
    }

    def residual(
        self,
        scan_a: Annotated[Pose, "mCScanA", "OmegaScanA", "RotScanA"],
        scan_b: Annotated[Pose, "mCScanB", "OmegaScanB", "RotScanBTr", WORLD_TO_LOCAL],
        *,
        point: Annotated[Point3, "PScanA"],
        current: Annotated[Point3, "PScanB0"],
        gradient_i: Annotated[Point3, "GradProjBI", Unit("pixel/m")],
        gradient_j: Annotated[Point3, "GradProjBJ", Unit("pixel/m")],
        distance: Annotated[Length, "DistB0"],
        gradient: Annotated[Point2, "GradDistB", Unit("m/pixel")],
    ) -> Scalar:
        """The distance of the point from B, minus that read in the raster of B (m)."""
        sight = let("sight", scan_a @ point - scan_b.centre)
        moved = scan_b.rotation.inverse() @ sight - current
        slope = gradient.x * gradient_i + gradient.y * gradient_j
        return norm(sight) - (distance + moved.dot(slope))


def same_pose(pose: Pose, current: Matrix3) -> Pose:
    """The same pose, its current matrix read from another copy of it."""
    return Pose(pose.centre, Rotation(current, pose.rotation.small))
