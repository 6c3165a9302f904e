"""Deflections of the vertical from a geoid file, for networks of any format."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network

SECOND = np.pi / 648_000
SYSTEM = "+proj=sterea +lat_0=48.8 +lon_0=2.4 +k_0=1 +x_0=0 +y_0=0 +datum=WGS84"
COR = "1 A 0 0 10 0.001 0.001 0.001 3 4\n1 B 0 100 12 0.001 0.001 0.001\n0 P 80 60 15\n"
OBS = "7 A B 0 0.001\n5 A P 59.0334 0.001\n6 A P 96.8196 0.001\n3 A P 100.125 0.002\n6 B P 97.87 0.001\n"
LIST = "!#=DNA 3.01 GEO                                    N         xi                 eta\n"


def files(folder, names=("A", "B", "P")):
    (folder / "o.obs").write_text(OBS)
    (folder / "p.cor").write_text(COR)
    rows = [f"{name:<40}{45.0:>10.3f}{-7.5:>19.3f}{12.5:>10.3f}" for name in names]
    (folder / "g.geo").write_text(LIST + "\n".join(rows) + "\n")
    return folder / "o.obs", folder / "p.cor"


def test_points_without_a_deflection_get_that_of_the_geoid(tmp_path):
    network = Network.read(*files(tmp_path), points_crs=SYSTEM, geoid=tmp_path / "g.geo")
    # A keeps its own: 3 east, 4 north; the file has xi (north) before eta (east)
    expected = np.array([[3.0, 4.0], [12.5, -7.5], [12.5, -7.5]]) * SECOND
    np.testing.assert_allclose(network.points.deflections, expected, rtol=1e-12)
    plain = Network.read(*files(tmp_path), points_crs=SYSTEM, ignore=["deflections"])
    moved = network.adjust().points.coordinates - plain.adjust().points.coordinates
    assert 1e-3 < np.linalg.norm(moved[2]) < 2e-2  # some seconds over 100 m


def test_on_the_command_line(tmp_path, capsys):
    obs, cor = map(str, files(tmp_path))
    given = ["adjust", "--obs", obs, "--cor", cor, "--geoid", str(tmp_path / "g.geo")]
    assert main([*given, "--points-crs", SYSTEM]) == 1  # one condition, which does not close: sigma0 is 4
    assert main(given) == 2
    assert "deflections need a place on the Earth" in capsys.readouterr().err


def test_a_geoid_of_other_points_is_refused(tmp_path):
    with pytest.raises(InputError, match="gives no deflection of the vertical for any"):
        Network.read(*files(tmp_path, "XYZ"), points_crs=SYSTEM, geoid=tmp_path / "g.geo")


def test_a_geoid_without_deflections_is_told_to_have_no_part(tmp_path):
    obs, cor = files(tmp_path)
    flat = (tmp_path / "g.geo").read_text().replace("-7.500", " 0.000").replace("12.500", " 0.000")
    (tmp_path / "flat.geo").write_text(flat)
    network = Network.read(obs, cor, points_crs=SYSTEM, geoid=tmp_path / "flat.geo")
    (told,) = (text for text in network.book.warnings if "flat.geo" in text)
    assert "all its deflections of the vertical are 0, and its geoid heights have no part" in told
    assert not Network.read(obs, cor, points_crs=SYSTEM, geoid=tmp_path / "g.geo").book.warnings
