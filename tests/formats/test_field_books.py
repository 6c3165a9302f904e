"""Field books: one simulated job gives the same result in every format; what each format says of its own."""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network

PATH = Path(__file__).parents[2] / "tools" / "benchmarks" / "field_books.py"
SPEC = importlib.util.spec_from_file_location("field_books", PATH)
assert SPEC is not None and SPEC.loader is not None
simulated = importlib.util.module_from_spec(SPEC)
sys.modules["field_books"] = simulated
SPEC.loader.exec_module(simulated)
SIGMAS = ["direction=2sec", "zenith=2sec", "distance=1mm"]
SIGHT = ["direction=2sec", "zenith=2sec", "distance=1mm", "height=1mm", "height-per-km=1mm"]
DEGREE, GON = math.pi / 180, math.pi / 200


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    simulated.write(folder)
    return folder


@pytest.fixture(scope="module")
def adjusted(job):
    """Result and field book of each file."""
    found = {}
    for name in simulated.FORMATS:
        network = Network.read_project(
            job / name, sigmas=SIGMAS, point_files=job / "known.csv", refraction=1.0
        )
        found[name] = network, network.adjust().record()
    return found


def test_a_job_gives_the_same_result_in_every_format(adjusted):
    places = {
        name: np.array([(p.x, p.y, p.z) for p in sorted(record.points, key=lambda p: p.name)])
        for name, (_, record) in adjusted.items()
    }
    _, first = adjusted["job.gsi"]
    for name, (_, record) in adjusted.items():
        np.testing.assert_allclose(places[name], places["job.gsi"], rtol=0, atol=1e-9, err_msg=name)
        assert record.sigma0 == pytest.approx(first.sigma0, rel=1e-9), name
        assert record.redundancy == first.redundancy


def test_the_wrong_target_height_is_named_in_every_format(adjusted):
    station, target, _ = simulated.WRONG
    for name, (_, record) in adjusted.items():
        (accused,) = record.diagnosis.accused
        assert f"height of target, {station} -> {target}" in accused.what, name
        assert accused.size[0] == pytest.approx(-0.2, abs=4 * accused.sigma[0])


def test_without_the_wrong_height_the_truth_comes_out(job, monkeypatch, tmp_path):
    station, target, _ = simulated.WRONG
    monkeypatch.setattr(simulated, "WRONG", (station, target, simulated.TARGET_HEIGHTS[target]))
    simulated.write(tmp_path)
    network = Network.read_project(
        tmp_path / "job.m5", sigmas=SIGMAS, point_files=tmp_path / "known.csv", refraction=1.0
    )
    record = network.adjust().record()
    assert 0.7 < record.sigma0 < 1.3
    for point in record.points:
        np.testing.assert_allclose((point.x, point.y, point.z), simulated.PLACES[point.name], atol=5e-3)


@pytest.mark.parametrize(
    "name", ["job.gsi", "job.jxl", "job.xml", "job.sdr", "nikon.raw", "job.job", "job.gts7"]
)
def test_errors_of_each_instrument_are_told(adjusted, name):
    """Collimation and index errors of two instruments, within four of their sigmas."""
    network, _ = adjusted[name]
    told = " ".join(network.book.warnings)
    for instrument, errors in simulated.INSTRUMENTS.items():
        for what, error in zip(("collimation error", "index error"), errors, strict=True):
            value, sigma = told.split(f"{what} of {instrument} from 10 pairs: ")[1].split(" cc", 2)[:2]
            assert float(value) == pytest.approx(error / 0.324, abs=4 * float(sigma.split()[-1])), instrument


def test_field_books_are_converted_and_adjusted_by_name(job, monkeypatch):
    monkeypatch.chdir(job)
    assert main(["convert", "job.jxl", "--to", "site.obs", "--sigmas", *SIGMAS]) == 0
    arguments = [
        "job.jxl",
        "--cor",
        "known.csv",
        "--refraction",
        "1",
        "--sigmas",
        *SIGMAS,
        "--json",
        "a.json",
    ]
    assert main(["adjust", *arguments]) == 1  # a wrong height is named
    assert main(["adjust", "site.obs", "known.csv", "--refraction", "1", "--json", "b.json"]) == 1


def read(folder, name, text):
    """Values by kind and ends, of a book."""
    (folder / name).write_text(text)
    book = Network.read_project(folder / name, sigmas=SIGHT, faces="all").book
    rows, names = book.observations, book.point_names
    found = {}
    for k in range(len(rows)):
        ends = names[rows.from_points[k]], names[rows.to_points[k]]
        found.setdefault((book.label(k).split()[0], *ends), []).append(float(rows.values[k]))
    return found, book


def test_prism_and_air_correct_the_distances_of_jobxml(tmp_path):
    """100 m, -34 mm, 10 ppm: 99.967 m. Mean turned angles, checks and deleted points have no part."""
    circle = (
        "<Circle><HorizontalCircle>10</HorizontalCircle><VerticalCircle>90</VerticalCircle>"
        "<EDMDistance>100</EDMDistance></Circle><StationID>s</StationID><TargetID>t</TargetID>"
    )
    found, book = read(
        tmp_path,
        "a.jxl",
        '<JOBFile><FieldBook><AtmosphereRecord ID="a"><PPM>10</PPM></AtmosphereRecord><StationRecord ID="s">'
        "<StationName>S</StationName><TheodoliteHeight>1.5</TheodoliteHeight><AtmosphereID>a</AtmosphereID>"
        '</StationRecord><TargetRecord ID="t"><PrismConstant>-0.034</PrismConstant><TargetHeight>1.3'
        f"</TargetHeight></TargetRecord><PointRecord><Name>P</Name>{circle}</PointRecord>"
        f"<PointRecord><Name>C</Name><Classification>Check</Classification>{circle}</PointRecord>"
        f"<PointRecord><Name>D</Name><Deleted>true</Deleted>{circle}</PointRecord>"
        f"<PointRecord><Name>M</Name><Method>MeanTurnedAngle</Method>{circle}</PointRecord>"
        "</FieldBook></JOBFile>",
    )
    assert found["Dist", "S", "P"] == [pytest.approx(99.967, abs=1e-9)]
    assert {ends[2] for ends in found} == {"P"}
    assert set(book.observations.from_heights) == {0.0, 1.5}
    told = " ".join(book.warnings)
    for what in (
        "1 points classified as checks",
        "1 points that were deleted",
        "1 points by MeanTurnedAngle",
    ):
        assert what in told


def test_angles_of_rw5_are_read_from_the_backsight(tmp_path):
    """The backsight stands at its reading of the circle; AL is to the left, DR from the prolongation."""
    head = "MO,AD0,UN0,SF1.0,EC0,EO0.0,AU0\nOC,OPS,N 10.0,E 20.0,EL 3.0\n"
    head += "LS,HI5.0,HR6.0\nBK,OPS,BPB,BS,BC10.0000\n"
    found, book = read(
        tmp_path,
        "a.rw5",
        head
        + "SS,OPS,FP7,AR100.3000,ZE90.0000,SD100.0\n"
        + "SS,OPS,FPL,AL20.0000,VA10.0000,HD50.0\nSS,OPS,FPD,DR5.0000\n",
    )
    degrees = {ends[2]: values[0] / DEGREE for ends, values in found.items() if ends[0] == "Hz"}
    assert degrees == pytest.approx({"7": 100.5, "L": 0.0, "D": 195.0, "B": 10.0}, abs=1e-9)
    assert found["Zen", "S", "L"] == [pytest.approx(80 * DEGREE)]
    assert found["Dist", "S", "7"] == [pytest.approx(30.48)]
    assert found["DistHz", "S", "L"] == [pytest.approx(15.24)]
    assert book.observations.from_heights[2] == pytest.approx(1.524)


def test_units_of_the_header_of_sdr(tmp_path):
    """Gon, feet, east before north, circle to the left; names of four columns."""
    text = (
        "00NMSDR20V03-05     0000 01-Jan-26 08:00222122\n02TP   1"
        + "10.000    20.000    3.000     5.000     \n"
        "03NM6.000     \n09F1   1   2100.000   90.000    30.000    \n"
    )
    found, book = read(tmp_path, "a.sdr", text)
    assert found["Hz", "1", "2"] == [pytest.approx(370 * GON)]
    assert found["Zen", "1", "2"] == [pytest.approx(90 * GON)]
    assert found["Dist", "1", "2"] == [pytest.approx(30.48)]
    assert book.observations.from_heights[1] == pytest.approx(1.524)
    (tmp_path / "b.sdr").write_text(text.replace("222122", "922122"))
    with pytest.raises(InputError, match="no six digits of units"):
        Network.read_project(tmp_path / "b.sdr", sigmas=SIGMAS)


def test_a_reference_counts_unless_it_is_sighted(tmp_path):
    """Nikon: the circle of the station record is a reading of the backsight, once."""
    head = "CO,Nikon RAW data format V2.00\nCO,Angle Units: Gons\nST,S,,B,,1.5,0.0000,12.0000\n"
    found, _ = read(tmp_path, "a.raw", head + "SS,P,1.3,10.0,50.0000,100.0000,,\n")
    assert found["Hz", "S", "B"] == [pytest.approx(12 * GON)]
    found, book = read(
        tmp_path, "b.raw", head + "F1,,1.3,,12.0100,100.0000,,\n*SS,P,1.3,10.0,50.0000,100.0000,,\n"
    )
    assert found["Hz", "S", "B"] == [pytest.approx(12.01 * GON)]
    assert "1 records with a *" in " ".join(book.warnings)


def m5(*lines):
    texts = []
    for k, (kind, info, *values) in enumerate(lines):
        blocks = "".join(f"{value:22}|" for value in (*values, "", "", "")[:3])
        texts.append(f"For M5|Adr {k:05d}|{kind:3} {info:27}|{blocks} \n")
    return "".join(texts)


def test_orientations_of_m5_wait_for_their_station(tmp_path):
    found, book = read(
        tmp_path,
        "a.m5",
        m5(
            ("TI", "INPUT", "ih          1.500 m", "th          1.300 m"),
            ("TI", "KN STAT"),
            ("PI1", f"{'':10}A{'':4}{'B':>12}", "Hz         10.3000 DMS", "V1         90.0000 DMS"),
            ("PI1", f"{'':10}S{'':4}{'S':>12}", "Y          1.000 m", "X          2.000 m"),
            (
                "PI1",
                f"{'':15}{'P':>12}",
                "SD        10.000 m",
                "Hz        20.0000 gon",
                "V3         10.0000 gon",
            ),
        ),
    )
    assert found["Hz", "S", "B"] == [pytest.approx(10.5 * DEGREE)]
    assert found["Zen", "S", "P"] == [pytest.approx(90 * GON)]
    assert set(book.observations.from_heights[1:]) == {0.0, 1.5}


def test_staffs_of_a_digital_level_give_height_differences(tmp_path):
    """Back 1.5 and 1.52, fore 1.2 and 1.24: 0.29 m over 25 + 25 m; sigma 1 mm per root of the kilometre."""
    found, book = read(
        tmp_path,
        "a.dat",
        m5(
            ("TO", "Start-Line         BFFB    1"),
            ("KD1", "   BM01                  1", "Z        100.00000 m"),
            ("KD1", "   BM01      08:01:121  1", "Rb         1.50000 m", "HD          25.00 m"),
            ("KD1", "    TP1      08:01:121  1", "Rf         1.20000 m", "HD          25.00 m"),
            ("KD1", "    TP1      08:01:121  1", "Rf         1.24000 m", "HD          25.00 m"),
            ("KD1", "   BM01      08:01:121  1", "Rb         1.52000 m", "HD          25.00 m"),
            ("KD1", "    TP1                  1", "Z        100.29000 m"),
            ("KD1", "    TP1      08:01:121  1", "Rb         1.10000 m", "HD          25.00 m"),
            ("KD1", "   BM02      08:01:121  1", "Rf         1.00000 m", "HD          25.00 m"),
        ),
    )
    assert found == {
        ("DH", "BM01", "TP1"): [pytest.approx(0.29)],
        ("DH", "TP1", "BM02"): [pytest.approx(0.1)],
    }
    np.testing.assert_allclose(book.observations.sigmas, 1e-3 * math.sqrt(0.05))


def test_angles_of_geodimeter_without_a_unit_are_told(tmp_path):
    found, book = read(
        tmp_path, "a.job", "2=S\n3=1.5\n5=P\n7=10.3000\n8=90.0000\n5=Q\n7=20.7000\n8=99.0000\n"
    )
    assert found["Hz", "S", "P"] == [pytest.approx(10.3 * GON)]
    assert "by its readings angles are gon" in " ".join(book.warnings)
    found, book = read(tmp_path, "b.job", "2=S\n3=1.5\n23=2112\n5=P\n17=190.3000\n24=10.3000\n")
    assert found["Hz", "S", "P"] == [pytest.approx(10.5 * DEGREE), pytest.approx(190.5 * DEGREE)]


def test_a_stream_of_topcon_may_be_sent_in_numbered_lines(tmp_path):
    stream = "_'7_(_)1.540_+1_ ?+00043575m0970930+1317260g+00043530t**+00+00111_*_,1.500_"
    cut = "".join(f"\x02{stream[k : k + 40]}{n}123\x03\n" for n, k in enumerate(range(0, len(stream), 40)))
    for name, text in (("a.gts", stream), ("b.gts", cut)):
        found, book = read(tmp_path, name, text)
        assert found["Dist", "7", "1"] == [pytest.approx(43.575)]
        assert found["Hz", "7", "1"] == [pytest.approx(131.726 * GON)]
        assert book.observations.to_heights[1] == 1.5


def test_a_table_of_known_points_says_itself_what_it_is(job, monkeypatch, capsys):
    monkeypatch.chdir(job)
    options = ["--sigmas", *SIGMAS, "--refraction", "1", "--to", "b.obs"]
    assert main(["convert", "job.gsi", "known.csv", *options]) == 0
    bare = (job / "b.obs").read_text()
    assert main(["convert", "job.gsi", "--cor", "known.csv", *options]) == 0
    assert (job / "b.obs").read_text() == bare


@pytest.mark.parametrize("tilt", ["", "+****", "-0012"])
def test_angles_alone_of_topcon_may_come_with_the_tilt(tmp_path, tilt):
    text = (
        f"_'S_(P_)1.676_+N_ <0955755+0100000{tilt}d086_* _,1.600_+1_ ?+00033870m0812338+1205111d_*P_,1.500_"
    )
    found, book = read(tmp_path, "a.gts", text)
    assert found["Hz", "S", "N"] == [pytest.approx(10.0 * DEGREE)]
    assert found["Zen", "S", "N"] == [pytest.approx((95.0 + 57.0 / 60.0 + 55.0 / 3600.0) * DEGREE)]
    assert found["Dist", "S", "1"] == [pytest.approx(33.870)]
    assert book.observations.to_heights.tolist() == [0.0, 1.6, 0.0, 1.5, 1.5]


def test_coordinates_after_a_backsight_are_its_own(tmp_path):
    station, back = "STN     A,1.4,\nXYZ     1.0,2.0,3.0\n", "BS      B,1.5,\nXYZ     5.0,6.0,7.0\n"
    read(tmp_path, "a.gts7", f"GTS-700 v3.0\n{station}{back}SD      0.0,90.0,9.0\n")
    network = Network.read_project(tmp_path / "a.gts7", sigmas=SIGMAS)
    places = dict(zip(network.points.names, network.points.coordinates.tolist(), strict=True))
    assert places == {"A": [1.0, 2.0, 3.0], "B": [5.0, 6.0, 7.0]}


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "a.sdr",
            "00NMSDR33 V04-04.02     01-Jan-26 08:00 111111\n09F1" + f"{'S':>16}{'P':>16}",
            "from 'S', and",
        ),
        (
            "a.jxl",
            "<JOBFile><FieldBook><PointRecord><Name>P</Name><Circle/></PointRecord></FieldBook></JOBFile>",
            "no St",
        ),
        ("a.rw5", "JB,NMx\nMO,AD0,UN1,AU0\nSS,OPS,FPP,AR1.0000\n", r"a\.rw5:3: nothing before this sight"),
        ("a.rw5", "JB,NMx\nOC,OPS\nLS,HI5\n", r"no mode record \(MO\)"),
        (
            "a.raw",
            "CO,Nikon RAW data\nST,S\nSS,P,1.0,10,10.7000,90.0000\n",
            "minutes are below 60, and seconds at most 60",
        ),
        ("a.raw", "CO,Nikon RAW data\nCO,Dist Units: Rods\n", "'rods' is none of"),
        ("a.m5", m5(("PI1", f"{'':15}{'P':>12}", "Hz   10.0000 DMS")), "no sight is in it"),
        ("a.job", "2=S\n5=P\n7=x\n", "'x' is not a number"),
        ("a.job", "2=S\n5=P\nhello\n7=1\n", r"a\.job:3: a line is a label"),
        ("a.gts7", "GTS-7\nJOB     x\nSTN     S,1.5\nHV      1.0,2.0\n", "names its target"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        Network.read_project(tmp_path / name, sigmas=SIGMAS)


def test_an_instrument_of_the_library_is_enough(job, monkeypatch, capsys):
    """Total station of 2 sec by ISO 17123-3: 2.83 sec in one face, 2 sec for the means of both."""
    monkeypatch.chdir(job)
    network = Network.read_project(
        job / "job.jxl", instrument="total-station-2sec", point_files=job / "known.csv"
    )
    rows = network.book.observations
    angles = rows.active & np.isin(rows.types, [5, 6])
    np.testing.assert_allclose(rows.sigmas[angles], 2 * np.pi / 648000, rtol=1e-3)
    own = Network.read_project(job / "job.jxl", instrument="total-station-2sec", sigmas=["direction=9sec"])
    assert own.book.observations.sigmas[own.book.observations.types == 5].max() > 30e-6
    assert main(["convert", "job.jxl", "--to", "w.obs", "--instrument", "total-station-2sec"]) == 0
    assert (
        main(["adjust", "w.obs", "known.csv", "--instrument", "total-station-5sec", "--json", "w.json"]) == 1
    )
    told = " ".join(capsys.readouterr().out.split())
    text = "are those of the stochastic model: horizontal direction, clockwise 21.8 cc (10) of TS-A"
    assert text in told
    assert main(["adjust", "job.jxl", "known.csv", "--instrument", "TS9"]) == 2
    assert (
        "--instrument TS9: it is none of total-station-0.5sec, total-station-1sec" in capsys.readouterr().err
    )


def test_an_instrument_of_a_file_goes_before_its_default(tmp_path):
    from obseq.formats import stochastic_model

    (tmp_path / "w.toml").write_text(
        'direction = "9sec"\nzenith = "9sec"\n[instrument.TS]\ndirection = "1sec"\n'
    )
    found = stochastic_model(tmp_path / "w.toml", "TS")
    assert found.of("") == pytest.approx({"direction": np.pi / 648000, "zenith": 9 * np.pi / 648000})
    assert found.of("TS")["direction"] == pytest.approx(np.pi / 648000)


def test_set_ups_with_another_error_than_their_instrument_are_named(tmp_path):
    """The second face at S3 reads 40 arc seconds more: half of it is 61.7 cc more of collimation."""
    from dataclasses import replace

    setups = simulated.job()
    third = setups[2]
    shots = [
        replace(shot, circle=(shot.circle + 40 * (shot.face - 1)) % simulated.TURN) for shot in third.shots
    ]
    setups[2] = replace(third, shots=shots)
    (tmp_path / "a.sdr").write_text("\n".join(simulated.sdr(setups)) + "\n")
    told = Network.read_project(tmp_path / "a.sdr", sigmas=SIGMAS).book.warnings
    (said,) = [text for text in told if "collimation error of TS-A" in text]
    others = said.split("other in ")[1]
    assert others.startswith("2 set-ups: S1 (+") and "S3 (-5" in others
    assert not any("other in" in text for text in told if "TS-B" in text)
