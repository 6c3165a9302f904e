"""Epipolar residuals: whether two orientations agree, from points that both images see."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obseq.images.epipolar.field import (
        Fit,
        Polynomial,
        exponents,
        fit,
        fit_field,
        percentiles,
        robust_weights,
    )
    from obseq.images.epipolar.residual import EpipolarResiduals, epipolar_residuals
    from obseq.images.epipolar.sensors import Pinhole, Sensor

_HOMES = {
    "field": ("Fit", "Polynomial", "exponents", "fit", "fit_field", "percentiles", "robust_weights"),
    "residual": ("EpipolarResiduals", "epipolar_residuals"),
    "sensors": ("Pinhole", "Sensor"),
}
_MODULES = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "EpipolarResiduals",
    "Fit",
    "Pinhole",
    "Polynomial",
    "Sensor",
    "epipolar_residuals",
    "exponents",
    "fit",
    "fit_field",
    "percentiles",
    "robust_weights",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'obseq.images.epipolar' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.images.epipolar.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
