"""Sensors known by their images of the ground: correction by a polynomial of the image, rational functions.

Ground coordinates are those of the sensor's own frame; image coordinates are raw pixels (line or column first
as the sensor says), not normalised.
"""

from dataclasses import dataclass
from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Point2, Point3, Vector
from obseq.formulas.distortion import polynomial, polynomial2
from obseq.formulas.functions import Scalar, let

GENERIC = "MMVII Formulas_GenSensor.h"


@dataclass(frozen=True)
class ImagePolynomial:
    """A polynomial correction of image coordinates: the identity plus every term up to a total degree.

    Attributes:
        degree: The total degree.
    """

    degree: int

    @property
    def powers(self) -> tuple[tuple[int, int], ...]:
        """The powers (i, j) of the terms, by i then by j."""
        return tuple((i, j) for i in range(self.degree + 1) for j in range(self.degree + 1 - i))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the coefficients `x_i_j`, `y_i_j` of `x^i y^j` in each component."""
        return tuple(f"{on}_{i}_{j}" for i, j in self.powers for on in "xy")

    def correct(self, point: Point2, parameters: tuple[Scalar, ...]) -> Point2:
        """The point plus its correction."""
        dx = polynomial2(dict(zip(self.powers, parameters[0::2], strict=True)), *point)
        dy = polynomial2(dict(zip(self.powers, parameters[1::2], strict=True)), *point)
        return Point2(point.x + dx, point.y + dy)


@dataclass(frozen=True)
class ImageCorrection(ImagePolynomial, Formula):
    """Polynomial correction of the image of a sensor, as a map of the plane, not a residual.

    Value: `(x + sum x_i_j x^i y^j, y + sum y_i_j x^i y^j)` with x = `xPix`, y = `yPix`, in pixels. Defined
    everywhere.
    """

    pattern = "Dist_Polyn2D_Degree_{degree}_EqDist"
    source = GENERIC

    @property
    def outputs(self) -> tuple[str, ...]:
        """The components of the corrected point."""
        return ("x", "y")

    def residual(
        self, point: Annotated[Point2, "xPix", "yPix"], *, parameters: Annotated[Vector, "parameters"]
    ) -> Point2:
        """The corrected point (pixels)."""
        return self.correct(point, parameters)


@dataclass(frozen=True)
class CorrectedSensor(ImagePolynomial, Formula):
    """Image of a ground point in a sensor known by its tangent map, corrected by a polynomial.

    Residual: `(I + sum x_i_j I^i J^j - IObs, J + sum y_i_j I^i J^j - JObs)` in pixels, where (I, J) is the
    image without correction, `IP0 + gradient_I . (ground - P0)` and the same for J. Defined everywhere.
    """

    pattern = "Dist_Polyn2D_Degree_{degree}_EqColin"
    source = GENERIC

    def residual(
        self,
        ground: Annotated[Point3, "XGround", "YGround", "ZGround"],
        parameters: Annotated[Vector, "parameters"],
        *,
        image: Annotated[Point2, "IObs", "JObs"],
        ground_0: Annotated[Point3, "P0x", "P0y", "P0z"],
        image_0: Annotated[Point2, "IP0", "JP0"],
        gradient_i: Annotated[Point3, "dIdX", "dIDY", "dIdZ"],
        gradient_j: Annotated[Point3, "dJdX", "dJDY", "dJdZ"],
    ) -> Point2:
        """The corrected image, minus the image observed (pixels)."""
        moved = ground - ground_0
        predicted = Point2(image_0.x + gradient_i.dot(moved), image_0.y + gradient_j.dot(moved))
        return self.correct(let("predicted", predicted), parameters) - image

    @property
    def outputs(self) -> tuple[str, ...]:
        """The observed coordinates."""
        return ("IObs", "JObs")


COEFFICIENTS = 20
"""Coefficients of a cubic polynomial of three variables."""


class RationalCamera(Formula):
    """Rational polynomial camera: image coordinates of a ground point and its height, not a residual.

    Value: `OffOut + ScaleOut (P_INum/P_IDen, P_JNum/P_JDen, z)` by components, the third affine in Z, where
    x, y, z are `(X - OffIn_x)/ScaleIn_x` and so on; P is a cubic in the order of RPC00B, whose first variable
    is y (the longitude there), the second x. Undefined where a denominator vanishes.
    """

    pattern = "RPC_Transfo"
    source = "MMVII Formulas_RPC.h"
    typical = {
        "scale_in": (2.0, 0.5),
        "i_denominator": (0.0, 0.05),
        "j_denominator": (0.0, 0.05),
        "IDen_0": (1.0, 0.0),
        "JDen_0": (1.0, 0.0),
    }
    i_numerator = tuple(f"INum_{k}" for k in range(COEFFICIENTS))
    i_denominator = tuple(f"IDen_{k}" for k in range(COEFFICIENTS))
    j_numerator = tuple(f"JNum_{k}" for k in range(COEFFICIENTS))
    j_denominator = tuple(f"JDen_{k}" for k in range(COEFFICIENTS))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Both image coordinates and the height."""
        return ("i", "j", "z")

    def residual(
        self,
        ground: Annotated[Point3, "X", "Y", "Z"],
        *,
        offset_in: Annotated[Point3, "OffIn"],
        scale_in: Annotated[Point3, "ScaleIn"],
        offset_out: Annotated[Point3, "OffOut"],
        scale_out: Annotated[Point3, "ScaleOut"],
        i_numerator: Annotated[Vector, "i_numerator"],
        i_denominator: Annotated[Vector, "i_denominator"],
        j_numerator: Annotated[Vector, "j_numerator"],
        j_denominator: Annotated[Vector, "j_denominator"],
    ) -> Point3:
        """The image coordinates and the height."""
        x = let("x", (ground.x - offset_in.x) / scale_in.x)
        y = let("y", (ground.y - offset_in.y) / scale_in.y)
        z = let("z", (ground.z - offset_in.z) / scale_in.z)
        i_above, i_below = (
            let("i_above", cubic(i_numerator, x, y, z)),
            let("i_below", cubic(i_denominator, x, y, z)),
        )
        j_above, j_below = (
            let("j_above", cubic(j_numerator, x, y, z)),
            let("j_below", cubic(j_denominator, x, y, z)),
        )
        i, j = i_above / i_below, j_above / j_below
        return Point3(
            offset_out.x + scale_out.x * i, offset_out.y + scale_out.y * j, offset_out.z + scale_out.z * z
        )


def cubic(c: tuple[Scalar, ...], x: Scalar, y: Scalar, z: Scalar) -> Scalar:
    """A cubic of three variables with its coefficients in the order of RPC00B.

    1, y, x, z, yx, yz, xz, y^2, x^2, z^2, xyz, y^3, y x^2, y z^2, y^2 x, x^3, x z^2, y^2 z, x^2 z, z^3.
    """
    z_0 = polynomial2(
        {
            (0, 0): c[0],
            (0, 1): c[1],
            (1, 0): c[2],
            (1, 1): c[4],
            (0, 2): c[7],
            (2, 0): c[8],
            (0, 3): c[11],
            (2, 1): c[12],
            (1, 2): c[14],
            (3, 0): c[15],
        },
        x,
        y,
    )
    z_1 = polynomial2(
        {(0, 0): c[3], (0, 1): c[5], (1, 0): c[6], (1, 1): c[10], (0, 2): c[17], (2, 0): c[18]}, x, y
    )
    z_2 = polynomial2({(0, 0): c[9], (0, 1): c[13], (1, 0): c[16]}, x, y)
    return polynomial((z_0, z_1, z_2, c[19]), z)


MMVII_DEGREES = range(4)
"""Degrees that MMVII generates."""

SENSORS: tuple[Formula, ...] = (
    *(ImageCorrection(degree) for degree in MMVII_DEGREES),
    *(CorrectedSensor(degree) for degree in MMVII_DEGREES),
    RationalCamera(),
)
