"""A result that is read again answers for one point, and says what it does not hold."""

from importlib.resources import files

import numpy as np
import pytest

from obseq import load
from obseq.errors import InputError
from obseq.survey import Network, Quality

DEMO = files("obseq.survey") / "data"


@pytest.fixture(scope="module")
def adjustment():
    network = Network.read(f"{DEMO}/demo.obs", f"{DEMO}/demo.cor", points_crs="IGNF:LAMB93")
    return network.adjust(quality=Quality(ellipses=0.95))


def test_covariances_and_ellipses_are_those_of_the_adjustment(adjustment, tmp_path):
    adjustment.save(tmp_path / "site.json")
    record = load(tmp_path / "site.json")
    np.testing.assert_allclose(record.covariance("PtB"), adjustment.covariance("PtB"), rtol=1e-12)
    found, expected = record.ellipse("PtC"), adjustment.ellipse("PtC")
    assert found.semi_major == pytest.approx(expected.semi_major)
    assert found.bearing == pytest.approx(expected.bearing)


def test_what_a_record_does_not_hold_is_said(adjustment):
    record = adjustment.record()
    with pytest.raises(InputError, match="Pt is no point of this record; its points are Pt"):
        record.covariance("Pt")
    with pytest.raises(InputError, match=r"of level 0.95, not 0.5: .* Quality\(ellipses=0.5\)"):
        record.ellipse("PtC", level=0.5)


def test_a_table_is_saved_as_csv_alone(adjustment, tmp_path):
    with pytest.raises(InputError, match=r"end the name in \.csv"):
        adjustment.table("observations").save(tmp_path / "residuals.xlsx")
    assert not list(tmp_path.iterdir())
