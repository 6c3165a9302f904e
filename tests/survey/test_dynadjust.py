"""Networks of DynAdjust, from DNA and from DynaML files."""

import json
import math

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.conversion import write_dynaml
from obseq.formats.dynadjust.geoid import read_geoid
from obseq.survey import Network, Quality


def network(shared_data, **options):
    folder = shared_data / "dynadjust-gnss"
    paths = [folder / "gnss-network.stn", folder / "gnss-network.msr"]
    return Network.read_project(paths, geoid=folder / "gnss-network-geoid.gsb", **options)


def geocentric(adjusted, given):
    rotation, translation = given.frame.system.geocentric_pose()
    return adjusted.points.coordinates @ rotation.T + translation


def test_the_gnss_network_of_dynadjust(shared_data):
    given = network(shared_data)
    adjusted = given.adjust(quality=Quality(a_priori=True))
    expected = json.loads((shared_data / "dynadjust-gnss" / "expected.json").read_text())
    summary, solution = expected["summary"], adjusted.solution
    assert (solution.n_observations, solution.n_unknowns) == (summary["measurements"], 129)
    assert solution.redundancy == summary["dof"]
    assert solution.variance_factor == pytest.approx(summary["sigma_zero"], abs=5e-4)
    assert solution.variance_factor * solution.redundancy == pytest.approx(summary["chi_squared"], abs=0.02)
    found = geocentric(adjusted, given)
    assert len(found) == len(expected["stations"]) == 43
    for name, xyz, sigmas in zip(adjusted.points.names, found, adjusted.points.crs_precisions, strict=True):
        np.testing.assert_allclose(xyz, expected["stations"][name]["XYZ"], rtol=0, atol=6e-5)
        np.testing.assert_allclose(sigmas, expected["stations"][name]["sd_enu"], rtol=0, atol=6e-5)


def test_vectors_are_brought_to_the_frame_of_the_network(shared_data):
    book = network(shared_data).book
    expected = json.loads((shared_data / "dynadjust-gnss" / "expected.json").read_text())["measurements"]
    measured = [float(row["measured"]) for row in expected]
    np.testing.assert_allclose(book.observations.values, measured, rtol=0, atol=5.1e-5)
    assert any("71 measurements in ITRF2008 from 2015.132" in text for text in book.warnings)
    as_given = network(shared_data, ignore=["frames"])
    assert np.abs(as_given.book.observations.values - measured).max() > 1e-3
    chi2 = as_given.adjust().solution
    assert chi2.variance_factor * chi2.redundancy == pytest.approx(335.45, abs=0.01)  # formats.md 24


def test_residuals_of_clusters_are_those_of_components(shared_data):
    adjusted = network(shared_data).adjust()
    expected = json.loads((shared_data / "dynadjust-gnss" / "expected.json").read_text())["measurements"]
    corrections = [row["correction"] for row in expected]
    np.testing.assert_allclose(adjusted.residuals, corrections, rtol=0, atol=2e-4)


def test_the_geoid_grid(shared_data):
    geoid = read_geoid(shared_data / "dynadjust-gnss" / "gnss-network-geoid.gsb")
    stations = json.loads((shared_data / "dynadjust-gnss" / "expected.json").read_text())["stations"]
    given = network(shared_data)
    places = np.radians([given.points_crs.from_geocentric([row["XYZ"]])[0][:2] for row in stations.values()])
    found = geoid.at(list(stations), places[:, 0], places[:, 1])
    gaps = found[:, 0] - [row["h"] - row["H"] for row in stations.values()]
    assert np.abs(gaps).max() < 4e-3  # bilinear here, bicubic there: formats.md 7
    assert np.isnan(geoid.at(["far"], np.array([0.0]), np.array([0.0]))).all()


def test_the_command_reads_both_files(shared_data, capsys):
    folder = shared_data / "dynadjust-gnss"
    command = ["adjust", str(folder / "gnss-network.stn"), "--geoid", str(folder / "gnss-network-geoid.gsb")]
    assert main(command) == 0  # one of 139 vectors has T 28.4: by the noise of the others it is chance
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "1.081" in said and "sigmas of VX" not in said
    )  # the root of 1.169; components say nothing of vectors
    assert "vector 324900360 -> 222702940" in said and "(T 28.4): As a whole it is off" in said


# A small network by hand: four stations within some kilometres, all types of measurement.

CENTRE = (149.0, -35.0, 600.0)
OFFSETS = {"A": (0, 0, 0), "B": (3000, 400, 50), "C": (1200, 2600, -40), "D": (2500, 1900, 90)}


def packed(radians, digits=9):
    """d.mmssss of an angle."""
    seconds = round(abs(math.degrees(radians)) * 3600.0, digits - 4)
    degrees, rest = divmod(seconds, 3600.0)
    minutes, seconds = divmod(rest, 60.0)
    text = f"{int(degrees)}.{int(minutes):02d}{seconds:0{digits - 1}.{digits - 4}f}".replace(".", "", 2)
    text = f"{int(degrees)}.{int(minutes):02d}" + f"{seconds:0{digits - 1}.{digits - 4}f}".replace(".", "")
    return ("-" if radians < 0 else "") + text


def parts(radians):
    """Columns of degrees, minutes and seconds."""
    seconds = round(abs(math.degrees(radians)) * 3600.0, 4)
    degrees, rest = divmod(seconds, 3600.0)
    minutes, seconds = divmod(rest, 60.0)
    sign = "-" if radians < 0 else ""
    return f"{sign + str(int(degrees)):>4}{int(minutes):2d}{seconds:8.4f}"


class Site:
    """The true network, and what would be measured in it."""

    def __init__(self):
        from obseq import crs

        plain = crs.parse("+proj=longlat +ellps=GRS80 +towgs84=0,0,0")
        self.frame = crs.rtl_at(np.array(CENTRE), plain)
        self.points = {name: np.array(xyz, float) for name, xyz in OFFSETS.items()}
        self.place = {
            name: plain.from_geocentric(self.frame.to_geocentric(xyz)) for name, xyz in self.points.items()
        }
        self.geo = {name: self.frame.to_geocentric(xyz) for name, xyz in self.points.items()}
        self.axes = {name: self.frame.vertical_rotation(xyz[None])[0] for name, xyz in self.points.items()}

    def seen(self, a, b, low=0.0, high=0.0):
        raised = self.points[b] + high * self.axes[b][2] - self.points[a] - low * self.axes[a][2]
        return self.axes[a] @ raised

    def azimuth(self, a, b):
        return math.atan2(*self.seen(a, b)[:2]) % (2 * math.pi)

    def zenith(self, a, b, low=0.0, high=0.0):
        east, north, up = self.seen(a, b, low, high)
        return math.atan2(math.hypot(east, north), up)

    def chord(self, a, b):
        from obseq import crs

        plain = crs.parse("+proj=longlat +ellps=GRS80 +towgs84=0,0,0")
        feet = [plain.to_geocentric(np.array([*self.place[name][:2], 0.0])) for name in (a, b)]
        return float(np.linalg.norm(feet[1] - feet[0]))


def records(site):
    """Type, points, value, sigma, heights: of everything but directions and vectors."""
    chord = site.chord("A", "C")
    radius = 6371000.0
    return [
        ("S", "AB", np.linalg.norm(site.seen("A", "B", 1.5, 1.7)), 0.002, (1.5, 1.7)),
        ("C", "AD", site.chord("A", "D"), 0.002, (0, 0)),
        ("E", "AC", 2 * radius * math.asin(chord / 2 / radius), 0.002, (0, 0)),
        ("M", "AC", 2 * radius * math.asin(chord / 2 / radius), 0.002, (0, 0)),
        ("A", "ABC", (site.azimuth("A", "C") - site.azimuth("A", "B")) % (2 * math.pi), 1.0, (0, 0)),
        ("B", "AC", site.azimuth("A", "C"), 1.0, (0, 0)),
        ("K", "BD", site.azimuth("B", "D"), 1.0, (0, 0)),
        ("V", "AD", site.zenith("A", "D", 1.5, 1.2), 2.0, (1.5, 1.2)),
        ("Z", "AC", math.pi / 2 - site.zenith("A", "C", 1.4, 0.0), 2.0, (1.4, 0.0)),
        ("L", "BC", site.place["C"][2] - site.place["B"][2], 0.003, (0, 0)),
        ("H", "A", site.place["A"][2], 0.003, (0, 0)),
        ("R", "B", site.place["B"][2], 0.003, (0, 0)),
        ("P", "A", math.radians(site.place["A"][1]), 0.0001, (0, 0)),
        ("Q", "A", math.radians(site.place["A"][0]), 0.0001, (0, 0)),
        ("I", "B", math.radians(site.place["B"][1]), 0.0001, (0, 0)),
        ("J", "B", math.radians(site.place["B"][0]), 0.0001, (0, 0)),
    ]


COVARIANCE = 1e-6 * np.array([[4.0, 1.0, -1.0], [1.0, 5.0, 0.5], [-1.0, 0.5, 6.0]])
HEADER = "!#=DNA 3.01 {}    01.01.2024       GDA2020    01.01.2020         9"


def dna(site, moved=0.0):
    stations = [HEADER.format("STN")]
    for name, (longitude, latitude, height) in site.place.items():
        system = "LLh"
        texts = packed(math.radians(latitude)), packed(math.radians(longitude)), f"{height + moved:.4f}"
        stations.append(f"{name:<20}FFF {system}{texts[0]:>20}{texts[1]:>20}{texts[2]:>20}    station {name}")
    lines = [HEADER.format("MSR")]
    for code, names, value, sigma, (low, high) in records(site):
        line = f"{code} " + "".join(f"{name:<20}" for name in f"{names:<3}"[:3]).ljust(60)
        if code in "ABKVZ":
            line = line.ljust(76) + parts(value)
        elif code in "PQIJ":
            line = line.ljust(62) + f"{packed(value, 8):>14}".ljust(28)
        else:
            line = line.ljust(62) + f"{value:14.4f}".ljust(28)
        lines.append(f"{line}{sigma:9.4f}{low:7.3f}{high:7.3f}")
    turn = 0.3
    angles = [(name, site.azimuth("D", name) + turn) for name in "ABC"]
    lines.append(f"D {'D':<20}{'A':<20}{'2':<20}".ljust(76) + parts(angles[0][1]) + "   1.0000")
    lines += [" " * 42 + f"{name:<20}".ljust(34) + parts(angle) + "   1.0000" for name, angle in angles[1:]]
    lines += vector_lines(site)
    return "\n".join(stations) + "\n", "\n".join(lines) + "\n"


def three_lines(values, covariance):
    rows = [[covariance[row, column] for column in range(row + 1)] for row in range(3)]
    return [
        " " * 62 + f"{value:20.4f}" + "".join(f"{entry:20.13e}" for entry in row)
        for value, row in zip(values, rows, strict=True)
    ]


def vector_lines(site):
    scales = f"{2.0:10.2f}{1.0:10.2f}{1.0:10.2f}{1.0:10.2f}"
    lines = [f"G {'A':<20}{'D':<20}".ljust(62) + scales]
    lines += three_lines(site.geo["D"] - site.geo["A"], COVARIANCE)
    lines += [f"X {'A':<20}{'B':<20}{'2':<20}" + scales]
    lines += three_lines(site.geo["B"] - site.geo["A"], COVARIANCE)
    lines += [" " * 82 + "".join(f"{entry:20.13e}" for entry in row) for row in 0.3 * COVARIANCE]
    lines += [f"X {'A':<20}{'C':<20}", *three_lines(site.geo["C"] - site.geo["A"], COVARIANCE)]
    lines += [f"Y {'A':<20}{'XYZ':<20}{'1':<20}" + scales, *three_lines(site.geo["A"], COVARIANCE)]
    return lines


def written(folder, texts, names=("n.stn", "n.msr")):
    paths = [folder / name for name in names]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    return paths


def test_all_types_of_measurement(tmp_path):
    site = Site()
    network = Network.read_project(written(tmp_path, dna(site, moved=3.0)))
    assert {network.book.label(row).split()[0] for row in range(len(network.book.observations))} >= {
        *("Dist", "Chord", "Angle", "Azim", "Zen", "DH", "Height", "Lat", "Lon", "Hz", "VX", "GeoX")
    }
    adjusted = network.adjust()
    assert adjusted.converged
    assert np.nanmax(np.abs(adjusted.normalised_residuals)) < 0.2  # but for what the files round
    for name, xyz in zip(adjusted.points.names, geocentric(adjusted, network), strict=True):
        np.testing.assert_allclose(xyz, site.geo[name], rtol=0, atol=5e-4)


def test_scales_of_variances(tmp_path):
    stn, msr = dna(Site())
    book = Network.read_project(written(tmp_path, (stn, msr))).book
    np.testing.assert_allclose(book.clusters[0].covariance, 2.0 * COVARIANCE, rtol=1e-12)
    np.testing.assert_allclose(book.clusters[1].covariance[:3, 3:], 0.6 * COVARIANCE, rtol=1e-12)
    up = msr.replace(
        f"{2.0:10.2f}{1.0:10.2f}{1.0:10.2f}{1.0:10.2f}", f"{1.0:10.2f}{1.0:10.2f}{1.0:10.2f}{9.0:10.2f}"
    )
    raised = Network.read_project(written(tmp_path, (stn, up))).book.clusters[0].covariance
    axes = Site().frame.rotation  # east, north, up at A, within 1e-9 rad
    local = axes.T @ raised @ axes
    assert local[2, 2] == pytest.approx(9.0 * (axes.T @ COVARIANCE @ axes)[2, 2], rel=1e-6)
    assert local[0, 0] == pytest.approx((axes.T @ COVARIANCE @ axes)[0, 0], rel=1e-6)


def test_positions_in_longitude_and_latitude(tmp_path):
    site = Site()
    stn, msr = dna(site)
    longitude, latitude, height = site.place["A"]
    radius = 6371000.0
    covariance = np.diag([(0.002 / radius) ** 2, (0.002 / radius) ** 2, 1e-4])
    lines = [f"Y {'A':<20}{'LLH':<20}{'1':<20}{1.0:10.2f}"]
    values = [packed(math.radians(latitude), 12), packed(math.radians(longitude), 12), f"{height:.4f}"]
    for row, text in enumerate(values):
        entries = "".join(f"{covariance[row, column]:20.13e}" for column in range(row + 1))
        lines.append(" " * 62 + f"{text:>20}" + entries)
    book = Network.read_project(written(tmp_path, (stn, msr + "\n".join(lines) + "\n"))).book
    rows = slice(len(book.observations) - 3, None)
    np.testing.assert_allclose(book.observations.values[rows], site.geo["A"], rtol=0, atol=1e-4)
    axes = site.frame.rotation
    local = axes.T @ book.clusters[-1].covariance @ axes
    np.testing.assert_allclose(
        np.sqrt(np.diag(local)), (0.002 * math.cos(math.radians(35.0)), 0.002, 0.01), rtol=5e-3
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("FFF LLh", "FXF LLh"), "n.stn:2: 'FXF' is not a constraint"),
        (("LLh", "LLX"), "n.stn:2: 'LLX' is no type of coordinates"),
        (("!#=DNA 3.01 MSR", "!#=DNA 1.00 MSR"), "n.msr:1: a DNA file begins with"),
        (("GDA2020", "       "), "n.stn: the file names no reference frame"),
        (("GDA2020", "GDA2099"), "reference frame 'GDA2099' is not known"),
        (("S A", "W A"), "n.msr:2: 'W' is not a type of measurement"),
        (("S A", "S Q"), "n.msr:2: station Q is in no file of stations"),
        (("S A                   B", "S A                   A"), "n.msr:2: two of the stations are the same"),
        ((f"{COVARIANCE[1, 1]:20.13e}", f"{-1:20.13e}"), "n.msr:21: the covariance is not positive definite"),
    ],
)
def test_bad_input_is_refused_by_file_and_line(tmp_path, change, message, capsys):
    texts = [text.replace(change[0], change[1], 1) for text in dna(Site())]
    paths = written(tmp_path, texts)
    with pytest.raises(InputError) as caught:
        Network.read_project(paths)
    assert message in str(caught.value)
    assert main(["adjust", *map(str, paths)]) == 2
    assert message in capsys.readouterr().err


def test_a_file_that_ends_in_a_cluster(tmp_path):
    stn, msr = dna(Site())
    lines = msr.splitlines()
    for count in range(19, len(lines)):
        paths = written(tmp_path, (stn, "\n".join(lines[:count])))
        try:
            Network.read_project(paths)
        except InputError as error:
            assert "n.msr:" in str(error)


def test_an_unknown_motion_between_epochs_is_refused(tmp_path):
    stn, msr = dna(Site())
    dynamic = [text.replace("      GDA2020", "     ITRF2008") for text in (stn, msr)]
    line = next(line for line in dynamic[1].splitlines() if line.startswith("G "))
    dynamic[1] = dynamic[1].replace(line, line.ljust(102) + f"{'ITRF2008':>20}{'01.01.2010':>20}")
    with pytest.raises(InputError, match=r"n\.msr:21: ITRF2008 at 2010.000 to ITRF2008 at 2020.000"):
        Network.read_project(written(tmp_path, dynamic))
    assert Network.read_project(written(tmp_path, dynamic), ignore=["frames"]).book.clusters


# DynaML: what is written is read again.


def assert_same_books(book, again):
    order = np.lexsort((book.observations.values, book.observations.types))
    other = np.lexsort((again.observations.values, again.observations.types))
    one, two = book.observations, again.observations
    np.testing.assert_array_equal(one.types[order], two.types[other])
    np.testing.assert_allclose(one.values[order], two.values[other], rtol=0, atol=1e-9)
    for name in ("sigmas", "from_heights", "to_heights", "active"):
        np.testing.assert_allclose(getattr(one, name)[order], getattr(two, name)[other], rtol=1e-12)
    names = [
        [
            (each.point_names[a], each.point_names[b])
            for a, b in zip(o.from_points[k], o.to_points[k], strict=True)
        ]
        for each, o, k in ((book, one, order), (again, two, other))
    ]
    assert names[0] == names[1]
    assert len(book.clusters) == len(again.clusters)


def test_dynaml_says_what_dna_says(tmp_path):
    stn, msr = dna(Site())
    kept = [
        line for line in msr.splitlines() if not line.startswith("L ")
    ]  # a level difference needs a geoid
    network = Network.read_project(written(tmp_path, (stn, "\n".join(kept))))
    write_dynaml(tmp_path / "n.xml", network, epoch="01.01.2020")
    again = Network.read_project(tmp_path / "n.xml")
    assert again.points_crs == network.points_crs
    assert_same_books(network.book, again.book)
    for one, two in zip(network.book.clusters, again.book.clusters, strict=True):
        np.testing.assert_array_equal(one.covariance, two.covariance)
    found, expected = again.adjust(), network.adjust()
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-6)
    np.testing.assert_allclose(geocentric(found, again), geocentric(expected, network), rtol=0, atol=1e-7)


def test_the_gnss_network_from_dynaml(shared_data, tmp_path):
    given = network(shared_data)
    write_dynaml(tmp_path / "n.xml", given, epoch="01.01.2020")
    adjusted = Network.read_project(tmp_path / "n.xml").adjust()
    expected = json.loads((shared_data / "dynadjust-gnss" / "expected.json").read_text())["summary"]
    solution = adjusted.solution
    assert (solution.n_observations, solution.redundancy) == (417, 288)
    assert solution.variance_factor * solution.redundancy == pytest.approx(expected["chi_squared"], abs=0.02)
    assert len(adjusted.points.names) == 43


def test_what_dynaml_cannot_say_is_refused_by_name(tmp_path):
    network = Network.read_project(written(tmp_path, dna(Site())))
    with pytest.raises(InputError, match=r"DH B -> C .*DynaML has no height of the target above the origin"):
        write_dynaml(tmp_path / "n.xml", network)
    assert not (tmp_path / "n.xml").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<Type>S</Type>", "<Type>W</Type>"), "n.xml:25: 'W' is not a type of measurement"),
        (("<StdDev>", "<Sigma>"), "the XML is broken"),
        (("<DnaXmlFormat", "<Other"), "n.xml: <Other> is not the root of a file"),
        (("<Type>LLh</Type>", "<Type>LLX</Type>"), "n.xml:3: 'LLX' is no type of coordinates"),
        (("<Total>2</Total>", "<Total>5</Total>"), "<Total> is 5, and 2 members are in it"),
        (("<SigmaXX>", "<SigmaXX>x"), "is not a number"),
        (("<First>A</First>", "<First></First>"), "<First> is missing before it, or empty"),
        (
            ('<?xml version="1.0"?>', '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]>'),
            "refused: XML with entities or external references",
        ),
    ],
)
def test_bad_dynaml_is_refused(tmp_path, change, message, capsys):
    stn, msr = dna(Site())
    kept = [line for line in msr.splitlines() if not line.startswith("L ")]
    path = tmp_path / "n.xml"
    write_dynaml(path, Network.read_project(written(tmp_path, (stn, "\n".join(kept)))))
    path.write_text(path.read_text().replace(*change, 1))
    assert main(["adjust", str(path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "n.xml" in error
