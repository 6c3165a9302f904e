"""What nothing determines of a network, in the words of a surveyor, and what would hold it."""

from __future__ import annotations

from obseq.errors import SingularSystemError
from obseq.leastsquares.diagnosis.singular import grouped

TILT = "rotation about x"
HOLDS = {
    "the position along": "a known point (flag 1 of the point file; 2 for x and y alone, 3 for z alone)",
    "the rotation about": "an azimuth (Azim, code 8), or another known point, for the rotation",
    TILT: "height differences, zenith angles or known heights (flag 3) for the tilt",
    "the scale": "a distance (Dist, code 3), or another known point, for the scale",
    "of shape": "more observations between these points for the shape",
}
"""What holds a motion, by words of its name."""


def in_words(error: SingularSystemError) -> SingularSystemError:
    """The error of a singular network: which points move, how, and what to give to hold them."""
    return SingularSystemError(_message(error), error.unknowns, error.defect, error.kernel, error.movements)


def free_motions_in_words(error: SingularSystemError) -> str:
    """What moves without any residual: "nothing fixes the position along x of A, B (rank deficiency 1)"."""
    free = "; nor ".join(dict.fromkeys(error.movements.values()))
    what = f"nothing fixes {free}" if free else f"the observations do not determine {grouped(error.unknowns)}"
    return what if error.defect is None else f"{what} (rank deficiency {error.defect})"


def _message(error: SingularSystemError) -> str:
    if error.kernel is None:
        return _astray(error)
    return f"{free_motions_in_words(error)}. Give {_remedy(error)}"


def _astray(error: SingularSystemError) -> str:
    """Of an error that comes where the iterations have led."""
    lost = grouped(error.unknowns) if error.unknowns else "some coordinates"
    return (
        f"the iterations lead where the observations do not determine {lost} any more. Observe that more, or "
        "give better approximate coordinates (flag 0 of the point file)"
    )


def _remedy(error: SingularSystemError) -> str:
    """What would hold the motions."""
    free = " and ".join(dict.fromkeys(error.movements.values())).replace("rotation about y", TILT)
    named = [remedy for motion, remedy in HOLDS.items() if motion in free]
    if all(text.endswith(f" of {name}") for name, text in error.movements.items()):
        named.insert(0, "observations from other directions")
    return "; ".join(named) or "more observations of it"
