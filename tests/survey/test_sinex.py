"""SINEX files: what is written is read again, and other forms of the same solution."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.conversion import write_sinex
from obseq.formats.sinex.writer import sinex_text
from obseq.survey import Network

FRAME = "RTL*2.4*48.8*0*EPSG:4326"
STATIONS = {"ALBY": (4200000.1, 170000.2, 4780000.3), "BASE": (4201000.0, 171000.0, 4779000.0)}


def covariance(seed=0):
    root = np.random.default_rng(seed).normal(size=(6, 6)) + 3.0 * np.eye(6)
    return 1e-6 * root @ root.T


def lines_of(matrix, form):
    for row in range(6):
        first, last = (row, 6) if form == "U" else (0, row + 1)
        for column in range(first, last, 3):
            part = matrix[row, column : min(column + 3, last)]
            yield f" {row + 1:5d} {column + 1:5d} " + " ".join(f"{value:21.14E}" for value in part)


def sinex(matrix, form="L", content="COVA", sigmas=None, epoch="20:001:00000", values=None, solution="   1"):
    sigmas = np.sqrt(np.diag(matrix)) if sigmas is None else sigmas
    values = np.ravel(list(STATIONS.values())) if values is None else values
    lines = ["%=SNX 2.02 AGY 20:001:00000 AGY 20:001:00000 20:001:00000 P 00006 2 S", "+SOLUTION/ESTIMATE"]
    for k in range(6):
        code = list(STATIONS)[k // 3]
        head = f" {k + 1:5d} STA{'XYZ'[k % 3]}   {code}  A {solution} {epoch} m    2"
        lines.append(f"{head} {values[k]:21.14E} {sigmas[k]:11.5E}")
    lines += ["-SOLUTION/ESTIMATE", f"+SOLUTION/MATRIX_ESTIMATE {form} {content}", *lines_of(matrix, form)]
    return "\n".join([*lines, "-SOLUTION/MATRIX_ESTIMATE", "%ENDSNX"]) + "\n"


def book_of(folder, text):
    path = folder / "n.snx"
    path.write_text(text)
    return Network.read_project(path).book


@pytest.mark.parametrize("form", ["L", "U"])
@pytest.mark.parametrize("content", ["COVA", "CORR", "INFO"])
def test_every_form_of_a_matrix_says_the_same(tmp_path, form, content):
    whole = covariance()
    sigmas = np.sqrt(np.diag(whole))
    correlations = whole / np.outer(sigmas, sigmas)
    np.fill_diagonal(correlations, sigmas)
    written = {"COVA": whole, "CORR": correlations, "INFO": np.linalg.inv(whole)}[content]
    book = book_of(tmp_path, sinex(written, form, content, sigmas))
    assert book.point_names == tuple(STATIONS)
    np.testing.assert_allclose(book.observations.values, np.ravel(list(STATIONS.values())), rtol=0, atol=1e-7)
    np.testing.assert_allclose(book.clusters[0].covariance, whole, rtol=1e-9)


def test_two_solutions_are_adjusted_together(tmp_path):
    first, second = covariance(0), covariance(1)
    values = np.ravel(list(STATIONS.values()))
    paths = [tmp_path / "a.snx", tmp_path / "b.snx"]
    paths[0].write_text(sinex(first))
    paths[1].write_text(sinex(second, values=values + 0.002))
    adjusted = Network.read_project(paths).adjust()
    weights = np.linalg.inv(first), np.linalg.inv(second)
    mean = np.linalg.solve(weights[0] + weights[1], weights[1] @ np.full(6, 0.002))
    rotation, translation = Network.read_project(paths).frame.system.geocentric_pose()
    found = adjusted.points.coordinates @ rotation.T + translation
    np.testing.assert_allclose(found.ravel() - values, mean, rtol=0, atol=1e-8)
    assert adjusted.solution.redundancy == 6


def test_adjusted_points_are_written_and_read_again(shared_data, tmp_path):
    folder = shared_data / "dynadjust-gnss"
    network = Network.read_project(folder / "gnss-network.stn")
    adjusted = network.adjust()
    write_sinex(tmp_path / "out.snx", adjusted)
    again = Network.read_project(tmp_path / "out.snx")
    result = again.adjust()
    assert result.solution.redundancy == 0
    rotation, translation = network.frame.system.geocentric_pose()
    expected = adjusted.points.coordinates @ rotation.T + translation
    np.testing.assert_allclose(again.book.observations.values, expected.ravel(), rtol=0, atol=1e-7)
    np.testing.assert_allclose(
        np.linalg.norm(result.points.precisions, axis=1),
        np.linalg.norm(adjusted.points.precisions, axis=1),
        rtol=1e-6,
    )
    text = (tmp_path / "out.snx").read_text()
    assert max(map(len, text.splitlines())) <= 80
    assert "Z000 211300470" in text  # nine letters do not fit


def test_the_command_writes_sinex(tmp_path, capsys):
    (tmp_path / "a.snx").write_text(sinex(covariance()))
    assert main(["adjust", str(tmp_path / "a.snx"), "--sinex", str(tmp_path / "b.snx")]) == 0
    assert (tmp_path / "b.snx").read_text().startswith("%=SNX 2.02")
    capsys.readouterr()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "SINEX is for places on the Earth"),
        ([f"--frame={FRAME}", "--datum=fixed"], "SINEX: point A is held exactly and has no covariance"),
        (
            [f"--frame={FRAME}", "--datum=inner", "--datum-points=A"],
            "point B does not carry the datum of this",
        ),
    ],
)
def test_what_sinex_cannot_hold_is_refused_before_the_adjustment(
    tmp_path, capsys, monkeypatch, options, message
):
    monkeypatch.setattr(Network, "adjust", None)
    (tmp_path / "n.obs").write_text("3 A B 100 0.001\n")
    (tmp_path / "n.cor").write_text("1 A 0 0 0 0.01\n0 B 100 0 0\n")
    files = [f"--obs={tmp_path / 'n.obs'}", f"--cor={tmp_path / 'n.cor'}", f"--sinex={tmp_path / 'b.snx'}"]
    assert main(["adjust", *files, *options]) == 2
    assert message in capsys.readouterr().err


def test_solutions_of_one_station_are_different_points(tmp_path):
    text = sinex(covariance()).replace("BASE  A    1", "ALBY  A    2")
    assert book_of(tmp_path, text).point_names == ("ALBY_1", "ALBY_2")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("%=SNX", "%=SNY"), "n.snx:1: a SINEX file begins with %=SNX"),
        (("-SOLUTION/ESTIMATE", "*"), "n.snx:10: block SOLUTION/ESTIMATE does not end before another begins"),
        (("SOLUTION/MATRIX", "OTHER/MATRIX"), "a block SOLUTION/MATRIX_ESTIMATE with L or U"),
        (("     2 STAY", "     7 STAY"), "the parameters are not numbered"),
        (("STAZ   BASE", "VELX   BASE"), "n.snx:6: BASE A has not one each of STAX, STAY, STAZ"),
        (("BASE  A    1 20:001", "BASE  A    1 19:001"), "n.snx:3: the positions are of different epochs"),
        (("L COVA", "L WXYZ"), "COVA, CORR or INFO is needed"),
        (("     1 STAX", "     x STAX"), "n.snx:3: 'x' is not the number of a parameter"),
        (("20:001:00000 m", "20-001-00000 m"), "n.snx:3: '20-001-00000' is not an epoch"),
    ],
)
def test_bad_input_is_refused_by_file_and_line(tmp_path, change, message, capsys):
    with pytest.raises(InputError) as caught:
        book_of(tmp_path, sinex(covariance()).replace(*change))
    assert message in str(caught.value)
    assert main(["adjust", str(tmp_path / "n.snx")]) == 2
    capsys.readouterr()


def test_standard_deviations_that_are_not_those_of_the_matrix(tmp_path):
    whole = covariance()
    with pytest.raises(InputError, match="is the variance factor missing"):
        book_of(tmp_path, sinex(whole, sigmas=3.0 * np.sqrt(np.diag(whole))))
    with pytest.raises(InputError, match="not positive definite"):
        book_of(tmp_path, sinex(-whole, sigmas=np.sqrt(np.diag(whole))))


def test_control_characters_between_numbers_are_nothing(tmp_path):
    text = sinex(covariance()).replace("     1     1 ", "   \x1c 1     1 ", 1)
    assert len(book_of(tmp_path, text).observations) == 6


def test_stations_stand_in_their_columns_with_approximate_places():
    """Code in columns 2 to 5, description to 44, then longitude, latitude (d m s), height of SINEX 2.02."""
    places = np.array(
        [[-6378147.0, 0.0, 0.0], [0.0, 6378137.0 * 0.9999, 0.0], [4079983.0, 335000.0, -4874000.0]]
    )
    text = sinex_text(["K1", "ALBY", "Pillar_1"], places, 1e-6 * np.eye(9), {})
    lines = text.partition("+SITE/ID\n")[2].partition("-SITE/ID")[0].splitlines()
    assert lines[0] == " K1    A 00000M000 P K1                     180  0  0.0   0  0  0.0    10.0"
    assert lines[1].startswith(" ALBY  A 00000M000 P ALBY                    90  0  0.0   0  0  0.0  -637.8")
    assert {len(line) for line in lines} == {75}
    west, south = lines[2][44:55].split(), lines[2][56:67].split()
    assert west[0] == "4" and south[0] == "-50"
    assert all(0 <= int(part[1]) < 60 and 0.0 <= float(part[2]) < 60.0 for part in (west, south))


def test_seconds_never_become_sixty():
    place = np.array([[6378137.0, -1e-3, 0.0]])  # 0.03 milliseconds west of Greenwich: 360 degrees
    text = sinex_text(["A"], place, 1e-6 * np.eye(3), {})
    assert "  0  0  0.0   0  0  0.0     0.0\n" in text or "360  0  0.0   0  0  0.0     0.0\n" in text
