"""Robust weights: how much an observation counts, given how far it is off.

A loss gives a weight w(u) to an observation whose residuals, divided by their sigmas, have the norm u: one
weight for all residuals of an observation. The solution is found by iteratively reweighted least squares:
weights are those of the residuals at the start of each iteration, and multiply the inverse squares of the
sigmas. All constants are in sigmas.

| loss | w(u) | for large u |
|---|---|---|
| Huber | 1, or k / u beyond k | the effect stays constant |
| L1 | 1 / u | the same, everywhere |
| Attenuated (MMVII) | 1 / (1 + (u / a)^p), 0 beyond a threshold | as L1 when p = 1 |
| Cauchy | 1 / (1 + (u / c)^2) | the effect falls as 1 / u |
| GemanMcClure | 1 / (1 + (u / c)^2)^2 | it falls as 1 / u^3 |
| Tukey | (1 - (u / c)^2)^2, 0 beyond c | none |
| IGG3 | 1, k / u ((r - u) / (r - k))^2 beyond k, 0 beyond r | none |
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Protocol, Self

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest


class Loss(Protocol):
    """What gives weights to observations."""

    def weights(self, u: FloatArray) -> FloatArray:
        """(n,) weights for norms of normalised residuals (n,)."""

    def widened(self, factor: float) -> Loss:
        """The same loss with its constants times a factor: closer to least squares when it is above 1."""


@dataclass(frozen=True)
class _Scaled:
    """A loss whose constants are positive lengths on the axis of u."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{type(self).__name__}: {entry.name} must be positive, not {value}")

    def widened(self, factor: float) -> Self:
        """The same loss with its constants times a factor."""
        return replace(self, **{entry.name: factor * getattr(self, entry.name) for entry in fields(self)})


@dataclass(frozen=True)
class Huber(_Scaled):
    """Least squares up to `k`, least absolute residuals beyond (Huber, 1964).

    Attributes:
        k: 1.345 keeps 95 % of the efficiency for normal errors.
    """

    k: float = 1.345

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        return self.k / np.maximum(u, self.k)


@dataclass(frozen=True)
class L1(_Scaled):
    """Least absolute residuals; quadratic within `smallest` of zero, so that no weight is infinite."""

    smallest: float = 1e-4

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        return 1.0 / np.maximum(u, self.smallest)


@dataclass(frozen=True)
class Cauchy(_Scaled):
    """Attributes: c: 2.385 keeps 95 % of the efficiency for normal errors."""

    c: float = 2.385

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        return 1.0 / (1.0 + np.square(u / self.c))


@dataclass(frozen=True)
class GemanMcClure(_Scaled):
    """Attributes: c: residual where the weight is a quarter."""

    c: float = 3.0

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        return 1.0 / np.square(1.0 + np.square(u / self.c))


@dataclass(frozen=True)
class Tukey(_Scaled):
    """Biweight: observations beyond `c` are left out; it needs a start that is nearly right.

    Attributes:
        c: 4.685 keeps 95 % of the efficiency for normal errors.
    """

    c: float = 4.685

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        return np.square(np.maximum(0.0, 1.0 - np.square(u / self.c)))


@dataclass(frozen=True)
class IGG3(_Scaled):
    """Three parts: kept up to `keep`, attenuated up to `reject`, left out beyond (Yang, 1999)."""

    keep: float = 1.5
    reject: float = 4.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.reject <= self.keep:
            raise InputError(f"IGG3: reject ({self.reject}) must be above keep ({self.keep})")

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        part = np.clip((self.reject - u) / (self.reject - self.keep), 0.0, 1.0)
        return self.keep / np.maximum(u, self.keep) * np.square(part)


@dataclass(frozen=True)
class Attenuated:
    """The weight of MMVII's bundle adjustment (`cStdWeighterResidual`), its constants divided by sigma.

    Attributes:
        attenuation: where the weight is one half; None for a constant weight.
        threshold: observations beyond it are left out; None for none.
        exponent: 1 tends to least absolute residuals, 2 is Cauchy's.
    """

    attenuation: float | None = 1.0
    threshold: float | None = None
    exponent: float = 1.0

    def __post_init__(self) -> None:
        for name in ("attenuation", "threshold", "exponent"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise InputError(f"Attenuated: {name} must be positive, not {value}")

    def widened(self, factor: float) -> Attenuated:
        """The same loss with its lengths times a factor."""
        attenuation = None if self.attenuation is None else factor * self.attenuation
        threshold = None if self.threshold is None else factor * self.threshold
        return Attenuated(attenuation, threshold, self.exponent)

    def weights(self, u: FloatArray) -> FloatArray:
        """Weights for norms of normalised residuals (n,)."""
        if self.attenuation is None:
            weights = np.ones_like(u)
        else:
            weights = 1.0 / (1.0 + (u / self.attenuation) ** self.exponent)
        return weights if self.threshold is None else np.where(u > self.threshold, 0.0, weights)


LOSSES: dict[str, type[Loss]] = {
    loss.__name__.lower(): loss for loss in (Huber, L1, Cauchy, GemanMcClure, Tukey, IGG3, Attenuated)
}
"""The losses by name, in lower case."""
OTHER_NAMES = {"iggiii": "igg3", "mmvii": "attenuated"}
"""What else some are called."""


def named_loss(name: str) -> Loss:
    """The loss of a name, with its usual constants; case, blanks, hyphens and underscores do not count.

    Raises:
        InputError: No loss has that name; the message gives the nearest ones.
    """
    plain = "".join(letter for letter in name.lower() if letter.isalnum())
    plain = OTHER_NAMES.get(plain, plain)
    if plain not in LOSSES:
        raise InputError(f"no loss is named {nearest(name, LOSSES)}")
    return LOSSES[plain]()
