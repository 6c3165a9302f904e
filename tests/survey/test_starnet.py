"""Data files of STAR*NET: what lines mean, in numbers that a person can follow, and what is refused."""

import math

import numpy as np
import pytest

from obseq import crs
from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import KINDS, Network

SECOND, SIGMAS = math.pi / 648_000, ["distance=3mm", "angle=5sec"]
PLANE = """
.2D
.UNITS Meters DMS
C A 0 0 ! !          # north and east
C B 100 0 ! !
C P 60 80
M A-B-P 53-07-48.4 100.003 5 0.005
D B-P 89.443 0.005   'a comment
"""


def read(tmp_path, text, **options):
    (path := tmp_path / "n.dat").write_text(text)
    return Network.read_project(path, **options)


def rows(network):
    """(kind, from, to, value, sigma) of the active observations."""
    book, kinds = network.book, {kind.code: kind.name for kind in KINDS}
    table = book.observations
    return [
        (
            kinds[int(table.types[k])],
            book.point_names[table.from_points[k]],
            book.point_names[table.to_points[k]],
            float(table.values[k]),
            float(table.sigmas[k]),
        )
        for k in range(len(table))
        if table.active[k]
    ]


def test_a_plane_network_is_adjusted(tmp_path):
    adjusted = read(tmp_path, PLANE).adjust()
    # A at the origin, B 100 m north: 53.13 degrees clockwise from there at 100 m is 80 m east, 60 m north
    assert adjusted.points.coordinates[2] == pytest.approx([80.0, 60.0, 0.0], abs=0.01)
    assert adjusted.solution.redundancy == 1
    assert adjusted.converged


def test_packed_and_dashed_angles_and_gons(tmp_path):
    packed = read(tmp_path, PLANE.replace("53-07-48.4", "53.07484"))
    gons = read(
        tmp_path, PLANE.replace("DMS", "GONS").replace("53-07-48.4 100.003 5", "59.033457 100.003 1.5")
    )
    angle = (53 + 7 / 60 + 48.4 / 3600) * math.pi / 180
    assert rows(packed)[0][3:] == pytest.approx((angle, 5 * SECOND))
    assert rows(gons)[0][3] == pytest.approx(angle, abs=2e-8)
    assert rows(gons)[0][4] == pytest.approx(1.5e-3 * math.pi / 200)


def test_feet_are_told_apart(tmp_path):
    survey = read(tmp_path, PLANE.replace("Meters", "FeetUS"))
    assert rows(survey)[1][3] == pytest.approx(100.003 * 1200 / 3937)
    with pytest.raises(InputError, match=r"n\.dat:3: which foot"):
        read(tmp_path, PLANE.replace("Meters", "Feet"))


SPACE = """
.3D
.UNITS Meters DMS
.ORDER EN AtFromTo
C A 0 0 10 ! ! !
C B 0 100 12 ! ! !
{}
"""


def in_space(tmp_path, lines, **options):
    return rows(read(tmp_path, SPACE.format(lines), **options))


def test_slope_distance_zenith_and_heights(tmp_path):
    found = in_space(tmp_path, "DV A-P 50.01 85-00-00 0.003 4 1.5/1.7")
    assert found[0] == ("Dist", "A", "P", 50.01, 0.003)
    assert found[1] == pytest.approx(("Zen", "A", "P", math.radians(85), 4 * SECOND))
    network = read(tmp_path, SPACE.format("DV A-P 50.01 85-00-00 0.003 4 1.5/1.7"))
    assert network.book.observations.to_heights.tolist() == [1.7, 1.7]
    assert network.frame.refraction_coefficient == 0.14  # STAR*NET's 0.07


def test_delta_is_horizontal_distance_and_height_difference(tmp_path):
    found = in_space(tmp_path, ".DELTA ON\nDV A-P 50 -1.25 0.003 0.002")
    assert found == [("DistHz", "A", "P", 50.0, 0.003), ("DH", "A", "P", -1.25, 0.002)]


def test_second_face_bearings_and_missing_values(tmp_path):
    found = in_space(tmp_path, "V A-P 275-00-00 4\nB A-P S30-00-00E 10\nBM A-Q N10W ? 90 1 1 1")
    assert found[0][3] == pytest.approx(math.radians(85))
    assert found[1][3] == pytest.approx(math.radians(150))
    assert found[2][3] == pytest.approx(math.radians(350))
    assert [row[0] for row in found] == ["Zen", "Azim", "Azim", "Zen"]


def test_levelling_takes_the_root_of_the_length(tmp_path):
    found = in_space(tmp_path, "L A-P 1.5 4000\nL A-Q 1.5 4000 0.01", sigmas=["height-per-km=1mm"])
    assert [row[4] for row in found] == pytest.approx([0.002, 0.01])


def test_lines_of_levels_that_are_metres_long_are_told(tmp_path):
    """0.18 is a length in kilometres, 3 a number of turns; both would make sigmas of nothing."""
    lines = SPACE.format("L A-P 1.5 0.18\nL A-Q 1.5 3\nL A-P 1.5 0.18 0.01\nL A-Q 1.5 400")
    network = read(tmp_path, lines, sigmas=["height-per-km=1mm"])
    (told,) = (text for text in network.book.warnings if "a line of levels of 0.18 m" in text)
    assert "and 1 more" in told and "turns" in told


def test_a_direction_set_has_one_orientation(tmp_path):
    network = read(tmp_path, SPACE.format("DB A\nDN B 0 3\nDM P 40-30-00 60 88 3 0.002 5\nDE"))
    assert [row[0] for row in rows(network)] == ["Hz", "Hz", "Dist", "Zen"]
    assert network.book.observations.stations.tolist()[:2] == [0, 0]


def test_a_traverse_is_angles_and_distances(tmp_path):
    lines = "TB B\nT A 90-00-00 50 90-00-00 3 .002 3\nT P 180-00-00 60 91 3 .002 3\nTE Q 270 B 3"
    network = read(tmp_path, SPACE.format(lines))
    found = rows(network)
    assert [row[:3] for row in found] == [
        ("Angle", "A", "P"),
        ("Dist", "A", "P"),
        ("Zen", "A", "P"),
        ("Angle", "P", "Q"),
        ("Dist", "P", "Q"),
        ("Zen", "P", "Q"),
        ("Angle", "Q", "B"),
    ]
    backs = network.book.observations.backsights
    names = [network.book.point_names[back] for back in backs[backs >= 0]]
    assert names == ["B", "A", "P"]


def test_marks_free_fix_and_default(tmp_path):
    lines = "D A-P 50 *\nD B-P 60 !\nD A-Q 70 &\nD B-Q 70"
    network = read(tmp_path, SPACE.format(lines), sigmas=["distance=3mm", "distance-ppm=2ppm"])
    assert network.book.observations.active.tolist() == [False, True, True, True]
    assert network.book.observations.sigmas[1:] == pytest.approx([1e-6, 3e-3, 3e-3])
    assert network.book.observations.relative_sigmas.tolist() == [0.0, 0.0, 2e-6, 2e-6]


def test_side_shots_place_their_points_and_no_others(tmp_path):
    lines = "D A-P 50 .01\nSS A-B-S 90 20 90 5 .01 5\nSS A-B-P 80 20 90 5 .01 5"
    network = read(tmp_path, SPACE.format(lines))
    assert {row[2] for row in rows(network)} == {"P", "S"}
    assert any(":9: side shot to P" in text for text in network.book.warnings)


def test_known_points_with_standard_errors(tmp_path):
    network = read(tmp_path, ".UNITS Meters DMS\nC A 5 7 9 0.01 0.02 ! \nC B 1 1 1\nE B 3 *\nD A-B 3 1\n")
    sigmas = network.points.sigmas
    assert sigmas[0].tolist() == [0.02, 0.01, 0.0]  # north first in the file, east first here
    assert np.isnan(sigmas[1]).all()
    assert network.points.coordinates.tolist() == [[7, 5, 9], [1, 1, 3]]


def test_lines_switched_off_and_missing_units_are_told(tmp_path):
    text = PLANE.replace(".UNITS Meters DMS\n", "") + ".DATA OFF\nD A-P 1 1\n.DATA ON\n.END\nrubbish\n"
    said = read(tmp_path, text).book.warnings
    assert any("metres and degrees are taken" in one for one in said)
    assert any("1 lines are switched off" in one for one in said)


def test_files_are_included_and_loops_found(tmp_path):
    (tmp_path / "more.dat").write_text("D A-P 100.001 0.005\n")
    assert len(rows(read(tmp_path, PLANE + ".INCLUDE more.dat\n"))) == 4
    (tmp_path / "more.dat").write_text(".INCLUDE n.dat\n")
    with pytest.raises(InputError, match="is there a loop"):
        read(tmp_path, PLANE + ".INCLUDE more.dat\n")
    with pytest.raises(InputError, match="outside the folder"):
        read(tmp_path, PLANE + ".INCLUDE ../other.dat\n")


def test_files_from_outside_the_folder_are_told(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "more.dat").write_text("D A-P 100.001 0.005\n")
    path = tmp_path / "in" / "n.dat"
    path.write_text(PLANE + ".INCLUDE ../more.dat\n")
    told = Network.read_project(path, outside=True).book.warnings
    assert any("more.dat: read from outside the folder of the project" in one for one in told)


WRONG = {
    "D A-P 50": "for all of its kind with --sigmas distance=",
    "D A-P-Q 50 1": "is not From-To",
    "D A-A 50 1": "names a point twice",
    "D A-P 50 1 2": "fields after the values",
    "D A-P 5,0 1": "is not a number",
    "D A-P -5 1": "is not positive",
    "D A-P 50 0": "not above zero",
    "A A-B-P 50-61-00 1": "minutes are below 60",
    "A A-B-P fifty 1": "is no angle",
    "M A-B-P 50 1 1/2": "`\\?` stands for what was not measured",
    "DN P 50 1": "begins with DB",
    "DB A": "open direction set",
    "TB B": "open traverse",
    "T A 50 1 90": "begins with TB",
    "G1 A-P 1 2 3": "no covariance",
    "G2 1 2 3": "G2 stands where G1 is expected",
    ".GPS FACTOR 2 VERT -3": "VERT and another one",
    ".D ON": "is not known here",
    "P A 50 10 100": "geographic coordinates",
    "XX A-P 1": "unknown code",
    ".GRID utm": "is not known here",
    ".UNITS fathoms": "is none of Meters",
    "C Q 1": "after the name",
}


@pytest.mark.parametrize("line", WRONG)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, capfd, line):
    with pytest.raises(InputError, match=WRONG[line]) as error:
        read(tmp_path, SPACE.format(line))
    assert str(error.value).startswith(f"{tmp_path / 'n.dat'}:7: ")
    assert main(["adjust", str(tmp_path / "n.dat")]) == 2
    assert WRONG[line].replace("\\", "") in capfd.readouterr().err


def test_default_sigmas_need_a_unit(tmp_path):
    for text in ("distance=2", "distance=2sec", "length=2mm", "angle=0sec", "angle=x"):
        with pytest.raises(InputError, match=f"--sigmas {text}"):
            read(tmp_path, PLANE, sigmas=[text])


def test_a_traverse_may_begin_and_end_on_a_bearing(tmp_path):
    # from A the backsight is due south; 233 07 48.4 clockwise from it is 53 07 48.4 from north
    lines = "TB S00-00-00W\nT A 233-07-48.4 100 3 .002\nTE P 53-07-48.4 N00-00-00E 4\n"
    found = rows(read(tmp_path, PLANE + lines))[3:]
    azimuth = (53 + 7 / 60 + 48.4 / 3600) * math.pi / 180
    assert found[0][:3] == ("Azim", "A", "P")
    assert found[0][3] == pytest.approx(azimuth, abs=1e-12)
    assert found[0][4] == pytest.approx(3 * SECOND)
    assert found[1][:4] == ("DistHz", "A", "P", 100.0)
    # at P an angle of 53 07 48.4 from A to north: A is at 360 - 53 07 48.4
    assert found[2][:3] == ("Azim", "P", "A")
    assert found[2][3] == pytest.approx(2 * math.pi - azimuth, abs=1e-12)


def test_options_are_abbreviated_and_instruments_named(tmp_path):
    text = PLANE.replace(".UNITS", ".U").replace("M A-B-P", ".INST TS 15\nM A-B-P")
    network = read(tmp_path, text + "D A-P 100\n", sigmas=["distance=2mm"])
    assert [group.name for group in network.book.groups] == ["TS 15"]
    assert any("instruments (TS 15)" in said for said in network.book.warnings)
    assert not any("no .UNITS" in said for said in network.book.warnings)
    assert rows(network)[-1][4] == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("given", "metres"), [("distance=0.006ft", 0.0018288), ("distance=2us-ft", 2 * 1200 / 3937)]
)
def test_sigmas_may_be_in_feet(tmp_path, given, metres):
    network = read(tmp_path, SPACE.format("D A-P 50"), sigmas=[given])
    assert rows(network)[-1][4] == pytest.approx(metres, rel=1e-12)


def test_levelling_may_be_weighed_by_turns(tmp_path):
    """Four turns of 0.3 mm are 0.6 mm; four metres are no way."""
    lines = SPACE.format("L A-P 1.5 4")
    assert rows(read(tmp_path, lines, sigmas=["height-per-turn=0.3mm"]))[-1][4] == pytest.approx(6e-4)
    assert rows(read(tmp_path, lines, sigmas=["height-per-km=1mm"]))[-1][4] == pytest.approx(
        1e-3 * 0.004**0.5
    )


VECTORS = """.3D
.UNITS Meters DMS
.ORDER EN
C A 700000 6600000 50 ! ! !
C P 700100 6600100 50
.GPS WEIGHT {weight}
.GPS FACTOR 2
G0 'session 1
G1 A-P {x:.5f} {y:.5f} {z:.5f} 'fixed
G2 {diagonal}
G3 {corners}
"""


def vectors(weight, diagonal, corners):
    ends = np.array([[700000.0, 6600000.0, 50.0], [700120.0, 6600110.0, 55.0]])
    x, y, z = np.subtract(*crs.parse("EPSG:2154").to_geocentric(ends)[::-1])
    return VECTORS.format(weight=weight, x=x, y=y, z=z, diagonal=diagonal, corners=corners)


@pytest.mark.parametrize("weight", ["COVARIANCE", "STDERRCORRELATION"])
def test_vectors_have_a_place_on_the_earth(tmp_path, weight):
    covariance = 1e-6 * np.array([[4.0, 1.0, -0.5], [1.0, 9.0, 2.0], [-0.5, 2.0, 16.0]])
    sigmas = np.sqrt(np.diag(covariance))
    whole = covariance / np.outer(sigmas, sigmas) if weight.startswith("STD") else covariance
    diagonal = sigmas if weight.startswith("STD") else np.diag(covariance)
    corners = [whole[0, 1], whole[0, 2], whole[1, 2]]
    texts = (" ".join(f"{value:.12g}" for value in values) for values in (diagonal, corners))
    network = read(tmp_path, vectors(weight, *texts), points_crs="EPSG:2154")
    np.testing.assert_allclose(network.book.clusters[0].covariance, 4.0 * covariance, rtol=1e-9)
    adjusted = network.adjust()
    np.testing.assert_allclose(adjusted.points.crs_coordinates[1], (700120, 6600110, 55), atol=2e-4)


def test_the_vertical_of_vectors_may_have_a_factor_of_its_own(tmp_path):
    """East, north and up at A have sigmas 1, 1 and 1 mm, then 2, 2 and 5 mm, wherever the axes point to."""
    text = vectors("COV", "1e-6 1e-6 1e-6", "0 0 0").replace("FACTOR 2", "FACTOR 2 VERT 5")
    network = read(tmp_path, text, points_crs="EPSG:2154")
    covariance = network.book.clusters[0].covariance
    place = network.points_crs.geodetic(np.array([700000.0, 6600000.0, 50.0]))
    longitude, latitude = place[0], place[1]
    up = np.array(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    assert up @ covariance @ up == pytest.approx(25e-6, rel=1e-6)
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    assert east @ covariance @ east == pytest.approx(4e-6, rel=1e-6)
    assert abs(east @ covariance @ up) < 1e-11
    np.testing.assert_allclose(network.book.observations.sigmas**2, np.diag(covariance))


def test_vectors_without_a_place_are_refused(tmp_path):
    with pytest.raises(InputError, match="a place on the Earth"):
        read(tmp_path, vectors("COV", "1e-6 1e-6 1e-6", "0 0 0")).adjust()


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("G1 A-P 1 2 3\nG3 1 2 3", "n.dat:3: G3 stands where G2 is expected"),
        (
            "G1 A-P 1 2 3\nG2 1 1 1\nG3 2 0 0",
            "n.dat:3: the covariance of the vector is not positive definite",
        ),
        ("G1 A-P 1 2 3\nG2 1 1 1\nG1 A-P 1 2 3", "n.dat:2: the vector has no covariance"),
        ("G1\nG2 1 1 1\nG3 0 0 0", "n.dat:2: G1 holds names and three numbers"),
        ("G1 A-P 1 2\nG2 1 1 1\nG3 0 0 0", "n.dat:2: G1 holds names and three numbers"),
    ],
)
def test_vectors_that_are_not_whole_are_refused(tmp_path, lines, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, ".3D\n" + lines + "\n")


@pytest.mark.parametrize("again", ["C A 1 0 ! !", "C A 0 0", "C A 0 0 0.01 0.01"])
def test_points_given_twice_otherwise_are_refused(tmp_path, again):
    lines = [".UNITS METERS DMS", ".2D", "C A 0 0 ! !", again, "C B 100 0 ! !", "D A-B 100 0.01"]
    with pytest.raises(InputError, match=r"n\.dat:4: point A is given twice.*\(first at .*n\.dat:3\)"):
        read(tmp_path, "\n".join(lines))


def test_points_given_twice_alike_are_taken_once(tmp_path):
    first = next(line for line in PLANE.splitlines() if line.startswith("C "))
    network = read(tmp_path, PLANE.replace(first, f"{first}\n{first}"))
    assert network.points.names == read(tmp_path, PLANE).points.names


@pytest.mark.parametrize("text", ["[Files]\nData1=survey one.dat\nData2=Levels.DAT\n", "\x00\x07binary\x00"])
def test_a_project_file_is_refused_with_the_data_files_to_give(tmp_path, text, capsys):
    path = tmp_path / "job.prj"
    path.write_text(text)
    (tmp_path / "job.dat").write_text("C A 0 0\n")
    assert main(["adjust", str(path)]) == 2
    said = capsys.readouterr().err
    assert "the form of STAR*NET's project files is not published; give its data files" in said
    names = ["survey one.dat", "Levels.DAT"] if "survey" in text else []
    assert all(name in said for name in [*names, "job.dat"])


IN_FEET = """\
.UNITS FeetUS DMS
.ORDER EN
.2D
C 1 5000.00 5000.00 ! !
C N 4000 6000 ! !
C 5 6300 5000 ! !
C S 7500 6500 ! !
TB N
T 1 116-01-38 {:.3f}
T 2 228-56-12 {:.3f}
T 3 105-43-36 {:.3f}
T 4 260-06-44 {:.3f}
TE 5 92-51-16 S
"""


def test_distances_in_metres_in_a_file_in_feet_are_told_as_that(tmp_path):
    """Neither they nor the coordinates are "in feet where metres are meant": the file is in feet."""
    feet = np.array([338.962, 439.496, 445.510, 345.121])
    assert read(tmp_path, IN_FEET.format(*feet), sigmas=SIGMAS).gross_errors() == ()
    (error,) = read(tmp_path, IN_FEET.format(*feet * 1200.0 / 3937.0), sigmas=SIGMAS).gross_errors()
    assert error.code in ("S151", "S203") and [slip.code for slip in error.slips] == ["W107"]
    assert len(error.observations) == 4
