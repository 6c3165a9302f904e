"""Geometry in space: distances, and coordinates in a sub-frame."""

from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import WORLD_TO_LOCAL, Length, Point3, Rotation, norm
from obseq.formulas.functions import Scalar


class Dist3D(Formula):
    """Distance between two points.

    Residual: `|p2 - p1| - D`. Undefined where the two points coincide.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "D": (10.0, 5.0)}

    def residual(self, p1: Point3, p2: Point3, *, distance: Annotated[Length, "D"]) -> Scalar:
        """The distance computed from the points, minus the distance observed (m)."""
        return norm(p2 - p1) - distance


class Dist3DParam(Formula):
    """Distance between two points, itself an unknown.

    Residual: `|p2 - p1| - d`. Undefined where the two points coincide.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "d": (10.0, 5.0)}

    def residual(self, distance: Annotated[Length, "d"], p1: Point3, p2: Point3) -> Scalar:
        """The distance computed from the points, minus the unknown distance (m)."""
        return norm(p2 - p1) - distance


class TopoSubFrame(Formula):
    """Vector between two points, observed in a sub-frame of unknown orientation.

    Residual: `(I + [r]x) R (p2 - p1) - v`, with `R` the current rotation from the frame to the sub-frame.
    Defined everywhere.
    """

    source = "MMVII Formulas_Geom3D.h"
    typical = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "vector": (0.0, 10.0)}

    def residual(
        self,
        frame: Annotated[Rotation, "r", "R", WORLD_TO_LOCAL],
        p1: Point3,
        p2: Point3,
        *,
        vector: Annotated[Point3, "v"],
    ) -> Point3:
        """The vector computed in the sub-frame, minus the vector observed there (m)."""
        return frame.inverse() @ (p2 - p1) - vector
