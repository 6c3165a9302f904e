"""Networks of SNAP: made observations of every type, from positions that are known, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
from pyproj import Geod, Proj, Transformer

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.registry import read_project
from obseq.survey import Network

TRUTH = {
    "A": (173.3210, -41.0130, 150.0),
    "B": (173.3280, -41.0070, 250.0),
    "C": (173.3330, -41.0080, 70.0),
    "D": (173.3260, -41.0200, 120.0),
}
GEOID = 10.0
SECOND = math.pi / 648_000.0
TO_XYZ = Transformer.from_pipeline("+proj=cart +ellps=GRS80")
GRID = Proj("EPSG:2113")
"""Wellington 2000."""


def xyz(name, up=0.0):
    longitude, latitude, height = TRUTH[name]
    return np.array(TO_XYZ.transform(longitude, latitude, height + up))


def local_axes(start):
    """(3, 3) east, north and up at a station."""
    lon, lat = np.radians(TRUTH[start][:2])
    east = [-math.sin(lon), math.cos(lon), 0.0]
    north = [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)]
    above = [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)]
    return np.array([east, north, above])


def local(start, end, up=(0.0, 0.0)):
    """East, north, up of a sight, in the horizon of its start."""
    return local_axes(start) @ (xyz(end, up[1]) - xyz(start, up[0]))


def azimuth(start, end):
    east, north, _ = local(start, end)
    return math.degrees(math.atan2(east, north)) % 360.0


def zenith(start, end, up):
    east, north, rise = local(start, end, up)
    return math.degrees(math.atan2(math.hypot(east, north), rise))


def bearing(start, end):
    first, last = (np.array(GRID(*TRUTH[name][:2])) for name in (start, end))
    return math.degrees(math.atan2(*(last - first))) % 360.0


def arc(start, end, height):
    """The distance along the ellipsoid, made larger to a height."""
    length = Geod(ellps="GRS80").inv(*TRUTH[start][:2], *TRUTH[end][:2])[2]
    return length * (1.0 + height / 6.3675e6)


def dms(angle, sides=""):
    size = abs(angle)
    degrees, minutes = int(size), int(size * 60.0 % 60.0)
    text = f"{degrees} {minutes} {size * 3600.0 - degrees * 3600.0 - minutes * 60.0:.8f}"
    return f"{text} {sides[angle < 0.0]}" if sides else text


def packed(angle):
    degrees, minutes, seconds = dms(angle).split()
    return f"{degrees}.{int(minutes):02d}{float(seconds) * 1e8:010.0f}"


def written(vector):
    return " ".join(f"{number:.6f}" for number in vector)


def level(start, end):
    """The distance at the mean height of its ends."""
    mean = (TRUTH[start][2] + TRUTH[end][2]) / 2.0
    return float(np.linalg.norm(xyz(end, mean - TRUTH[end][2]) - xyz(start, mean - TRUTH[start][2])))


def observations():
    """A data file with all types, in each of its layouts."""
    slope = np.linalg.norm(xyz("B", 1.3) - xyz("A", 1.5))
    ends = [name for name in TRUTH if name != "A"]
    full = "\n".join(" ".join("0.0001" if i == j else "0.00002" for j in range(i + 1)) for i in range(6))
    return "\n".join(
        [
            "All data types",
            "#ds_error 2 mm 1 ppm",
            "#data SD",
            f"A 1.5 B 1.3 {slope:.6f}",
            "A 1.5 B 1.3 * 12.0",
            "#data HD error ED no_heights",
            f"A C {level('A', 'C'):.6f} 0.002 {arc('A', 'C', 0.0):.6f} error 0.003",
            f"B D {level('B', 'D'):.6f} 0.002 -",
            "#data MD error no_heights",
            f"B C {arc('B', 'C', GEOID):.6f} 0.002",
            "#data DR no_heights",
            "C",
            *(f"{end} {np.linalg.norm(xyz(end) - xyz('C')) * 1.00005:.6f}" for end in ("A", "B", "D")),
            "#ha_error 1 sec 2 mm",
            "#zd_error 2 sec 90 mmh 1 mmv",
            "#refraction_coefficient default",
            "#data HA ZD",
            "A 1.5",
            *(
                f"{end} 1.3 {dms((azimuth('A', end) + 17.0) % 360.0)} {dms(zenith('A', end, (1.5, 1.3)))}"
                for end in ends
            ),
            "#note seen twice",
            "#hp_angles",
            "#data AZ error no_heights",
            f"B A {packed(azimuth('B', 'A'))} 2.0",
            "#deg_angles",
            "#az_error 2 sec",
            "#projection WELLTM2000",
            "#data PB no_heights",
            f"A D {bearing('A', 'D'):.10f}",
            "#dms_angles",
            "#data LV error no_heights",
            f"A B {TRUTH['B'][2] - TRUTH['A'][2]:.4f} 0.001",
            "#oh_error 5 mm",
            "#data OH no_heights",
            f"C {TRUTH['C'][2] - GEOID:.4f}",
            "#data EH error",
            f"D 1.1 {TRUTH['D'][2] + 1.1:.4f} 0.005",
            "#data LT error LN error no_heights",
            f"A {dms(TRUTH['A'][1], 'NS')} 0.001 {dms(TRUTH['A'][0], 'EW')} 0.001",
            "#gps_error_type correlation",
            "#data GB error no_heights",
            f"A B {written(xyz('B') - xyz('A'))} &",
            "0.01 0.01 0.01 0.1 0.2 0.3",
            "#gps_error_type full",
            "#data GB error grouped no_heights",
            "A",
            *(f"{end} {written(xyz(end) - xyz('A'))}" for end in ("B", "C")),
            "#end_set",
            full,
            "#gx_enu_error 10 10 20 mm",
            "#data GX no_heights",
            f"D {written(xyz('D'))}",
            "",
        ]
    )


@pytest.fixture
def job(tmp_path):
    """A network whose first values are some metres off."""
    lines = ["Made", "NZGD2000", "options ellipsoidal_heights geoid_heights c=order"]
    lines += [
        f"{name} {dms(lat + 2e-6, 'NS')} {dms(lon - 3e-6, 'EW')} {height + 0.2} {GEOID} "
        f"{'12'[name > 'B']} {name}"
        for name, (lon, lat, height) in TRUTH.items()
    ]
    (tmp_path / "net.crd").write_text("\n".join(lines))
    (tmp_path / "net.dat").write_text(observations())

    def write(*commands):
        text = "\n".join(
            ["title made", "coordinate_file net.crd ! known", "data_file net.dat", *commands, ""]
        )
        (tmp_path / "net.snp").write_text(text)
        return tmp_path / "net.snp"

    return write


QUIET = ("mode 3d adjustment", "refraction_coefficient default 0.0", "list residuals")


def test_all_types_give_the_positions_they_were_made_from(job):
    result = Network.read_project(job(*QUIET)).adjust()
    record = result.record()
    assert record.sigma0 < 0.05
    for point in record.points:
        place = np.array([point.crs_x, point.crs_y, point.crs_z])
        off = (place - TRUTH[point.name]) * [8.4e4, 1.11e5, 1.0]
        assert np.abs(off).max() < 2e-4, point.name
    used = [o for o in record.observations if o.active]
    worst = max(used, key=lambda o: abs(o.normalised_residual))
    assert abs(worst.normalised_residual) < 0.2, worst
    scales = [note for note in (*record.notes, *record.warnings) if "scale" in note]
    assert any("-5.00" in note and "e-05" in note for note in scales), scales


def test_refraction_counts_twice(job):
    """SNAP bends a sight by k D/R, we by k D/2R: its 0.075 is our 0.15."""
    assert read_project(job("mode 3d adjustment")).refraction == pytest.approx(0.15)


def test_standard_errors_of_commands_and_lines(job):
    book = Network.read_project(job(*QUIET)).book
    rows = book.observations
    by_line = {}
    for line, sigma in zip(rows.lines.tolist(), rows.sigmas.tolist(), strict=True):
        by_line.setdefault(line, []).append(sigma)
    assert by_line[4][0] == pytest.approx(
        math.hypot(0.002, 1e-6 * np.linalg.norm(xyz("B") - xyz("A"))), rel=1e-5
    )
    assert by_line[7] == [0.002, 0.003]
    flat = math.hypot(*local("A", "B")[:2])
    line = 1 + next(k for k, text in enumerate(observations().splitlines()) if text.startswith("B 1.3"))
    assert by_line[line][1] == pytest.approx(math.hypot(SECOND, 0.002 / flat), rel=1e-3)
    angle, slope = np.radians(zenith("A", "B", (1.5, 1.3))), np.linalg.norm(xyz("B", 1.3) - xyz("A", 1.5))
    across = math.hypot(0.09 * math.cos(angle), 0.001 * math.sin(angle)) / slope
    assert by_line[line][0] == pytest.approx(math.hypot(2.0 * SECOND, across), rel=1e-3)


def test_errors_of_a_session_are_those_between_any_two_of_its_stations(job, tmp_path):
    ends = {name: xyz(name) - xyz("A") for name in ("B", "C")}
    vectors = "\n".join(f"{name} {written(vector)}" for name, vector in ends.items())
    text = f"Session\n#gps_enu_error 3 3 7 mm 2 2 5 ppm\n#data GB grouped no_heights\nA\n{vectors}\n"
    (tmp_path / "session.dat").write_text(text)
    cluster = read_project(job("data_file session.dat")).book.clusters[-1]
    first, second = np.eye(6)[:, :3], np.eye(6)[:, 3:]
    turn = local_axes("A")
    for way, vector in ((first, ends["B"]), (second, ends["C"]), (first - second, ends["B"] - ends["C"])):
        length = np.linalg.norm(vector)
        expected = [math.hypot(mm * 1e-3, ppm * 1e-6 * length) ** 2 for mm, ppm in ((3, 2), (3, 2), (7, 5))]
        found = turn @ way.T @ cluster.covariance @ way @ turn.T
        assert np.diag(found) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("command", "held"),
    [
        ("fix A C", {"A": "xyz", "C": "xyz"}),
        ("fix horizontal order=2", {"C": "xy", "D": "xy"}),
        ("fix vertical A-B", {"A": "z", "B": "z"}),
        ("fix all\nfree ? vertical", dict.fromkeys(TRUTH, "xy")),
        ("mode 2d adjustment", dict.fromkeys(TRUTH, "z")),
        ("mode 1d adjustment", dict.fromkeys(TRUTH, "xy")),
    ],
)
def test_stations_are_held_as_commands_say(job, command, held):
    points = Network.read_project(job(*QUIET, command)).points
    found = {
        name: "".join(axis for axis, sigma in zip("xyz", sigmas, strict=True) if sigma == 0.0)
        for name, sigmas in zip(points.names, points.sigmas.tolist(), strict=True)
    }
    assert {name: axes for name, axes in found.items() if axes} == held


def test_floated_coordinates_are_observations(job):
    plain = Network.read_project(job(*QUIET))
    floated = Network.read_project(job(*QUIET, "horizontal_float_error 0.5", "float A", "float vertical B"))
    assert len(floated.book.observations) == len(plain.book.observations) + 4
    assert floated.book.observations.sigmas[-4] * 6.378e6 == pytest.approx(0.5)
    assert floated.book.observations.sigmas[-1] == 1.0


def test_types_are_left_out_switched_off_and_weighed(job):
    plain = Network.read_project(job(*QUIET)).book.observations
    commands = (
        "ignore_observations data_type=LV",
        "reject_observations data_type=ED/HD",
        "reweight_observations 3 data_type=GX",
    )
    changed = Network.read_project(job(*QUIET, *commands)).book
    rows = changed.observations
    assert len(rows) == len(plain) - 1
    assert rows.n_inactive == plain.n_inactive + 3
    positions = [np.diag(c.covariance) for c in changed.clusters if len(c.rows) == 3][-1]
    assert positions.max() < 9 * 0.02**2 * 1.001
    assert positions.sum() == pytest.approx(9 * (2 * 0.01**2 + 0.02**2))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("fix X", "station X is in no coordinate file"),
        ("recode A to B", "nothing here does that"),
        ("bearing_orientation_error calculate plan\nreference_frame GPS scale ?", "parameters"),
        ("data_file net.dat csv", "adjusted by themselves"),
        ("refraction_coefficient default 0.07 ?", "--estimate refraction"),
        ("include", "it names one file"),
    ],
)
def test_what_nothing_here_does_is_refused_with_its_line(job, command, message):
    with pytest.raises(InputError, match=r"net\.snp:\d+") as caught:
        Network.read_project(job(*QUIET, command))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("#data LV error no_heights\nA B 1 0.1 3", "follows what #data announces"),
        ("A Q", "Q"),
        ("#data XX", "neither a data type"),
        ("#data SD no_heights\nA B 10\nA", "the line ends where a station"),
        ("#gps_enu_error 1 mm\n#data GB no_heights\nA B 1 2 3", "three of a unit"),
        ("#data GB error grouped no_heights\nA\nB 1 2 3\n#end_set\n1 2 3", "6 numbers of a matrix"),
        ("#projection NZGD2000", "names no projection"),
        ("#data LT error no_heights\nA 41 0 1 E 1", "N or S is missing"),
    ],
)
def test_a_wrong_line_of_data_is_named(job, tmp_path, line, message):
    path = job(*QUIET)
    data = tmp_path / "net.dat"
    data.write_text(f"{data.read_text()}{line}\n")
    with pytest.raises(InputError, match=r"net\.dat:\d+") as caught:
        Network.read_project(path)
    assert message in str(caught.value)


def test_coordinates_of_a_grid_and_of_axes_are_the_same_positions(job, tmp_path):
    plain = read_project(job(*QUIET, "fix all")).points
    for code, place in (
        ("WELLTM2000", lambda lon, lat, h: (*GRID(lon, lat), h)),
        ("NZGD2000_XYZ", TO_XYZ.transform),
    ):
        rows = [
            f"{name} {written(place(*point))} {GEOID} {name}"
            for name, point in zip(plain.names, plain.coordinates.tolist(), strict=True)
        ]
        head = ["Made", code, "options ellipsoidal_heights geoid_heights"]
        (tmp_path / "net.crd").write_text("\n".join([*head, *rows]))
        again = read_project(job(*QUIET, "fix all")).points
        off = np.abs(again.coordinates - plain.coordinates).max(axis=0)
        assert off[:2].max() < 1e-9
        assert off[2] < 1e-4


def test_the_command_line_reads_and_converts_it(job, tmp_path, monkeypatch):
    job(*QUIET)
    monkeypatch.chdir(tmp_path)
    assert main(["adjust", "net.snp", "-q"]) == 0
    Path("net.dat").write_text("\n".join(["Short", "#data SD error no_heights", "A B 898.1 0.01", ""]))
    assert main(["convert", "net.snp", "--to", "net.obs.csv"]) == 0
    assert "Dist,A,B" in Path("net.obs.csv").read_text()


@pytest.mark.parametrize("name", ["net.crd", "net.dat"])
def test_a_part_of_a_network_says_what_it_belongs_to(job, tmp_path, name):
    job(*QUIET)
    with pytest.raises(InputError, match=r"adjust the command file \(\.snp\) that names it"):
        Network.read_project(tmp_path / name)


def test_checked_coordinates_beyond_a_right_angle_are_diagnosed(job):
    """Longitudes of 173 degrees are no latitudes: what exchanges them is no explanation, and no failure."""
    record = Network.read_project(job(*QUIET, "mode 3d data_check")).adjust().record()
    assert record.n_unknowns == 2
    assert record.failures == ()
    assert record.diagnosis.accused


def test_a_plan_in_which_nothing_is_unknown_gains_nothing(job, tmp_path, monkeypatch, capsys):
    job(*QUIET, "fix all", "mode 3d network_analysis")
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "net.snp"]) in (0, 1), capsys.readouterr().err
