"""Registration of a model on an image: position by a homothety or an affinity, radiometry by a line.

The image is read near the current position of the model point, at an offset in pixels from an origin
`(PtX0_H, PtY0_H)`: between the four pixels of a square, or from a value and its gradient. Residuals are model
minus image, in grey levels: the opposite order of the other formulas, MMVII's.
"""

from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number, Point2, Radiometry, Unit
from obseq.formulas.functions import Scalar, let

SOURCE = "MMVII Formulas_ImagesDeform.h"

Origin = Annotated[Point2, "PtX0_H", "PtY0_H", Unit("pixel")]
Translation = Annotated[Point2, "GeomTrX", "GeomTrY", Unit("pixel")]
ModelPoint = Annotated[Point2, "xMod", "yMod"]
ModelValue = Annotated[Radiometry, "ValueMod"]
Gain = Annotated[Number, "RadSc"]
Offset = Annotated[Radiometry, "RadTr"]
Homothety = Annotated[Number, "GeomSc"]

PIXELS = {"im_00": (100.0, 50.0), "im_10": (90.0, 50.0), "im_01": (80.0, 50.0), "im_11": (110.0, 50.0)}
MODEL = {"value": (100.0, 50.0), "point": (0.0, 5.0), "gain": (1.0, 0.3), "offset": (0.0, 20.0)}


class DeformImHomotethy(Formula):
    """Model placed on an image by a homothety, the image read by bilinear interpolation.

    Residual: `RadTr + RadSc ValueMod - I(X, Y)` (grey levels) with `X = GeomTrX + GeomSc xMod`, `Y = GeomTrY
    + GeomSc yMod` (pixels), and I bilinear in the square of pixels whose lowest corner is `(PtX0_H, PtY0_H)`;
    `Im10_H` is the next pixel along x. Defined everywhere; outside the square I is extrapolated.
    """

    source = SOURCE
    typical: ClassVar = {
        **PIXELS,
        **MODEL,
        "scale": (1.0, 0.1),
        "origin": (0.0, 2.0),
        "translation": (0.0, 2.0),
    }

    def residual(
        self,
        gain: Gain,
        offset: Offset,
        scale: Homothety,
        translation: Translation,
        *,
        origin: Origin,
        im_00: Annotated[Radiometry, "Im00_H"],
        im_10: Annotated[Radiometry, "Im10_H"],
        im_01: Annotated[Radiometry, "Im01_H"],
        im_11: Annotated[Radiometry, "Im11_H"],
        point: ModelPoint,
        value: ModelValue,
    ) -> Scalar:
        """The radiometry of the model, minus that of the image."""
        place = let("place", translation + scale * point - origin)
        return offset + gain * value - bilinear(place, im_00, im_10, im_01, im_11)


class LGrad_DeformImHomotethy(Formula):  # noqa: N801  (MMVII's name)
    """Model placed on an image by a homothety, the image read by its value and gradient.

    Residual: `RadTr + RadSc ValueMod - (Im_H + Gx_H (X - PtX0_H) + Gy_H (Y - PtY0_H))` (grey levels) with `X
    = GeomTrX + GeomSc xMod`, `Y = GeomTrY + GeomSc yMod` (pixels); `(PtX0_H, PtY0_H)` is the current
    position, where the image and its gradient were read. Defined everywhere.
    """

    source = SOURCE
    typical: ClassVar = {
        **MODEL,
        "image": (100.0, 50.0),
        "gradient": (0.0, 10.0),
        "scale": (1.0, 0.1),
        "origin": (0.0, 2.0),
        "translation": (0.0, 2.0),
    }

    def residual(
        self,
        gain: Gain,
        offset: Offset,
        scale: Homothety,
        translation: Translation,
        *,
        origin: Origin,
        image: Annotated[Radiometry, "Im_H"],
        gradient: Annotated[Point2, "Gx_H", "Gy_H", Unit("grey level/pixel")],
        point: ModelPoint,
        value: ModelValue,
    ) -> Scalar:
        """The radiometry of the model, minus that of the image."""
        place = let("place", translation + scale * point - origin)
        return offset + gain * value - (image + gradient.dot(place))


class DeformImAffinity(Formula):
    """Model placed on an image by an affinity, the image read by bilinear interpolation.

    Residual: `RadTr + RadSc ValueMod - I(X, Y)` (grey levels) with `X = GeomTrX + GeomScA11 xMod + GeomScA12
    yMod`, `Y = GeomTrY + GeomScA21 xMod + GeomScA22 yMod` (pixels), and I as in `DeformImHomotethy`. Defined
    everywhere.
    """

    source = SOURCE
    typical: ClassVar = {
        **PIXELS,
        **MODEL,
        "row_x": (0.5, 0.5),
        "row_y": (0.5, 0.5),
        "origin": (0.0, 2.0),
        "translation": (0.0, 2.0),
    }

    def residual(
        self,
        gain: Gain,
        offset: Offset,
        row_x: Annotated[Point2, "GeomScA11", "GeomScA12"],
        row_y: Annotated[Point2, "GeomScA21", "GeomScA22"],
        translation: Translation,
        *,
        origin: Origin,
        im_00: Annotated[Radiometry, "Im00_H"],
        im_10: Annotated[Radiometry, "Im10_H"],
        im_01: Annotated[Radiometry, "Im01_H"],
        im_11: Annotated[Radiometry, "Im11_H"],
        point: ModelPoint,
        value: ModelValue,
    ) -> Scalar:
        """The radiometry of the model, minus that of the image."""
        place = let("place", translation + Point2(row_x.dot(point), row_y.dot(point)) - origin)
        return offset + gain * value - bilinear(place, im_00, im_10, im_01, im_11)


class DeformImHomography(Formula):
    """Model placed on an image by a homography, with its light and its sharpness.

    Residual: `RadTr + RadTr_ . m + (RadSc + RadSc_ . m) (ValueMod + Blur SpreadMod) - (Im_H + Gx_H (X -
    PtX0_H) + Gy_H (Y - PtY0_H))` (grey levels) with the model point `m = (xMod, yMod)`, `p = A m / (1 +
    GeomPersp . m)` and `(X, Y) = GeomTr + p + |p|^2 GeomBend` (pixels), A as in `DeformImAffinity`. The
    perspective is relative to the model's origin, whose image `GeomTr` is. The bend is what a radial
    distortion does within the model, besides what A and the perspective take: `k r / f^2` for `k (r / f)^2`.
    `SpreadMod` is the change of the model's value when it is blurred by one
    pixel more; `Blur` is the blur that is added (pixels). `(PtX0_H, PtY0_H)` is where the image was read.

    The gradient should be the model's, at that place: one taken from the image has the same noise as the
    value, which shifts the place of the model. Undefined where `1 + GeomPersp . m` is 0.
    """

    source = "obseq; after MMVII Formulas_ImagesDeform.h"
    typical: ClassVar = {
        **MODEL,
        "gain_slope": (0.0, 0.1),
        "offset_slope": (0.0, 5.0),
        "blur": (0.0, 0.2),
        "spread": (0.0, 30.0),
        "row_x": (0.5, 0.5),
        "row_y": (0.5, 0.5),
        "perspective": (0.0, 0.02),
        "bend": (0.0, 0.001),
        "image": (100.0, 50.0),
        "gradient": (0.0, 10.0),
        "origin": (0.0, 2.0),
        "translation": (0.0, 2.0),
    }

    def residual(
        self,
        gain: Gain,
        offset: Offset,
        gain_slope: Annotated[Point2, "RadScX", "RadScY"],
        offset_slope: Annotated[Point2, "RadTrX", "RadTrY"],
        blur: Annotated[Number, "Blur"],
        row_x: Annotated[Point2, "GeomScA11", "GeomScA12"],
        row_y: Annotated[Point2, "GeomScA21", "GeomScA22"],
        perspective: Annotated[Point2, "GeomPerspX", "GeomPerspY"],
        bend: Annotated[Point2, "GeomBendX", "GeomBendY", Unit("1/pixel")],
        translation: Translation,
        *,
        origin: Origin,
        image: Annotated[Radiometry, "Im_H"],
        gradient: Annotated[Point2, "Gx_H", "Gy_H", Unit("grey level/pixel")],
        point: ModelPoint,
        value: ModelValue,
        spread: Annotated[Radiometry, "SpreadMod"],
    ) -> Scalar:
        """The radiometry of the model, minus that of the image."""
        depth = let("depth", 1 + perspective.dot(point))
        away = let("away", (1 / depth) * Point2(row_x.dot(point), row_y.dot(point)))
        place = let("place", translation + away + away.dot(away) * bend - origin)
        light = offset + offset_slope.dot(point)
        contrast = gain + gain_slope.dot(point)
        return light + contrast * (value + blur * spread) - (image + gradient.dot(place))


def bilinear(place: Point2, im_00: Scalar, im_10: Scalar, im_01: Scalar, im_11: Scalar) -> Scalar:
    """The image inside a square of pixels, from its corners: `im_10` the next along x, `im_01` along y."""
    low = im_00 + place.x * (im_10 - im_00)
    high = im_01 + place.x * (im_11 - im_01)
    return low + place.y * (high - low)
