"""The other files of the panel: points as text, a calibration and a pose in JSON, what the folders hold."""

import numpy as np
import panel
import pytest

from obseq.images import ControlPoints
from obseq.project.cameras import read_calibration


def test_the_points_as_text_are_those_of_the_file(shared_data):
    path = shared_data / "mmvii-bundle-panel/Positions-3D-14bit_lookup.txt"
    rows = [line.split() for line in path.read_text().splitlines() if line.strip()]
    text = ControlPoints.of(
        [row[0].zfill(3) for row in rows], np.array([row[1:4] for row in rows], dtype=float)
    )
    given = panel.control_points(shared_data)
    np.testing.assert_allclose(given.select(text.names).coordinates, text.coordinates, atol=1e-6)
    assert len(given.names) == 239
    assert len(set(panel.measures(shared_data).point_names)) == 73


def test_the_calibration_in_json_is_that_of_the_xml(shared_data):
    name = "CalibIntr_CamNIKON_D5600_Add043_Foc24"
    found = read_calibration(shared_data / f"mmvii-bundle-panel/json/{name}.json")
    stored = panel.cameras(shared_data, "BA2")[name]
    np.testing.assert_allclose(found.parameters, stored.parameters, rtol=1e-13)


@pytest.mark.parametrize(("body", "count"), [("043", 20), ("671", 16)])
def test_there_are_as_many_calibrations_as_the_medians_are_of(shared_data, body, count):
    assert len(list((shared_data / panel.FOLDER / "Ori/11P").glob(f"Calib-PerspCentral-{body}*"))) == count
