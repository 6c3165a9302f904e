"""Scales of instruments that nothing determines: no length is known beside the distances that have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.errors import InputError, SingularSystemError
from obseq.survey.adjustment.loose_motions import UNDETERMINED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from obseq.leastsquares import LeastSquares
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.initial.left_out import Determined


def check_scales(
    start: Determined,
    equations: Equations,
    equations_of: Callable[[Determined], Equations],
    whole: Callable[..., Determined],
) -> None:
    """Refuses to estimate a scale that the observations and the datum do not determine.

    Args:
        start: The network.
        equations: Its equations.
        equations_of: A network -> its equations.
        whole: A network -> what of it is determined.

    Raises:
        InputError: naming the scales.
    """
    scales = equations.shared.scales()
    if not scales:
        return
    equations = equations_of(start)
    before = _defect(equations.system)
    equations.system.freeze(list(scales.values()))
    if before > _defect(equations.system):
        raise _error(scales)
    equations = equations_of(whole(start))
    solution = equations.system.solve(max_iterations=0, covariance=True)
    scales = equations.shared.scales()
    sigmas = solution.precisions(list(scales.values()), a_priori=True)[:, 0].tolist()
    loose = [
        f"{name} (+- {sigma:.0%})" for name, sigma in zip(scales, sigmas, strict=True) if sigma > UNDETERMINED
    ]
    if loose:
        raise _error(loose)


def _defect(system: LeastSquares) -> int:
    """Number of unknowns that nothing but a datum determines."""
    try:
        system.solve(max_iterations=1)
    except SingularSystemError as error:
        return error.defect or 0
    return system.datum_defect


def _error(names: Iterable[str]) -> InputError:
    return InputError(
        f"nothing determines the scale of {', '.join(names)}: the network has no length beside the distances "
        "whose scale is asked for; let two known points hold it (datum given; inner constraints give no "
        "length), or do not estimate the scale"
    )
