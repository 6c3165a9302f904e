"""Epipolar residuals: whether two orientations agree, from points that both images see."""

import importlib
from typing import TYPE_CHECKING, Any

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

_HOMES = {
    "field": ("Fit", "Polynomial", "exponents", "fit", "fit_field", "percentiles", "robust_weights"),
    "clouds": ("fit_cloud", "percentile_text", "reduced", "residual_cloud"),
    "page": ("residual_page",),
    "satellites": ("CorrectedSensor", "RationalSensor"),
    "residual": ("EpipolarResiduals", "epipolar_residuals"),
    "sensors": ("OrientedCamera", "Pinhole", "Sensor"),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "CorrectedSensor",
    "EpipolarResiduals",
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
    "percentile_text",
    "percentiles",
    "reduced",
    "residual_cloud",
    "residual_page",
    "robust_weights",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'obseq.images.epipolar' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.images.epipolar.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
