"""Slips behind offsets and scales of distances: told where chance hardly gives them."""

import numpy as np
import pytest

from obseq.diagnosis.protocol import Change
from obseq.survey.causes import slips
from obseq.survey.causes.constants import CONSTANT, SCALE


def told(code: str, size: float, sigma: float) -> list[str]:
    """Codes of the slips behind an offset or a share."""
    change = Change(0, np.array([size]), np.array([sigma]))
    return [slip.code for slip in slips.FINDERS[code](None, change, None)]


@pytest.mark.parametrize(
    ("size", "sigma", "codes"),
    [
        (0.0345, 1e-4, ["W120"]),
        (-0.0345, 1e-4, ["W120"]),
        (0.0400, 2.5e-4, ["W120"]),
        (0.0400, 2.7e-4, []),  # nine prisms, each within three sigmas: a third of all offsets would fit one
        (0.0200, 1e-4, []),
    ],
)
def test_an_offset_is_a_difference_of_prisms(size: float, sigma: float, codes: list[str]) -> None:
    assert told(CONSTANT.code, size, sigma) == codes


@pytest.mark.parametrize(
    ("share", "codes"), [(1.0 - 0.3048, ["W106"]), (1.0 - 1.0 / 0.3048, ["W107"]), (1.0 - 0.3058, [])]
)
def test_a_scale_is_that_of_a_unit(share: float, codes: list[str]) -> None:
    assert told(SCALE.code, share, 1e-5) == codes
