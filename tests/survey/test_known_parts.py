"""Points of a plane network: the coordinates that their flag holds are known, whatever the others are."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.survey import Network

TARGETS = {"C1": (1000, 5000, 200), "C2": (1800, 5100, 230), "C3": (1500, 4300, 210), "C4": (900, 4400, 190)}


def network(folder, new, heights=None, targets=tuple(TARGETS), zero=-0.4):
    """Directions from (1300, 4800) to known points of a plane."""
    known = [
        f"7 {name} {x} {y} {z if heights is None else heights} 0.005" for name, (x, y, z) in TARGETS.items()
    ]
    (folder / "p.cor").write_text("\n".join([*known, new]))
    lines = []
    for name in targets:
        east, north = np.subtract(TARGETS[name][:2], (1300, 4800))
        reading = (np.arctan2(east, north) - zero) * 200 / np.pi % 400
        lines.append(f"{5 if lines else 7} S {name} {float(reading)!r} 0.0005")
    (folder / "o.obs").write_text("\n".join(lines))
    return Network.read([folder / "o.obs"], [folder / "p.cor"])


@pytest.mark.parametrize("heights", [None, 200, 150])
@pytest.mark.parametrize("place", ["0 0 150", "1310 4790 150"])
def test_a_resection_in_plan_keeps_the_height_that_is_held(tmp_path, heights, place):
    adjustment = network(tmp_path, f"6 S {place}", heights).adjust()
    assert not adjustment.left_out
    np.testing.assert_allclose(adjustment.points.coordinates[-1], (1300, 4800, 150), rtol=0, atol=1e-4)


def test_a_resection_without_any_height_is_one_position_in_plan(tmp_path):
    adjustment = network(tmp_path, "").adjust()
    np.testing.assert_allclose(adjustment.points.coordinates[-1], (1300, 4800, np.nan), rtol=0, atol=1e-4)


def test_two_directions_contradict_nothing(tmp_path):
    given = network(tmp_path, "6 S 1310 4790 0", 0, ("C1", "C2"))
    with pytest.raises(InputError, match="one more direction is needed") as refused:
        given.adjust()
    assert "contradicts" not in str(refused.value)
