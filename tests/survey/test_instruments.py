"""Unknowns of instruments: constant and scale of distances, refraction."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Datum, Network, estimating, write_obs

pytestmark = pytest.mark.usefixtures("unsearched")

POINTS = {"A": (0, 0, 10), "B": (900, 50, 60), "C": (300, 700, 25), "D": (1000, 900, 90), "P": (500, 400, 40)}
FRAME = "RTL*2.4*48.8*0*+proj=longlat +datum=WGS84"


def frame_book(folder, scale):
    """Two sub-frames, plumb and turned, whose unit of length is wrong by a scale of each."""
    folder.mkdir(exist_ok=True)
    known = [f"1 {n} {x} {y} {z} 0.0001 0.0001 0.0001" for n, (x, y, z) in POINTS.items() if n != "P"]
    (folder / "p.cor").write_text("\n".join([*known, "0 P 500.1 400.1 40.1"]) + "\n")
    rows = ["#VERT"]
    for origin, turn, factor in (("A", 0.3, scale), ("B", 2.0, -scale)):
        for name, point in POINTS.items():
            if name != origin:
                dx, dy, dz = np.subtract(point, POINTS[origin]) / (1.0 + factor)
                right = dx * math.cos(turn) - dy * math.sin(turn)
                front = dx * math.sin(turn) + dy * math.cos(turn)
                for code, value in ((14, right), (15, front), (16, dz)):
                    rows.append(f"{code} {origin} {name} {value:.6f} 0.0005")
    (folder / "f.obs").write_text("\n".join(rows) + "\n")
    return folder / "f.obs", folder / "p.cor"


def test_each_frame_has_a_scale_of_its_own(tmp_path):
    given = Network.read(*frame_book(tmp_path, 2e-4))
    book = estimating(given.book, ["frame-scale"])
    adjusted = replace(given, book=book).adjust()
    scales = [float(note.split(": ")[1].split()[0]) for note in adjusted.notes if "scale of frame" in note]
    np.testing.assert_allclose(scales, (2e-4, -2e-4), rtol=0, atol=2e-6)
    np.testing.assert_allclose(adjusted.points.coordinates[4], POINTS["P"], rtol=0, atol=1e-4)
    assert adjusted.sigma0 < 0.1
    assert given.adjust().sigma0 > 10.0


def test_a_scale_of_frames_without_frames(tmp_path):
    with pytest.raises(InputError, match="no active observation dx, dy or dz"):
        estimating(network(tmp_path).book, ["frame-scale"])


def lines(constant, scale, coefficient, network):
    """Distances and zenith angles between all points, as a wrong instrument reads them in refracting air."""
    for a in POINTS:
        for b in POINTS:
            if a == b:
                continue
            first, last = np.array(POINTS[a], float), np.array(POINTS[b], float)
            length = np.linalg.norm(last - first)
            yield f"3 {a} {b} {(length - constant) / (1 + scale):.6f} 0.0005"
            east, north, up = network.frame.vertical(first[None])[0] @ (last - first)
            zenith = math.atan2(math.hypot(east, north), up)
            bent = coefficient * math.hypot(east, north) / (2 * 6380000.0)
            yield f"6 {a} {b} {(zenith - bent) * 200 / math.pi:.7f} 0.0002"


def network(folder, constant=0.0, scale=0.0, coefficient=0.12, name="o.obs"):
    known = [f"1 {n} {x} {y} {z} 0.0001 0.0001 0.0001" for n, (x, y, z) in POINTS.items() if n != "P"]
    (folder / "p.cor").write_text("\n".join([*known, "0 P 500.1 400.1 40.1"]) + "\n")
    (folder / name).write_text("3 A B 1 1\n")
    plain = Network.read(folder / name, folder / "p.cor", frame=FRAME)
    (folder / name).write_text("\n".join(lines(constant, scale, coefficient, plain)) + "\n")
    return Network.read(folder / name, folder / "p.cor", frame=FRAME)


def more(given, *what):
    return replace(given, book=estimating(given.book, what))


def test_constant_and_scale(tmp_path):
    given = network(tmp_path, 0.012, 30e-6)
    uncorrected = given.adjust()
    assert uncorrected.sigma0 > 5.0
    adjusted = more(given, "constant", "scale").adjust()
    assert adjusted.sigma0 < 0.3
    values = dict(note.split(": ") for note in adjusted.notes if " of o.obs" in note)
    assert float(values["constant of o.obs"].split()[0]) == pytest.approx(0.012, abs=2e-4)
    assert float(values["scale of o.obs"].split()[0]) == pytest.approx(30e-6, abs=3e-7)
    np.testing.assert_allclose(adjusted.points.coordinates[-1], POINTS["P"], rtol=0, atol=2e-4)
    assert adjusted.solution.n_unknowns == uncorrected.solution.n_unknowns + 2


def test_slope_and_horizontal_distances_of_one_instrument_share_its_constant_and_scale(tmp_path):
    given = network(tmp_path, 0.012, 30e-6)
    extra = []
    for a in "ABCD":
        sight = np.subtract(POINTS["P"], POINTS[a])
        up = given.frame.vertical(np.array([POINTS[a]], float))[0][2]
        flat = float(np.linalg.norm(np.cross(up, sight)))
        extra.append(f"101 {a} P {(flat - 0.012) / (1.0 + 30e-6):.6f} 0.0005")
    with (tmp_path / "o.obs").open("a", encoding="utf-8") as file:
        file.write("\n".join(extra) + "\n")
    both = Network.read(tmp_path / "o.obs", tmp_path / "p.cor", frame=FRAME)
    adjusted = more(both, "constant", "scale").adjust()
    notes = [note for note in adjusted.notes if note.startswith(("constant", "scale"))]
    found = [float(note.split(": ")[1].split()[0]) for note in notes]
    assert (np.abs(np.subtract(found, (0.012, 30e-6))) < (2e-4, 4e-7)).all()
    assert adjusted.sigma0 < 0.2 and both.adjust().sigma0 > 5.0


def test_refraction(tmp_path):
    adjusted = more(network(tmp_path, coefficient=0.3), "refraction").adjust()
    (note,) = [note for note in adjusted.notes if note.startswith("refraction of o.obs")]
    assert float(note.split(": ")[1].split()[0]) == pytest.approx(0.3, abs=2e-3)
    assert adjusted.sigma0 < 0.2


def test_each_file_has_unknowns_of_its_own(tmp_path):
    network(tmp_path, 0.010, name="one.obs")
    network(tmp_path, -0.004, name="two.obs")
    both = Network.read([tmp_path / "one.obs", tmp_path / "two.obs"], tmp_path / "p.cor", frame=FRAME)
    notes = more(both, "constant").adjust().notes
    found = [float(note.split(": ")[1].split()[0]) for note in notes if note.startswith("constant")]
    np.testing.assert_allclose(found, (0.010, -0.004), rtol=0, atol=2e-4)


def test_what_cannot_be_estimated(tmp_path, capsys):
    given = network(tmp_path)
    with pytest.raises(InputError, match="--estimate colour: unknown"):
        more(given, "colour")
    (tmp_path / "o.obs").write_text("4 A P 30 0.001\n")
    command = [
        "adjust",
        "--obs",
        str(tmp_path / "o.obs"),
        "--cor",
        str(tmp_path / "p.cor"),
        "--estimate",
        "scale",
    ]
    assert main(command) == 2
    assert "no active observation for a slope distance with unknown scale" in capsys.readouterr().err


def test_instruments_are_named_in_the_file(tmp_path):
    parts = []
    for name, constant, coefficient in (("TS 15", 0.010, 0.3), ("old one", -0.004, 0.05)):
        given = network(tmp_path, constant, coefficient=coefficient)
        parts.append(f"#INSTRUMENT {name}\n" + (tmp_path / "o.obs").read_text())
    (tmp_path / "o.obs").write_text("3 A B 901.388 0.5\n" + "".join(parts) + "#INSTRUMENT\n4 A B 50 0.5\n")
    given = Network.read(tmp_path / "o.obs", tmp_path / "p.cor", frame=FRAME)
    notes = more(given, "constant", "refraction").adjust().notes
    found = dict(note.split(": ") for note in notes if " of " in note and "+-" in note)
    values = {name: float(text.split()[0]) for name, text in found.items()}
    assert values["constant of TS 15"] == pytest.approx(0.010, abs=2e-4)
    assert values["constant of old one"] == pytest.approx(-0.004, abs=2e-4)
    assert values["refraction of TS 15"] == pytest.approx(0.3, abs=5e-3)
    assert values["refraction of old one"] == pytest.approx(0.05, abs=5e-3)
    assert "constant of o.obs" in values  # the line of no instrument
    assert given.adjust().solution.n_unknowns == more(given, "constant").adjust().solution.n_unknowns - 3


def test_names_of_instruments_are_written_again(tmp_path):
    lines = "7 A B 0 0.001\n#INSTRUMENT TS 15\n5 A P 40 0.001\n3 A P 640 0.01\n#INSTRUMENT\n3 B P 500 0.01\n"
    network(tmp_path)
    (tmp_path / "o.obs").write_text(lines)
    before = Network.read(tmp_path / "o.obs", tmp_path / "p.cor").book
    write_obs(tmp_path / "again.obs", before)
    after = Network.read(tmp_path / "again.obs", tmp_path / "p.cor").book
    assert [group.name for group in after.groups] == ["TS 15"]
    np.testing.assert_array_equal(after.observations.groups, before.observations.groups)
    assert before.observations.groups.tolist() == [-1, 0, 0, -1]
    assert len(after.stations) == 1


def test_a_polar_frame_has_a_scale_of_its_own(tmp_path):
    scale, gon = 3e-4, 200.0 / math.pi
    known = [f"1 {n} {x} {y} {z} 0.0001 0.0001 0.0001" for n, (x, y, z) in POINTS.items() if n != "P"]
    (tmp_path / "p.cor").write_text("\n".join([*known, "0 P 500.1 400.1 40.1"]) + "\n")
    lines = []
    for name, point in POINTS.items():
        if name != "A":
            east, north, up = np.subtract(point, POINTS["A"])
            angles = (
                f"{math.atan2(north, east) * gon:.7f} {math.atan2(up, math.hypot(east, north)) * gon:.7f}"
            )
            lines.append(f"{name} {angles} {math.hypot(east, north, up) / (1 + scale):.6f} 0.0005 0.001 0")
    (tmp_path / "f.pol").write_text("\n".join(lines) + "\n")
    (tmp_path / "o.obs").write_text("12 A @f.pol\n3 A P 641 1\n")
    config = {
        "root_COR_file": "p.cor",
        "root_OBS_file": "o.obs",
        "files_unit": 1,
        "local_center": [500, 400, 0],
    }
    (tmp_path / "n.comp").write_text("data=" + json.dumps({"config": config}))
    given = Network.read_project(tmp_path / "n.comp", encoding="latin-1")
    unscaled, adjusted = given.adjust(), more(given, "frame-scale").adjust()
    (note,) = [note for note in adjusted.notes if note.startswith("scale of polar frame f.pol at A")]
    assert float(note.split(": ")[1].split()[0]) == pytest.approx(
        scale, abs=1.2e-5
    )  # distances at 50 m of height
    assert adjusted.solution.n_unknowns == unscaled.solution.n_unknowns + 1
    assert adjusted.sigma0 < unscaled.sigma0 / 10


@pytest.mark.parametrize("datum", ["inner", "given"])
def test_a_scale_that_nothing_determines_is_refused_with_the_reason(tmp_path, datum):
    given = network(tmp_path)
    sigmas = given.points.sigmas.copy()
    sigmas[1:] = np.nan
    azimuth = math.atan2(900, 50) * 200 / math.pi
    (tmp_path / "z.obs").write_text(f"8 A B {azimuth} 0.0005\n")
    files = [tmp_path / "o.obs", tmp_path / "z.obs"]
    both = replace(
        Network.read(files, tmp_path / "p.cor", frame=FRAME), points=replace(given.points, sigmas=sigmas)
    )
    assert both.adjust(datum=Datum(datum)).solution.converged
    with pytest.raises(InputError, match=r"nothing determines the scale of o.obs.*two known points"):
        more(both, "scale").adjust(datum=Datum(datum))
