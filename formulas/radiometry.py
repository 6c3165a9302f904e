"""Radiometric models of sensors and images: equalisation, stabilisation, vignetting.

The grey level of a pixel is `P_im (Albedo mul + add)`: the albedo of the ground point, a sensor model (radial
factor, polynomial, dark current) and a polynomial of the image. Both use the reduced coordinates of the
pixel, `u = (xIm - Cx) / NormR` and `v = (yIm - Cy) / NormR`: the centre C is the principal point, NormR the
largest distance from it to a corner of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number, Pixel, Point2, Radiometry, Unit, Vector
from obseq.formulas.functions import Scalar, let
from obseq.formulas.naming import Flag, Patterned, Whole

SOURCE = "MMVII Formulas_Radiom.h"

PixelPosition = Annotated[Point2, "xIm", "yIm", Unit("pixel")]
Centre = Annotated[Point2, "Cx", "Cy", Unit("pixel")]
Extent = Annotated[Pixel, "NormR"]
GreyLevel = Annotated[Radiometry, "RadIm"]
ImageCoefficients = Annotated[Vector, "image_coefficients"]
SensorCoefficients = Annotated[Vector, "sensor_coefficients"]

PLACE = {"pixel": (2000.0, 1500.0), "centre": (2000.0, 100.0), "extent": (2500.0, 500.0)}
Exponents = tuple[tuple[int, int], ...]


def image_exponents(degree: int) -> Exponents:
    """Exponents (i, j) of the monomials `u^i v^j` of total degree at most `degree`, i the slowest."""
    return tuple((i, j) for i in range(degree + 1) for j in range(degree + 1 - i))


def polynomial(coefficients: Sequence[Scalar], exponents: Exponents, place: Point2) -> Scalar:
    """The sum of coefficients times monomials."""
    return sum(c * (place.x**i * place.y**j) for c, (i, j) in zip(coefficients, exponents, strict=True))


def radial_factor(coefficients: Sequence[Scalar], rho2: Scalar) -> Scalar:
    """`1 + K0 rho2 + K1 rho2^2 + ...`."""
    return 1 + sum(c * rho2**k for k, c in enumerate(coefficients, 1))


def reduced(pixel: Point2, centre: Point2, extent: Scalar) -> Point2:
    """Coordinates of a pixel from the centre, as a share of the extent of the image."""
    place: Point2 = let("reduced", (1 / extent) * (pixel - centre))
    return place


@dataclass(frozen=True)
class Sensor(Patterned):
    """A sensor model: radial factor, dark current, polynomial.

    Attributes:
        radial: Number of radial coefficients.
        dark_current: True when a dark current is added.
        degree: Degree of the polynomial; None without one.
    """

    radial: int = 5
    dark_current: Annotated[bool, Flag("_WCste")] = False
    degree: Annotated[int | None, Whole(before="_DPolSens")] = None

    pattern = "DRad{radial}{dark_current}{degree}"

    @property
    def exponents(self) -> Exponents:
        """Monomials of the polynomial: without even powers of u alone up to the radial degree, redundant."""
        monomials = image_exponents(self.degree or 0)
        return tuple((i, j) for i, j in monomials if j or i % 2 or i > self.radial)

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        constant = ("DarkCurrent",) if self.dark_current else ()
        radial = tuple(f"K{k}" for k in range(self.radial))
        return constant + radial + tuple(f"Sens_Mon_{i}_{j}" for i, j in self.exponents)

    def evaluate(self, coefficients: Sequence[Scalar], place: Point2) -> tuple[Scalar, Scalar]:
        """What the sensor adds to the radiometry, and its factor.

        With a dark current the polynomial reads its coefficients one place early, from the last radial one:
        an offset of MMVII's code that is part of the values of its formulas, kept so that models can be
        exchanged.
        """
        first = int(self.dark_current)
        radial = coefficients[first : first + self.radial]
        start, monomials = self.radial, self.exponents
        polynomial_ = polynomial(coefficients[start : start + len(monomials)], monomials, place)
        factor = radial_factor(radial, let("rho2", place.dot(place))) + polynomial_
        return (coefficients[0] if first else 0), let("factor", factor)


@dataclass(frozen=True)
class _OfSensor(Formula):
    """What formulas with a sensor model share."""

    sensor: Sensor = Sensor()
    source = SOURCE

    @property
    def sensor_coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients of the sensor."""
        return self.sensor.coefficients


@dataclass(frozen=True)
class _OfImage(_OfSensor):
    """What formulas with a sensor model and an image polynomial share."""

    degree: int = 0

    @property
    def image_coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients of the image."""
        return tuple(f"Mon_{i}_{j}" for i, j in image_exponents(self.degree))


@dataclass(frozen=True)
class RadiomCalibPolIm(Formula):
    """Radiometric polynomial of one image: a correction, not a residual.

    Value: `sum Mon_i_j u^i v^j`, dimensionless; neutral when the first coefficient is 1 and the others 0.
    Undefined where `NormR` is 0. MMVII has its value only, for degrees 0 to 3; here it has derivatives as
    well.

    Attributes:
        degree: Degree of the polynomial.
    """

    degree: int = 0

    pattern = "RadiomCalibPolIm_{degree}"
    source = SOURCE
    typical: ClassVar = PLACE

    @property
    def outputs(self) -> tuple[str, ...]:
        """The value of the polynomial."""
        return ("correction",)

    @property
    def image_coefficients(self) -> tuple[str, ...]:
        """Names of the coefficients of the image."""
        return tuple(f"Mon_{i}_{j}" for i, j in image_exponents(self.degree))

    def residual(
        self, image: ImageCoefficients, *, pixel: PixelPosition, centre: Centre, extent: Extent
    ) -> Scalar:
        """The value of the polynomial at the pixel."""
        return polynomial(image, image_exponents(self.degree), reduced(pixel, centre, extent))


@dataclass(frozen=True)
class RadiomCalibRadSensor(_OfSensor):
    """Radiometric model of a sensor: two corrections, additive (grey levels) and multiplicative.

    Values: `add = DarkCurrent`, 0 without one, and `mul = 1 + sum_k K_k r^(2k+2) + sum Sens_Mon_i_j u^i v^j`,
    with `r^2 = u^2 + v^2`. Undefined where `NormR` is 0. With both a dark current and a polynomial the latter
    reads its coefficients one place early, from the last K on, as MMVII codes it: the last one is ignored.
    MMVII has its values only, for 5 radial coefficients; here they have derivatives as well. The monomials
    leave out `u^i` for i even and at most the number of radial coefficients.

    Attributes:
        sensor: The sensor model.
    """

    pattern = "RadiomCalibRadSensor_{sensor}"
    typical: ClassVar = PLACE

    @property
    def outputs(self) -> tuple[str, ...]:
        """The two corrections."""
        return ("add", "mul")

    def residual(
        self, sensor: SensorCoefficients, *, pixel: PixelPosition, centre: Centre, extent: Extent
    ) -> tuple[Scalar, Scalar]:
        """What the sensor adds (grey levels), and its factor."""
        return self.sensor.evaluate(sensor, reduced(pixel, centre, extent))


@dataclass(frozen=True)
class RadiomEqualisation(_OfImage):
    """Radiometry of a point of the ground in one of several images, which share its albedo.

    Residual: `RadIm - P_im (Albedo mul + add)` (grey levels): observed minus computed, MMVII's order, with
    `P_im` of `RadiomCalibPolIm`, `add` and `mul` of `RadiomCalibRadSensor`, whose offset of coefficients
    applies. Undefined where `NormR` is 0.

    Attributes:
        sensor: The sensor model.
        degree: Degree of the image polynomial.
    """

    pattern = "RadiomEqualisation_{sensor}_DegIm{degree}"
    typical: ClassVar = {**PLACE, "observed": (100.0, 50.0)}

    def residual(
        self,
        albedo: Annotated[Radiometry, "Albedo"],
        sensor: SensorCoefficients,
        image: ImageCoefficients,
        *,
        observed: GreyLevel,
        pixel: PixelPosition,
        centre: Centre,
        extent: Extent,
    ) -> Scalar:
        """The grey level observed, minus the one computed."""
        place = reduced(pixel, centre, extent)
        added, factor = self.sensor.evaluate(sensor, place)
        gain = let("gain", polynomial(image, image_exponents(self.degree), place))
        return observed - gain * (albedo * factor + added)


@dataclass(frozen=True)
class RadiomStabilized(_OfImage):
    """Weak constraint that keeps the polynomial of an image near a constant.

    Residual: `RadIm (Mon_0_0 - P_im)` (grey levels): minus the part of the polynomial of `RadiomCalibPolIm`
    that is not constant. The coefficients of the sensor do not appear; for degree 0 the residual is 0.
    Undefined where `NormR` is 0.

    Attributes:
        sensor: The sensor model, which only names unknowns.
        degree: Degree of the image polynomial.
    """

    pattern = "RadiomStabilized_{sensor}_DegIm{degree}"
    typical: ClassVar = {**PLACE, "observed": (100.0, 50.0)}

    def residual(
        self,
        sensor: SensorCoefficients,
        image: ImageCoefficients,
        *,
        observed: GreyLevel,
        pixel: PixelPosition,
        centre: Centre,
        extent: Extent,
    ) -> Scalar:
        """The grey level times the constant part of the polynomial minus all of it."""
        place = reduced(pixel, centre, extent)
        return -observed * polynomial(image[1:], image_exponents(self.degree)[1:], place)


@dataclass(frozen=True)
class RadiomVignetLin(Formula):
    """Radiometry of a point of the ground in an image with vignetting, corrected before it is compared.

    Residual: `RadIm / (1 + sum_k K_k Rho2^(k+1)) - Albedo MulIm` (grey levels), `Rho2` the squared reduced
    distance of the pixel from the centre: observed minus computed, MMVII's order. Undefined where the radial
    factor is 0. MMVII generates 5 coefficients only.

    Attributes:
        radial: Number of radial coefficients.
    """

    radial: int = 5

    pattern = "RadiomVignetLin_{radial}"
    source = SOURCE
    typical: ClassVar = {
        "observed": (100.0, 50.0),
        "albedo": (100.0, 50.0),
        "gain": (1.0, 0.2),
        "vignetting": (0.0, 0.1),
        "rho2": (0.5, 0.5),
    }

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the radial coefficients."""
        return tuple(f"K{k}" for k in range(self.radial))

    def residual(
        self,
        albedo: Annotated[Radiometry, "Albedo"],
        gain: Annotated[Number, "MulIm"],
        vignetting: Annotated[Vector, "coefficients"],
        *,
        observed: GreyLevel,
        rho2: Annotated[Number, "Rho2"],
    ) -> Scalar:
        """The grey level observed, corrected for vignetting, minus the one computed."""
        return observed / let("factor", radial_factor(vignetting, rho2)) - albedo * gain


SENSORS = tuple(Sensor(5, constant, degree) for constant in (True, False) for degree in (None, 2, 3))
REGISTERED: tuple[Formula, ...] = (
    RadiomVignetLin(5),
    *(RadiomCalibPolIm(degree) for degree in range(4)),
    *(RadiomCalibRadSensor(sensor) for sensor in SENSORS),
    *(RadiomEqualisation(sensor, degree) for sensor in SENSORS for degree in range(4)),
    *(RadiomStabilized(sensor, degree) for sensor in SENSORS for degree in range(4)),
)
"""The members that MMVII generates, to which others can be added on demand."""
