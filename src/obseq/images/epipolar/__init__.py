"""Epipolar residuals: whether two orientations agree, from points that both images see."""

from typing import TYPE_CHECKING

from obseq.lazy import lazy_names

if TYPE_CHECKING:
    from obseq.images.epipolar.clouds import fit_cloud, percentile_text, reduced, residual_cloud
    from obseq.images.epipolar.field import (
        Fit,
        Polynomial,
        exponents,
        fit,
        fit_field,
        percentiles,
        robust_weights,
    )
    from obseq.images.epipolar.page import residual_page
    from obseq.images.epipolar.residual import EpipolarResiduals, epipolar_residuals
    from obseq.images.epipolar.satellites import CorrectedSensor, RationalSensor
    from obseq.images.epipolar.sensors import OrientedCamera, Pinhole, Sensor
    from obseq.images.epipolar.verdict import EpipolarVerdict, judged

_HOMES = {
    "field": ("Fit", "Polynomial", "exponents", "fit", "fit_field", "percentiles", "robust_weights"),
    "clouds": ("fit_cloud", "percentile_text", "reduced", "residual_cloud"),
    "page": ("residual_page",),
    "satellites": ("CorrectedSensor", "RationalSensor"),
    "residual": ("EpipolarResiduals", "epipolar_residuals"),
    "sensors": ("OrientedCamera", "Pinhole", "Sensor"),
    "verdict": ("EpipolarVerdict", "judged"),
}

__all__ = [
    "CorrectedSensor",
    "EpipolarResiduals",
    "EpipolarVerdict",
    "Fit",
    "OrientedCamera",
    "Pinhole",
    "Polynomial",
    "RationalSensor",
    "Sensor",
    "epipolar_residuals",
    "exponents",
    "fit",
    "fit_cloud",
    "fit_field",
    "judged",
    "percentile_text",
    "percentiles",
    "reduced",
    "residual_cloud",
    "residual_page",
    "robust_weights",
]

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__)
