"""Field books of Leica: words, units, set-ups; a job written from one truth gives that truth."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network

SIGMAS = ["direction=3sec", "zenith=5sec", "distance=1mm"]
PLACES = {
    "S1": (0.0, 0.0, 100.0),
    "S2": (60.0, 80.0, 103.0),
    "P3": (90.0, 10.0, 98.0),
    "P4": (-20.0, 70.0, 110.0),
}
HEIGHTS = {"S1": 1.52, "S2": 1.61, "P3": 1.30, "P4": 1.80}
GON = np.pi / 200


def word(number: str, unit: str, value: float, wide: bool) -> str:
    digits = f"{abs(round(value)):0{16 if wide else 8}d}"
    return f"{number}..1{unit}{'-' if value < 0 else '+'}{digits} "


def named(number: str, text: str, wide: bool, info: str = "0001") -> str:
    return f"{number}{info}+{text.rjust(16 if wide else 8, '0')} "


def sights(origin: str, wide: bool, turn: float):
    """Both faces of all targets; collimation and index errors of 3 and 5 mgon."""
    x, y, z = PLACES[origin]
    for target, (u, v, w) in PLACES.items():
        if target == origin:
            continue
        sight = np.array([u - x, v - y, w + HEIGHTS[target] - z - HEIGHTS[origin]])
        slope = np.linalg.norm(sight)
        zenith, azimuth = np.arccos(sight[2] / slope), np.arctan2(sight[0], sight[1])
        for face in (1, 2):
            sign = 3 - 2 * face
            hz = (azimuth / GON - turn + (0 if face == 1 else 200) + sign * 0.003 / np.sin(zenith)) % 400
            v = (zenith / GON if face == 1 else 400 - zenith / GON) + 0.005
            yield (
                named("11", target, wide)
                + word("21", "2", hz * 1e5, wide)
                + word("22", "2", v * 1e5, wide)
                + word("31", "6", slope * 1e4, wide)
                + word("87", "0", HEIGHTS[target] * 1e3, wide)
            )


def job(kind: str, wide: bool) -> str:
    star = "*" if wide else ""
    lines = []
    for origin, turn in (("S1", 0.0), ("S2", 77.0)):
        x, y, z = PLACES[origin]
        height = HEIGHTS[origin] * 1e3
        if kind == "coordinates":
            axes = [
                word(n, "0", value * 1e3, wide)
                for n, value in zip(("84", "85", "86"), (x, y, z), strict=True)
            ]
            lines.append(named("11", origin, wide) + "".join(axes) + word("88", "0", height, wide))
        elif kind == "name":
            lines.append(named("16", origin, wide, "....") + word("88", "0", height, wide))
        else:
            code = named("41", "21", wide) + named("42", origin, wide, "....")
            lines.append(code + named("43", f"{round(height)}", wide, "...."))
        lines += sights(origin, wide, turn)
    return "".join(f"{star}{line.rstrip()}\n" for line in lines)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("kind", ["coordinates", "name", "code"])
def test_a_job_in_both_faces_gives_the_truth(tmp_path, kind, wide):
    (tmp_path / "job.gsi").write_text(job(kind, wide))
    (tmp_path / "known.cor").write_text("1 S1 0 0 100 0.0001\n1 P3 90 10 98 0.0001\n")
    network = Network.read_project(
        tmp_path / "job.gsi", sigmas=SIGMAS, refraction=1.0, point_files=tmp_path / "known.cor"
    )
    adjusted = network.adjust()
    for name, place in PLACES.items():
        row = adjusted.points.names.index(name)
        np.testing.assert_allclose(adjusted.points.coordinates[row], place, atol=3e-4)
    told = " ".join(network.book.warnings)
    assert "6 pairs of directions, 6 pairs of zenith angles are reduced to their means" in told
    assert "index error from 6 pairs: +50." in told
    assert ("codes with a name" in told) == (kind == "code")


def test_units_and_names_of_words(tmp_path):
    """Sexagesimal degrees, feet, decimal degrees, a point without its zeros, several blocks a line."""
    (tmp_path / "a.gsi").write_text(
        "110001+00000S10 84..10+00000000 85..10+00000000 88..10+00001000\n"
        "110002+00000042 21.324+03545100 22.324+09030000 31..01+00100000 110003+0000P.1A 21.323+09000000\n"
    )
    rows = Network.read_project(tmp_path / "a.gsi", sigmas=SIGMAS).book
    degree = np.pi / 180
    values = rows.observations.values
    assert values[0] == pytest.approx((35 + 45 / 60 + 10 / 3600) * degree, abs=1e-12)
    assert values[1] == pytest.approx(90.5 * degree, abs=1e-12)
    assert values[2] == pytest.approx(30.48, abs=1e-12)
    assert values[3] == pytest.approx(90.0 * degree, abs=1e-12)
    assert [rows.point_names[row] for row in rows.observations.to_points] == ["42"] * 3 + ["P.1A"]
    assert rows.observations.from_heights[2] == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "110001+00000001 21.322+00000000\n",
            r"a\.gsi:1: nothing before this sight says where",
        ),
        ("110001+00000001 hello\n", r"a\.gsi:1: no word of GSI at character 17"),
        (
            "16....+0000000S\n110001+00000001 21.329+00000000\n",
            r"a\.gsi:2: word 21: '9' is no unit of angles",
        ),
        ("16....+0000000S\n110001+00000001 21.322+0000000x\n", r"a\.gsi:2: word 21: '0000000x' is no whole"),
        (
            "16....+0000000S\n110001+00000001 22.324+09061000\n",
            "minutes are below 60, and seconds at most 60",
        ),
        ("16....+0000000S\n", "no sight is in it"),
    ],
)
def test_what_is_wrong_is_told_by_its_line(tmp_path, text, message):
    (tmp_path / "a.gsi").write_text(text)
    with pytest.raises(InputError, match=message):
        Network.read_project(tmp_path / "a.gsi", sigmas=SIGMAS)


def test_standard_deviations_are_asked_for(tmp_path):
    (tmp_path / "a.gsi").write_text(job("name", True))
    with pytest.raises(InputError, match="--sigmas direction=3sec"):
        Network.read_project(tmp_path / "a.gsi")


def test_a_field_book_becomes_other_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.gsi").write_text(job("coordinates", True))
    (tmp_path / "known.cor").write_text("1 S1 0 0 100 0.0001\n1 P3 90 10 98 0.0001\n")
    sigmas = ["--sigmas", *SIGMAS]
    assert main(["convert", "job.gsi", "--to", "site.obs", *sigmas]) == 0
    assert main(["adjust", "job.gsi", "known.cor", "--refraction", "1", *sigmas]) == 0
    assert main(["adjust", "site.obs", "known.cor", "--refraction", "1"]) == 0


def test_staffs_of_digital_levels_give_height_differences(tmp_path):
    """BFFB: mean of both pairs; then BF without the result of the turn between. Published sample values."""
    lines = [
        "410001+?......2",
        "110002+0000BM10 83...6+02500000",
        "110003+0000BM10 32...8+02250000 331.08+00162345",
        "110004+000000A1 32...8+02280000 332.08+00110220",
        "110005+000000A1 32...8+02280000 336.08+00110232",
        "110006+0000BM10 32...8+02250000 335.08+00162351",
        "110007+000000A1 571..8+00000006 574..8+04530000 83..08+25052122",
        "110008+000000A1 32...8+02710000 331.08+00131010",
        "110009+000000IS 32...8+02000000 333.08+00131010",
        "110010+0000BM11 32...8+02670000 332.08+00195544",
    ]
    (tmp_path / "a.gsi").write_text("\n".join(lines) + "\n")
    book = Network.read_project(tmp_path / "a.gsi", sigmas=["height-per-km=1mm"]).book
    rows, names = book.observations, book.point_names
    ends = [(names[a], names[b]) for a, b in zip(rows.from_points, rows.to_points, strict=True)]
    assert ends == [("BM10", "A1"), ("A1", "BM11")]
    np.testing.assert_allclose(rows.values, [0.52122, -0.64534], atol=1e-9)
    np.testing.assert_allclose(rows.sigmas, 1e-3 * np.sqrt([0.0453, 0.0538]))
    assert "1 intermediate readings of a levelling staff are left out" in " ".join(book.warnings)


def test_sixty_seconds_are_the_next_minute(tmp_path):
    """Programs that round seconds by themselves write them: 84 1 60.0 is 84 2 0.0."""
    (tmp_path / "a.gsi").write_text("16....+0000000S\n110001+00000001 21.324+08401600\n")
    (tmp_path / "b.gsi").write_text("16....+0000000S\n110001+00000001 21.324+08402000\n")
    values = [
        Network.read_project(tmp_path / name, sigmas=SIGMAS).book.observations.values
        for name in ("a.gsi", "b.gsi")
    ]
    np.testing.assert_allclose(values[0], values[1], rtol=1e-15)


def test_coordinates_that_moved_on_with_the_instrument_say_no_place(tmp_path):
    """B stands 10 m east of A, whatever the file says of it, and A stays where it is."""
    first = "STN     A,0.0,\nXYZ     500.0,300.0,20.0\nBS      B,0.0,\nSD      90.0000,90.0000,10.000\n"
    then = "STN     B,0.0,\nXYZ     500.0,300.0,20.0\nBS      A,0.0,\nSD      0.0000,90.0000,10.000\n"
    (tmp_path / "a.gts7").write_text(
        f"GTS-700 v3.0\n{first}{then}SS      P,0.0,\nSD      90.0000,90.0000,5.0\n"
    )
    network = Network.read_project(tmp_path / "a.gts7", sigmas=SIGMAS)
    assert "B as A" in " ".join(network.book.warnings)
    adjusted = network.adjust()
    places = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    at = places["A"]
    assert np.linalg.norm(places["B"] - at) == pytest.approx(10.0, abs=1e-6)
    assert at == pytest.approx([500.0, 300.0, 20.0], abs=1e-3)
    assert np.linalg.norm(places["P"] - at) == pytest.approx(np.hypot(10.0, 5.0), abs=1e-6)
