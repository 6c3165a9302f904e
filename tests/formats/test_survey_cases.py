"""Files of surveyors that came out wrong once, with what is right and why."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats import StochasticModel, read_stochastic
from obseq.survey import Network

OF_STARNET = ("--sigmas", "direction=3sec", "distance=2mm", "zenith=5sec")
COORDINATES = ("crs_x", "crs_y", "crs_z")


@pytest.fixture
def adjusted(shared_data, tmp_path, monkeypatch):
    """Goes into a copy of a case, and runs `obseq adjust` there: the result."""

    def run(case, *options):
        (folder,) = (shared_data / "survey-cases").glob(f"{case}-*")
        if not (tmp_path / case).exists():
            shutil.copytree(folder, tmp_path / case)
        monkeypatch.chdir(tmp_path / case)
        assert main(["adjust", *options, "--json", "out.json"]) in (0, 1)
        return json.loads((tmp_path / case / "out.json").read_text())

    return run


def heights(result):
    return {point["name"]: point["crs_z"] for point in result["points"]}


def places(result):
    return np.array([[point[name] for name in COORDINATES] for point in result["points"]])


def test_heights_of_dna_positions_are_above_the_geoid(adjusted):
    """H 100 and 160 with a geoid 30 m above the ellipsoid: those of stations and of position clusters."""
    result = adjusted("01", "net.stn", "net.msr", "--geoid", "net.geo")
    assert heights(result) == pytest.approx({"KIOSK": 130.0, "TOWER": 190.0}, abs=2e-4)
    bare = adjusted("01", "net.stn", "net.msr")
    assert heights(bare) == pytest.approx({"KIOSK": 100.0, "TOWER": 160.0}, abs=2e-4)
    assert "heights above the geoid are taken as above the ellipsoid" in " ".join(bare["warnings"])


def test_an_ellipsoidal_position_of_dna_has_no_geoid(shared_data, tmp_path):
    shutil.copytree(shared_data / "survey-cases/01-dna-position-llh-geoid", tmp_path / "a")
    measured = tmp_path / "a" / "net.msr"
    measured.write_text(measured.read_text().replace("LLH ", "LLh "))
    network = Network.read_project([tmp_path / "a" / "net.stn", measured], geoid=tmp_path / "a" / "net.geo")
    z = network.adjust().record().points[0].crs_z
    assert z == pytest.approx(100.0, abs=2e-4)


def test_deflections_of_a_geoid_are_left_out_on_demand(shared_data, tmp_path):
    shutil.copytree(shared_data / "survey-cases/01-dna-position-llh-geoid", tmp_path / "a")
    geoid, measured = tmp_path / "a" / "net.geo", tmp_path / "a" / "net.msr"
    geoid.write_text(geoid.read_text().replace("0.000              0.000", "5.000             -7.000"))
    line = f"V {'KIOSK':<20}{'TOWER':<20}{'':<20}{'88 45  0.00':>20}{'5.0':>19}\n"
    measured.write_text(measured.read_text() + line)
    files = [tmp_path / "a" / "net.stn", measured]
    deflected = Network.read_project(files, geoid=geoid)
    assert np.isfinite(deflected.points.deflections).all()
    straight = Network.read_project(files, geoid=geoid, ignore=["deflections"])
    assert not np.nan_to_num(straight.points.deflections).any()
    assert "taken as the normal of the ellipsoid: as asked for" in " ".join(straight.book.warnings)


def test_zones_of_digits_are_south(adjusted, tmp_path):
    digits = adjusted("02", "net.stn", "net.msr")
    assert "zones without a hemisphere are taken as south" in " ".join(digits["warnings"])
    (tmp_path / "02" / "with-S.stn").rename(tmp_path / "02" / "net.stn")
    named = adjusted("02", "net.stn", "net.msr")
    np.testing.assert_array_equal(places(digits), places(named))


def test_joined_codes_are_as_many_codes(adjusted):
    joined = adjusted("06", "net.dat", *OF_STARNET)
    spaced = adjusted("06", "spaced.dat", *OF_STARNET)
    np.testing.assert_array_equal(places(joined), places(spaced))
    assert len(joined["iterations"]) == 3


def test_several_data_files_are_one_network(adjusted):
    several = adjusted("08", "day1.dat", "day2.dat", *OF_STARNET)
    included = adjusted("08", "both.dat", *OF_STARNET)
    np.testing.assert_array_equal(places(several), places(included))
    assert len(several["iterations"]) == 3


def test_a_project_of_starnet_needs_no_option(adjusted):
    """STAR*NET's standard errors, centring included: sigma0 0.849804, accepted."""
    project = adjusted("09", "net.snproj")
    explicit = adjusted("09", "explicit.dat", "--sigmas", "azimuth=1sec")
    assert project["sigma0"] == pytest.approx(0.849804, abs=1e-6)
    assert explicit["sigma0"] == pytest.approx(0.849804, abs=1e-6)
    assert "1 data files take no part: net.dat" in " ".join(project["warnings"])


def test_centring_is_computed_as_starnet_does(adjusted, tmp_path):
    """The standard errors that stand in `explicit.dat`, with its digits."""
    adjusted("09", "explicit.dat", "--sigmas", "azimuth=1sec")
    project = tmp_path / "09" / "net.snproj"
    text = project.read_text().replace('2 "net.dat"', '3 "net.dat"').replace('3 "explicit', '2 "explicit')
    project.write_text(text)
    result = adjusted("09", "net.snproj")
    given = adjusted("09", "explicit.dat", "--sigmas", "azimuth=1sec")
    sigmas = [np.array([row["sigma"] for row in one["observations"]]) for one in (result, given)]
    np.testing.assert_allclose(*sigmas, rtol=2e-3)
    assert result["sigma0"] == pytest.approx(0.849804, abs=2e-4)
    assert "with centring the standard deviations are" in " ".join(result["warnings"])


def test_centring_and_instruments_may_stand_in_a_file(adjusted, tmp_path):
    adjusted("09", "explicit.dat", "--sigmas", "azimuth=1sec")
    (tmp_path / "09" / "worth.toml").write_text(
        "azimuth = '1sec'\n[instrument.TS]\ndistance = '3mm + 1.5ppm'\ndirection = '0.7sec'\n"
        "instrument-centring = '1.5mm'\ntarget-centring = '1.5mm'\n"
    )
    result = adjusted("09", "net.dat", "--stochastic", "worth.toml")
    assert result["sigma0"] == pytest.approx(0.849804, abs=2e-4)


def test_listing_options_change_nothing(adjusted, tmp_path):
    listed = adjusted("11", "net.dat", *OF_STARNET)
    path = tmp_path / "11" / "net.dat"
    path.write_text(
        "\n".join(line for line in path.read_text().splitlines() if line[:2] not in (".E", ".R", ".P"))
    )
    np.testing.assert_array_equal(places(listed), places(adjusted("11", "net.dat", *OF_STARNET)))


@pytest.mark.parametrize("start", ["", "sep=,\n", "\n"])
def test_columns_may_have_quotes_around_their_names(adjusted, tmp_path, start):
    adjusted("14", "points.csv", "obs.csv")
    path = tmp_path / "14" / "obs.csv"
    path.write_text(start + path.read_text() + ",,,,\n")
    assert adjusted("14", "points.csv", "obs.csv")["sigma0"] == pytest.approx(0.106066, abs=5e-7)


def test_decimal_commas_where_commas_separate_nothing(adjusted, tmp_path):
    adjusted("14", "points.csv", "obs.csv")
    path = tmp_path / "14" / "obs.csv"
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    assert adjusted("14", "points.csv", "obs.csv")["sigma0"] == pytest.approx(0.106066, abs=5e-7)


def test_axes_of_vectors_against_those_of_points_are_told(adjusted):
    """3.7, 2.8 and 5.2 mm over 100 km between NAD83(CSRS) and WGS 84."""
    result = adjusted("19", "net.dat", "--points-crs", "EPSG:2953")
    (told,) = [text for text in result["warnings"] if "GNSS vectors are along the axes" in text]
    assert "EPSG:2953 by 0.030 arc seconds" in told and "by up to 7.0 mm" in told


def test_what_is_right_stays_right(adjusted):
    levels = adjusted("20", "levels-latitude.xml")
    assert levels["sigma0"] == pytest.approx(0.28771767, abs=1e-8)
    found = heights(levels)
    assert found["R.5"] == pytest.approx(22.51586589, abs=1e-7)
    assert found["Q-77-002"] == pytest.approx(21.60496556, abs=1e-7)
    bearings = {point["name"]: (point["x"], point["y"]) for point in adjusted("20", "bearings.dat")["points"]}
    assert bearings["OAK"] == pytest.approx((6000000.0, 1000100.0005), abs=6e-5)
    assert bearings["ELM"] == pytest.approx((6000100.0, 999900.0), abs=6e-5)


# The stochastic model by itself: a point 30 m east and 40 m north of the instrument, 10 m above it.

TABLES = (
    {"name": ["A", "B", "C"], "x": [0.0, 30.0, -30.0], "y": [0.0, 40.0, 40.0], "z": [0.0, 10.0, 0.0],
     "sx": [0.0, None, 0.0], "sy": [0.0, None, 0.0], "sz": [0.0, None, 0.0]},
    {"type": ["Hz", "Hz", "Dist", "Zen", "DistHz"], "from": ["A"] * 5, "to": ["B", "C", "B", "B", "B"],
     "value": [0.6435, 5.6397, 50.990195, 1.373401, 50.0], "sigma": [1e-5] * 2 + [1e-3, 1e-5, 1e-3]},
)  # fmt: skip


def test_centring_by_hand():
    """d = 50, slope sqrt(2600): centring of 3 and 4 mm across makes 5 mm / 50 m; 1 mm in height."""
    from obseq.survey import network_from_tables

    given = {"direction": 1e-5, "distance": 1e-3, "distance-ppm": 2e-5, "zenith": 1e-5}
    centring = {"instrument-centring": 3e-3, "target-centring": 4e-3, "vertical-centring": 1e-3}
    model, network = StochasticModel({**given, **centring}), network_from_tables(*TABLES)
    book, taken = model.weighed(network.book)
    found = model.centring(replace(network, book=book), taken).book.observations.sigmas
    plan, height = 25e-6, 2e-6
    assert found[0] == pytest.approx(np.sqrt(1e-10 + plan / 2500), rel=1e-12)
    slope = (1e-3 + 2e-5 * np.sqrt(2600)) ** 2 + (2500 * plan + 100 * height) / 2600
    assert found[2] == pytest.approx(np.sqrt(slope), rel=1e-9)
    assert found[3] == pytest.approx(np.sqrt(1e-10 + (100 * plan + 2500 * height) / 2600**2), rel=1e-9)
    assert found[4] == pytest.approx(np.sqrt((1e-3 + 2e-5 * 50) ** 2 + plan), rel=1e-9)


def test_an_angle_has_the_centring_of_three_points(tmp_path):
    """At a right angle between 30 m and 40 m all three add c^2 (1/30^2 + 1/40^2), or their part of it."""
    (tmp_path / "a.dat").write_text(
        ".UNITS METERS\n.2D\nC A 0 0 ! !\nC B 0 30 ! !\nC C 40 0\nA A-B-C 270-00-00\nD A-C 40\n"
    )
    sigmas = ["angle=1sec", "distance=1mm", "instrument-centring=1mm", "target-centring=2mm"]
    network = Network.read_project(tmp_path / "a.dat", sigmas=sigmas)
    expected = (np.pi / 648000) ** 2 + 5e-6 * (1 / 900 + 1 / 1600)
    assert network.book.observations.sigmas[0] == pytest.approx(np.sqrt(expected), rel=1e-6)


ONE_FACE = """#VERT
7 A B 0 0.001
6 A B 95 0.001
6 A C 99 0.001
6 A D 101 0.001
#VERT
6 B D 98 0.001
6 B D 302 0.001
6 B C 99 0.001
3 A B 50 0.002
"""


def test_the_index_is_common_to_the_zenith_angles_of_a_set_up(tmp_path):
    """Three sights of A share it, one of B has it alone, the mean of both faces at B has none of it."""
    (tmp_path / "o.obs").write_text(ONE_FACE)
    points = {"A": (0, 0, 0), "B": (50, 0, 4), "C": (20, 60, 1), "D": (-30, 40, -1)}
    known = [f"1 {name} {x} {y} {z} 0 0 0" for name, (x, y, z) in points.items()]
    (tmp_path / "p.cor").write_text("\n".join([*known, ""]))
    (tmp_path / "w.toml").write_text('iso-17123-3 = "2sec"\nindex-setting = "3sec"\n')
    network = Network.read(
        tmp_path / "o.obs", tmp_path / "p.cor", frame="Local", stochastic=tmp_path / "w.toml"
    )
    second, (cluster,) = np.pi / 648_000, network.book.clusters
    own = 2.0 * (2.0 * second) ** 2
    np.testing.assert_allclose(cluster.covariance, np.eye(3) * own + (3.0 * second) ** 2, rtol=1e-12)
    rows = network.book.observations
    of = {network.book.label(row).split(" (")[0]: rows.sigmas[row] for row in np.flatnonzero(rows.active)}
    assert of["Zen B -> C"] == pytest.approx(np.hypot(np.sqrt(own), 3.0 * second))
    assert of["Zen B -> D"] == pytest.approx(2.0 * second)
    assert "common to the zenith angles of each set-up (4 in one face)" in " ".join(network.book.warnings)


def test_a_data_sheet_may_be_given_as_it_stands(tmp_path):
    (tmp_path / "w.toml").write_text('iso-17123-3 = "1sec"\niso-17123-2 = "0.3mm"\nzenith = "4sec"\n')
    found = read_stochastic(tmp_path / "w.toml").default
    second = np.pi / 648_000
    assert found["direction"] == pytest.approx(np.sqrt(2.0) * second)
    assert found["angle"] == pytest.approx(2.0 * second)
    assert found["zenith"] == pytest.approx(4.0 * second)
    assert found["height-per-km"] == pytest.approx(0.3e-3 * np.sqrt(2.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("direction = 3", "'direction' is none of .* with a text"),
        ("speed = '3sec'", "'speed' is none of"),
        ("direction = '3mm'", "a number with its unit"),
        ("[instrument.TS]\ndistance = '-1mm'", "instrument TS: a standard deviation is above zero"),
        ("direction = ", "no TOML"),
        ("instrument = 3", "begins what is of one instrument"),
    ],
)
def test_a_file_of_the_stochastic_model_is_checked(tmp_path, text, message):
    from obseq.errors import InputError

    (tmp_path / "w.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_stochastic(tmp_path / "w.toml")


def test_a_project_file_of_dynadjust_names_its_files(shared_data, tmp_path):
    """As the two files together; what changes measurements is refused by name."""
    shutil.copytree(shared_data / "survey-cases" / "02-dna-utm-zone-digits", tmp_path / "case")
    head = "# a project\n\n#general (35)   VALUE\n----\nnetwork-name   n\n\n#import (35)   VALUE\n----\n"
    lines = "stn-msr-file    net.stn  \nstn-msr-file    net.msr  \nv-scale   1\ninclude-msr-types  \n"
    path = tmp_path / "case" / "a.dnaproj"
    path.write_text(head + lines)
    given = Network.read_project(path)
    told = Network.read_project([path.with_name("net.stn"), path.with_name("net.msr")])
    np.testing.assert_array_equal(given.book.observations.values, told.book.observations.values)
    path.write_text(head + lines.replace("v-scale   1", "v-scale   2.5"))
    with pytest.raises(InputError, match=r"a\.dnaproj:11: v-scale 2\.5 changes what is adjusted"):
        Network.read_project(path)
    path.write_text(head)
    with pytest.raises(InputError, match="no stn-msr-file of the section #import"):
        Network.read_project(path)
