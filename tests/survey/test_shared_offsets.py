"""Offsets that zenith angles or distances of a set-up share are one finding, where heights absorb them."""

import pytest

from obseq.survey import Network
from obseq.survey.screening.findings import Cause


@pytest.fixture
def shifted(shared_data, tmp_path):
    """A network of Comp3D's with something added to values of a kind, with a point at one end."""

    def made(names: tuple[str, str, str], code: str, end: int, point: str, added: float) -> Network:
        folder, obs, cor = names
        lines = (shared_data / folder / obs).read_text(encoding="latin-1").splitlines()
        for k, line in enumerate(lines):
            words = line.split()
            if len(words) > 4 and words[0] == code and words[end] == point:
                words[3] = f"{float(words[3]) + added:.5f}"
                lines[k] = " ".join(words)
        path = tmp_path / obs
        kept = [line for line in lines if names == FIGURE or line.split()[2:3] in FEW]
        path.write_text("\n".join(kept))
        return Network.read(str(path), str(shared_data / folder / cor))

    return made


FEW = [[str(number)] for number in (*range(1, 5), *range(108, 116), *range(201, 205), 3050)]
"""Targets of the polygon that are enough, the tenth of its points that nothing determines among them."""

FIGURE = ("comp3d-figure", "figure.obs", "figure.cor")
POLYGON = ("comp3d-polygone-k06", "TDA5005.OBS", "TDA5005.cor")
SITES = [
    (FIGURE, "HLLST0001", 0.02, "the 30 zenith angles from HLLST0001", -0.02),
    (POLYGON, "2", 0.05, "the 12 zenith angles from 2", -0.05),  # whose height hangs on them
]


@pytest.mark.parametrize(("names", "point", "added", "what", "fits"), SITES)
def test_an_index_error_of_one_set_up(shifted, names, point, added, what, fits):
    """Ten and 27 right angles, each with a digit that may be wrong, were listed."""
    (error,) = shifted(names, "6", 1, point, added).gross_errors()
    assert error.cause is Cause.INDEX and error.what.startswith(what)
    assert float(error.text.split()[0]) == pytest.approx(fits, abs=0.001)
    assert error.text.endswith("likely an error of the index")


def test_zenith_angles_to_one_target_that_put_it_near_the_zenith(shifted):
    (error,) = shifted(POLYGON, "6", 2, "115", -40.0).gross_errors()
    assert error.cause is Cause.INDEX and error.what.startswith("the 4 zenith angles to 115")
    assert float(error.text.split()[0]) == pytest.approx(40.0, abs=0.005)


def test_the_constant_of_three_distances_where_others_have_no_place(shifted):
    """Ten observations of that network name points that nothing determines."""
    (error,) = shifted(POLYGON, "3", 1, "2", 0.035).gross_errors()
    assert error.cause is Cause.DISTANCES and error.what.startswith("the 3 distances from 2")
    assert error.text.startswith("-0.034")
